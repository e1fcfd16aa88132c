"""Scenes read from files: what they come to, and what is refused, on which line."""

from pathlib import Path

import numpy as np
import pytest

from physics_prior import inertia, rotations
from physics_prior.errors import SceneError
from physics_prior.model import JointKind
from physics_prior.resources import scene_path
from physics_prior.scene import (
    AngleReadout,
    EnergyReadout,
    ForceReadout,
    JointSource,
    OrientationSource,
    PointsSource,
    PoseSource,
    load_scene,
)

EVERYTHING = """\
description: one of everything
frame_id: map
model:
  parts:
    hand: {mass: 100 g, inertia: 0, joint: {kind: fixed, parent: arm, position: [0, 0, -30 cm]}}
    cart:
      mass: 2
      inertia: [[2, 0.1, 0], [0.1, 2 kg m^2, 0], [0, 0, 3]]
      joint: {kind: prismatic, axis: [0, 2, 0], name: rail}
    arm:
      mass: 1 kg
      center_of_mass: [0, 0, -0.15]
      inertia: {cylinder: {radius: 2 cm, length: 0.3 m, orientation: {axis: y, angle: 90 deg}}}
      shape: {sphere: 0.1 m}
      joint: {kind: spherical, parent: cart, name: shoulder}
    ball:
      mass: 1
      inertia: 0.01
      joint: free
effects:
  - gravity
  - joint_damping: {name: friction, coefficients: {rail: 2 N s/m, shoulder: 1 N mm s/rad}}
  - attachment: {name: grip, part: hand, to: ball}
measurements:
  - pose: {topic: /a, part: hand, position_noise: 1 mm, orientation_noise: 1 deg, scale: 2,
          frame: {position: [1, 2, 3 mm]}}
  - orientation: {topic: b/c, part: ball, orientation_noise: 0.1}
  - points: {topic: ~/d, noise: 2 mm, markers: [{name: R.ASIS, part: arm, point: [0, 0, 1]}, {name: q, part: ball}]}
  - joints: {topic: e, joints: {q1: rail}, noise: 1 mm}
noise:
  force: {rail: 1 N sqrt(s), shoulder: 2 N m sqrt(s), ball: {linear: 3, angular: 4 N m sqrt(s)}}
  velocity: 3
readouts:
  - joint: {joint: rail, name: x}
  - angle: {name: turn, part: arm, axis: -z}
  - energy
  - force: {constraint: grip, component: norm}
step: {integrator: semi_implicit_euler, size: 2 ms}
gate: {probability: 0.99}
health: {lost_after: 1 s}
initial:
  positions: {rail: 10 cm, shoulder: {axis: x, angle: 90 deg}, ball: {position: [1, 0, 0]}}
  velocities: {shoulder: [0, 0, 180 deg/s], ball: {angular: [1, 2, 3]}}
simulation: {seed: 7, force_noise: false}
"""


@pytest.fixture
def write(tmp_path):
    def write(text: str) -> Path:
        path = tmp_path / "everything.yaml"
        path.write_text(text)
        return path

    return write


def test_one_of_everything(write):
    path = write(EVERYTHING)
    scene = load_scene(path)
    assert (scene.name, scene.path, scene.frame_id) == ("everything", path, "map")
    tree = scene.tree
    assert [part.name for part in tree.parts] == ["cart", "arm", "hand", "ball"]  # depth-first, in the file's order
    assert [(link.joint.name, link.joint.kind) for link in tree.links] == [
        ("rail", JointKind.PRISMATIC),
        ("shoulder", JointKind.SPHERICAL),
        ("ball", JointKind.FREE),
    ]
    np.testing.assert_array_equal(tree.joint("rail").axis, [0, 1, 0])
    np.testing.assert_array_equal(tree.part("cart").mass_properties.inertia, [[2, 0.1, 0], [0.1, 2, 0], [0, 0, 3]])
    cylinder = inertia.cylinder(1.0, 0.02, 0.3).inertia
    np.testing.assert_allclose(  # along x now; measured 1e-18
        tree.part("arm").mass_properties.inertia, cylinder[[2, 1, 0]][:, [2, 1, 0]], atol=1e-15
    )
    shape = tree.part("arm").shape
    assert shape is not None
    assert shape.kind == "sphere"
    np.testing.assert_array_equal(shape.size, [0.2] * 3)
    np.testing.assert_array_equal(shape.position, [0, 0, -0.15])
    assert tree.part("ball").shape is None

    assert [effect.label for effect in scene.effects] == ["gravity", "friction", "grip"]
    np.testing.assert_allclose(scene.effects[1].parameters(tree)[:4], [2, 1e-3, 1e-3, 1e-3], rtol=1e-15)

    pose, orientation, points, joints = scene.measurements
    assert isinstance(pose, PoseSource)
    assert pose.frame.position == (1.0, 2.0, 0.003)
    assert (pose.position_noise, pose.scale) == (0.001, 2.0)
    assert "geometry_msgs/msg/PoseWithCovarianceStamped" in pose.message_types
    assert isinstance(orientation, OrientationSource)
    assert orientation.frame.orientation == (1.0, 0.0, 0.0, 0.0)
    assert isinstance(points, PointsSource)
    assert [(marker.name, marker.part, marker.point) for marker in points.markers] == [
        ("R.ASIS", "arm", (0.0, 0.0, 1.0)),
        ("q", "ball", (0.0, 0.0, 0.0)),
    ]
    assert isinstance(joints, JointSource)
    assert joints.joints == {"q1": "rail"}

    np.testing.assert_array_equal(scene.noise.force, [1, 2, 2, 2, 3, 3, 3, 4, 4, 4])
    np.testing.assert_array_equal(scene.noise.jerk, [100] * 10)
    np.testing.assert_array_equal(scene.noise.velocity, [3] * 10)

    assert [(readout.name, readout.kind) for readout in scene.readouts] == [
        ("x", "joint"),
        ("turn", "angle"),
        ("energy", "energy"),
        ("grip", "force"),
    ]
    _, angle, energy, force = scene.readouts
    assert isinstance(angle, AngleReadout)
    assert (angle.axis, angle.zero) == ((0.0, 0.0, -1.0), (1.0, 0.0, 0.0))
    assert isinstance(energy, EnergyReadout)
    assert energy.energy == "total"
    assert isinstance(force, ForceReadout)
    assert force.component == "norm"

    assert (scene.step.integrator, scene.step.size) == ("semi_implicit_euler", 2e-3)
    assert (scene.gate.probability, scene.gate.recover_after) == (0.99, 8)
    assert (scene.health.degraded_after, scene.health.lost_after) == (0.15, 1.0)
    assert (scene.simulation.seed, scene.simulation.force_noise) == (7, False)
    half = np.sqrt(0.5)
    np.testing.assert_allclose(scene.initial.q, [0.1, half, half, 0, 0, 1, 0, 0, 1, 0, 0, 0], atol=1e-15)
    np.testing.assert_allclose(scene.initial.v, [0, 0, 0, np.pi, 0, 0, 0, 1, 2, 3], atol=1e-15)


SLIPS = {
    # what stands in EVERYTHING -> what is written instead, the field blamed and what is said
    "parts:": ("prats:", "model: unknown key 'prats' (did you mean 'parts'?)"),
    "mass: 2\n": ("mass: -2\n", "model.parts.cart.mass: -2 is out of range: give a number >= 0"),
    "mass: 100 g": ("mass: 5 m", "model.parts.hand.mass: '5 m' is not a quantity in kg"),
    "[0, 0, -30 cm]": ("[0, 0]", "model.parts.hand.joint.position: [0, 0] has 2 entries: give 3"),
    "center_of_mass: [0, 0, -0.15]": (
        "center_of_mass: [0, 0, 5 kg]",
        "model.parts.arm.center_of_mass[2]: '5 kg' is not a quantity in m",
    ),
    "inertia: 0.01": ("shape: {sphere: 1}", "model.parts.ball: 'inertia' is missing"),
    "{sphere: 0.1 m}": ("{spere: 0.1 m}", "model.parts.arm.shape: 'spere' is not a shape (did you mean 'sphere'?)"),
    "shape: {sphere: 0.1 m}": ("shape: {box: [1, -1, 1]}", "model.parts.arm.shape.box[1]: -1 is out of range"),
    "radius: 2 cm": ("radius: 0 cm", "model.parts.arm.inertia.cylinder.radius: '0 cm' is out of range"),
    "[[2, 0.1, 0]": ("[[2, 0.2, 0]", "model.parts.cart.inertia: inertia [[2.0, 0.2, 0.0]"),
    "[0, 0, 3]]": ("[0, 0, 9]]", "model.parts.cart.inertia: inertia with principal moments"),
    "kind: spherical": ("kind: sperical", "kind: 'sperical' is not valid (did you mean 'spherical'?)"),
    "kind: spherical, parent": ("kind: spherical, axis: x, parent", "joint: 'axis' is not valid: a spherical joint"),
    "axis: [0, 2, 0]": ("axis: [0, 0, 0]", "joint.axis: [0, 0, 0] is not an axis"),
    "parent: arm": ("parent: amr", "hand.joint.parent: 'amr' is not a part (did you mean 'arm'?)"),
    "parent: cart": ("parent: hand", "do not lead to 'world'"),
    "name: rail}": ("name: ball}", "joint name 'ball' is used twice"),
    "    ball:\n": ("    2 balls:\n", "model.parts: '2 balls' is not a name"),
    "- gravity": ("- gravty", "effects[0]: 'gravty' is not an effect (did you mean 'gravity'?)"),
    "shoulder: 1 N mm s/rad": (
        "sholder: 1",
        "effects[1].joint_damping.coefficients: joint 'sholder' is unknown or fixed:"
        " moving joints are ['rail', 'shoulder', 'ball'] (did you mean 'shoulder'?)",
    ),
    "rail: 2 N s/m": ("rail: 2 N s", "coefficients.rail: '2 N s' is not a quantity in N m s/rad or in N s/m"),
    "coefficients": ("coefficient", "effects[1].joint_damping: unknown key 'coefficient' (did you mean"),
    "name: grip": ("name: rail", "effects[2].attachment.name: 'rail' is a joint's name"),
    "part: hand, to: ball": ("part: hand, to: bal", "effects[2].attachment.to: part 'bal' is unknown"),
    "topic: b/c": ("topic: /a", "measurements[1].orientation.topic: '/a' is read twice"),
    "topic: /a": ("topic: 7up", "measurements[0].pose.topic: '7up' is not a topic"),
    "position: [1, 2, 3 mm]": ("positon: [1, 2, 3]", "pose.frame: unknown key 'positon' (did you mean 'position'?)"),
    "part: ball, orientation_noise: 0.1": ("part: world, orientation_noise: 0.1", "orientation.part: 'world' is not"),
    "{name: q, part: ball}": ("{name: R.ASIS, part: ball}", "markers[1].name: 'R.ASIS' is another marker's name"),
    "{q1: rail}": ("{q1: shoulder}", "joints.joints.q1: 'shoulder' is not a revolute or prismatic joint"),
    "noise: 1 mm}": ("noise: 1 kg}", "joints.noise: '1 kg' is not a quantity in rad or in m"),
    "2 N m sqrt(s)": ("2 N sqrt(s)", "noise.force.shoulder: '2 N sqrt(s)' is not a quantity in N m sqrt(s)"),
    "linear: 3, ": ("", "noise.force.ball: 'linear' is missing"),
    "rail: 1 N sqrt(s), ": ("", "noise.force: joint 'rail' is missing"),
    "velocity: 3\n": ("velocity: 3 m/s\n", "noise.velocity: '3 m/s' is not a quantity in rad/s"),
    "joint: rail, name: x": ("joint: hand, name: x", "readouts[0].joint.joint: 'hand' is not a revolute or prismatic"),
    "axis: -z": ("axis: -z, zero: z", "readouts[1].angle: zero [0.0, 0.0, 1.0] lies along the axis"),
    "constraint: grip": ("constraint: ball", "readouts[3].force.constraint: 'ball' is not a constraint force"),
    "name: turn": ("name: x", "readouts[1].angle.name: 'x' is another readout's name"),
    "semi_implicit_euler": ("euler", "step.integrator: 'euler' is not valid"),
    "size: 2 ms": ("size: 2 ms, tolerance: 1e-9", "step: 'tolerance' is not valid: semi_implicit_euler"),
    "0.99}": ("1}", "gate.probability: 1 is out of range: give a number < 1"),
    "lost_after: 1 s": ("lost_after: 1 ms", "health: lost_after 0.001 s is too short"),
    "rail: 10 cm": ("rail: 10 deg", "initial.positions.rail: '10 deg' is not a quantity in m"),
    "[0, 0, 180 deg/s]": ("[0, 0]", "initial.velocities.shoulder: [0, 0] is not an angular velocity"),
    "angular: [1, 2, 3]": (
        "angle: [1, 2, 3]",
        "initial.velocities.ball: unknown key 'angle' (did you mean 'angular'?)",
    ),
    "seed: 7": ("seed: 7.5", "simulation.seed: 7.5 is not valid: give a whole number"),
    "force_noise: false": ("force_noise: 'no'", "simulation.force_noise: 'no' is not valid: give true or false"),
}


@pytest.mark.parametrize("old", SLIPS)
def test_slips_are_refused_by_line_and_field(write, old):
    new, message = SLIPS[old]
    assert old in EVERYTHING
    path = write(EVERYTHING.replace(old, new, 1))
    with pytest.raises(SceneError) as error:
        load_scene(path)
    said = str(error.value)
    assert message in said
    start, line, _ = said.split(":", 2)
    assert start == str(path)
    blamed = path.read_text().splitlines()[int(line) - 1]
    culprit = new.strip().strip("{}").split(",")[0] if new else old.split(":")[1].split("{")[0].strip()
    # an entry that is missing is missed in the line of what should have it
    if "is missing" not in message and "do not lead" not in message and "used twice" not in message:
        assert culprit in blamed, f"{said}\nblames: {blamed}"


@pytest.mark.parametrize(
    ("old", "new", "line"),
    [
        ("mass: 2\n", "mass: -2\n", 7),
        ("inertia: 0.01", "shape: {sphere: 1}", 16),
        ("shoulder: 1 N mm s/rad", "sholder: 1", 22),
        ("to: ball}", "to: bal}", 23),
        ("axis: -z", "axis: w", 35),
        ("angular: [1, 2, 3]", "angular: [1, 2]", 43),
    ],
)
def test_lines_are_exact(write, old, new, line):
    with pytest.raises(SceneError, match=rf"everything\.yaml:{line}: "):
        load_scene(write(EVERYTHING.replace(old, new, 1)))


@pytest.mark.parametrize("section", ["description", "model", "noise"])
def test_sections_that_are_needed(write, section):
    lines, keep = [], True
    for line in EVERYTHING.splitlines(keepends=True):
        keep = not line.startswith(section) if not line.startswith(" ") else keep
        lines += [line] if keep else []
    with pytest.raises(SceneError, match=rf"everything\.yaml:1: '{section}' is missing"):
        load_scene(write("".join(lines)))


URDF = """<robot name="r"><link name="base"/>
<link name="arm"><inertial><mass value="1"/><inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link>
<joint name="hip" type="revolute"><parent link="base"/><child link="arm"/><axis xyz="0 1 0"/></joint></robot>"""
URDF_SCENE = "description: d\nmodel:\n  urdf: robot.urdf\n"


def test_urdf_beside_the_scene(write, tmp_path):
    (tmp_path / "robot.urdf").write_text(URDF)
    assert [link.joint.name for link in load_scene(write(URDF_SCENE)).tree.links] == ["hip"]
    assert load_scene(write(URDF_SCENE + "  root: free\n")).tree.nv == 7


@pytest.mark.parametrize(
    ("urdf", "message"),
    [
        (None, "is not a file"),
        (URDF.replace('mass value="1"', 'mass value="-1"'), "mass -1 kg is negative"),
        (URDF.replace("revolute", "fixed"), "has nothing that moves"),
        ("<robot>", "is not well-formed XML"),
    ],
)
def test_urdf_that_is_refused(write, tmp_path, urdf, message):
    if urdf is not None:
        (tmp_path / "robot.urdf").write_text(urdf)
    with pytest.raises(SceneError, match=r"everything\.yaml:3: model.urdf: ") as error:
        load_scene(write(URDF_SCENE))
    assert message in str(error.value)


def test_axes_of_hinges_must_not_be_zero(write):
    text = EVERYTHING.replace("  - gravity\n", "  - hinge: {part: hand, axis: [0, 0, 0], to_axis: [0, 0, 1]}\n")
    with pytest.raises(SceneError, match=r"effects\[0\]\.hinge: .*axis"):
        load_scene(write(text))


def test_names_and_paths():
    assert load_scene("pendulum").path == scene_path("pendulum")
    with pytest.raises(SceneError, match=r"shipped are .*four_bar.*pendulum"):
        load_scene("no_such_scene")


def test_orientations_are_unit_quaternions(write):
    text = EVERYTHING.replace("{axis: x, angle: 90 deg}", "[2, 0, 0, -2]")
    q = load_scene(write(text)).initial.q[1:5]
    np.testing.assert_allclose(q, rotations.exp([0, 0, -np.pi / 2]), atol=1e-15)
