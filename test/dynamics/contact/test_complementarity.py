"""The complementarity problem of contact impulses: the law holds, whatever masses, redundancy and units."""

import numpy as np
import pytest

from physics_prior.dynamics.contact.complementarity import BILATERAL, DISC, NORMAL, PARTNER, complement


class Problem:
    """Bodies of given masses, touching at random points under random motion; rows as the kernels number them."""

    def __init__(self, rng, masses, contacts, friction, bilateral=0):
        nv = 6 * len(masses)
        m = bilateral + 3 * contacts
        A = np.zeros((m, nv))
        A[:bilateral] = rng.normal(size=(bilateral, nv))
        for r in range(bilateral, m, 3):
            i, j = rng.integers(len(masses)), rng.integers(-1, len(masses))
            n = np.array([0.0, 0.0, 1.0]) + 0.2 * rng.normal(size=3)
            n /= np.linalg.norm(n)
            t = np.cross(n, [1.0, 0.0, 0.0])
            t /= np.linalg.norm(t)
            for k, d in enumerate((n, t, np.cross(n, t))):
                for body, sign in ((i, 1.0), (j, -1.0)):
                    if body >= 0 and not (i == j and sign < 0):
                        arm = 0.1 * rng.normal(size=3)
                        A[r + k, 6 * body : 6 * body + 6] += sign * np.concatenate([d, np.cross(arm, d)])
        inverse = np.concatenate([np.r_[np.ones(3), np.ones(3) / 4e-3] / mass for mass in masses])
        self.m, self.S, self.b = m, A * inverse @ A.T, A @ rng.normal(size=nv)
        self.kinds = np.array([BILATERAL] * bilateral + [NORMAL, DISC, PARTNER] * contacts, dtype=float)
        self.owners, self.bounds = np.zeros(m), np.zeros(m)
        for r in range(bilateral, m, 3):
            self.owners[r + 1], self.bounds[r + 1] = r, friction

    def solve(self, S=None, b=None):
        p, m = np.zeros(self.m), self.m
        S, b = self.S if S is None else S, self.b if b is None else b
        left = complement(S, b, self.kinds, self.owners, self.bounds, p, m, np.zeros((m, m)), np.zeros((3, m)))
        return p, left


def broken_law(problem, p):
    """The largest violation of the law, root of energy, of the largest velocity."""
    u, size = problem.S @ p + problem.b, np.sqrt(np.diag(problem.S))
    worst = [0.0]
    for r, kind in enumerate(problem.kinds):
        if kind == BILATERAL:
            worst.append(abs(u[r]) / size[r])
        elif kind == NORMAL:
            worst += [-u[r] / size[r], -p[r] * size[r], min(p[r] * size[r], u[r] / size[r])]
        elif kind == DISC:
            limit, push, slip = problem.bounds[r] * p[int(problem.owners[r])], p[r : r + 2], u[r : r + 2]
            worst.append((np.linalg.norm(push) - limit) * size[r])
            # p . u = -limit |u|: against the slip and as large as it may be
            worst.append(abs(push @ slip + limit * np.linalg.norm(slip)) / np.max(np.abs(problem.b / size)))
    return max(worst) / np.max(np.abs(problem.b / size))


@pytest.mark.parametrize("friction", [0.0, 0.3, 1.0])
@pytest.mark.parametrize("contacts", [1, 2, 3])
@pytest.mark.parametrize("heavy", [1.0, 1e6])
def test_the_law_holds(friction, contacts, heavy):
    for seed in range(60):
        problem = Problem(np.random.default_rng(seed), (1.0, heavy), contacts, friction)
        p, left = problem.solve()
        assert left < 1e-11  # measured 1e-13
        assert broken_law(problem, p) < 1e-11  # measured 9e-14


@pytest.mark.parametrize("friction", [0.3, 1.0, 2.0])
def test_what_is_not_solved_to_the_end_still_never_pulls_nor_creates_energy(friction):
    # eight contacts at random normals on twelve freedoms jam; some are left with a residual, and say so
    unsolved = 0
    for seed in range(60):
        problem = Problem(np.random.default_rng(seed), (1.0, 1e6), 8, friction)
        p, left = problem.solve()
        unsolved += left > 1e-8
        assert left < 0.05  # measured 5e-4
        normals = p[problem.kinds == NORMAL]
        pushes = np.hypot(p[problem.kinds == DISC], p[problem.kinds == PARTNER])
        assert np.all(normals >= 0.0)
        assert np.all(pushes <= friction * normals * (1.0 + 1e-12))
        before = np.max(problem.b**2 / np.diag(problem.S))
        assert p @ (problem.b + 0.5 * problem.S @ p) < 1e-2 * left * before + 1e-9 * before
    assert unsolved <= 15  # measured 3 to 11 of 60


def test_bilateral_rows_hold_beside_contacts():
    for seed in range(60):
        problem = Problem(np.random.default_rng(seed), (1.0, 3.0), 3, 0.5, bilateral=2)
        p, left = problem.solve()
        assert left < 1e-11  # measured 1e-13
        assert broken_law(problem, p) < 1e-11  # measured 1e-13


def test_units_of_rows_do_not_matter():
    problem = Problem(np.random.default_rng(3), (1.0, 2.0), 3, 0.4)
    p, _ = problem.solve()
    # a contact's three rows measured in millimetres
    scale = np.repeat(1e3, problem.m)
    scaled, _ = problem.solve(problem.S * np.outer(scale, scale), problem.b * scale)
    assert np.max(np.abs(scaled * scale - p)) < 1e-13 * np.max(np.abs(p))  # measured 4e-19 in all


def test_the_same_contact_many_times_moves_as_once():
    rng = np.random.default_rng(0)
    one = Problem(rng, (1.0,), 1, 0.5)
    p, _ = one.solve()
    many = Problem(rng, (1.0,), 8, 0.5)
    copies = np.tile(np.arange(3), 8)
    many.S, many.b = one.S[np.ix_(copies, copies)], one.b[copies]
    shared, left = many.solve()
    assert left < 1e-13  # measured 2e-16
    assert np.allclose(shared.reshape(8, 3).sum(axis=0), p, atol=1e-11 * np.max(np.abs(p)))  # measured 1e-14


def test_no_approach_no_impulse():
    problem = Problem(np.random.default_rng(1), (1.0,), 4, 0.5)
    problem.b[:] = np.abs(problem.b)
    problem.b[problem.kinds != NORMAL] = 0.0
    p, left = problem.solve()
    assert left == 0.0
    assert not p.any()
