"""Things that touch: stacked boxes, a ball that bounces for ever shorter times, a block on an incline, a joint's stop."""

import numpy as np

from physics_prior import inertia, rotations
from physics_prior.effects.contact import Contact
from physics_prior.effects.joint_limit import JointLimit
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.chain import GRAVITY
from physics_prior.studies.problems.mechanism import Mechanism
from physics_prior.studies.problems.pendulum import DOWN, double_pendulum

EDGE = 0.2  # m, of the boxes
RADIUS = 0.1  # m, of the ball


def stack(*masses: float) -> Mechanism:
    """Cubes of these masses, kg, on the ground and on each other from below, at rest, friction 0.5."""
    parts = [Part(f"box{i}", inertia.box(mass, (EDGE, EDGE, EDGE))) for i, mass in enumerate(masses)]
    joints = [Joint(f"flight{i}", JointKind.FREE, "world", part.name) for i, part in enumerate(parts)]
    cube = (EDGE, EDGE, EDGE)
    contacts = [Contact(name="ground", part="box0", shape="box", size=cube, friction=0.5)]
    contacts += [
        Contact(
            name=f"on_box{i}",
            part=f"box{i + 1}",
            shape="box",
            size=cube,
            to=f"box{i}",
            to_shape="box",
            to_size=cube,
            friction=0.5,
        )
        for i in range(len(parts) - 1)
    ]
    q = np.concatenate([[0.0, 0.0, EDGE * (0.5 + i), 1.0, 0.0, 0.0, 0.0] for i in range(len(parts))])
    return Mechanism(Tree(parts, joints), (GRAVITY, *contacts), q, np.zeros(6 * len(parts)))


def bouncing_ball(restitution: float, height: float = 1.0) -> Mechanism:
    """A ball dropped from a height, m, of its lowest point."""
    tree = Tree([Part("ball", inertia.sphere(1.0, RADIUS))], [Joint("flight", JointKind.FREE, "world", "ball")])
    ground = Contact(part="ball", shape="sphere", size=(RADIUS,), restitution=restitution)
    q = np.array([0.0, 0.0, RADIUS + height, 1.0, 0.0, 0.0, 0.0])
    return Mechanism(tree, (GRAVITY, ground), q, np.zeros(6))


def block_on_incline(slope: float, friction: float) -> Mechanism:
    """A cube at rest on a plane that falls off along x at a slope, rad."""
    turn = rotations.exp([0.0, slope, 0.0])
    tree = Tree(
        [Part("block", inertia.box(1.0, (EDGE, EDGE, EDGE)))], [Joint("flight", JointKind.FREE, "world", "block")]
    )
    plane = Contact(
        part="block", shape="box", size=(EDGE, EDGE, EDGE), to_orientation=tuple(turn.tolist()), friction=friction
    )
    return Mechanism(
        tree, (GRAVITY, plane), np.concatenate([rotations.rotate(turn, [0.0, 0.0, 0.5 * EDGE]), turn]), np.zeros(6)
    )


def stopped_arm(stop: float, restitution: float = 0.0) -> Mechanism:
    """A double pendulum let go from 1.2 rad whose shoulder cannot fall below a stop, rad."""
    arm = double_pendulum()
    limit = JointLimit(lower={"shoulder": stop}, restitution=restitution)
    return Mechanism(arm.tree, (DOWN, limit), np.array([1.2, 0.0]), np.zeros(2))


def stopped_pendulum(stop: float, restitution: float = 0.0) -> Mechanism:
    """A rod of 1 m let go from 1.2 rad that cannot fall below a stop, rad, on which it comes to rest."""
    body = inertia.rod(1.0, 1.0)
    rod = body.transformed(
        rotations.matrix_from_quaternion(rotations.exp([0.5 * np.pi, 0.0, 0.0])), np.array([0.0, -0.5, 0.0])
    )
    tree = Tree([Part("rod", rod)], [Joint("pin", JointKind.REVOLUTE, "world", "rod")])
    limit = JointLimit(lower={"pin": stop}, restitution=restitution)
    return Mechanism(tree, (DOWN, limit), np.array([1.2]), np.zeros(1))
