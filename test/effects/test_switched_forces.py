"""Forces that come and go: what is on pushes as one that always does, and what is off as none."""

import numpy as np
import pytest

from physics_prior.dynamics.compose import Structure, step_source
from physics_prior.dynamics.force_noise import PointForces
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.drag import Drag
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.joint_damping import JointDamping
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.effects.soft_limit import SoftLimit
from physics_prior.effects.spring import Spring
from physics_prior.errors import SceneError
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.smoother import smooth
from physics_prior.interface.diagnostics import active_effects
from physics_prior.interface.topics import switch_services
from physics_prior.recording.simulate import EPOCH, motion
from physics_prior.scene import load_scene

END = (0.0, 0.0, -1.0)
FORCES = (
    Gravity(),
    JointDamping(coefficients={"shoulder": 0.3, "elbow": 0.2}),
    JointSpring(stiffness={"shoulder": 2.0, "elbow": 1.0}),
    Spring(part="lower", point=END, at=(1.0, 0.0, 0.0), stiffness=20.0, rest_length=0.5, damping=0.4),
    Drag(part="lower", point=END, quadratic=0.5, linear=0.1, gusts=(0.1, 0.0, 0.1)),
    SoftLimit(upper={"shoulder": 0.2}, range={"shoulder": 0.5}, stiffness={"shoulder": 30.0}),
)
LABELS = [effect.label for effect in FORCES]
Q, V = np.array([0.4, -0.9]), np.array([1.5, -2.0])


@pytest.fixture(scope="module")
def tree():
    return load_scene("double_pendulum").tree


@pytest.fixture(scope="module")
def switched(tree):
    return Simulator(tree, [effect.model_copy(update={"initially": "on"}) for effect in FORCES])


@pytest.fixture
def having(switched):
    """The simulator with just these forces on."""

    def turn(*labels):
        for label in LABELS:
            switched.switch(label, label in labels, Q.copy(), V.copy())
        switched.time = 0.0
        return switched

    return turn


def moved(simulator, steps=500):
    q, v = Q.copy(), V.copy()
    simulator.advance(q, v, 1e-3, steps)
    return np.concatenate([q, v])


def all_of(simulator):
    """Acceleration, its derivatives and the potential energy."""
    forces = [simulator.acceleration(Q, V), *map(np.ravel, simulator.acceleration_derivatives(Q, V))]
    simulator.move(Q, V)
    return np.hstack([*forces, simulator.energy()])


def test_all_on_is_as_always_on_and_all_off_as_none(tree, having):
    assert moved(having(*LABELS)) == pytest.approx(moved(Simulator(tree, FORCES)), abs=1e-12)
    assert moved(having()) == pytest.approx(moved(Simulator(tree, [])), abs=1e-12)
    assert moved(having("gravity")) == pytest.approx(moved(Simulator(tree, [Gravity()])), abs=1e-12)


@pytest.mark.parametrize("label", LABELS)
def test_each_adds_what_is_its_own_and_takes_it_away(label, having):
    """Forces add up: what one adds to none is what leaving it out takes from all."""
    alone = all_of(having(label)) - all_of(having())
    among = all_of(having(*LABELS)) - all_of(having(*(other for other in LABELS if other != label)))
    assert alone == pytest.approx(among, abs=1e-11)  # of numbers up to 300
    assert np.abs(alone).max() > 0.1


def test_gusts_blow_only_where_drag_acts(having):
    assert PointForces(having("drag")).columns(Q, V).any()
    assert not PointForces(having("gravity")).columns(Q, V).any()


def test_only_a_force_that_may_be_switched_is_asked_whether_it_acts():
    drag = FORCES[LABELS.index("drag")]
    assert "acts" not in step_source([drag], Structure(), "rk4")
    text = step_source([drag.model_copy(update={"initially": "off"}), *FORCES[1:3]], Structure(), "rk4")
    assert "if acts(parameters, 3, 0): apply_drag" in text
    assert text.count("if acts") == 2  # the force and its derivatives


DAMPED = """
description: A rod whose bearing is braked for a while.
model:
  parts:
    rod:
      mass: 1 kg
      center_of_mass: [0, 0, -0.5]
      inertia: {rod: 1 m}
      joint: {kind: revolute, axis: -y, name: pivot}
effects:
  - gravity
  - joint_damping: {name: brake, coefficients: {pivot: 1 N m s/rad}, WHEN}
noise: {force: 5e-2, velocity: 2}
measurements:
  - pose: {topic: /rod/pose, part: rod, position_noise: 5 mm, orientation_noise: 2 deg}
  MORE
initial: {positions: {pivot: 80 deg}}
step: {size: 5 ms}
simulation: {duration: 1.5 s, rate: 50 Hz}
"""
SWITCHES = ((0.505, True), (1.0, False))  # s


@pytest.fixture(scope="module")
def braked(tmp_path_factory):
    """The scene, with some of its text changed."""

    def load(when, more=""):
        path = tmp_path_factory.mktemp("scene") / "braked.yaml"
        path.write_text(DAMPED.replace("WHEN", when).replace("MORE", more))
        return load_scene(path)

    return load


def estimated(scene, measurements, commands=()):
    """Posteriors and smoothed states of a recording, in which commands come with these measurements, by index."""
    estimator, nodes, due = Estimator(scene, history_length=5.0), [], dict(commands)
    estimator.on_settled = nodes.append
    for index, measurement in enumerate(measurements):
        estimator.add(measurement)
        for time, on in due.get(index, ()):
            assert estimator.switch("brake", on, EPOCH + round(time * 1e9))
    estimator.reset()
    last = {node.measurement.stamp: node.posterior for node in nodes}
    smoothed = [each for each in smooth(estimator.filter, nodes, 1.0) if each.stamp in last]
    return [np.concatenate([each.state.q, each.state.v]) for each in (*last.values(), *smoothed)], list(last.values())


def test_the_estimate_follows_schedule_and_command_alike_and_late_ones_too(braked):
    scheduled, commanded = braked("when: {from: 0.505 s, until: 1 s}"), braked("initially: off")
    measurements = [each for moment in motion(scheduled, scheduled.simulator(), seed=1) for each in moment.measurements]
    stamps = [(each.stamp - EPOCH) * 1e-9 for each in measurements]
    states, posteriors = estimated(scheduled, measurements)
    for late in (0, 10):
        when = {next(k for k, t in enumerate(stamps) if t >= time) + late: [(time, on)] for time, on in SWITCHES}
        ordered, _ = estimated(commanded, measurements, when.items())
        for state in states:  # commands make posteriors of their own between
            assert min(np.abs(state - other).max() for other in ordered) < 1e-12
    always, _ = estimated(braked("initially: on"), measurements)
    never, _ = estimated(commanded, measurements)
    assert np.abs(np.subtract(states, always)).max() > 0.02
    assert np.abs(np.subtract(states, never)).max() > 0.02
    nis = [each.nis for each in posteriors if each.used and not each.start]
    assert np.mean(nis) / 6.0 == pytest.approx(1.0, abs=0.2)


def test_a_measured_force_switches_a_force(braked):
    scene = braked("initially: off", "- switch: {topic: /brake/force, effect: brake, above: 20 N, below: 5 N}")
    assert scene.measurements[1].effect == "brake"
    with pytest.raises(SceneError, match=r"'gravity' is not an effect that can be switched.*\['brake'\]"):
        braked("initially: off", "- switch: {topic: /brake/force, effect: gravity, above: 20 N, below: 5 N}")


def test_what_acts_is_told_and_served(braked):
    scene = braked("initially: off")
    simulator = scene.simulator()
    assert switch_services(scene) == {"brake": "~/effects/brake"}
    assert active_effects(scene, simulator, None) == ["gravity"]
    simulator.switch("brake", True, np.array([0.5]), np.array([0.0]))
    assert active_effects(scene, simulator, None) == ["gravity", "brake"]
    assert scene.effects[1].explain(scene.tree).endswith(", on command")
    with pytest.raises(SceneError, match="give either 'when' or 'initially'"):
        braked("initially: off, when: {from: 1 s}")
