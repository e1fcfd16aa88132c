"""Blocks of numbers against NumPy."""

import numpy as np
import pytest

from physics_prior.dynamics.algebra import fma
from physics_prior.dynamics.blocks import at_most, get_block, inner, lane, lanes_of, put_block
from physics_prior.dynamics.kernel import kernel

COUNT = 8


@kernel
def subtract(a, b, s, begin, some):
    block = 2.0 * get_block(a, begin, COUNT, some)
    put_block(a, begin, fma(-s, get_block(b, begin, COUNT, some), block), some)


@kernel
def product(a, b, some):
    return inner(get_block(a, 0, 12, some), get_block(b, 0, COUNT, COUNT))


@pytest.mark.parametrize("some", range(COUNT + 1))
def test_blocks_are_numbers_side_by_side_and_leave_what_is_not_theirs(some):
    rng = np.random.default_rng(some)
    a, b = rng.normal(size=(2, 20))
    expected = a.copy()
    expected[5 : 5 + some] = 2.0 * a[5 : 5 + some] - 0.3 * b[5 : 5 + some]
    subtract(a, b, 0.3, 5, some)
    np.testing.assert_allclose(a, expected, rtol=1e-15, atol=1e-15)
    np.testing.assert_array_equal(np.delete(a, np.s_[5 : 5 + some]), np.delete(expected, np.s_[5 : 5 + some]))


def test_what_a_block_leaves_out_is_not_read():
    """Behind an array lies memory of others: of its last rows, blocks read no further."""
    a = np.full(COUNT, np.nan)
    a[:3] = 1.0
    assert product(a, np.ones(COUNT), 3) == 3.0


@kernel
def all_at_most(a, b, c, limit):
    return at_most(lanes_of(a, b, c), limit)


@kernel
def second(a, b, c):
    return lane(lanes_of(a, b, c), 1)


def test_a_block_is_at_most_what_all_of_it_is():
    assert all_at_most(1.0, 2.0, 3.0, 3.0)
    assert not all_at_most(1.0, 3.5, 3.0, 3.0)
    assert not all_at_most(1.0, np.nan, 3.0, 3.0)
    assert second(1.0, 2.0, 3.0) == 2.0
