"""What a replay found, in tables."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from rich.table import Table

from physics_prior.commands.terminal import console, table
from physics_prior.estimation.score import FROM_SECONDS
from physics_prior.recording.replay import ReplayResult

MOST_HEALTH = 1e-3  # s, of a health that is worth a word


def print_report(result: ReplayResult, written: Sequence[str]) -> None:
    """Print figures and readouts of a replay, and which files hold more."""
    out = console()
    if result.loss is not None:
        out.print(f"salvaged: {result.loss}", style="bold yellow")
    figures = result.summary()
    out.print(_figures(result, figures))
    if result.forces:
        out.print()
        out.print(_forces(figures["reference"]))
    if result.readouts:
        out.print()
        out.print(_readouts(result))
    if written:
        out.print(f"\nwritten: {', '.join(written)}")


def _figures(result: ReplayResult, figures: dict[str, Any]) -> Table:
    out = table(f"{result.scene.name}, {result.kind}", "", "")
    counts = figures["measurements"]
    out.add_row("measurements", ", ".join(f"{counts[key]} {key}" for key in counts))
    factor = figures["realtime_factor"]
    speed = f", {factor:.3g}x real time" if factor is not None else ""
    out.add_row("recording", f"{figures['span_s']:.2f} s, replayed in {figures['wall_s']:.2f} s{speed}")
    out.add_row("NIS", _nis(figures["nis"]))
    spans = [f"{level} {seconds:.2f} s" for level, seconds in figures["health"].items() if seconds > MOST_HEALTH]
    out.add_row("health", ", ".join(spans))
    score = figures["reference"]
    for key, what in SCORES.items():
        if score is not None and score.get(key) is not None:
            out.add_row(f"RMSE of {what[0]}", f"{score[key]:.3g} {what[1]}, from {score['from_s']:g} s on")
    return out


def _forces(score: dict[str, Any]) -> Table:
    """What the ground does, against force plates."""
    title = f"forces of the ground, from {score['from_s']:g} s on"
    out = table(title, "plate", "component", "RMSE, % of range", "% of weight", "r", "compared, s", numbers=4)
    for name, components in score["forces"].items():
        for component, own in components.items():
            out.add_row(
                name,
                component.replace("_", "-"),
                *(
                    "-" if own[key] is None else f"{own[key]:.3g}"
                    for key in ("rrmse_percent", "percent_weight", "r", "seconds")
                ),
            )
    return out


SCORES = {
    "position_rmse_deg": ("angles", "deg"),
    "position_rmse_m": ("lengths", "m"),
    "velocity_rmse": ("rates", "rad/s or m/s"),
    "force_rmse_percent_weight": ("forces", "% of weight"),
}
"""Figures against a reference: what they are and in which unit."""


def _nis(nis: dict[str, Any]) -> str:
    """The normalised innovation squared, with a verdict."""
    if nis["mean"] is None:
        return "no measurement was used"
    low, high = nis["band95"]
    verdict = "in its 95 % band"
    if nis["mean"] > high:
        verdict = "above its 95 % band, model and noise are trusted too much"
    elif nis["mean"] < low:
        verdict = "below its 95 % band, model and noise are trusted too little"
    return f"mean {nis['mean']:.3f}, expected {nis['expected']:.3f}, {verdict} [{low:.3f}, {high:.3f}]"


def _readouts(result: ReplayResult) -> Table:
    settled = result.stamps >= FROM_SECONDS
    if not settled.any():
        settled[:] = True
    title = "readouts" if settled.all() else f"readouts, from {FROM_SECONDS:g} s on"
    out = table(title, "name", "unit", "least", "most", "last", "standard deviation, median", numbers=4)
    for name in result.readouts:
        values, spread = (each[name][settled] for each in (result.readouts, result.deviations))
        columns, spread = values.reshape(len(values), -1), spread.reshape(len(spread), -1)
        for index, column in enumerate(columns.T):
            label = f"{name}/{'xyz'[index]}" if columns.shape[1] == 3 else name
            shown = (column.min(), column.max(), column[-1], np.median(spread[:, index]))
            out.add_row(label, result.units[name], *(f"{_plain(number):.4g}" for number in shown))
    return out


def _plain(number: float) -> float:
    """Rounding errors as the zero that they are."""
    return float(number) if abs(number) > 1e-9 else 0.0
