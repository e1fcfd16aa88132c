"""Any scene moves on in finite numbers or is refused by name; none makes energy; what is held stays held."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from physics_prior.dynamics.simulator import Simulator
from physics_prior.dynamics.switches import UNLIKE
from physics_prior.errors import ModelError, SimulationError
from physics_prior.model import Tree

STEPS = 10
FINEST = 2048  # parts of a step against which its error is measured
ROUNDING = 1e-9  # of the energy: what a step may add to it beside its own error
AT_A_FOLD = 5e-6  # the same where rows hold by the square of a motion: 1e-11 m left in them is 4.4e-6 m of height
STRAY = 1e-3  # rad or m: by how much rows that hold by the square of a motion let a mechanism stray: rounding over its lever
HELD = 1e-10  # m: what projection may leave
DIGITS = 1e-14  # of coordinates, which an unstable step may have thrown 1e8 m away
HARDLY_HELD = 1e-6  # m: the same where rows lose rank or nearly do; a step that leaves more is refused

FREE = {"pushed": False, "held": False, "touching": False, "extreme": True}
KINDS = {
    "free": (FREE, "rk4"),
    "held": (FREE | {"held": True, "extreme": False}, "rk4"),
    "held, extreme": (FREE | {"held": True}, "rk4"),
    "touching": (FREE | {"touching": True, "extreme": False}, "rk4"),
    "pushed and held": ({"pushed": True, "held": True, "touching": False, "extreme": False}, "semi_implicit_euler"),
}
HEALTH = (HealthCheck.too_slow, HealthCheck.data_too_large, HealthCheck.filter_too_much)


def begin(scene, integrator):
    """A simulator at the scene's beginning and its state; None if it was refused, which it must have been by name."""
    q, v, refusal = scene.q.copy(), scene.v.copy(), None
    try:
        simulator = Simulator(Tree(scene.parts, scene.joints), scene.effects, integrator)
        simulator.begin(q, v)
    except (ModelError, SimulationError) as error:
        refusal = error
    if refusal is not None:
        assert any(f"'{name}" in str(refusal) for name in scene.names)
        assert isinstance(refusal, ModelError) or not scene.consistent or UNLIKE in str(refusal)
        return None
    assert not scene.conflicting
    assert np.isfinite(q).all()
    assert np.isfinite(v).all()
    return simulator, q, v


def norm(x, metrics):
    """Length of a tangent vector x (nv,) in the largest of some metrics (nv, nv)."""
    return np.sqrt(max(0.0, *(float(x @ M @ x) for M in metrics)))


def energy(simulator, q, v):
    simulator.move(q, v)
    return simulator.energy()


def folded(simulator, q, v):
    """Whether rows lose rank at q that they have beside it, or add so little to others that they hardly hold a motion."""
    if simulator.rows == 0:
        return False
    A, _ = simulator.tangent_rows(q, v)
    B, _ = simulator.tangent_rows(simulator.displaced(q, 1e-2 * np.cos(np.arange(simulator.nv))), v)
    here, beside = (np.linalg.svd(rows, compute_uv=False) for rows in (A, B))  # levers, m
    return bool(np.any((here < 1e-2) & (np.maximum(here, beside) > 1e-12)))


def check_step(simulator, q, v, h, fold):
    """Move q and v by a step in which no energy is made; return by how much more, relative, than the step's error allows.

    That error is how far it ends, d, from the same step in parts. It changes the energy by at most |v| |dv| + |a| |dq| in the
    mass metrics of either end, a the acceleration at rest; four times as much is allowed. Two parts tell it where the step
    is small; of one beyond the integrator's stability, which two parts may be as well, more do. At a fold, where rounding of the
    rows lets the mechanism stray by its root, projection may also lift it by so much.
    """
    M, before = simulator.mass_matrix(q), energy(simulator, q, v)
    # relative to the energy of motion and of a metre of height: an energy may be zero where it is measured from
    scale = 0.5 * v @ M @ v + abs(before) + 9.81 * simulator.tree.mass
    pull = simulator.acceleration(q, np.zeros(simulator.nv))
    q_start, v_start = q.copy(), v.copy()
    simulator.advance(q, v, h)
    made, parts, metrics = energy(simulator, q, v) - before, 1, (M, simulator.mass_matrix(q))
    if fold and np.max(np.abs(simulator.tree.difference(q_start, q))) <= STRAY:
        made -= max(0.0, energy(simulator, q, 0.0 * v) - energy(simulator, q_start, 0.0 * v))
    while parts < FINEST:
        parts *= 4 if parts > 1 else 2
        q_parts, v_parts = q_start.copy(), v_start.copy()
        simulator.advance(q_parts, v_parts, h / parts, parts)
        allowed = norm(v - v_parts, metrics) * max(norm(v, metrics), norm(v_parts, metrics))
        allowed += norm(pull, metrics) * norm(simulator.tree.difference(q, q_parts), metrics)
        excess = (made - 4.0 * allowed) / scale
        if excess <= ROUNDING:
            break
    return excess


def check(scene, kind):
    """Follow a scene for some steps, which may be refused as too large, or for a joint that a posture leaves no inertia."""
    fields, integrator = KINDS[kind]
    begun = begin(scene, integrator)
    if begun is None:
        return
    simulator, q, v = begun
    # masses of 1e-5 and 1e4 kg and inertias of 1e-12 between two that are held: rows of unlike scales close less exactly
    alike = not (fields["held"] and fields["extreme"])
    for _ in range(STEPS):
        fold, refusal = folded(simulator, q, v), ""
        try:
            made = check_step(simulator, q, v, scene.h, fold)
        except SimulationError as error:
            refusal = str(error)
        if refusal:
            assert "after a step of" in refusal or any(f"'{name}" in refusal for name in scene.names)
            return
        assert np.isfinite(q).all()
        assert np.isfinite(v).all()
        assert made <= (AT_A_FOLD if fold else ROUNDING)
        left = np.max(np.abs(simulator.constraint_error(q, v)), initial=0.0)
        assert left <= (HELD + DIGITS * np.max(np.abs(q)) if alike and not fold else HARDLY_HELD)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=40, derandomize=True, suppress_health_check=HEALTH)
@given(data=st.data())
def test_a_scene_is_sound_or_refused(random_scenes, kind, data):
    check(data.draw(random_scenes(**KINDS[kind][0])), kind)


@pytest.mark.slow
@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=2000, suppress_health_check=HEALTH)
@given(data=st.data())
def test_ten_thousand_scenes(random_scenes, kind, data):
    """2000 of each of the five kinds."""
    check(data.draw(random_scenes(**KINDS[kind][0])), kind)
