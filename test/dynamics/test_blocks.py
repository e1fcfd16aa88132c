"""Blocks of numbers against NumPy."""

import numpy as np
import pytest

from physics_prior.dynamics.blocks import get_block, inner, minus_scaled, put_block, scale_block
from physics_prior.dynamics.kernel import kernel

COUNT = 8


@kernel
def subtract(a, b, s, begin, some):
    block = scale_block(2.0, get_block(a, begin, COUNT, some))
    put_block(a, begin, minus_scaled(block, s, get_block(b, begin, COUNT, some)), some)


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
