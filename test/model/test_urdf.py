"""URDF: frames, inertias and joints of a small arm, Pinocchio as an oracle, one sentence for each fault."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from physics_prior import rotations
from physics_prior.errors import ModelError
from physics_prior.model import JointKind, Tree
from physics_prior.model.urdf import MAXIMUM_CHARACTERS, tree_from_urdf

INERTIAL = """<inertial><origin xyz="{xyz}" rpy="{rpy}"/><mass value="{mass}"/>
  <inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0.001" ixz="-0.002" iyz="0.003"/></inertial>"""
ARM = f"""<?xml version="1.0" encoding="utf-8"?>
<robot name="arm">
  <link name="hand">
    {INERTIAL.format(xyz="0.01 0.02 0.03", rpy="0.1 0.2 0.3", mass=0.5)}
    <visual>
      <origin xyz="0 0 0.05" rpy="0 1.5 0"/><geometry><cylinder radius="0.02" length="0.1"/></geometry>
    </visual>
  </link>
  <link name="base"><collision><geometry><box size="0.1 0.2 0.3"/></geometry></collision></link>
  <link name="upper">
    {INERTIAL.format(xyz="0 0 0.2", rpy="0.5 -0.4 1.2", mass=2.0)}
    <visual><geometry><mesh filename="package://arm/upper.stl"/></geometry></visual>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="slider">{INERTIAL.format(xyz="0 0.1 0", rpy="0 0 0", mass=1.0)}</link>
  <link name="flange"/>
  <joint name="wrist" type="fixed">
    <parent link="flange"/><child link="hand"/><origin xyz="0.1 0 0" rpy="0 0.7 0"/>
  </joint>
  <joint name="shoulder" type="continuous">
    <parent link="base"/><child link="upper"/><origin xyz="0 0 0.3" rpy="0.3 0.2 0.1"/><axis xyz="0 3 4"/>
  </joint>
  <joint name="extension" type="prismatic">
    <parent link="upper"/><child link="slider"/><origin xyz="0 0 0.4"/><axis xyz="0 0 2"/>
    <limit lower="0" upper="0.5" effort="1" velocity="1"/>
  </joint>
  <joint name="elbow" type="revolute">
    <parent link="slider"/><child link="flange"/><origin rpy="1 0 0"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <gazebo reference="hand"><material>Red</material></gazebo>
</robot>"""


def mass_matrix(tree: Tree, q: np.ndarray, step: float = 1e-6) -> np.ndarray:
    """Mass matrix of revolute and prismatic joints from positions alone: sum of J^T M J, J by differences."""

    def poses(q: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        found: list[tuple[np.ndarray, np.ndarray]] = []
        for link in tree.links:
            joint, coordinate = link.joint, q[link.q][0]
            place, turn = found[link.parent] if link.parent >= 0 else (np.zeros(3), np.eye(3))
            place = place + turn @ joint.position
            turn = turn @ rotations.matrix_from_quaternion(joint.orientation)
            if joint.kind is JointKind.REVOLUTE:
                turn = turn @ Rotation.from_rotvec(coordinate * joint.axis).as_matrix()
            else:
                place = place + turn @ joint.axis * coordinate
            found.append((place, turn))
        return found

    here = poses(q)
    pairs = [(poses(q + step * e), poses(q - step * e)) for e in np.eye(tree.nq)]
    M = np.zeros((tree.nv, tree.nv))
    for i, link in enumerate(tree.links):
        body = link.mass_properties
        linear = [
            (a[i][0] + a[i][1] @ body.center_of_mass - b[i][0] - b[i][1] @ body.center_of_mass) / (2.0 * step)
            for a, b in pairs
        ]
        angular = [
            here[i][1].T @ Rotation.from_matrix(a[i][1] @ b[i][1].T).as_rotvec() / (2.0 * step) for a, b in pairs
        ]
        M += body.mass * np.array(linear) @ np.array(linear).T
        M += np.array(angular) @ body.inertia @ np.array(angular).T
    return M


def test_arm_has_the_parts_and_joints_of_the_file():
    tree = tree_from_urdf(ARM)
    assert [part.name for part in tree.parts] == ["base", "upper", "slider", "flange", "hand"]
    assert [joint.name for joint in tree.joints] == ["root", "shoulder", "extension", "elbow", "wrist"]
    assert [joint.kind for joint in tree.joints] == [
        JointKind.FIXED,
        JointKind.REVOLUTE,
        JointKind.PRISMATIC,
        JointKind.REVOLUTE,
        JointKind.FIXED,
    ]
    assert tree.mass == 3.5
    assert tree.part("base").mass_properties.mass == 0.0
    np.testing.assert_allclose(tree.joint("shoulder").axis, [0.0, 0.6, 0.8], atol=1e-15)
    np.testing.assert_array_equal(tree.joint("elbow").axis, [1.0, 0.0, 0.0])  # URDF's default


def test_origins_turn_about_fixed_axes():
    tree = tree_from_urdf(ARM)
    expected = Rotation.from_euler("xyz", [0.3, 0.2, 0.1]).as_matrix()
    joint = tree.joint("shoulder")
    np.testing.assert_allclose(rotations.matrix_from_quaternion(joint.orientation), expected, atol=1e-15)
    np.testing.assert_array_equal(joint.position, [0.0, 0.0, 0.3])


def test_inertia_is_turned_into_the_axes_of_the_link():
    body = tree_from_urdf(ARM).part("hand").mass_properties
    R = Rotation.from_euler("xyz", [0.1, 0.2, 0.3]).as_matrix()
    given = np.array([[0.02, 0.001, -0.002], [0.001, 0.03, 0.003], [-0.002, 0.003, 0.04]])
    np.testing.assert_allclose(body.inertia, R @ given @ R.T, atol=1e-16)
    np.testing.assert_array_equal(body.center_of_mass, [0.01, 0.02, 0.03])


def test_shapes_come_from_visual_then_collision_geometry():
    tree = tree_from_urdf(ARM)
    shapes = {part.name: part.shape for part in tree.parts}
    assert {name: shape and shape.kind for name, shape in shapes.items()} == {
        "base": "box",
        "upper": "sphere",
        "slider": None,
        "flange": None,
        "hand": "cylinder",
    }
    np.testing.assert_allclose(shapes["base"].size, [0.1, 0.2, 0.3])
    np.testing.assert_allclose(shapes["upper"].size, [0.2, 0.2, 0.2])
    np.testing.assert_allclose(shapes["hand"].size, [0.04, 0.04, 0.1])
    np.testing.assert_allclose(shapes["hand"].position, [0.0, 0.0, 0.05])
    np.testing.assert_allclose(rotations.log(shapes["hand"].orientation), [0.0, 1.5, 0.0], atol=1e-15)


@pytest.mark.parametrize(("root", "freedoms"), [("fixed", 3), ("free", 9)])
def test_root_is_fixed_or_free(root, freedoms):
    massive = ARM.replace('<link name="base">', f'<link name="base">{INERTIAL}').format(
        xyz="0 0 0", rpy="0 0 0", mass=1.0
    )
    assert tree_from_urdf(massive, root).nv == freedoms


def test_a_root_link_named_world_is_the_ground():
    grounded = ARM.replace('"base"', '"world"')
    tree = tree_from_urdf(grounded)
    assert [part.name for part in tree.parts] == ["upper", "slider", "flange", "hand"]
    assert tree.joint("shoulder").parent == "world"
    with pytest.raises(ModelError, match="the root link 'world' is the ground"):
        tree_from_urdf(grounded, "free")


def test_a_floating_joint_on_the_world_is_free():
    text = f"""<robot name="r"><link name="world"/><link name="body">{INERTIAL}</link>
      <joint name="flight" type="floating"><parent link="world"/><child link="body"/></joint></robot>"""
    tree = tree_from_urdf(text.format(xyz="0 0 0", rpy="0 0 0", mass=1.0))
    assert tree.joint("flight").kind is JointKind.FREE


def test_pinocchio_reads_the_same_arm():
    pinocchio = pytest.importorskip("pinocchio", reason="the bench extra (pin) is not installed")
    model = pinocchio.buildModelFromXML(ARM)
    tree = tree_from_urdf(ARM)
    assert list(model.names)[1:] == [link.joint.name for link in tree.links]
    for i, link in enumerate(tree.links, start=1):
        placement, body = model.jointPlacements[i], model.inertias[i]
        np.testing.assert_allclose(link.joint.position, placement.translation, atol=1e-15)
        R = rotations.matrix_from_quaternion(link.joint.orientation)
        np.testing.assert_allclose(R, placement.rotation, atol=1e-15)  # 2e-16
        assert link.mass_properties.mass == pytest.approx(body.mass, abs=1e-15)
        np.testing.assert_allclose(link.mass_properties.center_of_mass, body.lever, atol=1e-15)  # 0
        np.testing.assert_allclose(link.mass_properties.inertia, body.inertia, atol=1e-15)  # 7e-18

    # the shoulder is continuous: Pinocchio keeps its cosine and sine
    q = np.array([0.7, 0.2, -0.4])
    theirs = pinocchio.crba(model, model.createData(), np.array([np.cos(q[0]), np.sin(q[0]), q[1], q[2]]))
    theirs = np.triu(theirs) + np.triu(theirs, 1).T
    np.testing.assert_allclose(mass_matrix(tree, q), theirs, atol=1e-8)  # 1e-10


WRIST = '<parent link="flange"/><child link="hand"/>'


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        (
            'type="fixed"',
            'type="planar"',
            r"joint 'wrist', <joint type>: 'planar' is not supported: use one of",
        ),
        ('type="fixed"', "", "joint 'wrist', <joint type>: None is not supported"),
        (WRIST, WRIST + '<mimic joint="elbow"/>', "joint 'wrist', <mimic>: coupled joints are not supported"),
        (WRIST, '<child link="hand"/>', "joint 'wrist': <parent> is missing"),
        (WRIST, '<parent link="flange"/><child/>', "joint 'wrist', <child>: attribute 'link' is missing"),
        (
            WRIST,
            '<parent link="flage"/><child link="hand"/>',
            "'wrist', <parent link>: 'flage' is unknown: links are",
        ),
        (WRIST, '<parent link="hand"/><child link="upper"/>', "child link 'upper' is used 2 times"),
        (
            WRIST,
            '<parent link="flange"/><child link="base"/>',
            "do not lead to 'world': a tree needs one path",
        ),
        ('xyz="0 3 4"', 'xyz="0 0 0"', "joint 'shoulder', <axis xyz>: the axis is zero"),
        (
            'xyz="0 3 4"',
            'xyz="0 1"',
            "joint 'shoulder', <axis xyz>: '0 1' is not valid: give 3 finite numbers",
        ),
        ('xyz="0 3 4"', 'xyz="0 0 nan"', "joint 'shoulder', <axis xyz>: '0 0 nan' is not valid"),
        ('xyz="0 3 4"', "", "joint 'shoulder', <axis>: attribute 'xyz' is missing"),
        ('xyz="0 0 0.4"', 'xyz="0 0 1e300"', "joint 'extension', <origin xyz>: '0 0 1e300' is not valid"),
        ('rpy="1 0 0"', 'rpy="${angle} 0 0"', "joint 'elbow', <origin rpy>"),
        ('rpy="0.1 0.2 0.3"', 'rpy="a b c"', "link 'hand', <inertial>, <origin rpy>: 'a b c' is not valid"),
        ('<mass value="2.0"/>', "", "link 'upper': <mass> is missing"),
        ('<mass value="2.0"/>', '<mass value="-2"/>', "link 'upper', <inertial>: mass -2 kg is negative"),
        ('<mass value="2.0"/>', '<mass value="inf"/>', "link 'upper', <mass value>: 'inf' is not valid"),
        ('ixx="0.02" ', "", "link 'hand', <inertia>: attribute 'ixx' is missing"),
        ('ixx="0.02"', 'ixx="0.2"', "link 'hand', <inertial>: .* triangle inequality"),
        (
            'size="0.1 0.2 0.3"',
            'size="0.1 0.2 -1"',
            "link 'base', <box size>: lengths must be greater than zero",
        ),
        ('size="0.1 0.2 0.3"', 'size="0.1"', "link 'base', <box size>: '0.1' is not valid: give 3"),
        (
            '<geometry><sphere radius="0.1"/></geometry>',
            "",
            "link 'upper', <collision>: <geometry> is missing",
        ),
        (
            '<link name="flange"/>',
            '<link name="flange"/><link name="flange"/>',
            "link name 'flange' is used 2 times",
        ),
        ('<link name="flange"/>', '<link name="flange"/><link name="lost"/>', r"has \['base', 'lost'\]"),
        ('<link name="flange"/>', '<link name="flange"/><link/>', "a <link> has no name"),
        ('name="wrist"', 'name="elbow"', "joint name 'elbow' is used twice"),
        ("</robot>", "", "not well-formed XML"),
        ("robot", "sdf", "outermost element: it must be <robot>"),
        ("<robot", '<!DOCTYPE robot [<!ENTITY a "b">]><robot', "has a DOCTYPE 'robot', which is refused"),
        ('"base"', '"&undefined;"', "not well-formed XML: undefined entity"),
    ],
)
def test_faults_are_named_in_one_sentence(old, new, complaint):
    assert old in ARM
    with pytest.raises(ModelError, match=complaint) as caught:
        tree_from_urdf(ARM.replace(old, new))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("text", ["", "\0", "\ud800", "<robot>" * 1000, "{}", "<robot/>"])
def test_text_that_is_no_urdf_is_refused(text):
    with pytest.raises(ModelError, match="URDF"):
        tree_from_urdf(text)


def test_expanding_entities_and_huge_files_are_refused_before_they_cost_anything():
    laughs = "".join(f'<!ENTITY l{i + 1} "{f"&l{i};" * 10}">' for i in range(9))
    with pytest.raises(ModelError, match="DOCTYPE"):
        tree_from_urdf(f'<!DOCTYPE robot [<!ENTITY l0 "ha">{laughs}]><robot name="&l9;"/>')
    with pytest.raises(ModelError, match="2000001 characters, more than the 2000000 accepted"):
        tree_from_urdf(" " * (MAXIMUM_CHARACTERS + 1))


def test_an_unknown_root_is_refused():
    with pytest.raises(ModelError, match=r"root 'floating' is not valid: use one of \['fixed', 'free'\]"):
        tree_from_urdf(ARM, "floating")


def test_many_roots_are_named_in_a_short_sentence():
    links = "".join(f'<link name="{i:04}"/>' for i in range(1000))
    with pytest.raises(ModelError, match="'0019'] and 980 more"):
        tree_from_urdf(f"<robot>{links}</robot>")
