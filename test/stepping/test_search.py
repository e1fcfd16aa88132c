"""The search for the coarsest setting that will do, and the choice among what was measured, on made-up figures."""

import math

import pytest

from physics_prior.scene import Accuracy, Step
from physics_prior.stepping.choice import Measured, allowed_us, cheapest, most_exact
from physics_prior.stepping.search import FINENESS, coarsest, first


@pytest.mark.parametrize("order", [1, 2, 4, 8])
@pytest.mark.parametrize("allowed", [1e-2, 1e-5, 1e-8])
def test_the_coarsest_is_found_in_few_tries(order, allowed):
    tries = []

    def error(n):
        tries.append(n)
        return 3.0 * n**-order if n > 2 else math.inf  # coarser than that, the motion is lost

    n = coarsest(error, order, allowed, lambda: 10**12)
    exact = max(3.0, (3.0 / allowed) ** (1.0 / order))
    assert error(n) <= allowed
    assert exact - 1e-9 <= n <= (1.0 + FINENESS) * exact + 1.0
    assert len(tries) <= 20  # 15 at most; order 1 down to 1e-8 grows by 8 a try


def test_a_coarse_one_that_will_do_is_taken_at_once():
    assert coarsest(lambda n: 1e-9, 4, 1e-6, lambda: 100) == 1


@pytest.mark.parametrize(("allowed", "found"), [(1.0, 10), (0.99, 11), (0.7, 11), (0.6, 12), (0.1, 18)])
def test_where_coarse_ones_are_many_parts_the_search_is_as_fine(allowed, found):
    """Ten parts at least, and of the order four: a third less error is one part more."""
    tries = []

    def error(n):
        tries.append(n)
        return (10.0 / n) ** 4

    assert coarsest(error, 4, allowed, lambda: 100, 10) == found
    assert min(tries) == 10


@pytest.mark.parametrize("most", [1, 7, 999])
def test_nothing_is_tried_beyond_the_most(most):
    tries = []

    def error(n):
        tries.append(n)
        return 1.0 / n

    assert coarsest(error, 1, 1e-3, lambda: most) is None
    assert max(tries) <= most


def test_what_is_hopeless_is_given_up_at_once():
    tries = []

    def error(n):
        tries.append(n)
        return 1.0 / n

    assert coarsest(error, 1, 1e-12, lambda: 10**6) is None
    assert tries == [1]


def test_the_first_that_is_allowed():
    for count in range(6):
        for start in range(count + 1):
            errors = [1.0] * start + [0.0] * (count - start)
            assert first(errors.__getitem__, 0.5, count) == (start if start < count else None)


def test_the_finest_may_be_lost_to_rounding_and_the_coarsest_to_coarseness():
    """As on four-bars, which no tolerance below 2e-12 gets past their fold."""
    for coarse in range(4):
        for window in range(1, 8):
            errors = [math.inf] * coarse + [1.0] * 22 + [0.0] * window + [math.inf] * 8
            assert first(errors.__getitem__, 0.5, len(errors)) == coarse + 22
    assert first([1.0, 1.0, math.inf].__getitem__, 0.5, 3) is None
    assert first([math.inf].__getitem__, 0.5, 1) is None


def measured(scheme, error, us):
    return Measured(scheme=scheme, step=Step(), error=error, us=us)


def test_of_like_costs_the_first_is_taken_however_the_clock_wavers():
    for wavering in (0.95, 1.0, 1.05):
        found = [measured("a", 1e-5, 10.0 * wavering), measured("b", 1e-9, 10.0), measured("c", 1e-5, 30.0)]
        assert cheapest(found).scheme == "a"
    assert cheapest([measured("a", 1e-5, 12.0), measured("b", 1e-5, 10.0)]).scheme == "b"


def test_a_budget_buys_the_most_exact():
    found = [measured("a", 1e-3, 5.0), measured("b", 1e-6, 20.0), measured("c", 1e-9, 60.0)]
    assert [most_exact(found, budget, 0.0).scheme for budget in (6.0, 30.0, 100.0)] == ["a", "b", "c"]


def test_what_errors_do_not_tell_apart_costs_do():
    found = [measured("a", 1e-12, 50.0), measured("b", 5e-11, 20.0)]
    assert most_exact(found, 100.0, 1e-10).scheme == "b"
    assert most_exact(found, 100.0, 1e-13).scheme == "a"


def test_where_nothing_fits_the_cheapest_is_taken():
    assert most_exact([measured("a", 1e-3, 50.0), measured("b", 1e-9, 20.0)], 1.0, 0.0).scheme == "b"


def test_what_is_asked_as_microseconds_a_measurement():
    assert allowed_us(Accuracy(tolerance=1e-3), 0.01) is None
    assert allowed_us(Accuracy(budget=50e-6), 0.01) == pytest.approx(50.0)
    assert allowed_us(Accuracy(real_time_factor=20.0), 0.01) == pytest.approx(500.0)
