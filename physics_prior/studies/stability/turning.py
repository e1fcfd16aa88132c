"""Rotations where formulas lose their digits: by half a turn, slightly off the group, and with either sign."""

from itertools import product

import numpy as np

from physics_prior import rotations
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.errors import ModelError
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import PoseMeasurement
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.scene import load_scene
from physics_prior.studies.problems.chain import hung_human, thrown_human
from physics_prior.studies.problems.mechanism import Mechanism
from physics_prior.studies.stability.case import Check, Measurements, case

SIGNS = np.array([axis for axis in product((-1.0, 0.0, 1.0), repeat=3) if any(axis)])
AXES = SIGNS / np.linalg.norm(SIGNS, axis=1, keepdims=True)
"""All 26 sign patterns of an axis."""


@case(19, "Rotations by half a turn, less 0 or 1e-16 to 1e-4", "gtsam #2723 2.3e-4, pinocchio #1647")
def half_turns(thorough: bool) -> Measurements:
    """exp(log R) = R, and the rotation vector itself, by way of matrix and quaternion."""
    matrix_off = vector_off = 0.0
    for axis in AXES:
        for less in (0.0, *(10.0**-k for k in range(4, 17))):
            vector = (np.pi - less) * axis
            R = _rodrigues(axis, less)
            found = rotations.log(rotations.quaternion_from_matrix(R))
            again = rotations.matrix_from_quaternion(rotations.exp(found))
            matrix_off = max(matrix_off, float(np.max(np.abs(again - R))))
            # half a turn has two vectors, and so has what is nearer to it than rounding
            either = [np.linalg.norm(found - vector)] + ([np.linalg.norm(found + vector)] if less < 1e-15 else [])
            vector_off = max(vector_off, float(min(either)))
    yield Check("exp(log R) less R, 26 axes, 14 angles", matrix_off, 1e-12)
    yield Check("rotation vector less the one it was made of", vector_off, 1e-9, "rad")


def _rodrigues(axis: np.ndarray, less: float) -> np.ndarray:
    """Rotation by pi less an angle about an axis, R = 1 + s [a]x + (1 - c) [a]x^2, sine and cosine exact at pi."""
    cross = rotations.skew(axis)
    return np.asarray(np.eye(3) + np.sin(less) * cross + (1.0 + np.cos(less)) * (cross @ cross))


@case(20, "Matrices off the rotations by 1e-16 to 1e-8", "pinocchio #2768")
def off_the_group(thorough: bool) -> Measurements:
    """Log stays finite and near; a matrix that is none is refused."""
    rng = np.random.default_rng(0)
    broken, worst = 0, 0.0
    for axis in AXES:
        for less in (0.0, 1e-8, 1.0, np.pi - 1e-8, np.pi):
            R = _rodrigues(axis, less)
            for size in 10.0 ** np.arange(-16, -7):
                off = R + size * rng.uniform(-1.0, 1.0, (3, 3))
                found = rotations.log(rotations.quaternion_from_matrix(off))
                if not np.all(np.isfinite(found)):
                    broken += 1
                    continue
                again = rotations.matrix_from_quaternion(rotations.exp(found))
                worst = max(worst, float(np.max(np.abs(again - R)) / size))
    yield Check("logarithms that are not finite, of 1170", float(broken), 0.0)
    yield Check("rotation found less the true one, of the matrix's error", worst, 10.0)
    wrong = {"not finite": np.full((3, 3), np.nan), "stretched": 1.1 * np.eye(3), "mirrored": -np.eye(3)}
    taken = 0
    for matrix in wrong.values():
        try:
            rotations.quaternion_from_matrix(matrix)
            taken += 1
        except ModelError:
            pass
    yield Check(f"matrices taken that are {', '.join(wrong)}", float(taken), 0.0)


@case(
    21,
    "A quaternion and its negative",
    "two_state_information_filter #22, simbody #519",
)
def either_sign(thorough: bool) -> Measurements:
    """The same motion, the same target, the same estimate; errors that are never longer than half a turn."""
    for name, mechanism in (("hung human", hung_human()), ("thrown human", thrown_human())):
        plain, other = mechanism.run(), mechanism.run()
        for link in mechanism.tree.links:
            if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
                other.q[link.q.stop - 4 : link.q.stop] *= -1.0
        for run in (plain, other):
            run.advance(1e-3, 100)
        apart = mechanism.tree.difference(plain.q, other.q)
        yield Check(f"state, 100 steps, {name}", float(np.max(np.abs(apart))), 1e-14, "rad")
        yield Check(f"velocity, 100 steps, {name}", float(np.max(np.abs(plain.v - other.v))), 1e-14, "rad/s")
    target = rotations.exp([0.4, 0.3, -0.2])
    ends = []
    for sign in (1.0, -1.0):
        w, x, y, z = (sign * target).tolist()
        spring = JointSpring(stiffness={"ball": 2.0}, rest={"ball": (w, x, y, z)})
        run = Mechanism(_ball(), (spring,), np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)).run()
        run.to(0.5, 1e-3)
        ends.append(run.q)
    yield Check("target of a spring, after 0.5 s", float(np.max(np.abs(ends[0] - ends[1]))), 1e-14)
    longest = 0.0
    for angle in np.linspace(0.0, 4.0 * np.pi, 721):
        for axis in AXES:
            longest = max(longest, float(np.linalg.norm(rotations.log(rotations.exp(angle * axis)))))
    yield Check("longest rotation vector over two turns, less pi", longest - np.pi, 1e-15, "rad")
    estimates = [_estimate(signs) for signs in ((1.0, 1.0), (-1.0, -1.0), (1.0, -1.0))]
    differ = max(float(np.max(np.abs(estimates[0] - each))) for each in estimates[1:])
    yield Check("estimate from measurements of the other sign, and of changing sign", differ, 1e-14)


def _ball() -> Tree:
    """An uneven body on a ball joint."""
    body = MassProperties(1.0, np.array([0.1, 0.0, -0.3]), np.diag([0.02, 0.03, 0.01]))
    return Tree([Part("bob", body)], [Joint("ball", JointKind.SPHERICAL, "world", "bob")])


def _estimate(signs: tuple[float, float]) -> np.ndarray:
    """Pose and velocity (13,) of the thrown cube from 40 measured poses whose quaternions take these signs in turn."""
    scene = load_scene("thrown_cube")
    estimator, topic = Estimator(scene), scene.measurements[0].topic
    for k in range(40):
        turned = rotations.exp([0.5 * k / 40.0, -1.0 + 7.0 * k / 40.0, 0.2])  # past half a turn
        place = np.array([0.01 * k, 0.0, 0.4 + 0.01 * k * (1.0 - k / 60.0)])
        estimator.add(PoseMeasurement(10_000_000 * (k + 1), topic, place, signs[k % 2] * turned))
    estimate = estimator.estimate()
    q = estimate.q.copy()
    q[3:] *= np.sign(q[3 + int(np.argmax(np.abs(q[3:])))])
    return np.concatenate([q, estimate.v])
