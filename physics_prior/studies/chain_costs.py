"""Cost over the number of bodies: open chains and rows of four-bars, from 10 links to 300, timed in turns."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import thread_time
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullLocator

from physics_prior.studies.bench import machine, one_core
from physics_prior.studies.plot import require_format
from physics_prior.studies.problems.chain import chain
from physics_prior.studies.problems.four_bar import four_bar
from physics_prior.studies.problems.mechanism import Mechanism

LINKS = (10, 20, 30, 50, 100, 150, 200, 300)
LOOPS_SHARE = 2  # moving links that a further four-bar brings: its crossbar and the next crank
ROUNDS, STEPS = 21, 20  # of the timing
H = 1e-4  # s
KINDS: dict[str, Callable[[int], Mechanism]] = {
    "open chain": chain,
    "four-bars in a row": lambda links: four_bar(links // LOOPS_SHARE, 0.1),
}
COLORS = {"open chain": "#0072b2", "four-bars in a row": "#d55e00"}


@dataclass(frozen=True)
class Cost:
    """Microseconds of the processor for a step of Runge and Kutta's, four evaluations, of a mechanism of so many links."""

    kind: str
    links: int
    rows: int
    us: float


def run_chain_costs(links: Sequence[int] = LINKS, progress: Callable[[float], None] = lambda done: None) -> list[Cost]:
    """Time a step of every kind at every size, medians of runs in turns, on one core."""
    runs = {(kind, each): make(each).run() for kind, make in KINDS.items() for each in links}
    times: dict[tuple[str, int], list[float]] = {key: [] for key in runs}
    with one_core():
        for done in range(ROUNDS + 1):
            for key, run in runs.items():
                begin = thread_time()
                run.advance(H, STEPS)
                times[key].append(thread_time() - begin)
            progress((done + 1) / (ROUNDS + 1))
    return [
        Cost(
            kind,
            len(run.simulator.tree.links),
            run.simulator.rows,
            1e6 * float(np.median(times[kind, each][1:])) / STEPS,
        )
        for (kind, each), run in runs.items()
    ]


def exponents(costs: Sequence[Cost]) -> dict[str, float]:
    """By kind, the power of the number of links that the cost grows with: the slope in logarithms, by least squares."""
    out = {}
    for kind in dict.fromkeys(cost.kind for cost in costs):
        own = [cost for cost in costs if cost.kind == kind]
        out[kind] = float(np.polyfit(np.log([cost.links for cost in own]), np.log([cost.us for cost in own]), 1)[0])
    return out


def card(costs: Sequence[Cost]) -> dict[str, Any]:
    """Every figure, for JSON."""
    return {"costs": [asdict(cost) for cost in costs], "exponents": exponents(costs), "machine": machine(False)}


def table(costs: Sequence[Cost]) -> str:
    """The figures as a table of Markdown."""
    rows = [
        f"| {each.kind} | {each.links} | {each.rows} | {each.us:.1f} | {each.us / each.links:.3f} |" for each in costs
    ]
    head = "| | links | rows of constraints | us a step of RK4 | us a link |"
    told = [f"{kind}: the cost grows as links^{power:.2f}" for kind, power in exponents(costs).items()]
    return "\n".join([head, "|---|---|---|---|---|", *rows, "", *told])


def draw(costs: Sequence[Cost], path: Path) -> None:
    """Draw cost over links into a file, PNG, SVG or PDF by its ending, beside what is exactly linear.

    Raises:
        PhysicsPriorError: another ending.
    """
    require_format(path)
    figure = Figure(figsize=(7.0, 4.6), dpi=110, layout="constrained")
    axes = figure.add_subplot()
    axes.set_xscale("log")
    axes.set_yscale("log")
    for kind, power in exponents(costs).items():
        own = [cost for cost in costs if cost.kind == kind]
        x, y = np.array([cost.links for cost in own]), np.array([cost.us for cost in own])
        axes.plot(x, y, "o-", color=COLORS[kind], ms=5, lw=1.6, label=f"{kind}: links$^{{{power:.2f}}}$", zorder=3)
        middle = len(own) // 2
        axes.plot(x, x * y[middle] / x[middle], ":", color=COLORS[kind], lw=1.2)
    axes.plot([], [], ":", color="#222222", lw=1.2, label="in proportion to the links")
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        axis.set_minor_locator(NullLocator())
        axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.set_title("The cost of a step grows in proportion to the number of bodies", loc="left", fontsize=10.5)
    axes.set_xlabel("moving links", fontsize=9)
    axes.set_ylabel("processor time of a step of RK4 [us]", fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#000000", alpha=0.1, lw=0.6)
    axes.tick_params(labelsize=8.5)
    axes.legend(fontsize=8.5, frameon=False)
    figure.savefig(path)
