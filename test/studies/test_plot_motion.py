"""Pictures of motion: joints, forces against plates, figures of sticks, with the words that tell what is seen."""

import numpy as np
import pytest

from physics_prior import cli, rotations
from physics_prior.estimation.force_score import Comparison
from physics_prior.model import Tree
from physics_prior.model.ball_hinges import hinge_angles
from physics_prior.model.coordinates import coordinate_errors, coordinates
from physics_prior.recording.replay import ReplayResult
from physics_prior.resources import scene_path
from physics_prior.scene import load_scene
from physics_prior.stepping import kept
from physics_prior.studies.plot_motion import _sticks, plot_figures, plot_forces, plot_joints


def made_up(scene, count=40):
    """A made-up motion of a scene: all coordinates swing, a free root goes ahead."""
    tree, rng = scene.tree, np.random.default_rng(0)
    phases = rng.uniform(0.0, 2 * np.pi, tree.nv)
    q = np.array([tree.integrate(tree.neutral(), 0.4 * np.sin(0.2 * k + phases)) for k in range(count)])
    if tree.nq > tree.nv:
        q[:, 0] += 0.05 * np.arange(count)
    return ReplayResult(scene, stamps=0.05 * np.arange(count), q=q, spread=np.full((count, tree.nv), 0.01))


def words(draw, result, tmp_path):
    path = tmp_path / "picture.svg"
    draw(result, path)
    return path.read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["double_pendulum", "free_body", "ball_on_rod", "walk_lemouel"])
def test_joints_and_figures_of_any_body_are_drawn(tmp_path, name):
    result = made_up(load_scene(name))
    joints, figures = words(plot_joints, result, tmp_path), words(plot_figures, result, tmp_path)
    for link in result.scene.tree.links:
        assert link.joint.name.replace("_", " ") in joints
    for word in ("[deg]", "time [s]", f"{name}, causal: joints"):
        assert word in joints
    for word in ("along the motion [m]", "height [m]", "0.00 s"):
        assert word in figures
    sided = any(part.name.startswith("left") for part in result.scene.tree.parts)
    assert ("left" in figures) == sided


def test_forces_stand_beside_their_plates_with_the_figures(tmp_path):
    result = made_up(load_scene("free_body"))
    stamps = np.concatenate([np.arange(20), 60 + np.arange(20)]) * 50_000_000
    forces = np.random.default_rng(1).normal(size=(40, 3))
    result.weight, result.forces = 2.0, {"total": Comparison(stamps, forces + 0.1, forces)}
    text = words(plot_forces, result, tmp_path)
    for word in ("total, vertical", "RMSE 5 % of weight", "medio-lateral", "r 1.000", "plate", "estimate", "[N]"):
        assert word in text


def test_sticks_join_the_joints_and_go_on_to_the_end():
    scene = load_scene("double_pendulum")
    (side, begin, end), (_, elbow, tip) = _sticks(scene.tree, np.array([np.pi / 2, 0.0]))
    assert side == ""
    np.testing.assert_allclose([begin, end, elbow, tip], [[0, 0, 0], [-1, 0, 0], [-1, 0, 0], [-2, 0, 0]], atol=1e-12)


def test_coordinates_of_turns_are_their_hinges_and_errors_go_with_them():
    tree = load_scene("walk_lemouel").tree
    assert isinstance(tree, Tree)
    rng = np.random.default_rng(2)
    q = tree.integrate(tree.neutral(), 0.3 * rng.normal(size=tree.nv))
    values = coordinates(tree, q)
    hip = tree.link("left_hip")
    np.testing.assert_array_equal(values[hip.v], hinge_angles(q[hip.q]))
    assert rotations.matrix_from_quaternion(q[hip.q])[1, 2] == pytest.approx(-np.sin(values[hip.v][1]))
    assert values[tree.link("left_knee").v] == q[tree.link("left_knee").q]
    errors, h = rng.normal(size=(tree.nv, 2)), 1e-6
    for column, expected in zip(errors.T, coordinate_errors(tree, q, errors).T, strict=True):
        ahead, behind = (coordinates(tree, tree.integrate(q, sign * h * column)) for sign in (1, -1))
        np.testing.assert_allclose((ahead - behind) / (2 * h), expected, rtol=1e-6, atol=1e-8)


def test_the_command_writes_what_the_bag_has(tmp_path, capsys):
    assert cli.main(["simulate", "pendulum", "-o", str(tmp_path / "bag"), "--duration", "0.5"]) == 0
    assert cli.main(["plot", str(tmp_path / "bag"), "--scene", "pendulum", "-o", str(tmp_path / "pictures")]) == 0
    assert capsys.readouterr().out.count("written: ") == 3
    names = sorted(file.name for file in (tmp_path / "pictures").iterdir())
    assert names == ["figures.png", "joints.png", "readouts.png"]
    for file in (tmp_path / "pictures").iterdir():
        assert file.read_bytes().startswith(b"\x89PNG")
    (tmp_path / "taken").write_text("")
    assert cli.main(["plot", str(tmp_path / "bag"), "--scene", "pendulum", "-o", str(tmp_path / "taken")]) == 2
    assert "give a folder" in capsys.readouterr().err


def test_the_command_steps_as_the_accuracy_wants_that_a_scene_asks_for(tmp_path):
    """It refused: the step was not chosen yet."""
    (tmp_path / "asks.yaml").write_text(scene_path("pendulum").read_text() + "\naccuracy: {tolerance: 1e-3 m}\n")
    scene = load_scene(tmp_path / "asks.yaml")
    assert scene.accuracy is not None
    kept.path_of(scene).unlink(missing_ok=True)
    assert cli.main(["simulate", "pendulum", "-o", str(tmp_path / "bag"), "--duration", "0.5"]) == 0
    words = ["plot", str(tmp_path / "bag"), "--scene", str(tmp_path / "asks.yaml"), "-o", str(tmp_path / "pictures")]
    assert cli.main(words) == 0
    assert kept.read(scene) is not None
