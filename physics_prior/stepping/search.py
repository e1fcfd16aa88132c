"""The coarsest setting whose error is small enough, found in few tries."""

import math
from collections.abc import Callable

FINENESS = 0.1  # relative: how near to the coarsest that will do is near enough
GROWTH = (1.2, 8.0)  # from one try to the next
LOST = 4.0  # where the motion was lost: an error tells nothing then
HOPELESS = 10.0  # times the finest: where the order says so much is needed, nothing is tried
AIM = 0.8  # of the error that will do: a try a little beyond it is a try wasted


def coarsest(error: Callable[[int], float], order: int, allowed: float, most: Callable[[], int]) -> int | None:
    """The smallest n, up to some, whose error is allowed; None where there is none.

    error: falls with the order-th power of n, about; infinite where the motion is lost. Nothing above most() is tried, which may
    learn from what was.
    """
    failed, n = 0, 1
    while not (found := error(n)) <= allowed:
        growth, limit = LOST, most()
        if n >= limit:
            return None
        if math.isfinite(found):
            needed = (found / (AIM * allowed)) ** (1.0 / order)
            if n * needed > HOPELESS * limit:
                return None
            growth = min(max(needed, GROWTH[0]), GROWTH[1])
        failed, n = n, min(limit, max(n + 1, math.ceil(n * growth)))
    while failed and n - failed > max(1.0, FINENESS * n):
        middle = round(math.sqrt(n * failed)) if n > 3 * failed else (n + failed) // 2
        if error(middle) <= allowed:
            n = middle
        else:
            failed = middle
    return n


def first(allowed: Callable[[int], bool], count: int) -> int | None:
    """The first of so many that is allowed, where all after it are too; None where none is."""
    low, high = 0, count
    while low < high:
        middle = (low + high) // 2
        if allowed(middle):
            high = middle
        else:
            low = middle + 1
    return low if low < count else None
