"""Mechanisms that fold: a step that lands on the dead centre goes through it as if it had landed beside.

There all rods lie in one line, rows lose rank and the two four-bars have two freedoms more; forces grow like one over the
distance from it. Stages that see it would let the freedoms go: up to 300 J in one step of 10 ms.
"""

import numpy as np
import pytest

from physics_prior.studies.problems.four_bar import first_top_at, four_bar
from physics_prior.studies.problems.mechanism import Run
from physics_prior.studies.problems.pendulum import G


def before_the_fold(loops, distance, time):
    """A run that will be `distance` rad beyond the dead centre after `time` s, by the exact motion."""
    c = G * ((loops + 1) / 2 + loops) / ((loops + 1) / 3 + loops)
    turn, h = 0.5 * np.pi + distance, -time / 100
    rate = np.sqrt(1.0 + 2.0 * c * (1.0 - np.cos(turn)))
    for _ in range(100):  # backwards, RK4 of the one-freedom equation
        slopes, ahead = [], np.zeros(2)
        for share in (0.0, 0.5, 0.5, 1.0):
            at = np.array([turn, rate]) + share * h * ahead
            ahead = np.array([at[1], c * np.sin(at[0])])
            slopes.append(ahead)
        turn, rate = np.array([turn, rate]) + h / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])
    signs = np.array([-1.0, 1.0] * loops + [-1.0])
    return Run(four_bar(loops).run().simulator, signs * (turn - 0.5 * np.pi), signs * rate)


@pytest.mark.parametrize("loops", [1, 2])
@pytest.mark.parametrize("stage", [1.0, 0.5])
@pytest.mark.parametrize("h", [1e-2, 1e-3, 1e-4])
def test_landing_on_the_dead_centre_costs_no_energy(loops, stage, h):
    """Measured 1e-7 J at 10 ms, 1e-8 J at 1 ms, 5e-10 J at 0.1 ms; the kinetic energy is some 40 J."""
    for distance in (0.0, 1e-9, 1e-7, -1e-6, 3e-6, -1e-5, 3e-5, 1e-4):
        run = before_the_fold(loops, distance, (1.0 + stage) * h)
        before = run.energy()
        run.advance(h, 5)
        assert abs(run.energy() - before) < max(1e-7, 50.0 * h) * 1e-6


def test_acceleration_at_the_dead_centre_is_that_beside_it():
    """Parallel rods, whatever the distance. Measured 2e-7 of it at most."""
    expected = before_the_fold(2, 3e-3, 0.0)
    parallel = expected.simulator.acceleration(expected.q, expected.v)[0]
    for distance in (1e-9, 1e-8, 1e-6, 1e-5):
        run = before_the_fold(2, distance, 0.0)
        vdot = run.simulator.acceleration(run.q, run.v)
        assert np.max(np.abs(vdot[0::2] - vdot[0])) < 1e-4 * abs(vdot[0])
        assert vdot[0] == pytest.approx(parallel, rel=1e-2)


def test_two_four_bars_at_a_step_that_lands_on_it():
    """RK4 at 1.603 ms for 12 s: at 10.94 s a step ends 2e-6 rad from the dead centre. Measured 3e-9 m; it was 0.2 m."""
    benchmark, h = four_bar(2), 0.0016032729244919257
    run = benchmark.run()
    run.advance(h, 7500)
    assert np.linalg.norm(benchmark.observe(run) - first_top_at(2, np.array([run.time]))[0]) < 1e-6
