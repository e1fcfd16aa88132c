"""The study as plain data, one card a version, and as a table; two cards compared."""

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from rich.table import Table

from physics_prior import __version__
from physics_prior.errors import PhysicsPriorError
from physics_prior.studies.accuracy.front import front, seconds_to_reach
from physics_prior.studies.accuracy.measure import Point
from physics_prior.studies.accuracy.problem import Problem
from physics_prior.studies.accuracy.schemes import FAMILIES
from physics_prior.studies.bench import machine

LARGEST_CARD = 10_000_000  # bytes
SHOWN_TARGETS = (1e-2, 1e-4, 1e-6, 1e-8)


def card(found: Mapping[str, tuple[Problem, Sequence[Point]]], peers: bool) -> dict[str, Any]:
    """Every figure: by problem its points, its front, the cost of some errors, and ratios to peers at its target."""
    problems = {}
    for key, (problem, points) in found.items():
        own = [point for point in points if point.engine == "compiled"]
        problems[key] = {
            "title": problem.title,
            "unit": problem.unit,
            "target": problem.target,
            "seconds_to_reach": {f"{error:g}": seconds_to_reach(own, error) for error in SHOWN_TARGETS},
            "ratios": ratios(problem, points),
            "front": [point.figures() for point in front(own)],
            "points": [point.figures() for point in points],
        }
    return {"version": __version__, "machine": machine(peers), "problems": problems}


def ratios(problem: Problem, points: Sequence[Point]) -> dict[str, float | None]:
    """Time of every peer's scheme over ours, at the problem's target; None where the peer does not reach it."""
    ours = seconds_to_reach([point for point in points if point.engine == "compiled"], problem.target)
    out: dict[str, float | None] = {}
    for scheme in dict.fromkeys(point.scheme for point in points if point.engine not in FAMILIES):
        theirs = seconds_to_reach([point for point in points if point.scheme == scheme], problem.target)
        out[scheme] = theirs / ours if theirs is not None and ours is not None else None
    return out


def read_card(path: Path) -> dict[str, Any]:
    """A card of some version.

    Raises:
        PhysicsPriorError: the file is not one.
    """
    try:
        if path.stat().st_size > LARGEST_CARD:
            raise PhysicsPriorError(
                f"--compare {path}: larger than {LARGEST_CARD} bytes: that is no card of this study"
            )
        data = json.loads(path.read_text(encoding="utf-8"))
        if {"version", "problems"} <= set(data):
            return dict(data)
    except OSError as error:
        raise PhysicsPriorError(f"--compare {path}: {error.strerror}") from None
    except (ValueError, TypeError):
        pass
    raise PhysicsPriorError(f"--compare {path}: not a card of this study: give one that --json wrote")


def front_table(data: Mapping[str, Any]) -> Table:
    """Of every problem, what to take: the front, one line a point."""
    out = Table(
        title="What accuracy costs: of each problem the best there is, coarse to fine", box=None, pad_edge=False
    )
    for name in ("problem", "integrator"):
        out.add_column(name, header_style="dim")
    for name in ("step", "error", "energy [J]", "open [m]", "us a simulated ms", "real time"):
        out.add_column(name, justify="right", header_style="dim", no_wrap=True)
    for problem in data["problems"].values():
        for index, point in enumerate(problem["front"]):
            out.add_row(
                problem["title"] if index == 0 else "",
                point["scheme"],
                _step(point),
                f"{point['error']:.1e} {problem['unit']}",
                _number(point["energy"]),
                _number(point["residual"]),
                f"{1e3 * point['seconds']:.3g}",
                f"{point['real_time']:,.0f}x",
            )
    return out


def ratio_table(data: Mapping[str, Any]) -> Table:
    """Of every peer, its time over ours at the error at which they are compared."""
    out = Table(title="Time of others over ours, at equal error", box=None, pad_edge=False)
    for name in ("problem", "at", "other"):
        out.add_column(name, header_style="dim")
    out.add_column("their time over ours", justify="right", header_style="dim")
    for problem in data["problems"].values():
        for scheme, ratio in problem["ratios"].items():
            told = "does not reach it" if ratio is None else f"{ratio:.1f}"
            out.add_row(problem["title"], f"{problem['target']:g} {problem['unit']}", scheme, told)
    return out


def unmeasured_table(data: Mapping[str, Any]) -> Table:
    """Of every scheme the settings that have no figures, and why."""
    out = Table(title="Without figures", box=None, pad_edge=False)
    for name in ("problem", "scheme", "why"):
        out.add_column(name, header_style="dim")
    for problem in data["problems"].values():
        missing: dict[str, dict[str, list[str]]] = {}
        for point in problem["points"]:
            if point["outcome"] != "measured":
                missing.setdefault(point["scheme"], {}).setdefault(point["outcome"], []).append(_step(point))
        for scheme, outcomes in missing.items():
            told = "; ".join(f"{outcome} at {', '.join(steps)}" for outcome, steps in outcomes.items())
            out.add_row(problem["title"], scheme, told)
    return out


def comparison_table(data: Mapping[str, Any], before: Mapping[str, Any]) -> Table:
    """Time of this version over that of an earlier card, by problem and error: below 1 is faster, on a like machine."""
    out = Table(title=f"Time over that of {before['version']}, at equal error", box=None, pad_edge=False)
    out.add_column("problem", header_style="dim")
    for error in SHOWN_TARGETS:
        out.add_column(f"{error:g}", justify="right", header_style="dim")
    for key, problem in data["problems"].items():
        old = before["problems"].get(key, {}).get("seconds_to_reach", {})
        cells = []
        for error, seconds in problem["seconds_to_reach"].items():
            was = old.get(error)
            cells.append(f"{seconds / was:.2f}" if seconds and was else "")
        out.add_row(problem["title"], *cells)
    return out


def _step(point: Mapping[str, Any]) -> str:
    if "own steps" in point["scheme"]:
        return f"to {point['tolerance']:.0e}"
    return f"{1e3 * point['h']:g} ms"


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.1e}"
