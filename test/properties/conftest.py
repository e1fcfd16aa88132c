"""Random scenes: trees of all joints, bodies of all sizes, effects that only take energy, constraints that may not fit."""

from dataclasses import dataclass, field

import numpy as np
import pytest
from hypothesis import reject
from hypothesis import strategies as st

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment, Hinge, Rod, Weld
from physics_prior.effects.contact import Contact
from physics_prior.effects.drag import Drag
from physics_prior.effects.effect import Effect
from physics_prior.effects.gravity import Gravity
from physics_prior.effects.joint_damping import JointDamping
from physics_prior.effects.joint_limit import JointLimit
from physics_prior.effects.joint_spring import JointSpring
from physics_prior.effects.spring import Spring
from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties, point_mass
from physics_prior.model import Joint, JointKind, Part, Tree

FIXED, REVOLUTE, PRISMATIC, SPHERICAL, FREE = JointKind
ONE_FREEDOM = (REVOLUTE, PRISMATIC)
Vector = tuple[float, float, float]

unit = st.floats(-1.0, 1.0, allow_subnormal=False)
axis = st.sampled_from([(0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0)]) | st.tuples(unit, unit, unit).filter(
    lambda a: float(np.linalg.norm(a)) > 0.1
)
point = st.sampled_from([(0.0, 0.0, -1.0), (0.0, 0.0, 0.0), (0.5, 0.0, 0.0)]) | st.tuples(unit, unit, unit)
turn = st.just((0.0, 0.0, 0.0)) | st.tuples(unit, unit, unit).map(lambda t: tuple(3.0 * each for each in t))
length = st.floats(0.1, 2.0)


@dataclass
class Drawn:
    """A scene: what it is made of, its state, and whether it was drawn so that its constraints cannot all be met.

    consistent: all of them are met at q, as they were drawn.
    """

    parts: list[Part]
    joints: list[Joint]
    effects: list[Effect]
    q: np.ndarray = field(default_factory=lambda: np.zeros(0))
    v: np.ndarray = field(default_factory=lambda: np.zeros(0))
    h: float = 1e-3
    consistent: bool = True
    conflicting: bool = False

    @property
    def names(self) -> list[str]:
        """Whatever a refusal may blame."""
        labels = [effect.label for effect in self.effects]
        return [*(part.name for part in self.parts), *(joint.name for joint in self.joints), *labels]


@st.composite
def bodies(draw: st.DrawFn, carries: bool, extreme: bool) -> MassProperties | None:
    """A box, a rod, a point mass; massless (None) if it `carries` something. 0.01 to 10 kg; `extreme`: 1e-5 to 1e4, or tiny."""
    kinds = ["box", "box", "box", "tiny" if extreme else "box", "rod", "point"]
    kind = draw(st.sampled_from([*kinds, "massless"] if carries else kinds))
    if kind == "massless":
        return None
    mass = 10.0 ** draw(st.just(0.0) | (st.floats(-5.0, 4.0) if extreme else st.floats(-2.0, 1.0)))
    center = np.array(draw(point))
    if kind == "point":
        return point_mass(mass, center if center.any() else (0.0, 0.0, -0.5))
    if kind == "rod":
        return MassProperties(mass, np.array([0.0, 0.0, -0.5]), mass / 12.0 * np.diag([1.0, 1.0, 0.0]))
    size = 1e-6 if kind == "tiny" else draw(length)
    return MassProperties(mass, center, mass * size**2 * np.diag([1.0, 0.9, draw(st.floats(0.2, 1.8))]))


@st.composite
def trees(draw: st.DrawFn, inner: bool, extreme: bool) -> tuple[list[Part], list[Joint]]:
    """Up to six parts and their joints, depth first; with `inner`, one joint at least is neither fixed nor free."""
    count = draw(st.integers(1, 6))
    parents = [draw(st.integers(-1, i - 1)) if draw(st.booleans()) else i - 1 for i in range(count)]
    kinds = [draw(st.sampled_from([REVOLUTE, SPHERICAL, PRISMATIC, FREE, FIXED])) for _ in range(count)]
    kinds = [REVOLUTE if kind is FREE and parents[i] >= 0 else kind for i, kind in enumerate(kinds)]
    if (inner and not any(kind not in (FIXED, FREE) for kind in kinds)) or all(kind is FIXED for kind in kinds):
        kinds[-1] = REVOLUTE
    parts, joints = [], []
    for i, (parent, kind) in enumerate(zip(parents, kinds, strict=True)):
        body = draw(bodies(carries=kind is not FREE and i in parents, extreme=extreme))
        parts.append(Part(f"part{i}") if body is None else Part(f"part{i}", body))
        base = "world" if parent < 0 else f"part{parent}"
        if kind is FREE:
            joints.append(Joint(f"joint{i}", kind, "world", f"part{i}"))
        else:
            place = np.array(draw(point)), rotations.exp(np.array(draw(turn))), np.array(draw(axis))
            joints.append(Joint(f"joint{i}", kind, base, f"part{i}", *place))
    tree = Tree.sorted(parts, joints)
    return list(tree.parts), list(tree.joints)


@st.composite
def states(draw: st.DrawFn, tree: Tree) -> tuple[np.ndarray, np.ndarray]:
    """Configuration and velocity; often with angles of zero or right ones: chains straight, folded or flat."""
    angle = st.sampled_from([0.0, 0.5 * np.pi, np.pi, -0.5 * np.pi]) | st.floats(-3.0, 3.0, allow_subnormal=False)
    rate = st.just(0.0) | st.floats(-5.0, 5.0, allow_subnormal=False)
    moved = np.array([draw(angle) for _ in range(tree.nv)])
    return tree.integrate(tree.neutral(), moved), np.array([draw(rate) for _ in range(tree.nv)])


@st.composite
def forces(draw: st.DrawFn, tree: Tree) -> list[Effect]:
    """One of each effect that pushes, always in this order, so that all scenes share a step; coefficients may be zero."""
    coefficient = st.just(0.0) | st.floats(-2.0, 3.0).map(lambda e: 10.0**e)
    inner = [link.joint.name for link in tree.links if link.joint.kind is not FREE]
    damped = {name: draw(coefficient) for name in inner}
    sprung = {name: draw(coefficient) for name in inner[: draw(st.integers(1, len(inner)))]}
    moving = [name for name, frame in tree.frames.items() if frame.link >= 0]
    part = draw(st.sampled_from(moving))
    others = [name for name, frame in tree.frames.items() if frame.link != tree.frame(part).link]
    spring = Spring(
        part=part,
        point=draw(point),
        to=draw(st.sampled_from(others)),
        at=draw(point),
        stiffness=draw(coefficient),
        rest_length=draw(st.just(0.0) | length),
        damping=draw(coefficient),
    )
    drag = Drag(
        part=draw(st.sampled_from(moving)),
        point=draw(point),
        linear=1e-3 + draw(coefficient),
        quadratic=draw(coefficient),
        angular=draw(coefficient),
    )
    return [JointDamping(coefficients=damped), JointSpring(stiffness=sprung), spring, drag]


def _posed(tree: Tree, q: np.ndarray) -> Simulator:
    """A simulator that knows where the parts are at q; rejects a tree that has joints which move nothing."""
    try:
        simulator = Simulator(tree)
    except ModelError:
        reject()
    simulator.move(q, np.zeros(tree.nv))
    return simulator


@st.composite
def constraints(draw: st.DrawFn, scene: Drawn, tree: Tree) -> list[Effect]:
    """One to three effects that hold, closed at q; then perhaps copies, one that is off, one that contradicts the first."""
    simulator = _posed(tree, scene.q)
    moving = [name for name, frame in tree.frames.items() if frame.link >= 0]
    held: list[Effect] = []
    for _ in range(draw(st.integers(1, 3))):
        part = draw(st.sampled_from(moving))
        others = [name for name, frame in tree.frames.items() if frame.link != tree.frame(part).link]
        to = draw(st.sampled_from(others))
        (x, R), (y, S) = simulator.pose(part), simulator.pose(to)
        own = draw(point)
        at = S.T @ (x + R @ np.array(own) - y)
        common = {"name": f"hold{len(held)}", "part": part, "to": to, "point": own}
        kind = draw(st.sampled_from([Attachment, Rod, Hinge, Weld]))
        if kind is Rod:
            away = np.array(draw(axis)) * draw(length)
            held.append(Rod(**common, at=tuple(at + away), length=float(np.linalg.norm(away))))
            continue
        if kind is Hinge:
            along = draw(axis)
            common |= {"axis": along, "to_axis": tuple(S.T @ R @ np.array(along))}
        if kind is Weld:
            common |= {"orientation": tuple(rotations.quaternion_from_matrix(S.T @ R))}
        held.append(kind(**common, at=tuple(at)))
    fate = draw(st.sampled_from(["as it is", "copied", "off", "contradicted"]))
    first = held[0]
    if fate == "copied":
        held += [each.model_copy(update={"name": f"copy_of_{each.name}"}) for each in held]
    elif fate == "off":
        off = 10.0 ** draw(st.floats(-6.0, -0.5)) * np.array(draw(axis))
        held[-1] = held[-1].model_copy(update={"at": tuple(np.array(held[-1].at) + off)})
        scene.consistent = False
    elif fate == "contradicted" and not isinstance(first, Rod):
        away = tuple(np.array(first.at) + draw(st.sampled_from([1e-3, 0.1, 1.0])) * np.array(draw(axis)))
        held.append(first.model_copy(update={"name": "contradiction", "at": away}))
        scene.consistent, scene.conflicting = False, True
    return held


@st.composite
def stops(draw: st.DrawFn, tree: Tree, q: np.ndarray) -> list[Effect]:
    """A stop on a joint, if there is one for it, and convex shapes over the ground or against each other."""
    restitution = draw(st.sampled_from([0.0, 0.5, 1.0]))
    out: list[Effect] = []
    for link in tree.links:
        if link.joint.kind in ONE_FREEDOM and draw(st.booleans()):
            name, here = link.joint.name, float(q[link.q][0])
            limits = {"lower": {name: here - draw(length)}, "upper": {name: here + draw(st.just(0.0) | length)}}
            out.append(JointLimit(name=f"stop_{name}", restitution=restitution, **limits))
    simulator = _posed(tree, q)
    moving = [name for name, frame in tree.frames.items() if frame.link >= 0]
    for index in range(draw(st.integers(0 if out else 1, 2))):
        part = draw(st.sampled_from(moving))
        shape = draw(st.sampled_from([("sphere", (0.1,)), ("box", (0.1, 0.2, 0.3)), ("capsule", (0.05, 0.3))]))
        height = simulator.pose(part)[0][2] - draw(st.sampled_from([0.2, 0.21, 0.5]))
        out.append(
            Contact(
                name=f"contact{index}",
                part=part,
                shape=shape[0],
                size=shape[1],
                to_position=(0.0, 0.0, float(height)),
                friction=draw(st.sampled_from([0.0, 0.3, 1.0])),
                restitution=restitution,
            )
        )
    return out


@st.composite
def scenes(draw: st.DrawFn, pushed: bool, held: bool, touching: bool, extreme: bool) -> Drawn:
    """A scene with effects that push, that hold and that touch, or without; of bodies as unlike as can be, or less so."""
    parts, joints = draw(trees(inner=pushed, extreme=extreme))
    pull = draw(st.sampled_from([(0.0, 0.0, -9.81), (0.0, 0.0, 0.0), (3.0, 4.0, -5.0)]))
    scene = Drawn(parts, joints, [Gravity(acceleration=pull)])
    tree = Tree(parts, joints)
    scene.q, scene.v = draw(states(tree))
    scene.h = draw(st.sampled_from([1e-3, 1e-4, 1e-2]))
    if pushed:
        scene.effects += draw(forces(tree))
    if held:
        scene.effects += draw(constraints(scene, tree))
    if touching:
        scene.effects += draw(stops(tree, scene.q))
    return scene


@pytest.fixture(scope="session")
def random_scenes():
    """`random_scenes(pushed, held, touching, extreme)`: a strategy of Drawn scenes."""
    return scenes
