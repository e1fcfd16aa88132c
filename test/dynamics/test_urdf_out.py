"""URDF out: what is written reads back as the same body, and moves as it."""

from xml.etree import ElementTree

import numpy as np
import pytest

from physics_prior import rotations
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import ModelError
from physics_prior.inertia import rod
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.model.ball_hinges import AXES, hinge_angles
from physics_prior.model.human import Human
from physics_prior.model.urdf import tree_from_urdf
from physics_prior.model.urdf_out import urdf_from_tree


def person() -> Tree:
    return Human(70.0, 1.75, "female", "dumas", {"left_shank": 0.37}).tree()


def test_a_person_reads_back_and_moves_the_same():
    rng = np.random.default_rng(4)
    tree = person()
    back = tree_from_urdf(urdf_from_tree(tree, "person"), root="free")
    assert back.nv == tree.nv
    own, other = (Simulator(each, (Gravity(),), "rk4") for each in (tree, back))
    q, v = tree.neutral(), np.zeros(tree.nv)
    for link in tree.links:
        if link.joint.kind in (JointKind.SPHERICAL, JointKind.FREE):
            q[link.q][-4:] = rotations.exp(rng.normal(scale=0.7, size=3))
        else:
            q[link.q] = rng.uniform(0.1, 1.0)
    v[:] = rng.normal(size=tree.nv)
    q_back, v_back = back.neutral(), np.zeros(back.nv)
    own.move(q, v)
    for link in back.links:
        name = link.joint.name
        if name == "root":
            q_back[link.q], v_back[link.v] = q[:7], v[:6]
        elif name[:-2] in [joint.name for joint in tree.joints] and name[-2:] in ("_y", "_x", "_z"):
            ball = tree.link(name[:-2])
            which = [letter for letter, _ in AXES].index(name[-1])
            a, b, c = hinge_angles(q[ball.q])
            Rx, Rz = (
                rotations.matrix_from_quaternion(rotations.exp(t * e))
                for t, e in ((b, np.eye(3)[0]), (c, np.eye(3)[2]))
            )
            # angular velocity in the child's axes: Rz^T Rx^T y a' + Rz^T x b' + z c'
            rates = np.column_stack([Rz.T @ Rx.T @ np.eye(3)[1], Rz.T @ np.eye(3)[0], np.eye(3)[2]])
            q_back[link.q], v_back[link.v] = (a, b, c)[which], np.linalg.solve(rates, v[ball.v])[which]
        else:
            q_back[link.q], v_back[link.v] = q[tree.link(name).q], v[tree.link(name).v]
    own.advance(q, v, 1e-3, 20)
    other.advance(q_back, v_back, 1e-3, 20)
    own.move(q, v)
    other.move(q_back, v_back)
    worst = 0.0
    for part in tree.parts:
        for mine, theirs in zip(
            own.pose(part.name) + own.velocity(part.name),
            other.pose(part.name) + other.velocity(part.name),
            strict=True,
        ):
            worst = max(worst, float(np.max(np.abs(mine - theirs))))
    assert worst < 1e-9  # measured: 8.3e-11


def test_what_viewers_need_is_there():
    robot = ElementTree.fromstring(urdf_from_tree(person(), "person"))
    links = {link.get("name") for link in robot.findall("link")}
    children = [joint.find("child").get("link") for joint in robot.findall("joint")]
    assert links - set(children) == {"pelvis"}
    assert len(children) == len(set(children)) == len(links) - 1
    knee = next(joint for joint in robot.findall("joint") if joint.get("name") == "left_knee")
    assert knee.get("type") == "revolute"
    assert np.degrees(float(knee.find("limit").get("upper"))) == pytest.approx(150.0)
    drawn = [link for link in robot.findall("link") if link.find("visual") is not None]
    assert len(drawn) == 18  # 16 segments and two soles


@pytest.mark.parametrize("seed", range(20))
def test_any_tree_reads_back(random_tree, seed):
    """Joints, frames and inertias, up to what roll, pitch and yaw round; ball joints as three hinges."""
    rng = np.random.default_rng(seed)
    tree = random_tree(
        rng,
        root=JointKind.FREE if seed % 2 else None,
        kinds=(JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.SPHERICAL),
    )
    roots = [joint for joint in tree.joints if joint.parent == "world"]
    if len(roots) > 1 and any(joint.kind is JointKind.FREE for joint in roots):
        with pytest.raises(ModelError, match="one root link"):
            urdf_from_tree(tree, "any")
        return
    back = tree_from_urdf(urdf_from_tree(tree, "any"), "free" if roots[0].kind is JointKind.FREE else "fixed")
    for part, joint in zip(tree.parts, tree.joints, strict=True):
        other = back.part(part.name).mass_properties
        assert other.mass == part.mass_properties.mass
        assert np.array_equal(other.center_of_mass, part.mass_properties.center_of_mass)
        assert np.allclose(other.inertia, part.mass_properties.inertia, rtol=0.0, atol=1e-15)
        if joint.kind in (JointKind.REVOLUTE, JointKind.PRISMATIC, JointKind.FIXED):
            again = back.joint(joint.name)
            assert (again.kind, again.parent) == (joint.kind, joint.parent)
            assert np.array_equal(again.position, joint.position)
            turn = rotations.multiply(rotations.conjugate(again.orientation), joint.orientation)
            assert np.linalg.norm(rotations.log(turn)) < 1e-13
            if joint.kind is not JointKind.FIXED:
                assert again.axis == pytest.approx(joint.axis, abs=1e-15)


@pytest.mark.parametrize("pitch", [90.0, -90.0])
def test_straight_up_and_down_read_back(pitch):
    turn = rotations.multiply(rotations.exp(np.radians(pitch) * np.eye(3)[1]), rotations.exp(0.3 * np.eye(3)[0]))
    tree = Tree([Part("a", rod(1.0, 1.0))], [Joint("j", JointKind.REVOLUTE, "world", "a", orientation=turn)])
    again = tree_from_urdf(urdf_from_tree(tree, "any")).joint("j")
    assert np.linalg.norm(rotations.log(rotations.multiply(rotations.conjugate(again.orientation), turn))) < 1e-7
