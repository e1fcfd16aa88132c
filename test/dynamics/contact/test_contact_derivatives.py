"""The derivative of a step through events: the saltation matrix at an impact, no error into what holds."""

import numpy as np

H = 1e-3


def test_a_bounce_is_crossed_by_the_saltation_matrix(ball, at, g):
    e, h = 0.6, H
    simulator = ball(restitution=e)
    q, v = at((0.0, 0.0, 0.1 + 1e-3), (0.0, 0.0, -2.0))
    F, _ = simulator.linearise(q.copy(), v.copy(), h, np.zeros(6))
    # state (height, speed): x' = (s, -g); jump s+ = -e s-; Aizerman and Gantmacher's matrix between the two flights
    first = (-2.0 + np.sqrt(4.0 + 2.0 * g * 1e-3)) / g
    before = -2.0 - g * first
    jump = np.array([[1.0, 0.0], [0.0, -e]])
    flow_before, flow_after = np.array([before, -g]), np.array([-e * before, -g])
    salt = jump + np.outer(flow_after - jump @ flow_before, [1.0, 0.0]) / before
    flight = lambda t: np.array([[1.0, t], [0.0, 1.0]])  # noqa: E731
    expected = flight(h - first) @ salt @ flight(first)
    assert np.allclose(F[np.ix_([2, 8], [2, 8])], expected, atol=1e-8)  # measured 2e-10


def test_what_holds_takes_no_error(cube, at):
    simulator = cube(friction=0.8)
    q, v = at((0.0, 0.0, 0.1))
    F, G = simulator.linearise(q, v, H, np.full(6, 0.1))
    F, G = simulator.linearise(q, v, H, np.full(6, 0.1))
    # height and tilt stay, and nothing moves: what slides and turns on the floor is where, not how fast
    assert np.max(np.abs(F[[2, 3, 4]])) < 1e-9  # measured 3e-11
    assert np.max(np.abs(F[6:, 6:])) < 1e-9  # measured 9e-12: what sticks is stopped, whatever it was about to do
    assert np.max(np.abs(G)) < 1e-10  # measured 3e-12: an unknown force does not move what sticks


def test_derivatives_in_flight_are_the_integrators_own(cube, at):
    simulator = cube(friction=0.5)
    q, v = at((0.0, 0.0, 2.0), (1.0, 0.0, 0.0), (2.0, 1.0, 0.5))
    F, _ = simulator.linearise(q.copy(), v.copy(), H, np.zeros(6))
    base_q, base_v = q.copy(), v.copy()
    simulator.advance(base_q, base_v, H)
    for k in range(6):
        moved = np.zeros(6)
        moved[k] = 1e-6
        other_q, other_v = simulator.displaced(q, moved), v.copy()
        simulator.advance(other_q, other_v, H)
        change = np.concatenate([simulator.tree.difference(base_q, other_q), other_v - base_v]) / 1e-6
        assert np.allclose(F[:, k], change, atol=1e-8)  # measured 1e-10
