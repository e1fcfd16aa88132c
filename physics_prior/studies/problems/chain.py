"""Chains and arms: many links in a row, from very light to very heavy."""

import numpy as np

from physics_prior import inertia, rotations
from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.effects import Effect
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import ModelError
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.bench_models import HELD_FEET, humanlike
from physics_prior.studies.problems.mechanism import Benchmark, Mechanism
from physics_prior.studies.problems.pendulum import DOWN
from physics_prior.studies.problems.reference_values import HELD_HUMAN

GRAVITY = Gravity(acceleration=(0.0, 0.0, -9.81))


def chain(links: int, length: float = 10.0) -> Mechanism:
    """A chain of uniform rods, of 1 kg/m and a length in m altogether, released from a straight line 45 deg off."""
    share = length / links
    half = np.array([0.0, -0.5 * share, 0.0])
    body = MassProperties(share, half, share**3 / 12.0 * np.diag([1.0, 0.0, 1.0]))
    parts = [Part(f"link{i}", body) for i in range(links)]
    joints = [
        Joint(f"joint{i}", JointKind.REVOLUTE, f"link{i - 1}" if i else "world", f"link{i}", 2.0 * half * (i > 0))
        for i in range(links)
    ]
    q = np.zeros(links)
    q[0] = 0.25 * np.pi
    return Mechanism(Tree(parts, joints), (DOWN,), q, np.zeros(links))


def arm() -> Mechanism:
    """A serial arm of 7 hinges, from 4 kg at the shoulder to a finger of 10 g, with a bent wrist; let go at rest."""
    masses = (4.0, 3.0, 2.0, 1.5, 1.0, 0.3, 0.01)
    lengths = (0.2, 0.25, 0.2, 0.2, 0.15, 0.08, 0.05)
    axes = np.eye(3)[[2, 1, 2, 1, 2, 1, 2]]
    parts, joints = [], []
    for i, (mass, length) in enumerate(zip(masses, lengths, strict=True)):
        body = inertia.capsule(mass, 0.2 * length, length).transformed(np.eye(3), np.array([0.01, 0.0, 0.5 * length]))
        parts.append(Part(f"link{i}", body))
        place = np.array([0.0, 0.0, lengths[i - 1]]) if i else np.zeros(3)
        joints.append(
            Joint(f"joint{i}", JointKind.REVOLUTE, f"link{i - 1}" if i else "world", f"link{i}", place, axis=axes[i])
        )
    return Mechanism(Tree(parts, joints), (GRAVITY,), np.array([0.3, 1.2, -0.5, 0.8, 0.4, -0.6, 0.2]), np.zeros(7))


def hung_human() -> Mechanism:
    """The human-like tree of 16 bodies, hung by its pelvis on a ball joint and let go with all joints bent."""
    human = humanlike()
    root = Joint("hook", JointKind.SPHERICAL, "world", "pelvis")
    tree = Tree(human.parts, [root, *human.joints[1:]])
    q = tree.integrate(tree.neutral(), 0.3 * np.sin(np.arange(tree.nv)))
    return Mechanism(tree, (GRAVITY,), q, np.zeros(tree.nv))


def thrown_human() -> Mechanism:
    """The same in free flight, turning at 2 rad/s, limbs swinging."""
    tree = humanlike()
    v = 2.0 * np.cos(np.arange(tree.nv))
    return Mechanism(tree, (GRAVITY,), tree.integrate(tree.neutral(), 0.3 * np.sin(np.arange(tree.nv))), v)


def held_human() -> Benchmark:
    """The same let go at rest on both feet, whose toes are pinned where they stand; the head at every 0.05 s to 0.5 s."""
    tree = humanlike()
    q = tree.integrate(tree.neutral(), 0.3 * np.sin(np.arange(tree.nv)))
    where = kinematics(tree, q, np.zeros(tree.nv))
    pins = []
    for anchor in HELD_FEET:
        link = tree.frame(anchor.part).link
        at = where.position[link] + rotations.rotate(where.orientation[link], anchor.point)
        pins.append(
            Attachment(name=f"{anchor.part}_pin", part=anchor.part, point=tuple(anchor.point), at=tuple(at.tolist()))
        )
    return Benchmark(
        tree,
        (GRAVITY, *pins),
        q,
        np.zeros(tree.nv),
        observe=lambda run: run.point("head", (0.0, 0.0, 0.0)),
        times=HELD_HUMAN[:, 0],
        values=HELD_HUMAN[:, 1:],
    )


def scaled(mechanism: Mechanism, length: float, mass: float) -> Mechanism:
    """The same mechanism in other units of length and mass: lengths, masses and gravity times as much, times unchanged.

    Its effects may be gravity and attachments.
    """
    parts = [
        Part(
            part.name,
            MassProperties(
                mass * part.mass_properties.mass,
                length * part.mass_properties.center_of_mass,
                mass * length**2 * part.mass_properties.inertia,
            ),
        )
        for part in mechanism.tree.parts
    ]
    joints = [
        Joint(j.name, j.kind, j.parent, j.child, length * j.position, j.orientation, j.axis)
        for j in mechanism.tree.joints
    ]
    effects: list[Effect] = []
    for effect in mechanism.effects:
        if isinstance(effect, Gravity):
            effects.append(Gravity(acceleration=tuple(length * effect.field())))
        elif isinstance(effect, Attachment):
            ends = {"point": tuple(length * np.array(effect.point)), "at": tuple(length * np.array(effect.at))}
            effects.append(effect.model_copy(update=ends))
        else:
            raise ModelError(f"a mechanism with a '{effect.kind}' cannot be scaled: only gravity and attachments can")
    return Mechanism(Tree(parts, joints), tuple(effects), mechanism.q, mechanism.v)
