"""What a scene file may say: its sections, and the types of values that they share."""

import re
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, JsonValue, PlainValidator, model_validator

from physics_prior import rotations
from physics_prior.dynamics.integrators import DEFAULT, INTEGRATORS, TOLERATED, IntegratorName
from physics_prior.errors import ModelError
from physics_prior.scene.quantity import parse_quantity, quantity
from physics_prior.scene.section import Section
from physics_prior.scene.yaml_file import shown

_NAME = re.compile(r"[A-Za-z][\w.-]{0,79}", re.ASCII)
_TOPIC = re.compile(r"(~/|/)?[A-Za-z_]\w*(/[A-Za-z_]\w*)*", re.ASCII)
_AXES = {
    "x": [1.0, 0.0, 0.0],
    "y": [0.0, 1.0, 0.0],
    "z": [0.0, 0.0, 1.0],
    "-x": [-1.0, 0.0, 0.0],
    "-y": [0.0, -1.0, 0.0],
    "-z": [0.0, 0.0, -1.0],
}


def check_name(name: str) -> str:
    """Return a name that can stand in a topic, a plot and a sentence; ValueError otherwise."""
    if not _NAME.fullmatch(name):
        raise ValueError(f"{shown(name)} is not a name: use letters, digits, '_', '.' and '-', a letter first")
    return name


def _check_topic(topic: str) -> str:
    if len(topic) > 200 or not _TOPIC.fullmatch(topic):
        raise ValueError(f"{shown(topic)} is not a topic: give one such as '/link1/pose'")
    return topic


def _axis(value: Any) -> tuple[float, float, float]:
    """Parse an axis, x, -z or [1, 1, 0], into a unit vector."""
    if isinstance(value, str) and value in _AXES:
        value = _AXES[value]
    numbers = _numbers(value, 3)
    length = float(np.linalg.norm(numbers)) if numbers is not None else 0.0
    if numbers is None or not 1e-9 < length < 1e60:
        raise ValueError(f"{shown(value)} is not an axis: give one of {list(_AXES)} or three numbers, not all zero")
    x, y, z = (numbers / length).tolist()
    return x, y, z


def parse_orientation(value: Any) -> tuple[float, float, float, float]:
    """Parse [w, x, y, z] or {axis: z, angle: 90 deg} into a unit quaternion; ValueError if it is neither."""
    if isinstance(value, dict) and set(value) == {"axis", "angle"}:
        angle = parse_quantity(value["angle"], "rad")
        q = rotations.exp(angle * np.array(_axis(value["axis"])))
    else:
        numbers = _numbers(value, 4)
        try:
            q = rotations.normalize(numbers if numbers is not None else np.zeros(4))
        except ModelError:
            raise ValueError(
                f"{shown(value)} is not an orientation: give a quaternion [w, x, y, z], not zero,"
                " or {axis: z, angle: 90 deg}"
            ) from None
    w, x, y, z = q.tolist()
    return w, x, y, z


def _per_step(value: Any) -> Any:
    """A budget of time, '50 us per step', as the time that it is."""
    return re.sub(r"\s+per\s+step\s*$", "", value) if isinstance(value, str) else value


def _numbers(value: Any, count: int) -> np.ndarray | None:
    """Return `count` plain numbers as an array, or None if the value is anything else."""
    plain = isinstance(value, list) and all(type(each) in (int, float) for each in value)
    return np.array(value, dtype=float) if plain and len(value) == count else None


Name = Annotated[str, AfterValidator(check_name)]
Topic = Annotated[str, AfterValidator(_check_topic)]
Axis = Annotated[tuple[float, float, float], PlainValidator(_axis)]
"""(3,) unit vector."""
Orientation = Annotated[tuple[float, float, float, float], PlainValidator(parse_orientation)]
"""(4,) unit quaternion w, x, y, z."""

Number = Annotated[float, quantity("")]
Length = Annotated[float, quantity("m")]
PositiveLength = Annotated[Length, Field(gt=0.0)]
PositiveAngle = Annotated[float, quantity("rad"), Field(gt=0.0)]
PositiveTime = Annotated[float, quantity("s"), Field(gt=0.0)]
Speed = Annotated[float, quantity("m/s")]
AngularSpeed = Annotated[float, quantity("rad/s")]
Position = tuple[Length, Length, Length]
"""(3,) m."""


class Pose(Section):
    """Where a frame stands in another: position, m, and orientation, its axes to the other's."""

    position: Position = (0.0, 0.0, 0.0)
    orientation: Orientation = (1.0, 0.0, 0.0, 0.0)


class Twist(Section):
    """Velocity of a free part: linear, m/s, in world axes, and angular, rad/s, in the part's."""

    linear: tuple[Speed, Speed, Speed] = (0.0, 0.0, 0.0)
    angular: tuple[AngularSpeed, AngularSpeed, AngularSpeed] = (0.0, 0.0, 0.0)


class JointSection(Section):
    """The joint that carries a part."""

    shorthand: ClassVar[str | None] = "kind"

    kind: Literal["fixed", "revolute", "prismatic", "spherical", "free"]
    name: Name | None = None
    parent: str = "world"
    position: Position = (0.0, 0.0, 0.0)
    orientation: Orientation = (1.0, 0.0, 0.0, 0.0)
    axis: Axis | None = None

    @model_validator(mode="after")
    def _check_axis(self) -> "JointSection":
        turns_or_slides = self.kind in ("revolute", "prismatic")
        if turns_or_slides and self.axis is None:
            raise ValueError(f"'axis' is missing: a {self.kind} joint needs one, for example 'axis: y'")
        if not turns_or_slides and self.axis is not None:
            raise ValueError(f"'axis' is not valid: a {self.kind} joint has none")
        return self


class PartSection(Section):
    """A part: mass, kg, and where it is, and the joint that carries it."""

    mass: Annotated[float, quantity("kg"), Field(ge=0.0)] = 0.0
    center_of_mass: Position = (0.0, 0.0, 0.0)
    inertia: JsonValue = None
    shape: JsonValue = None
    joint: JointSection


class HumanSection(Section):
    """A person: what ``model.human.Human`` takes, which checks it."""

    mass: Annotated[float, quantity("kg")]
    height: Length
    sex: Literal["female", "male"]
    table: Literal["de_leva", "dumas"] = "de_leva"
    lengths: dict[str, Length] = Field(default={})
    rigid: tuple[str, ...] = ()


class ModelSection(Section):
    """The model: parts by name, a person, or a URDF file relative to the scene's and how its root stands."""

    parts: JsonValue = None
    human: JsonValue = None
    urdf: str | None = None
    root: Literal["fixed", "free"] = "fixed"

    @model_validator(mode="after")
    def _check_one(self) -> "ModelSection":
        if sum(each is not None for each in (self.parts, self.human, self.urdf)) != 1:
            raise ValueError("give one of 'parts', 'human' and 'urdf'")
        return self


class SleepSection(Section):
    """When simulated islands at rest sleep: once they have been slower than a velocity, m/s and rad/s, for a duration, s."""

    velocity: Annotated[Number, Field(gt=0.0, le=1e-2)] = 1e-4
    duration: PositiveTime = 0.5


class Step(Section):
    """Time stepping: the integrator, its step size, s, the error that an adaptive one allows each part of a step, and sleep."""

    integrator: IntegratorName = DEFAULT
    size: PositiveTime = 1e-3
    tolerance: Annotated[Number, Field(ge=1e-14, le=1e-2)] = TOLERATED
    sleep: SleepSection | None = None

    @model_validator(mode="after")
    def _check_tolerance(self) -> "Step":
        if "tolerance" in self.model_fields_set and not INTEGRATORS[self.integrator].adaptive:
            adaptive = [name for name, own in INTEGRATORS.items() if own.adaptive]
            raise ValueError(
                f"'tolerance' is not valid: {self.integrator} makes its steps as they are, {adaptive} do not"
            )
        return self


class Accuracy(Section):
    """What is asked in place of a step: an error, m, or a cost, s of the processor per measurement or times real time."""

    tolerance: Annotated[Length, Field(ge=1e-13)] | None = None  # below it is rounding
    budget: Annotated[PositiveTime, BeforeValidator(_per_step)] | None = None
    real_time_factor: Annotated[Number, Field(gt=0.0)] | None = None

    @model_validator(mode="after")
    def _check_one(self) -> "Accuracy":
        if sum(each is not None for each in (self.tolerance, self.budget, self.real_time_factor)) != 1:
            raise ValueError("give one of 'tolerance', 'budget' and 'real_time_factor'")
        return self


class Gate(Section):
    """Which measurements are believed: those inside the chi-square region of this probability.

    After ``recover_after`` refused ones in a row the measurement is taken to be right and the estimate wrong.
    """

    probability: Annotated[Number, Field(gt=0.0, lt=1.0)] = 0.999
    recover_after: Annotated[int, Field(strict=True, ge=1)] = 8


class Health(Section):
    """How long, s, the estimate is trusted without an accepted measurement."""

    degraded_after: PositiveTime = 0.15
    lost_after: PositiveTime = 5.0

    @model_validator(mode="after")
    def _check_order(self) -> "Health":
        if self.lost_after <= self.degraded_after:
            raise ValueError(
                f"lost_after {self.lost_after:g} s is too short: give more than degraded_after,"
                f" {self.degraded_after:g} s"
            )
        return self


class Simulation(Section):
    """What ``simulate`` records: duration, s; measurement rate, Hz; seed; whether force noise acts."""

    duration: PositiveTime = 10.0
    rate: Annotated[float, quantity("Hz"), Field(gt=0.0)] = 100.0
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    force_noise: Annotated[bool, Field(strict=True)] = True


class NoiseSection(Section):
    """Noise as written: each a number, or one per joint, checked against the model by the loader."""

    force: JsonValue
    jerk: JsonValue = 100.0
    velocity: JsonValue = 10.0


class FreeNoiseSection(Section):
    """Noise of a free joint as written: along lines and about axes."""

    linear: JsonValue
    angular: JsonValue


class InitialSection(Section):
    """Start values as written, by joint name, checked against the model by the loader."""

    positions: JsonValue = None
    velocities: JsonValue = None


class SceneFile(Section):
    """The top of a scene file."""

    description: str
    frame_id: Annotated[str, Field(min_length=1)] = "world"
    model: JsonValue
    effects: JsonValue = None
    measurements: JsonValue = None
    noise: NoiseSection | None = None
    readouts: JsonValue = None
    gate: Gate = Gate()
    health: Health = Health()
    step: Step = Step()
    accuracy: Accuracy | None = None
    initial: InitialSection = InitialSection()
    simulation: Simulation = Simulation()
