"""Pictures of the hard cases: the margins of all at a glance, and what single ones looked like."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from physics_prior.studies.stability.case import Curve, Picture
from physics_prior.studies.stability.suite import Outcome

COLORS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#000000")
"""Told apart by all kinds of colour vision (Okabe and Ito)."""
PASSED, FAILED, EXACT = "#0072b2", "#c0392b", "#9cc3dd"
MOST = 1e8  # larger margins are drawn as this
INK = "#222222"


def draw(outcomes: Sequence[Outcome], folder: Path) -> None:
    """Draw ``margins.png`` and one picture of every case that has some, into a folder that is there."""
    _margins(outcomes).savefig(folder / "margins.png")
    for outcome in outcomes:
        for picture in outcome.pictures:
            _picture(picture).savefig(folder / f"{outcome.case.id:02d}_{picture.name}.png")


def _margins(outcomes: Sequence[Outcome]) -> Figure:
    """One bar a case: how many times its tightest figure fits into its bound."""
    figure = Figure(figsize=(12.0, 1.6 + 0.34 * len(outcomes)), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    for row, outcome in enumerate(outcomes):
        margin = outcome.tightest.margin
        exact = outcome.passed and margin > MOST
        length = MOST if exact else max(margin, 1.2e-1)
        axes.barh(row, length, left=0.1, color=(EXACT if exact else PASSED) if outcome.passed else FAILED, height=0.72)
        axes.text(length * 1.15, row, _told(outcome), va="center", fontsize=7.5, color=INK)
    axes.set_yticks(
        range(len(outcomes)), [f"{outcome.case.name}  {outcome.case.id}" for outcome in outcomes], fontsize=7.5
    )
    axes.invert_yaxis()
    axes.set_xscale("log")
    axes.set_xlim(0.1, MOST * 1e7)
    axes.set_xticks([10.0**k for k in range(0, 9, 2)])
    axes.axvline(1.0, color=FAILED, lw=1.2)
    axes.text(1.0, -0.9, "bound", color=FAILED, fontsize=8, ha="center")
    axes.set_xlabel("how many times the figure closest to its bound fits into it", fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(axis="x", color="#000000", alpha=0.1, lw=0.6)
    axes.tick_params(axis="x", labelsize=8)
    count = sum(outcome.passed for outcome in outcomes)
    figure.suptitle(f"{count} of {len(outcomes)} hard cases pass; beside each bar, what others do", fontsize=11)
    return figure


def _told(outcome: Outcome) -> str:
    check = outcome.tightest
    if not outcome.passed:
        return f"FAILED: {check.what}"[:90]
    own = "exact" if math.isinf(check.margin) else f"{check.margin:.2g} x"
    return f"{own}    {outcome.case.peers}"[:110]


def _picture(picture: Picture) -> Figure:
    """The curves of a picture."""
    figure = Figure(figsize=(8.5, 4.6), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    for color, curve in zip(_colors(picture.curves), picture.curves, strict=True):
        if curve.dots:
            axes.plot(curve.x, curve.y, "o", color=color, ms=4.5, alpha=0.75, label=curve.label)
        else:
            dotted = ".-" if len(curve.x) <= 12 else "-"
            axes.plot(curve.x, curve.y, dotted, color=color, lw=1.4, label=curve.label)
    if "x" in picture.logarithmic:
        axes.set_xscale("log")
    if "y" in picture.logarithmic:
        axes.set_yscale("log")
    for text, level in picture.levels:
        ours = text.startswith("bound")
        axes.axhline(level, color=FAILED if ours else "#777777", lw=1.1, ls="-" if ours else "--", zorder=0.5)
        side, align = (0.005, "left") if ours else (0.995, "right")
        place = axes.get_yaxis_transform()
        axes.text(side, level, text, transform=place, ha=align, va="bottom", fontsize=7.5, color=INK)
    axes.set_title(picture.title, loc="left", fontsize=10)
    axes.set_xlabel(picture.x, fontsize=8)
    axes.set_ylabel(picture.y, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#000000", alpha=0.1, lw=0.6)
    axes.tick_params(labelsize=8)
    axes.legend(fontsize=7.5, frameon=False, loc="best")
    return figure


def _colors(curves: Sequence[Curve]) -> list[str]:
    """One color a curve: the palette where it suffices, else shades of one, light to dark."""
    if len(curves) <= len(COLORS):
        return list(COLORS[: len(curves)])
    return [
        f"#{int(210 - 190 * s):02x}{int(225 - 110 * s):02x}{int(240 - 62 * s):02x}"
        for s in np.linspace(0.0, 1.0, len(curves))
    ]
