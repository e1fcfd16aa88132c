"""Blocks of numbers against NumPy."""

import numpy as np
import pytest

from physics_prior.dynamics.algebra import cross, dot, fma, inverse9, times
from physics_prior.dynamics.blocks import at_most, get_block, get_lanes, inner, lane, lanes_of, put_block, put_lanes
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


RECORD = np.dtype([("index", "i8"), ("m", "f8", 9), ("u", "f8", 3), ("out", "f8", 3)], align=True)


@kernel
def solve_each(records):
    for record in records:
        m = (
            record.m[0],
            record.m[1],
            record.m[2],
            record.m[3],
            record.m[4],
            record.m[5],
            record.m[6],
            record.m[7],
            record.m[8],
        )
        x = answer(m, (record.u[0], record.u[1], record.u[2]))
        record.out[0], record.out[1], record.out[2] = x


@kernel
def answer(m, u):
    x = times(inverse9(m), u)
    y = cross(x, u)
    return y[0] / 3.0, -y[1] - 0.5, y[2] * dot(x, u) + 2.0


@kernel
def solve_four(records, where):
    m = (
        get_lanes(records, "m", 0, where),
        get_lanes(records, "m", 1, where),
        get_lanes(records, "m", 2, where),
        get_lanes(records, "m", 3, where),
        get_lanes(records, "m", 4, where),
        get_lanes(records, "m", 5, where),
        get_lanes(records, "m", 6, where),
        get_lanes(records, "m", 7, where),
        get_lanes(records, "m", 8, where),
    )
    u = get_lanes(records, "u", 0, where), get_lanes(records, "u", 1, where), get_lanes(records, "u", 2, where)
    x, y, z = answer(m, u)
    put_lanes(records, "out", 0, where, x)
    put_lanes(records, "out", 1, where, y)
    put_lanes(records, "out", 2, where, z)


def test_the_algebra_of_numbers_is_that_of_blocks_to_the_last_bit():
    records = np.zeros(6, dtype=RECORD)
    rng = np.random.default_rng(0)
    records["m"], records["u"] = rng.normal(size=(6, 9)), rng.normal(size=(6, 3))
    solve_each(records)
    expected = records["out"].copy()
    records["out"] = 0.0
    solve_four(records, (5, 0, 3, 3))
    np.testing.assert_array_equal(records["out"][[0, 3, 5]], expected[[0, 3, 5]])
    assert not records["out"][[1, 2, 4]].any()


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
