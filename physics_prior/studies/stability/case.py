"""The contract of a hard case: it runs, and says what it measured and what it may be at most."""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Check:
    """One figure of a case.

    Attributes:
        what: what was measured, for people.
        measured: the figure; NaN fails.
        bound: the largest that passes.
        unit: of both; empty for ratios and counts.
    """

    what: str
    measured: float
    bound: float
    unit: str = ""

    @property
    def passed(self) -> bool:
        """Whether the figure is within its bound."""
        return self.measured <= self.bound

    @property
    def margin(self) -> float:
        """How many times the figure fits into its bound: infinite for zero, 0 for one that is no number."""
        if not math.isfinite(self.measured):
            return 0.0
        if self.measured <= 0.0:
            return math.inf
        return self.bound / self.measured


@dataclass(frozen=True, eq=False)
class Curve:
    """A line of a picture, or points where ``dots``: x (k,) and y (k,)."""

    label: str
    x: np.ndarray
    y: np.ndarray
    dots: bool = False


@dataclass(frozen=True, eq=False)
class Picture:
    """What a case looked like, drawn by ``physics-prior stability --plot``.

    Attributes:
        name: of the file, without its ending.
        title, x, y: what a person reads; x and y with their units.
        curves: what is drawn.
        logarithmic: which axes are: any of "xy".
        levels: text -> y of a horizontal line (a bound, a peer's figure).
    """

    name: str
    title: str
    x: str
    y: str
    curves: Sequence[Curve]
    logarithmic: str = ""
    levels: tuple[tuple[str, float], ...] = ()


Measurements = Iterator[Check | Picture]


@dataclass(frozen=True)
class Case:
    """A hard case.

    Attributes:
        id: its number in the list that the issue names; further ones follow on.
        key: what it is called on the command line.
        name: what it is, for people.
        peers: what others do there, as measured or reported.
        run: runs it and yields its figures; told whether to be thorough (the command) or quick (the test suite: the same
            figures and bounds, from fewer runs).
    """

    id: int
    key: str
    name: str
    peers: str
    run: Callable[[bool], Measurements]


def case(number: int, name: str, peers: str = "") -> Callable[[Callable[[bool], Measurements]], Case]:
    """Make a case of the function that runs it; its key is the function's name."""

    def make(run: Callable[[bool], Measurements]) -> Case:
        return Case(number, run.__name__, name, peers, run)

    return make
