"""A replay as a picture: every readout with its uncertainty, how far it is off, and whether the filter believes itself.

One row a readout: its value on the left, its error and two standard deviations on the right. Below, the normalised
innovations with the band in which 95 % of their means lie if the model and the noise are right; at the foot, health and
the measurements that the gate refused.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from physics_prior.errors import PhysicsPriorError
from physics_prior.estimation import chi_squared
from physics_prior.estimation.estimate import Level
from physics_prior.recording.replay import BAND, ReplayResult

FORMATS = (".png", ".svg", ".pdf")

LINES = ("#0072b2", "#d55e00", "#009e73")
"""Of a scalar, or of x, y and z: tells apart to all kinds of colour vision (Okabe and Ito)."""
REFERENCE, BAND_COLOR, GATED = "#222222", "#999999", "#d55e00"
UNDERLAY: dict[str, Any] = {"lw": 3.5, "alpha": 0.3, "zorder": 1.5}
HEALTH = {Level.OK: "#cfe8d5", Level.DEGRADED: "#f5c242", Level.LOST: "#c0392b"}

SHOWN = {"rad": ("deg", 180.0 / np.pi), "m": ("m", 1.0), "J": ("J", 1.0), "N": ("N", 1.0)}
SHOWN_ERROR = SHOWN | {"m": ("mm", 1e3)}
"""Unit of a readout -> unit on the axis, and what to multiply by."""

MOST_POINTS = 4000  # of a line: more are not to be seen
WINDOW = 1.0  # s, of the running mean of innovations
SIGMAS = 2.0
EDGE = 0.5  # percent of the values that may lie outside the axes: those of the start, mostly
SETTLED = 97.0  # percentile of the deviations that must lie inside: in the beginning they are large
MARGIN = 1.15


def require_format(path: Path) -> None:
    """Refuse a file name whose ending names no kind of picture."""
    if path.suffix.lower() not in FORMATS:
        raise PhysicsPriorError(f"{path} is not a picture that can be drawn: end its name in {', '.join(FORMATS)}")


def plot_replay(result: ReplayResult, path: Path) -> None:
    """Draw a replay into a file, PNG, SVG or PDF by its ending.

    Raises:
        PhysicsPriorError: another ending.
    """
    require_format(path)
    count = len(result.readouts)
    figure = Figure(figsize=(11.0, 3.4 + 1.45 * count), dpi=110, layout="constrained")
    grid = figure.add_gridspec(count + 2, 2, height_ratios=[1.45] * count + [1.3, 0.35], width_ratios=(1.6, 1.0))
    order = np.argsort(result.stamps, kind="stable")
    order = order[:: 1 + len(order) // MOST_POINTS]
    span = result.stamps.min(), result.stamps.max()
    scored = any(name in result.reference for name in result.readouts)
    for row, name in enumerate(result.readouts):
        left, right = (figure.add_subplot(grid[row, column], xlim=span) for column in (0, 1))
        _readout(result, name, order, left, right)
        if row == 0:
            left.set_title("value", loc="left", fontsize=9)
            right.set_title("error, estimate \u2212 reference" if scored else "uncertainty", loc="left", fontsize=9)
    _innovations(result, figure.add_subplot(grid[count, :], xlim=span))
    _health(result, figure.add_subplot(grid[count + 1, :], xlim=span))
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
        axes.grid(color="#000000", alpha=0.08, lw=0.6)
        place = axes.get_subplotspec()
        assert place is not None  # all stand in the grid
        axes.tick_params(labelsize=8, labelbottom=place.rowspan.stop in (count, count + 2))
    figure.suptitle(_title(result), x=0.012, ha="left", fontsize=11)
    figure.savefig(path)


def _title(result: ReplayResult) -> str:
    figures = result.summary()
    counts, nis, score = figures["measurements"], figures["nis"], figures["reference"] or {}
    facts = [f"{counts['used']} of {counts['read']} measurements used"]
    if nis["mean"] is not None:
        facts.append(f"NIS {nis['mean']:.3g}, expected {nis['expected']:.3g}")
    facts += [
        f"{what} {score[key]:.3g} {unit}"
        for what, key, unit in (
            ("RMSE", "position_rmse_deg", "deg"),
            ("RMSE", "position_rmse_m", "m"),
            ("force", "force_rmse_percent_weight", "% of weight"),
        )
        if score.get(key) is not None
    ]
    return f"{result.scene.name}: {result.kind} estimate \u00b1{SIGMAS:g} standard deviations\n{';  '.join(facts)}"


def _readout(result: ReplayResult, name: str, order: np.ndarray, left: Axes, right: Axes) -> None:
    """One readout's value (left) and error (right)."""
    unit, scale = SHOWN[result.units[name]]
    error_unit, error_scale = SHOWN_ERROR[result.units[name]]
    angle = result.units[name] == "rad"
    stamps = result.stamps[order]
    values = _columns(result.readouts[name])[order]
    spread = SIGMAS * _columns(result.deviations[name])[order]
    if angle:
        values = np.unwrap(values, axis=0)
    reference = _reference(result, name, stamps)
    worst = 0.0
    for index, color in enumerate(LINES[: values.shape[1]]):
        value, band = values[:, index], spread[:, index]
        label = "xyz"[index] if values.shape[1] == 3 else "estimate"
        left.plot(stamps, scale * value, color=color, lw=1.2, label=label)
        left.fill_between(stamps, scale * (value - band), scale * (value + band), color=color, alpha=0.25, lw=0)
        right.fill_between(stamps, -error_scale * band, error_scale * band, color=color, alpha=0.16, lw=0)
        if reference is not None:
            error = value - reference[:, index]
            if angle:
                error = (error + np.pi) % (2.0 * np.pi) - np.pi
            worst = max(worst, float(np.nanpercentile(np.abs(error), 100.0 - EDGE)))
            left.plot(stamps, scale * (value - error), color=REFERENCE, **UNDERLAY)
            right.plot(stamps, error_scale * error, color=color, lw=0.8)
    typical = np.median(spread, axis=0)
    limit(left, scale * np.concatenate([values - typical, values + typical]))
    largest = error_scale * MARGIN * max(float(np.percentile(spread, SETTLED)), worst)
    right.set_ylim(-largest or -1e-3, largest or 1e-3)
    if values.shape[1] == 3 or reference is not None:
        if reference is not None:
            left.plot([], [], color=REFERENCE, **UNDERLAY, label="reference")
        legend(left)
    left.set_ylabel(f"{name}\n[{unit}]", fontsize=8)
    right.set_ylabel(f"[{error_unit}]", fontsize=8)


def _reference(result: ReplayResult, name: str, stamps: np.ndarray) -> np.ndarray | None:
    """The reference (k, 1 or 3) at the estimate's stamps, NaN outside it; None where there is none."""
    if name not in result.reference:
        return None
    columns = _columns(result.reference[name])
    if result.units[name] == "rad":
        columns = np.unwrap(columns, axis=0)
    known = result.reference_stamps
    return np.stack([np.interp(stamps, known, column, left=np.nan, right=np.nan) for column in columns.T], axis=1)


def _innovations(result: ReplayResult, axes: Axes) -> None:
    """Innovations squared over their dimension, and their running mean in the band of a right model."""
    order = np.argsort(result.nis_stamps, kind="stable")
    order = order[~result.gated[order]]
    stamps, nis, dimension = result.nis_stamps[order], result.nis[order], result.nis_dimension[order]
    thin = slice(None, None, 1 + len(stamps) // MOST_POINTS)
    if len(stamps):
        first = np.searchsorted(stamps, stamps - 0.5 * WINDOW, side="left")
        last = np.searchsorted(stamps, stamps + 0.5 * WINDOW, side="right")
        total, freedom = (np.concatenate([[0.0], np.cumsum(each)]) for each in (nis, dimension))
        window = freedom[last] - freedom[first]
        low, high = chi_squared.interval(BAND, window[thin])
        at = stamps[thin]
        axes.plot(at, (nis / dimension)[thin], ".", ms=2, color=LINES[0], alpha=0.25, label="each measurement")
        axes.fill_between(
            at,
            low / window[thin],
            high / window[thin],
            color=BAND_COLOR,
            alpha=0.45,
            lw=0,
            label="95 % band of the mean",
        )
        mean = ((total[last] - total[first]) / window)[thin]
        mean[1:][np.diff(at) > 0.5 * WINDOW] = np.nan  # no line where nothing was measured
        axes.plot(at, mean, color=LINES[0], lw=1.4, label=f"mean over {WINDOW:g} s")
        axes.axhline(1.0, color=REFERENCE, lw=0.6)
        axes.set_ylim(0.0, max(2.5, 1.2 * float(np.nanpercentile(mean, 98))))
        legend(axes)
    axes.set_ylabel("NIS /\nexpected", fontsize=8)
    axes.set_title("normalised innovations squared: 1 where model and noise are right", loc="left", fontsize=9)


def _health(result: ReplayResult, axes: Axes) -> None:
    """Health as a strip of colour, the gated measurements as ticks on it."""
    order = np.argsort(result.stamps, kind="stable")
    stamps, health = result.stamps[order], result.health[order]
    changes = np.flatnonzero(np.diff(health)) + 1
    for first, last in zip([0, *changes], [*changes, len(stamps) - 1], strict=True):
        axes.axvspan(stamps[first], stamps[last], color=HEALTH[Level(health[first])], lw=0)
    gated = result.nis_stamps[result.gated]
    axes.plot(gated, np.full(len(gated), 0.5), "|", color=GATED, ms=11, mew=1.1)
    axes.set_ylim(0.0, 1.0)
    axes.set_yticks([])
    axes.set_ylabel("health", fontsize=8, rotation=0, ha="right", va="center")
    seen = [level for level in Level if level in health]
    handles: list[Artist] = [Patch(color=HEALTH[level], label=level.name) for level in seen]
    handles += axes.plot([], [], "|", color=GATED, ms=5, mew=1.1, label=f"{len(gated)} gated")
    axes.set_xlabel("time [s]", fontsize=8)
    legend(axes, handles)


def _columns(values: np.ndarray) -> np.ndarray:
    return values.reshape(len(values), -1)


def limit(axes: Axes, values: np.ndarray) -> None:
    """Show what most of the values need: not the uncertainty of the first moment, which dwarfs all else."""
    low, high = np.percentile(values, [EDGE, 100.0 - EDGE])
    margin = (MARGIN - 1.0) * (high - low) or 1e-3 * max(1.0, abs(high))
    axes.set_ylim(low - margin, high + margin)


def legend(axes: Axes, handles: Sequence[Artist] | None = None) -> None:
    """A legend above the axes, at the right, where it covers nothing."""
    place: dict[str, Any] = {"loc": "lower right", "bbox_to_anchor": (1.0, 0.97), "borderaxespad": 0.0}
    shown = handles or axes.get_legend_handles_labels()[0]
    axes.legend(handles=shown, **place, ncols=len(shown), fontsize=7, frameon=False, markerscale=2.0)
