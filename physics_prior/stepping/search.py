"""The coarsest setting whose error is small enough, found in few tries."""

import math
from collections.abc import Callable

FINENESS = 0.1  # relative: how near to the coarsest that will do is near enough
GROWTH = (1.2, 8.0)  # from one try to the next
LOST = 4.0  # where the motion was lost: an error tells nothing then
HOPELESS = 10.0  # times the finest: where the order says so much is needed, nothing is tried
AIM = 0.8  # of the error that will do: a try a little beyond it is a try wasted


def coarsest(
    error: Callable[[int], float], order: int, allowed: float, most: Callable[[], int], least: int = 1
) -> int | None:
    """The smallest n, from the least up to some, whose error is allowed; None where there is none.

    error: falls with the order-th power of n, about; infinite where the motion is lost. Nothing above most() is tried, which may
    learn from what was.
    """
    failed, n = 0, least
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


def first(error: Callable[[int], float], allowed: float, count: int) -> int | None:
    """The first of so many, coarse to fine, whose error is allowed, where those of all after it are; None where none is.

    But for the finest: where an error was told and it is infinite further on, rounding loses the motion, not coarseness.
    """
    low, high, found, told = 0, count, None, False
    while low < high:
        middle = (low + high) // 2
        own = error(middle)
        if own <= allowed:
            found = high = middle
        elif told and not math.isfinite(own):
            high = middle
        else:
            low, told = middle + 1, told or math.isfinite(own)
    return found
