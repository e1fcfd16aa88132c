"""Small dense systems against NumPy, whatever rows have to be exchanged."""

import numpy as np
import pytest

from physics_prior.dynamics.linear_solve import factorize_square, solve_square


@pytest.mark.parametrize("n", [1, 2, 3, 7, 40])
@pytest.mark.parametrize("seed", range(5))
def test_a_system_is_solved_whatever_rows_are_exchanged(n, seed):
    rng = np.random.default_rng(seed)
    matrix, columns, pivots = rng.normal(size=(n, n)), rng.normal(size=(n, 3)), np.empty(n)
    factors, x = matrix.copy(), columns.copy()
    factorize_square(factors, pivots)
    solve_square(factors, pivots, x)
    np.testing.assert_allclose(
        x, np.linalg.solve(matrix, columns), rtol=0, atol=1e-14 * np.linalg.cond(matrix) * np.max(np.abs(x))
    )
    assert n < 3 or np.any(pivots != np.arange(n))


def test_a_singular_matrix_leaves_what_is_not_finite():
    factors, pivots, x = np.ones((2, 2)), np.empty(2), np.ones((2, 1))
    factorize_square(factors, pivots)
    solve_square(factors, pivots, x)
    assert not np.isfinite(x).all()
