"""Random models, states and constraints that all tests of dynamics share, as factory fixtures."""

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from physics_prior import rotations
from physics_prior.dynamics.formulations import generalized
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.effect import Anchor, Effect, PointPair
from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import MassProperties, rod
from physics_prior.model import Joint, JointKind, Part, Tree

MOVING = (JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.SPHERICAL)
MOVING_OR_FREE = (*MOVING, JointKind.FREE)


def _unit(rng: np.random.Generator, size: int) -> np.ndarray:
    vector = rng.normal(size=size)
    return vector / np.linalg.norm(vector)


def _mass_properties(rng: np.random.Generator) -> MassProperties:
    """An uneven body of 0.5 to 3 kg and some 20 cm, its centre of mass off the joint."""
    mass = rng.uniform(0.5, 3.0)
    spread = rng.normal(scale=0.2, size=(3, 3))
    second_moment = mass * (spread @ spread.T + 1e-3 * np.eye(3))
    inertia = np.trace(second_moment) * np.eye(3) - second_moment
    return MassProperties(mass, rng.normal(scale=0.2, size=3), inertia)


def _random_tree(
    rng: np.random.Generator,
    size: int | None = None,
    root: JointKind | None = None,
    massless: bool = False,
    kinds: Sequence[JointKind] = MOVING,
) -> Tree:
    """Build a tree of `size` moving links (1 to 8 if None) and some parts fixed to them.

    The first joint is of kind `root` (if None any that moves, free included), later ones of `kinds`; now and
    then a branch starts on the world. With `massless`, some links between a one-freedom joint and the next
    have no mass of their own.
    """
    size = int(rng.integers(1, 9)) if size is None else size
    parts: list[Part] = []
    joints: list[Joint] = []
    path = ["world"]
    hollow = False
    moving = 0
    while moving < size:
        # depth-first: branch off anywhere on the path from the world to the last part
        depth = len(path) - 1 if hollow or rng.random() < 0.7 else int(rng.integers(0, len(path)))
        path = path[: depth + 1]
        name = f"part{len(parts)}"
        if moving and not hollow and rng.random() < 0.15:
            kind = JointKind.FIXED
        elif moving == 0:
            kind = root if root is not None else MOVING_OR_FREE[int(rng.integers(len(MOVING_OR_FREE)))]
        else:
            kind = kinds[int(rng.integers(len(kinds)))]
        one_freedom = kind in (JointKind.REVOLUTE, JointKind.PRISMATIC)
        hollow = massless and one_freedom and not hollow and moving + 1 < size and rng.random() < 0.4
        moving += kind is not JointKind.FIXED
        parts.append(Part(name) if hollow else Part(name, _mass_properties(rng)))
        if kind is JointKind.FREE:
            joints.append(Joint(f"joint{len(joints)}", kind, "world", name))
        else:
            place = (rng.normal(scale=0.3, size=3), _unit(rng, 4), _unit(rng, 3))
            joints.append(Joint(f"joint{len(joints)}", kind, path[-1], name, *place))
        path = ["world", name] if kind is JointKind.FREE else [*path, name]
    return Tree(parts, joints)


def _random_state(rng: np.random.Generator, tree: Tree) -> tuple[np.ndarray, np.ndarray]:
    """Configuration (nq,) with quaternions evenly over all rotations, and velocity (nv,) of about one."""
    q = rng.normal(size=tree.nq)
    for link in tree.links:
        if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
            q[link.q.stop - 4 : link.q.stop] = _unit(rng, 4)
    return q, rng.normal(size=tree.nv)


def _part_pose(tree: Tree, q: np.ndarray, part: str) -> tuple[np.ndarray, np.ndarray]:
    """World position and quaternion of a part, walking from it up to the world."""
    frame = tree.frame(part)
    position, orientation, index = frame.position, frame.orientation, frame.link
    while index >= 0:
        link = tree.links[index]
        joint, coordinates = link.joint, q[link.q]
        if joint.kind is JointKind.FREE:
            origin, turn = coordinates[:3], coordinates[3:]
        else:
            origin, turn = joint.position, joint.orientation
            if joint.kind is JointKind.PRISMATIC:
                origin = origin + rotations.rotate(turn, coordinates[0] * joint.axis)
            elif joint.kind is JointKind.REVOLUTE:
                turn = rotations.multiply(turn, rotations.exp(coordinates[0] * joint.axis))
            else:
                turn = rotations.multiply(turn, coordinates)
        position = origin + rotations.rotate(turn, position)
        orientation = rotations.multiply(turn, orientation)
        index = link.parent
    return position, orientation


def _random_pairs(rng: np.random.Generator, tree: Tree, q: np.ndarray, count: int) -> list[PointPair]:
    """`count` point pairs, closed at q, of one to three directions or a rod, to another part or the world."""
    links = {name: frame.link for name, frame in tree.frames.items()}
    moving = [name for name, link in links.items() if link >= 0]
    pairs = []
    for _ in range(count):
        b = moving[int(rng.integers(len(moving)))]
        others = [name for name, link in links.items() if link != links[b]]
        a = others[int(rng.integers(len(others)))]
        xa, qa = _part_pose(tree, q, a)
        xb, qb = _part_pose(tree, q, b)
        point_b = rng.normal(scale=0.3, size=3)
        point_a = rotations.rotate(rotations.conjugate(qa), xb + rotations.rotate(qb, point_b) - xa)
        axes = rotations.matrix_from_quaternion(_unit(rng, 4))
        rows = int(rng.integers(0, 4))
        if rows == 0:
            length = rng.uniform(0.3, 1.5)
            anchor = Anchor(a, point_a - length * axes[0])
            pairs.append(PointPair(anchor, Anchor(b, point_b), axes[:1], length))
        else:
            # along the free directions the two points need not coincide
            point_a = point_a - axes[rows:].T @ rng.normal(scale=0.3, size=3 - rows)
            pairs.append(PointPair(Anchor(a, point_a), Anchor(b, point_b), axes[:rows]))
    return pairs


def _consistent_velocity(tree: Tree, q: np.ndarray, v: np.ndarray, pairs: Sequence[PointPair]) -> np.ndarray:
    """Velocity (nv,) nearest to v that the point pairs allow at q."""
    _, J = generalized.constraint_jacobian(tree, q, pairs)
    return v - np.linalg.pinv(J, rcond=1e-10) @ (J @ v)


def _q_rate(tree: Tree, q: np.ndarray, v: np.ndarray) -> np.ndarray:
    """Time derivative (nq,) of q under v."""
    rate = np.empty(tree.nq)
    for link in tree.links:
        if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
            start = link.q.stop - 4
            rate[link.q.start : start] = v[link.v][:-3]
            rate[start : link.q.stop] = rotations.derivative(q[start : link.q.stop], v[link.v][-3:])
        else:
            rate[link.q] = v[link.v]
    return rate


Acceleration = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _trajectory(
    tree: Tree, q: np.ndarray, v: np.ndarray, times: np.ndarray, acceleration: Acceleration
) -> tuple[np.ndarray, np.ndarray]:
    """Configurations (times, nq) and velocities (times, nv) from q, v at times[0], by DOP853 at 1e-12."""

    def rate(_: float, y: np.ndarray) -> np.ndarray:
        q, v = y[: tree.nq], y[tree.nq :]
        return np.concatenate([_q_rate(tree, q, v), acceleration(q, v)])

    start = np.concatenate([q, v])
    out = solve_ivp(rate, (times[0], times[-1]), start, method="DOP853", t_eval=times, rtol=1e-12, atol=1e-12)
    assert out.success
    return out.y[: tree.nq].T, out.y[tree.nq :].T


def _reference(name: str) -> np.ndarray:
    """Reference trajectory as a record array, by column name; skips the test where it is not at hand."""
    path = Path(__file__).resolve().parents[2].parent / "shared" / "reference" / name
    if not path.exists():
        pytest.skip(f"reference trajectory {name} is missing beside the repository (shared/reference)")
    return np.genfromtxt(path, delimiter=",", names=True)


@pytest.fixture(scope="session")
def random_tree() -> Callable[..., Tree]:
    """`random_tree(rng, size=None, root=None, massless=False, kinds=MOVING) -> Tree`."""
    return _random_tree


@pytest.fixture(scope="session")
def random_state() -> Callable[[np.random.Generator, Tree], tuple[np.ndarray, np.ndarray]]:
    """`random_state(rng, tree) -> (q, v)`."""
    return _random_state


@pytest.fixture(scope="session")
def random_pairs() -> Callable[[np.random.Generator, Tree, np.ndarray, int], list[PointPair]]:
    """`random_pairs(rng, tree, q, count) -> list[PointPair]`, satisfied at q."""
    return _random_pairs


@pytest.fixture(scope="session")
def consistent_velocity() -> Callable[..., np.ndarray]:
    """`consistent_velocity(tree, q, v, pairs) -> v`, fulfilling the pairs' rows."""
    return _consistent_velocity


@pytest.fixture(scope="session")
def trajectory() -> Callable[..., tuple[np.ndarray, np.ndarray]]:
    """`trajectory(tree, q, v, times, acceleration) -> (q, v)` at those times, by SciPy's DOP853."""
    return _trajectory


@pytest.fixture(scope="session")
def reference() -> Callable[[str], np.ndarray]:
    """`reference(name) -> records` of a CSV of shared/reference; skips where it is missing."""
    return _reference


@pytest.fixture(scope="session")
def double_pendulum() -> Tree:
    """Two uniform thin rods of 1 m and 1 kg that hang in a row and turn about y; angles from hanging down."""
    body = MassProperties(1.0, np.array([0.0, 0.0, -0.5]), np.diag([1.0, 1.0, 0.0]) / 12.0)
    axis = np.array([0.0, -1.0, 0.0])
    hook = Joint("shoulder", JointKind.REVOLUTE, "world", "upper", axis=axis)
    elbow = Joint("elbow", JointKind.REVOLUTE, "upper", "lower", np.array([0.0, 0.0, -1.0]), axis=axis)
    return Tree([Part("upper", body), Part("lower", body)], [hook, elbow])


@pytest.fixture(scope="session")
def heavy_top() -> Tree:
    """The fast heavy top of Bruels, Cardona and Arnold: 15 kg, 1 m from the fixed point along its axis y."""
    body = MassProperties(15.0, np.array([0.0, 1.0, 0.0]), np.diag([0.234375, 0.46875, 0.234375]))
    return Tree([Part("top", body)], [Joint("pivot", JointKind.SPHERICAL, "world", "top")])


@pytest.fixture(scope="session")
def free_top() -> Tree:
    """A body with principal moments 1, 2 and 3 kg m^2 that nothing holds."""
    body = MassProperties(1.0, np.zeros(3), np.diag([1.0, 2.0, 3.0]))
    return Tree([Part("top", body)], [Joint("flight", JointKind.FREE, "world", "top")])


@pytest.fixture(scope="session")
def four_bar() -> tuple[Tree, list[Effect], np.ndarray, np.ndarray]:
    """The four-bar linkage of shared/reference: tree, effects, q and v. Three rods, the verticals upright, pushed at 1 m/s."""
    body = rod(1.0, 1.0).transformed(np.eye(3), np.array([0.0, 0.0, 0.5]))
    axis, up = np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    joints = [
        Joint("a", JointKind.REVOLUTE, "world", "left", axis=axis),
        Joint("b", JointKind.REVOLUTE, "left", "top", up, axis=axis),
        Joint("c", JointKind.REVOLUTE, "top", "right", up, axis=axis),
    ]
    tree = Tree([Part(name, body) for name in ("left", "top", "right")], joints)
    pin = Attachment(part="right", point=(0.0, 0.0, 1.0), at=(1.0, 0.0, 0.0))
    field = Gravity(acceleration=(0.0, 0.0, -9.81))
    return tree, [field, pin], np.array([0.0, np.pi / 2, np.pi / 2]), np.array([1.0, -1.0, 1.0])
