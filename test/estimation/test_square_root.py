"""Square-root algebra against the dense formulas, where those still have digits, and beyond."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from physics_prior.dynamics.blocked import FEW
from physics_prior.dynamics.blocks import WIDE
from physics_prior.dynamics.covariance import carry_factor, triangularise
from physics_prior.estimation.gain import MANY, gain_of
from physics_prior.estimation.observation import Innovation
from physics_prior.estimation.square_root import lower_factor, normalised_error, with_first

seeds = st.integers(0, 2**32 - 1)
sizes = st.integers(1, 8) | st.integers(WIDE + 1, WIDE + 10)


def _factor(rng, n, decades):
    """Lower factor of a covariance whose standard deviations span 10^-decades to 10^decades."""
    return lower_factor(10.0 ** rng.uniform(-decades, decades, size=(n, 1)) * rng.normal(size=(n, n)))


def _carry(F, S, G):
    """The lower factor of F S S^T F^T + G G^T."""
    n, g = G.shape
    T = np.empty((n + g, n))
    carry_factor(F.copy(), G, np.ascontiguousarray(S.T), T)
    triangularise(T, n, np.empty(2 * n + g))
    return T[:n].T


def _update(S, H, noise, y):
    """NIS, correction and posterior factor, and the logarithm of the determinant of the innovation's covariance."""
    U = with_first(np.ascontiguousarray(S.T), H.shape[1])
    gain = gain_of(U, Innovation(y, H, noise, len(y)), np.zeros(H.shape[1]))
    assert gain.change == np.max(np.abs(gain.correction[: H.shape[1]]))
    return gain.nis, gain.correction, gain.factor(), gain.log_determinant


def _relative(difference, covariance):
    """The largest error of a covariance's entries, in units of their standard deviations."""
    deviations = np.sqrt(np.diag(covariance))
    return np.max(np.abs(difference) / np.outer(deviations, deviations))


@given(seeds, st.integers(1, 8), st.integers(0, 8))
def test_triangularise_keeps_the_square(seed, n, more):
    rng = np.random.default_rng(seed)
    W = 10.0 ** rng.uniform(-6, 6, size=(n, 1)) * rng.normal(size=(n, n + more))
    L = lower_factor(W)
    assert np.array_equal(np.triu(L, 1), np.zeros_like(L))
    assert np.all(np.diag(L) >= 0.0)
    assert _relative(L @ L.T - W @ W.T, W @ W.T) < 1e-13  # 1e-15


@given(seeds, st.integers(FEW + 4, 3 * FEW), st.integers(0, 9), st.integers(0, 9))
def test_blocks_of_reflections_make_the_same_factor(seed, n, more, nothing):
    """Of many errors; with rows of zeros at the end and columns without any error."""
    rng = np.random.default_rng(seed)
    T = np.concatenate([rng.normal(size=(n + more, n)), np.zeros((nothing, n))])
    T[:, rng.permutation(n)[:nothing]] = 0.0
    one_by_one = T.copy()
    triangularise(one_by_one, n, np.empty(len(T) + n))
    S = lower_factor(T.T)
    assert not np.triu(S, 1).any()
    np.testing.assert_allclose(S @ S.T, T.T @ T, atol=1e-12)
    if not nothing:
        np.testing.assert_allclose(S.T, one_by_one[:n], atol=1e-8)


def test_triangularise_leaves_zero_rows_alone():
    W = lower_factor(np.array([[0.0, 0.0, 0.0], [3.0, 4.0, 0.0]]))
    np.testing.assert_allclose(W @ W.T, [[0.0, 0.0], [0.0, 25.0]], atol=1e-15)


@given(seeds, sizes, st.integers(1, 8))
def test_prediction_is_the_dense_one(seed, n, g):
    rng = np.random.default_rng(seed)
    F, G, S = rng.normal(size=(n, n)), rng.normal(size=(n, g)), _factor(rng, n, 0)
    expected = F @ S @ S.T @ F.T + G @ G.T
    S = _carry(F, S, G)
    assert _relative(S @ S.T - expected, expected) < 1e-13  # 1e-15


@given(seeds, sizes, st.integers(1, 6) | st.integers(MANY, 40), st.integers(0, 3))
def test_update_is_the_dense_one(seed, n, m, unseen):
    """By few rows and by a frame of many."""
    rng = np.random.default_rng(seed)
    size = max(1, n - unseen)
    H, S, noise, y = rng.normal(size=(m, size)), _factor(rng, n, 0), _factor(rng, m, 0), rng.normal(size=m)
    noise += np.eye(m)
    nis, correction, posterior, determinant = _update(S, H, noise, y)
    full = np.hstack([H, np.zeros((m, n - size))])
    P, R = S @ S.T, noise @ noise.T
    innovation = full @ P @ full.T + R
    K = P @ full.T @ np.linalg.inv(innovation)
    joseph = (np.eye(n) - K @ full) @ P @ (np.eye(n) - K @ full).T + K @ R @ K.T
    conditioning = np.linalg.cond(innovation)
    assert nis == pytest.approx(y @ np.linalg.solve(innovation, y), rel=1e-13 * conditioning)
    # to rounding of what is summed: the sum itself may cancel
    np.testing.assert_allclose(
        correction, K @ y, rtol=0, atol=1e-13 * conditioning * np.linalg.norm(K) * np.linalg.norm(y)
    )
    assert _relative(posterior @ posterior.T - joseph, P) < 1e-13 * conditioning
    assert determinant == pytest.approx(np.linalg.slogdet(innovation)[1], rel=1e-9, abs=1e-9)


@pytest.mark.parametrize("m", [3, 40])
def test_an_innovation_found_elsewhere_corrects_as_if_found_at_the_prior(m):
    """Of few rows, and of many."""
    rng = np.random.default_rng(m)
    n, h = 9, 5
    S, H, noise, y, about = (
        _factor(rng, n, 0),
        rng.normal(size=(m, h)),
        np.eye(m),
        rng.normal(size=m),
        rng.normal(size=h),
    )
    U = with_first(np.ascontiguousarray(S.T), h)
    here = gain_of(U, Innovation(y, H, noise, m), np.zeros(h))
    there = gain_of(U, Innovation(y - H @ about, H, noise, m), about)
    assert there.nis == pytest.approx(here.nis, rel=1e-12)
    np.testing.assert_allclose(there.correction, here.correction, rtol=0, atol=1e-12)
    assert there.change == np.max(np.abs(there.correction[:h] - about))


def _frame(rng, n, blocks):
    """An innovation of blocks of three rows, each with its own noise."""
    noise = np.zeros((3 * blocks, 3 * blocks))
    for k in range(0, 3 * blocks, 3):
        noise[k : k + 3, k : k + 3] = _factor(rng, 3, 0) + np.eye(3)
    return Innovation(rng.normal(size=3 * blocks), rng.normal(size=(3 * blocks, n - 1)), noise, 3)


def _of_seen(seen, S):
    """The triangular factor, transposed, of the errors that are seen."""
    U, count = with_first(np.ascontiguousarray(S.T), seen.H.shape[1]), seen.H.shape[1]
    np.testing.assert_allclose(U.T @ U, S @ S.T, rtol=1e-12, atol=1e-12 * np.max(S) ** 2)
    assert not U[count:, :count].any()
    return U


@given(seeds, st.integers(2, 8), st.integers(1, 5))
def test_blocks_are_whitened_and_judged_alone(seed, n, blocks):
    rng = np.random.default_rng(seed)
    seen, S = _frame(rng, n, blocks), _factor(rng, n, 0)
    H, y = seen.whitened
    np.testing.assert_allclose(seen.noise @ H, seen.H, atol=1e-12)
    np.testing.assert_allclose(seen.noise @ y, seen.y, atol=1e-12)
    squares = seen.squares(_of_seen(seen, S))
    for k, square in enumerate(squares):
        rows = slice(3 * k, 3 * k + 3)
        spread = seen.H[rows] @ S[: n - 1]
        P = spread @ spread.T + seen.noise[rows, rows] @ seen.noise[rows, rows].T
        assert square == pytest.approx(seen.y[rows] @ np.linalg.solve(P, seen.y[rows]), rel=1e-13 * np.linalg.cond(P))


@given(seeds)
def test_blocks_are_judged_however_little_is_known(seed):
    """Standard deviations of 1e12: what is measured says nothing against the state."""
    rng = np.random.default_rng(seed)
    seen = _frame(rng, 6, 4)
    squares = seen.squares(_of_seen(seen, 1e12 * _factor(rng, 6, 0)))
    assert np.all((squares >= 0.0) & (squares < 1e-6))


@pytest.mark.parametrize("m", [2, MANY])
@settings(max_examples=20)
@given(seeds)
def test_thousands_of_updates_at_extreme_variances(m, seed):
    """No update, however sharp or dull, leaves the covariance anything but one."""
    rng = np.random.default_rng(seed)
    n = 4
    S = np.diag(10.0 ** rng.uniform(-6, 6, size=n))
    for _ in range(2000):
        noise = np.diag(10.0 ** rng.uniform(-6, 6, size=m))  # variances 1e-12 to 1e12
        before = np.sum(S * S, axis=1)
        nis, _, S, _ = _update(S, rng.normal(size=(m, n)), noise, rng.normal(size=m))
        assert np.isfinite(nis)
        assert np.isfinite(S).all()
        assert np.all(np.sum(S * S, axis=1) <= before * (1.0 + 1e-9))  # a measurement never takes knowledge away
        G = np.diag(10.0 ** rng.uniform(-8, 1, size=n))
        S = _carry(np.eye(n) + 0.1 * rng.normal(size=(n, n)), S, G)
    P = S @ S.T
    assert np.array_equal(P, P.T)
    deviations = np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh(P / np.outer(deviations, deviations))[0] > -1e-15


def test_many_measurements_add_up_their_information():
    """Of a still state: P^-1 = P0^-1 + sum H^T R^-1 H, through 5000 updates."""
    rng = np.random.default_rng(1)
    n, m = 5, 3
    S = np.diag(10.0 ** rng.uniform(-1, 3, size=n))
    information = np.linalg.inv(S @ S.T)
    for _ in range(5000):
        H, noise = rng.normal(size=(m, n)), np.diag(10.0 ** rng.uniform(-1, 3, size=m))
        information += H.T @ np.linalg.inv(noise @ noise.T) @ H
        _, _, S, _ = _update(S, H, noise, np.zeros(m))
    expected = np.linalg.inv(information)
    assert _relative(S @ S.T - expected, expected) < 1e-12  # 2e-14


@pytest.mark.parametrize("rank", [1, 3, 6])
def test_normalised_error_is_chi_square_of_the_rank(rank):
    """Units far apart, and directions without any error as constraints leave them."""
    rng = np.random.default_rng(rank)
    n, count = 6, 4000
    half = 10.0 ** rng.uniform(-5, 5, size=(n, 1)) * rng.normal(size=(n, rank))
    S = np.zeros((n, n))
    S[:, :rank] = half
    results = [normalised_error(S, half @ rng.normal(size=rank)) for _ in range(count)]
    assert {found for _, found in results} == {rank}
    low, high = chi2.ppf([0.001, 0.999], rank * count) / count
    assert low < np.mean([value for value, _ in results]) < high
