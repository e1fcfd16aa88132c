"""Springs and dampers, in joints and between points, against closed forms, MuJoCo and the energy they may not make."""

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.effects.spring import Spring
from physics_prior.inertia import box
from physics_prior.model import Joint, JointKind, Part, Tree

BODY = box(2.0, (0.1, 0.2, 0.3))
X, Y = np.eye(3)[:2]
POINTS = {"part": "tip", "point": (0.1, 0.05, -0.02), "at": (0.2, 0.9, 0.1)}


@pytest.fixture(scope="module")
def arm():
    """A slide, a hinge and a ball joint in a row."""
    return Tree(
        [Part("cart", BODY), Part("arm", BODY), Part("tip", BODY)],
        [
            Joint("rail", JointKind.PRISMATIC, "world", "cart", axis=X),
            Joint("elbow", JointKind.REVOLUTE, "cart", "arm", 0.3 * X, axis=Y),
            Joint("wrist", JointKind.SPHERICAL, "arm", "tip", 0.4 * X),
        ],
    )


@pytest.fixture(scope="module")
def ball_and_cart():
    """A free body and one on a slide."""
    return Tree(
        [Part("ball", BODY), Part("cart", BODY)],
        [Joint("flight", JointKind.FREE, "world", "ball"), Joint("rail", JointKind.PRISMATIC, "world", "cart", axis=X)],
    )


def springs(joint=None, first=None, second=None):
    """A joint spring and two springs, those not given without any stiffness: one compiled step serves all tests."""
    return [
        joint or JointSpring(stiffness={"rail": 0.0}),
        Spring(**{"part": "cart", "stiffness": 0.0} | (first or {})),
        Spring(**{"name": "second", "part": "cart", "stiffness": 0.0} | (second or {})),
    ]


def all_springs(damping):
    """Springs in all joints of the arm and two between points."""
    turn = tuple(rotations.exp(np.array([0.2, -0.4, 0.3])))
    return springs(
        JointSpring(
            stiffness={"rail": 40.0, "elbow": 3.0, "wrist": 6.0},
            rest={"rail": 0.1, "elbow": -0.5, "wrist": turn},
            damping={"rail": damping, "elbow": 0.1 * damping, "wrist": 0.02 * damping},
        ),
        POINTS | {"stiffness": 20.0, "rest_length": 0.3, "damping": damping},
        {"part": "tip", "to": "cart", "at": (0.0, 0.2, 0.3), "stiffness": 20.0, "damping": damping},
    )


def start(tree):
    rng = np.random.default_rng(3)
    return tree.integrate(tree.neutral(), 0.3 * rng.normal(size=tree.nv)), rng.normal(size=tree.nv)


def total_energy(simulator, q, v):
    simulator.move(q, v)
    return simulator.energy()


def test_springs_keep_the_energy(arm):
    simulator = Simulator(arm, [Gravity(), *all_springs(0.0)])
    q, v = start(arm)
    before = total_energy(simulator, q, v)
    kinetic = 0.5 * v @ simulator.mass_matrix(q) @ v
    worst = 0.0
    for _ in range(10):
        simulator.advance(q, v, 2.5e-4, 400)
        worst = max(worst, abs(total_energy(simulator, q, v) - before))
    assert worst < 1e-9 * kinetic  # measured 2e-11


def test_energy_is_that_of_the_state_last_seen(arm):
    """Readouts ask for it after ``move``, or after ``wrench_array`` where they read forces too."""
    simulator = Simulator(arm, all_springs(0.0))
    q, v = start(arm)
    expected = total_energy(simulator, q, v)
    for vdot in (None, np.zeros(arm.nv)):
        assert total_energy(simulator, arm.neutral(), 0.0 * v) != expected
        simulator.wrench_array(q, v, vdot)
        assert simulator.energy() == pytest.approx(expected, rel=1e-14)


def test_a_joint_bears_what_a_spring_does_not(ball_and_cart):
    """The rail carries the cart's weight less the 45 N with which a spring pulls it up."""
    spring = {"part": "cart", "at": (0.0, 0.0, 2.0), "stiffness": 30.0, "rest_length": 0.5}
    simulator = Simulator(ball_and_cart, [Gravity(acceleration=(0.0, 0.0, -9.81)), *springs(first=spring)])
    wrench = simulator.wrenches(ball_and_cart.neutral(), np.zeros(7))["rail"]
    assert np.allclose(wrench.force, [0.0, 0.0, 9.81 * BODY.mass - 45.0], rtol=1e-14)


def test_dampers_only_take_energy(arm):
    simulator = Simulator(arm, [Gravity(), *all_springs(5.0)])
    q, v = start(arm)
    energies = []
    for _ in range(200):
        energies.append(total_energy(simulator, q, v))
        simulator.advance(q, v, 1e-3, 10)
    assert np.all(np.diff(energies) < 0.0)


@pytest.mark.parametrize("damping", [0.0, 3.0, 60.0])
def test_joint_spring_on_a_slide_is_the_damped_oscillator(damping):
    """x'' + 2 d x' + w^2 x = 0 from x0 at rest, d above w too: x = x0 e^-dt (cosh st + d/s sinh st), s^2 = d^2 - w^2."""
    tree = Tree([Part("cart", BODY)], [Joint("rail", JointKind.PRISMATIC, "world", "cart", axis=X)])
    spring = JointSpring(stiffness={"rail": 200.0}, rest={"rail": 0.25}, damping={"rail": damping})
    simulator = Simulator(tree, springs(spring))
    q, v = np.array([0.75]), np.zeros(1)
    simulator.advance(q, v, 1e-3, 500)
    d, t = 0.5 * damping / BODY.mass, 0.5
    s = np.sqrt(complex(d * d - 100.0))
    expected = 0.25 + 0.5 * np.exp(-d * t) * (np.cosh(s * t) + d / s * np.sinh(s * t)).real
    assert q[0] == pytest.approx(expected, abs=1e-9)  # measured 2e-10 (w h = 0.01)


def test_spring_of_no_length_is_an_oscillator_in_space(ball_and_cart):
    """Held by its centre of mass, a spinning body moves as x = x0 cos wt + v0/w sin wt, through the middle too."""
    at = np.array([0.1, 0.2, 0.3])
    simulator = Simulator(ball_and_cart, springs(first={"part": "ball", "at": tuple(at), "stiffness": 50.0}))
    x0, v0 = np.array([0.5, 0.0, -0.2]), np.array([0.3, 1.0, 0.0])
    q, v = ball_and_cart.neutral(), np.zeros(7)
    q[:3], v[:3], v[3:6] = at + x0, v0, (1.0, 2.0, 3.0)
    simulator.advance(q, v, 1e-3, 700)
    w, t = 5.0, 0.7
    assert np.allclose(q[:3], at + x0 * np.cos(w * t) + v0 / w * np.sin(w * t), rtol=0.0, atol=1e-10)  # measured 3e-12


def test_force_of_a_spring_by_hand(ball_and_cart):
    """As stiff as in A05 of numerics.md, with its damper; equal and opposite on both ends."""
    spring = {"part": "ball", "to": "cart", "stiffness": 8e5, "damping": 4e4, "rest_length": 0.5}
    simulator = Simulator(ball_and_cart, springs(first=spring))
    q, v = ball_and_cart.neutral(), np.zeros(7)
    q[:3], v[:3] = (0.6, 0.8, 0.0), (1.0, 0.0, 2.0)  # one metre apart, lengthening by 0.6 m/s
    force = (8e5 * 0.5 + 4e4 * 0.6) * np.array([0.6, 0.8, 0.0])
    vdot = simulator.acceleration(q, v)
    assert np.allclose(vdot[:3], -force / BODY.mass, rtol=1e-15)
    assert np.allclose(vdot[3:6], 0.0)
    assert vdot[6] == pytest.approx(force[0] / BODY.mass, rel=1e-15)
    assert simulator.effort == pytest.approx(0.0)


@pytest.mark.parametrize("rest_length", [0.0, 0.4])
@pytest.mark.parametrize("apart", [0.0, 1e-12, 1e-9, 1e-6])
def test_spring_whose_ends_meet_stays_finite(arm, rest_length, apart):
    spring = {"part": "cart", "at": (apart, 0.0, 0.0), "stiffness": 1e4, "rest_length": rest_length, "damping": 10.0}
    simulator = Simulator(arm, springs(first=spring))
    q, v = arm.neutral(), start(arm)[1]
    pull = simulator.acceleration(q, 0.0 * v)
    assert np.max(np.abs(pull)) <= 1e4 * max(rest_length, apart) / BODY.mass
    assert np.all(np.isfinite(np.hstack(simulator.acceleration_derivatives(q, v))))
    assert np.isfinite(total_energy(simulator, q, v))


def test_springs_agree_with_mujoco(arm):
    mujoco = pytest.importorskip("mujoco")
    turn = rotations.exp(np.array([0.2, -0.4, 0.3]))
    rest = float(np.degrees(-0.5))
    ixx, iyy, izz = np.diag(BODY.inertia).tolist()
    inertial = f'<inertial pos="0 0 0" mass="{BODY.mass}" diaginertia="{ixx!r} {iyy!r} {izz!r}"/>'
    model = mujoco.MjModel.from_xml_string(f"""
        <mujoco><option gravity="0 0 -9.80665"/><worldbody><site name="wall" pos="0.2 0.9 0.1"/>
        <body><joint type="slide" axis="1 0 0" stiffness="40" springref="0.1" damping="5"/>{inertial}
          <site name="post" pos="0 0.2 0.3"/>
          <body pos="0.3 0 0"><joint type="hinge" axis="0 1 0" stiffness="3" springref="{rest!r}" damping="0.5"/>
            {inertial}
            <body pos="0.4 0 0"><joint type="ball" stiffness="6" damping="0.1"/>{inertial}
              <site name="tip"/><site name="edge" pos="0.1 0.05 -0.02"/>
        </body></body></body></worldbody><tendon>
        <spatial stiffness="20" springlength="0.3" damping="5"><site site="wall"/><site site="edge"/></spatial>
        <spatial stiffness="20" springlength="0" damping="5"><site site="post"/><site site="tip"/></spatial>
        </tendon></mujoco>""")
    model.qpos_spring[2:] = turn
    data = mujoco.MjData(model)
    simulator = Simulator(arm, [Gravity(), *all_springs(5.0)])
    rng = np.random.default_rng(5)
    for _ in range(5):
        q, v = arm.integrate(arm.neutral(), rng.normal(size=arm.nv)), rng.normal(size=arm.nv)
        data.qpos[:], data.qvel[:] = q, v
        mujoco.mj_forward(model, data)
        expected = simulator.acceleration(q, v)
        assert np.max(np.abs(data.qacc - expected)) < 1e-13 * np.max(np.abs(expected))  # measured 3e-15
