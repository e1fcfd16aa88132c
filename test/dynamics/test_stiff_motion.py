"""Forces far faster than the step, by the integrator for them: what is damped decays, and nothing gains energy."""

import numpy as np
import pytest

from physics_prior.dynamics.integrators import INTEGRATORS
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.effects.spring import Spring
from physics_prior.errors import SimulationError
from physics_prior.inertia import MassProperties, box
from physics_prior.model import Joint, JointKind, Part, Tree

STIFF = "lobatto_iiic"
Z = np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("h", [0.01, 0.001])
@pytest.mark.parametrize("omega_h", [0.1, 1.0, 3.0, 10.0, 30.0, 100.0])
@pytest.mark.parametrize("damping_ratio", [0.0, 0.1, 1.0])
def test_stiff_position_control(h, omega_h, damping_ratio, double_pendulum):
    """Springs and dampers hold both joints of an arm: its energy never rises, and ends where dampers take it.

    Newton's method, left to find its way, ended six turns away at h = 1 ms, omega h = 1, with 6500 times the energy.
    """
    omega = omega_h / h
    stiffness, damping = omega**2, 2.0 * damping_ratio * omega
    joints = ("shoulder", "elbow")
    control = JointSpring(stiffness=dict.fromkeys(joints, stiffness), damping=dict.fromkeys(joints, damping))
    simulator = Simulator(double_pendulum, [control], STIFF)
    q, v = np.array([0.3, -0.2]), np.array([1.0, 2.0])
    energies = []
    for _ in range(300):
        energies.append(0.5 * v @ simulator.mass_matrix(q) @ v + 0.5 * stiffness * q @ q)
        simulator.advance(q, v, h)
    assert np.all(np.diff(energies) <= 1e-12 * energies[0])
    assert np.isfinite(energies[-1])


@pytest.mark.parametrize("ratio", [1.0, 100.0, 1e6])
def test_strong_damping_decays_without_changing_sign(ratio):
    """C h / I from 1 to 1e6."""
    body = MassProperties(1.0, np.zeros(3), np.eye(3))
    wheel = Tree([Part("wheel", body)], [Joint("axle", JointKind.REVOLUTE, "world", "wheel", axis=Z)])
    damper = JointSpring(stiffness={"axle": 0.0}, damping={"axle": ratio / 1e-3})
    simulator = Simulator(wheel, [damper], STIFF)
    q, v, before = np.zeros(1), np.ones(1), 1.0
    for _ in range(20):
        simulator.advance(q, v, 1e-3)
        assert 0.0 <= v[0] < before or before == 0.0
        before = v[0]
    assert v[0] < 1e-7  # measured 1.1e-8 for C h / I = 1


def test_strong_damping_in_a_chain(double_pendulum):
    """Both joints of an arm, C h / I of 100 and more: energy falls at every step."""
    joints = ("shoulder", "elbow")
    dampers = JointSpring(stiffness=dict.fromkeys(joints, 0.0), damping={"shoulder": 1e4, "elbow": 1e5})
    simulator = Simulator(double_pendulum, [dampers], STIFF)
    q, v, before = np.array([0.3, -0.4]), np.array([3.0, -2.0]), np.inf
    for _ in range(50):
        energy = v @ simulator.mass_matrix(q) @ v
        assert energy < before or energy < 1e-30
        before = energy
        simulator.advance(q, v, 1e-2)


@pytest.fixture(scope="module")
def governor():
    """The flyball governor of shared/reference: tree and effects."""
    bar, joints, parts = (1.0, 0.01, 0.01), [], []
    axes = {"left": -1.0, "right": 1.0}
    parts.append(Part("shaft", box(0.3, (0.01, 0.01, 1.0)).transformed(np.eye(3), 0.5 * Z)))
    joints.append(Joint("bearing", JointKind.REVOLUTE, "world", "shaft", axis=Z))
    for name, sign in axes.items():
        arm = box(0.3, bar).transformed(np.eye(3), np.array([0.5 * sign, 0.0, 0.0]))
        parts += [Part(name, arm), Part(f"{name}_ball", MassProperties(5.0, np.zeros(3), np.zeros((3, 3))))]
        hinge = np.array([0.05 * sign, 0.0, 1.0])
        joints.append(Joint(f"{name}_hinge", JointKind.REVOLUTE, "shaft", name, hinge, axis=np.array([0.0, sign, 0.0])))
        joints.append(Joint(f"{name}_tip", JointKind.FIXED, name, f"{name}_ball", np.array([sign, 0.0, 0.0])))
    parts.append(Part("slider", box(3.0, (0.1, 0.1, 0.1))))
    joints.append(Joint("slide", JointKind.PRISMATIC, "shaft", "slider", axis=Z))
    springs = [
        Spring(
            name=f"{name}_spring",
            part=name,
            point=(0.5 * sign, 0.0, 0.0),
            to="slider",
            at=(0.05 * sign, 0.0, 0.0),
            stiffness=8e5,
            damping=4e4,
            rest_length=0.5,
        )
        for name, sign in axes.items()
    ]
    return Tree.sorted(parts, joints), [Gravity(acceleration=(0.0, 0.0, -9.81)), *springs]


@pytest.mark.parametrize(
    ("h", "seconds", "bound"), [(1e-3, 10.0, 1e-4), (1e-2, 1.0, 1e-3)]
)  # m; measured 4.8e-5, 2.5e-4
def test_flyball_governor(h, seconds, bound, governor, reference):
    """Springs whose fastest mode decays by exp(-7000 t)."""
    table = reference("A05_flyball_governor_10s.csv")
    table = table[table["t"] <= seconds + 1e-9]
    tree, effects = governor
    simulator, worst = Simulator(tree, effects, STIFF), 0.0
    slide = tree.link("slide").q
    q, v = tree.neutral(), np.zeros(tree.nv)
    v[tree.link("bearing").v], q[slide] = 2.0 * np.pi, 0.5
    for name in ("left_hinge", "right_hinge"):
        q[tree.link(name).q] = np.radians(30.0)
    for row in table[1:]:
        while simulator.time < row["t"] - 0.5 * h:
            simulator.advance(q, v, h)
        if abs(simulator.time - row["t"]) < 1e-9:
            worst = max(worst, abs(float(q[slide][0]) - row["s"]))
    assert 0.0 < worst < bound


def test_step_without_solution_is_refused(double_pendulum):
    """No step is as exact as that, however short."""
    simulator = Simulator(double_pendulum, [], "dop853", 1e-40)
    with pytest.raises(SimulationError, match=r"'dop853' found no solution of a step of 0\.001 s"):
        simulator.advance(np.array([0.3, 0.1]), np.ones(2), 1e-3)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_state_that_is_no_number_is_refused(integrator, double_pendulum):
    simulator = Simulator(double_pendulum, [], integrator)
    with pytest.raises(SimulationError, match="not finite"):
        simulator.advance(np.array([0.3, np.nan]), np.zeros(2), 1e-3)
