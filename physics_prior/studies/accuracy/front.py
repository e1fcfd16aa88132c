"""The Pareto front of work and precision, and what a given error costs."""

import math
from collections.abc import Sequence

from physics_prior.studies.accuracy.measure import Point


def front(points: Sequence[Point]) -> list[Point]:
    """Those that no other beats in both error and time, from coarse and cheap to fine and dear."""
    out: list[Point] = []
    for point in sorted(points, key=lambda each: (each.seconds, each.error)):
        if point.measured and (not out or point.error < out[-1].error):
            out.append(point)
    return out


def seconds_to_reach(points: Sequence[Point], error: float) -> float | None:
    """Processor time per simulated second for an error, by the front, straight in logarithms between its points.

    Where the cheapest is already as exact, its own; None where none is.
    """
    edge = front(points)
    for before, point in zip([None, *edge], edge, strict=False):
        if point.error > error:
            continue
        if before is None or before.scheme != point.scheme or point.error == 0.0:
            return point.seconds
        share = math.log(before.error / error) / math.log(before.error / point.error)
        return float(before.seconds * (point.seconds / before.seconds) ** share)
    return None
