"""Attachments come and go: what is off does nothing, and what takes hold does so by the impulse of equation 9."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from physics_prior import inertia, rotations
from physics_prior.dynamics.formulations import generalized
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment, Rod, Weld
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import ModelError, SimulationError
from physics_prior.model import Joint, JointKind, Part, Tree

GRAVITY = Gravity(acceleration=(0.3, -0.2, -9.81))


def off(actual, expected):
    """Largest deviation, relative to the largest entry (or one)."""
    expected = np.asarray(expected)
    return float(np.max(np.abs(actual - expected), initial=0.0) / max(1.0, np.max(np.abs(expected), initial=0.0)))


def kinetic_energy(simulator, q, v):
    return 0.5 * v @ simulator.mass_matrix(q) @ v


@pytest.fixture(scope="module")
def chain():
    """A free box that carries two rods, each on a ball joint."""
    rod = inertia.capsule(1.0, 0.05, 1.0).transformed(np.eye(3), np.array([0.0, 0.0, -0.5]))
    down = np.array([0.0, 0.0, -1.0])
    return Tree(
        [Part("box", inertia.box(3.0, (0.3, 0.2, 0.1))), Part("upper", rod), Part("lower", rod)],
        [
            Joint("flight", JointKind.FREE, "world", "box"),
            Joint("shoulder", JointKind.SPHERICAL, "box", "upper"),
            Joint("elbow", JointKind.SPHERICAL, "upper", "lower", down),
        ],
    )


HAND = Attachment(name="hand", part="lower", point=(0.0, 0.0, -1.0), at="here", initially="off")
GRIP = Weld(name="grip", part="box", at="here", initially="off")
TETHER = Rod(name="tether", part="upper", point=(0.0, 0.1, -0.5), at=(0.0, 0.3, 0.4), length=1.0, initially="off")
EFFECTS = [GRAVITY, HAND, GRIP, TETHER]


def with_tether(chain, q):
    """A simulator of EFFECTS whose tether is as long as it is at q."""
    simulator = Simulator(chain, EFFECTS)
    simulator.move(q, np.zeros(chain.nv))
    x, R = simulator.pose("upper")
    length = float(np.linalg.norm(x + R @ np.array(TETHER.point) - np.array(TETHER.at)))
    return Simulator(chain, [GRAVITY, HAND, GRIP, TETHER.model_copy(update={"length": length})])


def named(simulator, effect):
    """The effect as one that holds at the place where it took hold."""
    hold = simulator.switches.holds[simulator.switches.index(effect.label)]
    return effect.caught(np.array(hold.caught[:3]), np.array(hold.caught[3:])) if hold.caught else effect


def on_from_the_start(simulator, effect):
    return named(simulator, effect).model_copy(update={"initially": "on"})


@pytest.mark.parametrize(
    "held", [(), ("hand",), ("grip",), ("tether",), ("hand", "tether"), ("hand", "grip", "tether")]
)
def test_what_is_off_does_nothing(held, chain, random_state):
    """Motion, derivatives, rank and wrenches are those of a scene that does not name what is off."""
    rng = np.random.default_rng(1)
    q, v = random_state(rng, chain)
    simulator = with_tether(chain, q)
    for label in simulator.switches.labels:
        simulator.switch(label, label in held, q, v)
    alone = Simulator(
        chain,
        [GRAVITY, *(on_from_the_start(simulator, each) for each in simulator.switches.effects if each.label in held)],
    )
    assert off(simulator.acceleration(q, v), alone.acceleration(q, v)) < 1e-12  # measured 3e-14
    assert simulator.rank == alone.rank
    assert simulator.switches.rows == alone.rows
    for ours, theirs in zip(
        simulator.acceleration_derivatives(q, v), alone.acceleration_derivatives(q, v), strict=True
    ):
        assert off(ours, theirs) < 1e-10  # measured 2e-12
    wrenches, expected = simulator.wrenches(q, v), alone.wrenches(q, v)
    for name, wrench in wrenches.items():
        force = expected[name].force if name in expected else np.zeros(3)
        assert off(wrench.force, force) < 1e-10  # measured 4e-13
    (F, G), (F_alone, G_alone) = (
        each.linearise(q.copy(), v.copy(), 1e-3, np.ones(chain.nv)) for each in (simulator, alone)
    )
    assert off(G, G_alone) < 1e-10  # measured 2e-13
    A, A_q = alone.tangent_rows(q, v)
    allowed = np.eye(2 * chain.nv)
    if held:
        left = 2 * chain.nv - 2 * alone.rank
        allowed = np.linalg.svd(np.block([[A, np.zeros_like(A)], [A_q, A]]))[2][-left:].T
    assert (
        off(F @ allowed, F_alone @ allowed) < 1e-6
    )  # measured 1e-8: the step leaves the rows by O(h^5), which one of them projects
    simulator.advance(q, v, 1e-3, 100)
    assert np.max(np.abs(simulator.constraint_error(q, v))) < 1e-11 or not held


def test_taking_hold_is_the_impulse_of_equation_9(chain, random_state):
    """The velocity after, and impulses ON the held parts, are the formulation's; the position stays."""
    q, v = random_state(np.random.default_rng(2), chain)
    simulator = Simulator(chain, EFFECTS)
    before, v_before = q.copy(), v.copy()
    simulator.switch("hand", True, q, v)
    impulses = simulator.switch("grip", True, q, v)
    assert off(q, before) < 1e-12
    pairs = [pair for effect in (HAND, GRIP) for pair in named(simulator, effect).point_pairs(chain)]
    first, _, _ = generalized.attach(chain, q, v_before, pairs[:1])
    after, forces, _ = generalized.attach(chain, q, first, pairs)
    assert off(v, after) < 1e-12  # measured 2e-15
    assert off(impulses["hand"].force, forces[0]) < 1e-12
    assert off(impulses["grip"].force, forces[1:].sum(axis=0)) < 1e-10
    assert set(impulses) == {"hand", "grip"}
    # momentum is what the impulses brought: [M A^T; A 0]
    simulator.move(q, v)
    work = np.zeros(chain.nv)
    for part, point, name in (("lower", HAND.point, "hand"), ("box", GRIP.point, "grip")):
        J = simulator.jacobian(part, np.array(point))
        work += J.T @ np.concatenate([impulses[name].moment, impulses[name].force])
    assert off(simulator.mass_matrix(q) @ (v - first), work) < 1e-10
    assert kinetic_energy(simulator, q, v) < kinetic_energy(simulator, q, v_before)


def test_letting_go_changes_no_state(chain, random_state):
    q, v = random_state(np.random.default_rng(3), chain)
    simulator = Simulator(chain, EFFECTS)
    simulator.switch("hand", True, q, v)
    kept = q.copy(), v.copy()
    assert simulator.switch("hand", False, q, v) == {}
    assert np.array_equal(q, kept[0])
    assert np.array_equal(v, kept[1])


def test_a_rod_that_is_off_may_have_its_points_together(chain):
    """Its direction would be 0 / 0."""
    tether = TETHER.model_copy(update={"point": (0.0, 0.0, 0.0), "at": (0.0, 0.0, 0.0)})
    simulator = Simulator(chain, [GRAVITY, HAND, GRIP, tether])
    q, v = chain.neutral(), np.zeros(chain.nv)
    assert np.all(np.isfinite(simulator.acceleration(q, v)))
    F, G = simulator.linearise(q, v, 1e-3, np.ones(chain.nv))
    assert np.all(np.isfinite(F))
    assert np.all(np.isfinite(G))
    assert np.all(np.isfinite(simulator.wrench_array(q, v)))


@pytest.mark.parametrize("size", [1e-3, 1e-2, 1e-1])
@pytest.mark.parametrize("effect", [HAND, GRIP, TETHER], ids=lambda effect: effect.label)
def test_a_start_that_is_off_is_assembled_without_energy(size, effect, chain, random_state):
    """Hard case 18: residual <= 1e-10 m, no kinetic energy beyond 1e-6 J; an assembled state stays to 1e-12."""
    rng = np.random.default_rng(4)
    for _ in range(5):
        q, v = random_state(rng, chain)
        simulator = with_tether(chain, q)
        simulator.switch(effect.label, True, q, v)
        own = next(each for each in simulator.switches.effects if each.label == effect.label)
        others = [each for each in simulator.switches.effects if each is not own]
        simulator = Simulator(chain, [GRAVITY, *others, on_from_the_start(simulator, own)])
        for moving in (False, True):
            start, speed = chain.integrate(q, size * rng.normal(size=chain.nv)), v * moving
            before = kinetic_energy(simulator, start, speed)
            simulator.begin(start, speed)
            assert np.max(np.abs(simulator.constraint_error(start, speed))) <= 1e-10  # measured 5e-16
            assert kinetic_energy(simulator, start, speed) <= before + 1e-6  # measured: never above before
            again, speed_again = start.copy(), speed.copy()
            simulator.begin(again, speed_again)
            assert off(again, start) <= 1e-12
            assert off(speed_again, speed) <= 1e-12


def test_a_step_from_a_start_that_is_off_adds_no_kinetic_energy(chain):
    """The same without ``begin``: one step of 1 ms without gravity leaves residual and energy where they should be."""
    hook = Attachment(name="hand", part="lower", point=(0.0, 0.0, -1.0), at=(0.0, 0.0, -2.0))
    simulator = Simulator(chain, [GRAVITY.model_copy(update={"acceleration": (0.0, 0.0, 0.0)}), hook, GRIP, TETHER])
    for size in (1e-3, 1e-2, 1e-1):
        q, v = chain.neutral(), np.zeros(chain.nv)
        q[:3] += size
        simulator.advance(q, v, 1e-3)
        assert np.max(np.abs(simulator.constraint_error(q, v))) <= 1e-10  # measured 1e-12
        assert kinetic_energy(simulator, q, v) <= 1e-6  # measured 0


def test_what_cannot_be_reached_is_refused_with_what_is_left():
    rod = inertia.capsule(1.0, 0.05, 1.0)
    arm = Tree([Part("arm", rod)], [Joint("rail", JointKind.PRISMATIC, "world", "arm", axis=np.array([0.0, 0.0, 1.0]))])
    simulator = Simulator(arm, [Attachment(part="arm", at=(0.0, 2.0, 3.0), initially="off")])
    q, v = np.array([1.0]), np.zeros(1)
    with pytest.raises(SimulationError, match="'attachment' cannot take hold: 2 m stay between"):
        simulator.switch("attachment", True, q, v)
    assert simulator.switches.holding == ()
    assert (q[0], v[0]) == (1.0, 0.0)
    with pytest.raises(ModelError, match=r"effect 'hand' cannot be switched: .*\['attachment'\]"):
        simulator.switch("hand", True, q, v)


@pytest.mark.parametrize("axis", np.eye(3))
@pytest.mark.parametrize("angle", [170.0, 179.999, 180.0])
def test_a_weld_never_sticks_at_half_a_turn(axis, angle):
    """Its rows are satisfied there too, by a lever that points backwards."""
    body = Tree([Part("box", inertia.box(3.0, (0.3, 0.2, 0.1)))], [Joint("flight", JointKind.FREE, "world", "box")])
    simulator = Simulator(body, [Weld(part="box", initially="off")])
    q, v = body.neutral(), np.zeros(6)
    q[3:] = rotations.exp(np.radians(angle) * axis)
    simulator.switch("weld", True, q, v)
    assert off(np.sign(q[3]) * q, body.neutral()) < 1e-12  # measured 1e-16


@settings(max_examples=30, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), order=st.lists(st.sampled_from(["hand", "grip", "tether"]), max_size=8))
def test_any_switching_leaves_numbers_finite_and_adds_no_energy(seed, order, chain, random_state):
    """A passive scene: each name takes hold where it does not and lets go where it does, 20 ms of motion between."""
    q, v = random_state(np.random.default_rng(seed), chain)
    simulator = with_tether(chain, q)
    for label in order:
        on = label not in simulator.switches.holding
        simulator.move(q, v)
        before = simulator.energy()
        try:
            simulator.switch(label, on, q, v)
        except SimulationError:
            assert label == "tether"  # the others take hold wherever they are
            continue
        simulator.move(q, v)
        if label != "tether":  # which may have to lift what it pulls
            assert simulator.energy() <= before + 1e-9
        assert np.max(np.abs(simulator.constraint_error(q, v))) <= 1e-10
        simulator.advance(q, v, 1e-3, 20)
        assert np.all(np.isfinite(q))
        assert np.all(np.isfinite(v))
        assert np.max(np.abs(simulator.constraint_error(q, v)), initial=0.0) <= 1e-10


def test_what_others_hold_half_a_turn_away_is_refused():
    body = Tree(
        [Part("box", inertia.box(3.0, (0.3, 0.2, 0.1)))],
        [Joint("pin", JointKind.REVOLUTE, "world", "box", axis=np.array([0.0, 0.0, 1.0]))],
    )
    backwards = Weld(part="box", orientation=(0.0, 1.0, 0.0, 0.0), initially="off")
    simulator = Simulator(body, [backwards])
    with pytest.raises(SimulationError, match="'weld' cannot take hold: its part is held by others half a turn away"):
        simulator.switch("weld", True, np.zeros(1), np.zeros(1))
