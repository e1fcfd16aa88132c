"""Numbers that are none, and absurd ones, at every door: refused there, with the field's name."""

import math
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import PhysicsPriorError, SimulationError
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import (
    JointsMeasurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)
from physics_prior.inertia import MassProperties
from physics_prior.interface.intake import take_in
from physics_prior.model import Joint, JointKind
from physics_prior.recording.cdr import encode
from physics_prior.recording.messages import (
    Header,
    Point,
    Pose,
    PoseArray,
    PoseStamped,
    PoseWithCovariance,
    PoseWithCovarianceStamped,
    Quaternion,
    Time,
)
from physics_prior.scene import load_scene
from physics_prior.studies.problems.chain import hung_human
from physics_prior.studies.stability.case import Check, Measurements, case

ABSURD = (math.nan, math.inf, -math.inf, 1e300)

SCENE = """
description: One of everything that takes a number.
model:
  parts:
    cart:
      mass: 2.0
      center_of_mass: [0.1, 0.0, 0.0]
      inertia: [[2.0, 0.1, 0.0], [0.1, 2.0, 0.0], [0.0, 0.0, 3.0]]
      joint: {kind: prismatic, axis: [0.0, 2.0, 0.0], position: [0.0, 0.0, 1.0], name: rail}
    arm:
      mass: 1.0
      center_of_mass: [0.0, 0.0, -0.15]
      inertia: {cylinder: {radius: 0.02, length: 0.3}}
      shape: {sphere: 0.1}
      joint: {kind: spherical, parent: cart, name: shoulder, orientation: [1.0, 0.0, 0.0, 0.0]}
    ball: {mass: 1.0, inertia: 0.01, joint: free}
effects:
  - gravity: {acceleration: [0.0, 0.0, -9.81]}
  - joint_damping: {name: friction, coefficients: {rail: 2.0, shoulder: 0.001}}
  - joint_spring: {stiffness: {rail: 10.0}, rest: {rail: 0.1}, damping: {rail: 1.0}}
  - spring: {part: arm, point: [0.0, 0.0, -0.3], at: [0.0, 1.0, 1.0], stiffness: 5.0, rest_length: 1.0, damping: 0.1}
  - attachment: {part: ball, point: [0.0, 0.0, 0.0], at: [3.0, 0.0, 0.0]}
measurements:
  - pose: {topic: /a, part: arm, position_noise: 0.001, orientation_noise: 0.01, scale: 2.0, frame: {position: [1.0, 2.0, 3.0]}}
  - points: {topic: /d, noise: 0.002, markers: [{name: m, part: arm, point: [0.0, 0.0, 1.0]}]}
  - joints: {topic: /e, joints: {q1: rail}, noise: 0.001}
noise: {force: {rail: 1.0, shoulder: 2.0, ball: {linear: 3.0, angular: 4.0}}, velocity: 3.0}
step: {size: 0.002}
gate: {probability: 0.99}
health: {lost_after: 1.0}
initial:
  positions: {rail: 0.1, shoulder: {axis: x, angle: 0.5}, ball: {position: [3.0, 0.0, 0.0]}}
  velocities: {rail: 0.1, shoulder: [0.0, 0.0, 3.0]}
simulation: {duration: 2.0, rate: 50.0}
"""

POSES = """
description: A body and a marker, seen.
model:
  parts:
    body: {mass: 1.0, inertia: 0.01, joint: free}
measurements:
  - pose: {topic: /pose, part: body, position_noise: 0.01, orientation_noise: 0.01}
  - points: {topic: /points, noise: 0.01, markers: [{name: m, part: body}]}
noise: {force: 1.0}
"""


@case(30, "NaN, infinities and 1e300 as inputs", "drake #19322")
def absurd_inputs(thorough: bool) -> Measurements:
    """Every number of a scene, of a measurement, of a message and of a model, four ways; and a state that is none."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "scene.yaml"
        load_scene(_written(path, yaml.safe_load(SCENE)))
        wrong, tried = _scene_fields(path)
        yield Check(f"fields of a scene, of {tried} tries, taken or not named{_listed(wrong)}", float(len(wrong)), 0.0)
        wrong, tried = _message_fields(_written(path, yaml.safe_load(POSES)))
        yield Check(
            f"fields of a message, of {tried} tries, taken or not named{_listed(wrong)}", float(len(wrong)), 0.0
        )
    for what, makers in (("measurement", _measurements()), ("model", _models())):
        tries = [(field, value, make) for field, make in makers.items() for value in ABSURD]
        wrong = [
            f"{field} = {value:g}" for field, value, make in tries if not _refused(make, value, field.split(" ")[0])
        ]
        yield Check(
            f"fields of a {what}, of {len(tries)} tries, taken or not named{_listed(wrong)}", float(len(wrong)), 0.0
        )
    run = hung_human().run()
    left = sum(_computed(run.simulator, k, value) for k in range(0, run.simulator.nv, 5) for value in ABSURD)
    yield Check("states that are none, from which a motion was computed", float(left), 0.0)


def _listed(wrong: list[str]) -> str:
    """Names of what went wrong, for the report of a failure."""
    return f" ({', '.join(wrong[:5])})" if wrong else ""


def _written(path: Path, scene: Any) -> Path:
    path.write_text(yaml.safe_dump(scene), encoding="utf-8")
    return path


def _scene_fields(path: Path) -> tuple[list[str], int]:
    """Fields of the scene that some absurd number gets through, or whose refusal does not name them; and the tries."""
    wrong, tried = [], 0
    for place in _numbers(yaml.safe_load(SCENE)):
        named = [str(key) for key in place if isinstance(key, str)]
        for value in ABSURD:
            scene = yaml.safe_load(SCENE)
            inner = scene
            for key in place[:-1]:
                inner = inner[key]
            inner[place[-1]] = value
            tried += 1
            try:
                load_scene(_written(path, scene))
                wrong.append(f"{'.'.join(map(str, place))} = {value:g}")
            except PhysicsPriorError as error:
                if named[-1] not in str(error):
                    wrong.append(f"{'.'.join(map(str, place))} = {value:g} unnamed")
    return wrong, tried


def _numbers(tree: Any, place: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """The places of all numbers in plain data."""
    if isinstance(tree, float):
        yield place
    elif isinstance(tree, dict | list):
        for key, inner in tree.items() if isinstance(tree, dict) else enumerate(tree):
            yield from _numbers(inner, (*place, key))


def _refused(make: Callable[[float], object], value: float, name: str) -> bool:
    """Whether making something of a value is refused by a sentence that names the field."""
    try:
        make(value)
    except PhysicsPriorError as error:
        return name in str(error)
    return False


def _measurements() -> dict[str, Callable[[float], object]]:
    """Field -> what makes a measurement with a number in that field."""
    zero, one = np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0])
    return {
        "position of a pose": lambda x: PoseMeasurement(1, "t", np.array([x, 0.0, 0.0]), one),
        "orientation of a pose": lambda x: PoseMeasurement(1, "t", zero, np.array([x, 0.0, 0.0, 1.0])),
        "covariance of a pose": lambda x: PoseMeasurement(1, "t", zero, one, np.diag([x, 1.0, 1.0, 1.0, 1.0, 1.0])),
        "orientation": lambda x: OrientationMeasurement(1, "t", np.array([0.0, x, 0.0, 1.0])),
        "points": lambda x: PointsMeasurement(1, "t", np.array([[0.0, 0.0, x if not math.isnan(x) else math.inf]])),
        "positions of joints": lambda x: JointsMeasurement(1, "t", ("a",), np.array([x])),
    }


def _models() -> dict[str, Callable[[float], object]]:
    """Field -> what makes a part of a model with a number in that field."""
    zero = np.zeros(3)
    return {
        "mass": lambda x: MassProperties(x, zero, np.eye(3)),
        "center_of_mass": lambda x: MassProperties(1.0, np.array([x, 0.0, 0.0]), np.eye(3)),
        "inertia": lambda x: MassProperties(1.0, zero, np.where(np.eye(3) > 0.0, x, 0.0)),
        "position of a joint": lambda x: Joint("j", JointKind.REVOLUTE, "world", "p", np.array([x, 0.0, 0.0])),
        "axis of a joint": lambda x: Joint("j", JointKind.REVOLUTE, "world", "p", axis=np.array([x, 0.0, 1.0])),
        "quaternion of a joint": lambda x: Joint(
            "j", JointKind.REVOLUTE, "world", "p", orientation=np.array([x, 0.0, 0.0, 1.0])
        ),
    }


def _message_fields(path: Path) -> tuple[list[str], int]:
    """Fields of messages that an absurd number gets through into an estimate, or whose refusal does not name them."""
    scene = load_scene(path)
    estimator, (poses, points) = Estimator(scene), scene.measurements
    messages: dict[str, Callable[[float], tuple[Any, PoseStamped | PoseArray | PoseWithCovarianceStamped]]] = {
        "position": lambda x: (poses, PoseStamped(_header(), Pose(Point(x, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)))),
        "orientation": lambda x: (
            poses,
            PoseStamped(_header(), Pose(Point(0.0, 0.0, 0.0), Quaternion(x, 0.0, 0.0, 1.0))),
        ),
        "covariance": lambda x: (
            poses,
            PoseWithCovarianceStamped(
                _header(),
                PoseWithCovariance(
                    Pose(Point(0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0)),
                    np.where(np.eye(6) > 0.0, x, 0.0).ravel(),
                ),
            ),
        ),
        "points": lambda x: (
            points,
            PoseArray(_header(), [Pose(Point(0.0, x, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))]),
        ),
    }
    wrong, tried = [], 0
    for field, make in messages.items():
        for value in ABSURD:
            if field == "points" and math.isnan(value):
                continue  # a marker that was not seen
            tried += 1
            source, message = make(value)
            before = estimator.counts.rejected
            take_in(estimator, source, message.ros_type, encode(message))
            if estimator.counts.rejected != before + 1 or field not in estimator.last_rejection:
                wrong.append(f"{field} = {value:g}")
    return wrong, tried


def _header() -> Header:
    return Header(Time(1, 0), "")


def _computed(simulator: Simulator, k: int, value: float) -> int:
    """1 if a motion is computed from a velocity that has an absurd entry, 0 if that is refused."""
    q, v = simulator.tree.neutral(), np.zeros(simulator.nv)
    v[k] = value
    try:
        with np.errstate(all="ignore"):
            simulator.advance(q, v, 1e-3)
    except SimulationError:
        return 0
    return 1
