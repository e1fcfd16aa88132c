"""The study as one picture: for each problem error, force error and consistency over the cost of a measurement."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from physics_prior.studies.estimator.study import PAYING, Point, enough
from physics_prior.studies.plot import require_format

COLORS = {
    "rk4": "#0072b2",
    "semi_implicit_euler": "#d55e00",
    "derivatives once": "#56b4e9",
    "no physics": "#999999",
    "fewer measurements": "#cc79a7",
    "smoothed, later by": "#009e73",
}
"""By series: told apart by all kinds of colour vision (Okabe and Ito)."""
ABOVE = {
    "rk4": -9,
    "semi_implicit_euler": 5,
    "derivatives once": -16,
    "no physics": 5,
    "fewer measurements": 12,
    "smoothed, later by": 5,
}
"""Points that a label stands above its dot."""
ROWS = (
    ("rmse_deg", "error of angles [deg]"),
    ("force_percent", "error of forces [% of weight]"),
    ("consistency", "NEES, or NIS of a recording (1 is right)"),
)


def draw(points: Sequence[Point], path: Path) -> None:
    """Draw the study into a file, PNG, SVG or PDF by its ending.

    Raises:
        PhysicsPriorError: another ending.
    """
    require_format(path)
    problems = list(dict.fromkeys(point.problem for point in points))
    figure = Figure(figsize=(4.0 + 4.0 * len(problems), 9.0), dpi=110, layout="constrained")
    axes = figure.subplots(len(ROWS), len(problems), squeeze=False, sharex="col")
    for column, problem in enumerate(problems):
        own = [point for point in points if point.problem == problem]
        best = enough(points, problem)
        for row, (key, title) in enumerate(ROWS):
            place = axes[row, column]
            for series, color in COLORS.items():
                line = [point for point in own if point.series == series and np.isfinite(getattr(point, key))]
                if not line:
                    continue
                x, y = [point.us for point in line], [getattr(point, key) for point in line]
                place.plot(x, y, "o-", color=color, label=series.replace("_", " "), ms=4, lw=1.2)
                for point, u, value in zip(line, x, y, strict=True):
                    if row == 0:
                        place.annotate(
                            point.label,
                            (u, value),
                            fontsize=6,
                            color=color,
                            xytext=(2, ABOVE[series]),
                            textcoords="offset points",
                        )
            place.plot(
                best.us,
                getattr(best, key),
                "o",
                ms=11,
                mfc="none",
                mec="#222222",
                label="enough: all else that a step gains, noise hides",
            )
            if row == 0:
                place.axhspan(best.rmse_deg / PAYING, best.rmse_deg * PAYING, color="#000000", alpha=0.08, lw=0)
            if key == "consistency":
                place.axhline(1.0, color="#222222", lw=0.6)
            _logarithmic(place)
            place.grid(color="#000000", alpha=0.08, lw=0.6)
            place.spines[["top", "right"]].set_visible(False)
            place.tick_params(labelsize=7, which="both")
            if column == 0:
                place.set_ylabel(title, fontsize=8)
        axes[0, column].set_title(problem.replace("_", " "), fontsize=10)
        axes[-1, column].set_xlabel("processor time a measurement [us]", fontsize=8)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8, frameon=False)
    figure.suptitle("What accuracy costs the estimator: shorter steps pay until noise is all that is left", fontsize=11)
    figure.savefig(path)


def _logarithmic(axes: Axes) -> None:
    """Logarithmic axes with plain numbers on them."""
    axes.set_xscale("log")
    axes.set_yscale("log")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
