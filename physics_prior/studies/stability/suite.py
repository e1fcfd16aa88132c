"""Runs hard cases, and tells what became of them: as a table and as figures."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from rich.table import Table

from physics_prior.errors import PhysicsPriorError
from physics_prior.studies.stability.case import Case, Check, Picture

SHOWN_MARGIN = 1e4  # larger ones tell no more


@dataclass(frozen=True, eq=False)
class Outcome:
    """What became of a case.

    Attributes:
        case: which.
        checks: its figures, as many as it came to.
        pictures: what it looked like.
        error: why it ended early; empty if it did not.
    """

    case: Case
    checks: tuple[Check, ...]
    pictures: tuple[Picture, ...]
    error: str = ""

    @property
    def passed(self) -> bool:
        """Whether it ran to its end with every figure within its bound."""
        return not self.error and bool(self.checks) and all(check.passed for check in self.checks)

    @property
    def tightest(self) -> Check:
        """The figure with the smallest margin, one that fails first of all; one that is no number if there is none."""
        if self.error or not self.checks:
            return Check(self.error or "nothing was measured", math.nan, 0.0)
        return min(self.checks, key=lambda check: (check.passed, check.margin))


def run_case(case: Case, thorough: bool = True) -> Outcome:
    """Run a case; what is refused on the way is its end, and does not raise."""
    checks: list[Check] = []
    pictures: list[Picture] = []
    error = ""
    try:
        for found in case.run(thorough):
            if isinstance(found, Check):
                checks.append(found)
            else:
                pictures.append(found)
    except PhysicsPriorError as problem:
        error = str(problem)
    return Outcome(case, tuple(checks), tuple(pictures), error)


def run_cases(cases: Sequence[Case], progress: Callable[[float, str], None]) -> list[Outcome]:
    """Run cases thoroughly, one after the other; progress is told the fraction done and what comes next."""
    outcomes = []
    for index, case in enumerate(cases):
        progress(index / len(cases), f"case {case.id}, {case.key}")
        outcomes.append(run_case(case))
    return outcomes


def figures(outcomes: Sequence[Outcome]) -> dict[str, Any]:
    """The outcomes as plain data: each case with its tightest figure, and all of its checks."""
    passed = sum(outcome.passed for outcome in outcomes)
    return {"cases": [_figures(outcome) for outcome in outcomes], "passed": passed, "failed": len(outcomes) - passed}


def _figures(outcome: Outcome) -> dict[str, Any]:
    case, tightest = outcome.case, _check_figures(outcome.tightest)
    return {
        "id": case.id,
        "name": case.name,
        "key": case.key,
        **tightest,
        "passed": outcome.passed,
        "peers": case.peers,
        "error": outcome.error,
        "checks": [_check_figures(check) for check in outcome.checks],
    }


def _check_figures(check: Check) -> dict[str, Any]:
    """A check as plain data; what is no number is null."""
    measured = float(check.measured)
    return {
        "what": check.what,
        "measured": measured if math.isfinite(measured) else None,
        "bound": float(check.bound),
        "unit": check.unit,
        "passed": bool(check.passed),
    }


def table(outcomes: Sequence[Outcome]) -> Table:
    """One line a case: its tightest figure, the bound, how often it fits in, and what others do."""
    count = sum(outcome.passed for outcome in outcomes)
    out = Table(
        title=f"{count} of {len(outcomes)} hard cases passed; of each the figure closest to its bound",
        title_justify="left",
        title_style="bold",
        box=None,
        pad_edge=False,
        padding=(0, 2, 0, 0),
    )
    out.add_column("", justify="right", header_style="dim")
    out.add_column("case", header_style="dim")
    out.add_column("measured", header_style="dim")
    for name in ("figure", "bound", "margin"):
        out.add_column(name, justify="right", no_wrap=True, header_style="dim")
    out.add_column("others", header_style="dim", style="dim")
    for outcome in outcomes:
        case, check = outcome.case, outcome.tightest
        figure = f"{check.measured:.2g} {check.unit}".strip() if math.isfinite(check.measured) else "none"
        bound = f"{check.bound:g} {check.unit}".strip()
        row = (str(case.id), case.name, check.what, figure, bound, _margin(check), case.peers)
        out.add_row(*row, style=None if outcome.passed else "bold red")
    return out


def _margin(check: Check) -> str:
    """How often a figure fits into its bound, for people."""
    if not check.passed:
        return "FAILED"
    if check.margin > SHOWN_MARGIN:
        return "exact" if math.isinf(check.margin) else f"> {SHOWN_MARGIN:g}"
    return f"{check.margin:.3g}"
