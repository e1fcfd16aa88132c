"""Work-precision pictures: error against processor time, the best of ours as one line, everybody else around it."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from physics_prior.studies.accuracy.front import front
from physics_prior.studies.accuracy.measure import Point
from physics_prior.studies.accuracy.problem import Problem

COLORS = {
    "rk4": "#0072b2",
    "dop853": "#009e73",
    "dop853, its own steps": "#56b4e9",
    "semi_implicit_euler": "#e69f00",
    "implicit_midpoint": "#cc79a7",
    "lobatto_iiic": "#d55e00",
}
"""Of our integrators, told apart by all kinds of colour vision (Okabe and Ito)."""
PEERS = {"mujoco": "#7a1f1f", "pinocchio": "#3d3d8f", "exudyn": "#5b5b00"}
MARKERS = "sD^v"
TEXTBOOK = "#9a9a9a"
NUMPY = "NumPy formulations"
BEST, INK = "#cfe8dc", "#222222"
FINEST, COARSEST = 1e-14, 3.0


def draw(problem: Problem, points: Sequence[Point], folder: Path) -> None:
    """Draw ``PROBLEM.png`` into a folder that is there."""
    picture(problem, points).savefig(folder / f"{problem.key}.png")


def picture(problem: Problem, points: Sequence[Point]) -> Figure:
    """One panel, the best at its lower right."""
    figure = Figure(figsize=(9.5, 5.4), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_yscale("log")
    usable = [point for point in points if FINEST < point.error < COARSEST]
    marks = iter(MARKERS * 3)
    for scheme in dict.fromkeys(point.scheme for point in usable):
        own = [point for point in usable if point.scheme == scheme]
        x, y = [point.error for point in own], [point.seconds for point in own]
        if own[0].engine == "compiled":
            axes.plot(x, y, "o-", color=COLORS[scheme], ms=4, lw=1.5, label=scheme, zorder=3)
        elif own[0].engine == "textbook":
            axes.plot(x, y, ":", color=TEXTBOOK, lw=1.1, marker=".", ms=4)
        else:
            color, marker = PEERS[own[0].engine], next(marks)
            axes.plot(x, y, ls="--", color=color, marker=marker, mfc="none", ms=6, lw=1.1, label=scheme, zorder=2)
    if any(point.engine == "textbook" for point in usable):
        axes.plot([], [], ":", color=TEXTBOOK, lw=1.1, marker=".", ms=4, label=NUMPY)
    edge = front([point for point in usable if point.engine == "compiled"])
    x, y = [point.error for point in edge], [point.seconds for point in edge]
    axes.plot(x, y, "-", color=BEST, lw=11, solid_capstyle="round", zorder=0, label="best of ours (Pareto front)")
    for name in _absent(points):
        axes.plot([], [], " ", label=f"{name}: lost or too slow")
    axes.axhline(1.0, color="#c0392b", lw=1.1, zorder=0.5)
    place = axes.get_yaxis_transform()
    label = axes.text(0.995, 1.0, "real time", color="#c0392b", fontsize=8, transform=place, ha="right", va="bottom")
    label.set_bbox({"facecolor": "white", "edgecolor": "none", "pad": 1.0, "alpha": 0.8})
    axes.set_ylim(top=2.0 * max(1.0, *(point.seconds for point in usable)))
    axes.invert_xaxis()
    axes.yaxis.set_major_locator(LogLocator(numticks=12))
    axes.yaxis.set_major_formatter(FuncFormatter(_duration))
    axes.yaxis.set_minor_formatter(NullFormatter())
    axes.set_title(f"{problem.title}: lower is faster, further right is more exact", loc="left", fontsize=10.5)
    axes.set_xlabel(f"largest error [{problem.unit}]", fontsize=9)
    axes.set_ylabel("processor time per simulated second", fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#000000", alpha=0.1, lw=0.6)
    axes.tick_params(labelsize=8.5)
    figure.legend(loc="outside right upper", fontsize=8, frameon=False, labelcolor=INK)
    return figure


def _absent(points: Sequence[Point]) -> list[str]:
    """Who has no figures at any setting, the NumPy formulations as one."""
    measured: dict[str, bool] = {}
    for point in points:
        name = NUMPY if point.engine == "textbook" else point.scheme
        measured[name] = measured.get(name, False) or point.measured
    return [name for name, told in measured.items() if not told]


def _duration(seconds: float, _: int) -> str:
    """A power of ten of seconds, for people."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("us", 1e-6)):
        if seconds >= 0.999 * size:
            return f"{seconds / size:g} {unit}"
    return f"{seconds:g} s"
