"""The picture of an effects study: what each effect is worth, and what was fitted."""

import math
from collections.abc import Sequence
from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.axes import Axes

from physics_prior.studies.effects.ablation import Verdict
from physics_prior.studies.effects.fit import Fitted

KEPT, DROPPED, INK = "#2a6f97", "#b9b9b9", "#333333"
LINEAR = 10.0  # of the logarithmic axis: about as much evidence as may be chance


def draw(verdicts: Sequence[Verdict], fitted: Sequence[Fitted], path: Path) -> None:
    """Draw bars of the evidence for each effect and, where there are any, fitted numbers with their intervals."""
    heights = [max(1.2, 0.45 * len(verdicts) + 0.8), *([max(1.2, 0.45 * len(fitted) + 0.8)] if fitted else [])]
    figure, axes = plt.subplots(
        len(heights), 1, figsize=(8.0, sum(heights) + 0.6), height_ratios=heights, squeeze=False, layout="constrained"
    )
    _evidence(verdicts, axes[0, 0])
    if fitted:
        _intervals(fitted, axes[1, 0])
    figure.savefig(path, dpi=120)
    plt.close(figure)


def _evidence(verdicts: Sequence[Verdict], axes: Axes) -> None:
    for row, verdict in enumerate(verdicts):
        gain, color = verdict.delta_log_likelihood, KEPT if verdict.keep else DROPPED
        cost = "" if verdict.us_per_step is None else f", {verdict.us_per_step:.2g} us"
        axes.barh(row, gain or 0.0, color=color, height=0.55)
        axes.plot([verdict.threshold] * 2, [row - 0.4, row + 0.4], color=INK, lw=1.0)
        text = "cannot do without it" if gain is None else f"{gain:+.4g}"
        axes.annotate(
            f"{text}{cost}",
            (max(gain or 0.0, verdict.threshold), row),
            (6, 0),
            textcoords="offset points",
            va="center",
            fontsize=8,
        )
    axes.set_xscale("symlog", linthresh=LINEAR)
    low, high = axes.get_xlim()
    axes.set_xlim(low, max(high, LINEAR) * 30.0)
    names = [f"{each.name} (proposed)" if each.proposed else each.name for each in verdicts]
    axes.set_yticks(range(len(verdicts)), names, fontsize=9)
    axes.invert_yaxis()
    axes.set_xlabel("log-likelihood with it, less without; the mark is what chance would give", fontsize=8)
    axes.set_title("kept (blue) and dropped (grey) effects", loc="left", fontsize=9)


def _intervals(fitted: Sequence[Fitted], axes: Axes) -> None:
    for row, each in enumerate(fitted):
        known = math.isfinite(each.low)
        scale = max(abs(each.value), 0.5 * (each.high - each.low) if known else 0.0) or 1.0
        if known:
            ends = [(end - each.value) / scale for end in (each.low, each.high)]
            axes.plot(ends, [row, row], color=KEPT, lw=2.0)
        axes.plot(0.0, row, "o", color=KEPT, ms=5)
        axes.plot((each.start - each.value) / scale, row, "|", color=INK, ms=12)
        axes.annotate(f"{each.value:.5g}", (0.0, row), (0, 7), textcoords="offset points", ha="center", fontsize=8)
    axes.set_yticks(range(len(fitted)), [each.path for each in fitted], fontsize=8)
    axes.set_ylim(len(fitted) - 0.4, -0.6)
    axes.set_xlabel(
        "95 % interval and the file's value (mark), in parts of the estimate, or of half the interval", fontsize=8
    )
    axes.set_title("fitted numbers", loc="left", fontsize=9)
