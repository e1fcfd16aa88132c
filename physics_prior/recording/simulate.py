"""Simulated recordings: a scene's own motion, what its sources would measure of it, and the truth beside them."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from physics_prior import __version__, rotations
from physics_prior.dynamics.force_noise import PointForces
from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SimulationError
from physics_prior.estimation.measurement import (
    ForceMeasurement,
    JointsMeasurement,
    Measurement,
    OrientationMeasurement,
    PointsMeasurement,
    PoseMeasurement,
)
from physics_prior.estimation.process import steps
from physics_prior.interface.geometry import NANOSECONDS, header_of, point_of, pose_of, wrench_of
from physics_prior.recording.definitions import message_class
from physics_prior.recording.messages import JointState, Pose, PoseArray, PoseStamped, WrenchStamped
from physics_prior.recording.truth import Truth
from physics_prior.recording.wire import Message
from physics_prior.recording.writer import BagWriter
from physics_prior.scene import (
    JointSource,
    MeasurementSource,
    OrientationSource,
    PointsSource,
    PoseSource,
    Scene,
    SwitchSource,
)

EPOCH = 1_700_000_000 * NANOSECONDS  # stamp of the start, ns: always the same, so that recordings are
MAXIMUM_MEASUREMENTS = 10_000_000  # times sources: a slip of the finger in the duration fills no disk


@dataclass(frozen=True, eq=False)
class Moment:
    """The true state, q (nq,) and v (nv,), at a stamp, ns, and what the sources measure of it, in their order."""

    stamp: int
    q: np.ndarray
    v: np.ndarray
    measurements: list[Measurement]


def motion(
    scene: Scene, simulator: Simulator, seed: int | None = None, duration: float | None = None
) -> Iterator[Moment]:
    """The motion of a scene from its initial state, at its rate of measurements, the start and the end included.

    An unknown force pushes as the scene's noise says, one value a step: its standard deviation is the density over sqrt(h).
    All noise comes from PCG64 streams spawned from the seed, the force's own and one a source, so that what one of them
    draws does not depend on the others. What holds for a time takes hold and lets go as scheduled, at a moment's stamp before
    the moment. seed and duration [s] are the scene's where left out.

    Raises:
        SimulationError: a seed or duration that is not valid; initial values that cannot be put onto the constraints; a
            motion that leaves the numbers.
    """
    seed = scene.simulation.seed if seed is None else seed
    duration = scene.simulation.duration if duration is None else duration
    count = _count(scene, seed, duration)
    streams = np.random.SeedSequence(seed).spawn(1 + len(scene.measurements))
    force_noise, *noises = (np.random.Generator(np.random.PCG64(stream)) for stream in streams)
    gusts = PointForces(simulator)
    q, v = scene.initial.q.copy(), scene.initial.v.copy()
    try:
        simulator.begin(q, v)
    except SimulationError as problem:
        raise SimulationError(f"the scene's initial positions do not do: {problem}") from None
    stamp = EPOCH
    for k in range(count + 1):
        measurements = []
        simulator.move(q, v)
        for source, noise in zip(scene.measurements, noises, strict=True):
            measurements.append(measure(source, simulator, q, v, stamp, noise))
        yield Moment(stamp, q.copy(), v.copy(), measurements)
        following = EPOCH + round((k + 1) * NANOSECONDS / scene.simulation.rate)
        for stretch in simulator.switches.stretches(stamp - EPOCH, following - EPOCH) if k < count else ():
            inner, h = steps((stretch.end - stretch.begin) * 1e-9, scene.step.size)
            for _ in range(inner):
                tau = scene.noise.force * force_noise.normal(size=simulator.nv) / math.sqrt(h)
                if gusts.count:
                    tau += gusts.columns(q, v) @ force_noise.normal(size=gusts.count) / math.sqrt(h)
                simulator.advance(q, v, h, tau=tau if scene.simulation.force_noise else None)
            simulator.time = stretch.end * 1e-9
            simulator.switches.follow(stretch.events, q, v)
        stamp = following


def simulate(
    scene: Scene,
    out: Path,
    seed: int | None = None,
    duration: float | None = None,
    progress: Callable[[float], None] | None = None,
) -> None:
    """Record a simulated motion as a bag: each source on its own topic, the truth beside it on /truth/... topics.

    The same scene, seed and duration give the same bytes on the same machine with the same versions of the libraries. Other
    processors and versions may round differently in the last bits, no more. progress is told the share that is done.

    Raises:
        RecordingError: the bag exists or cannot be written; SimulationError: as ``motion``. Nothing is left half-written.
    """
    seed = scene.simulation.seed if seed is None else seed
    duration = scene.simulation.duration if duration is None else duration
    _count(scene, seed, duration)
    simulator = scene.simulator()
    truth = Truth(scene, simulator)
    with BagWriter(out) as writer:
        for source in scene.measurements:
            writer.add_topic(source.topic, message_class(source.message_types[0]))
        for topic, message_type in truth.topics.items():
            writer.add_topic(topic, message_type)
        writer.add_metadata(
            "simulation",
            {
                "scene": scene.name,
                "seed": str(seed),
                "duration_s": repr(float(duration)),
                "rate_hz": repr(float(scene.simulation.rate)),
                "version": __version__,
            },
        )
        for moment in motion(scene, simulator, seed, duration):
            for measurement in moment.measurements:
                writer.write(measurement.topic, message_of(measurement, scene.frame_id), moment.stamp)
            for topic, message in truth.messages(moment.stamp, moment.q, moment.v):
                writer.write(topic, message, moment.stamp)
            if progress is not None:
                progress(min(1.0, (moment.stamp - EPOCH) / NANOSECONDS / duration))


def message_of(measurement: Measurement, frame_id: str) -> Message:
    """The message that brings a measurement: PoseStamped, PoseArray or JointState, without a covariance."""
    header = header_of(measurement.stamp, frame_id)
    if isinstance(measurement, PoseMeasurement):
        return PoseStamped(header, pose_of(measurement.position, measurement.orientation))
    if isinstance(measurement, OrientationMeasurement):
        return PoseStamped(header, pose_of(np.zeros(3), measurement.orientation))
    if isinstance(measurement, PointsMeasurement):
        return PoseArray(header, [Pose(point_of(point)) for point in measurement.points])
    if isinstance(measurement, ForceMeasurement):
        return WrenchStamped(header, wrench_of(measurement.force, np.zeros(3)))
    assert isinstance(measurement, JointsMeasurement)
    return JointState(header, measurement.names, measurement.positions)


def _count(scene: Scene, seed: int, duration: float) -> int:
    """How many intervals of measurement fill the duration."""
    if seed < 0:
        raise SimulationError(f"seed {seed} is not valid: give a whole number >= 0")
    if not 0.0 < duration < math.inf:
        raise SimulationError(f"duration {duration:g} s is not valid: give a positive number")
    count = math.floor(duration * scene.simulation.rate + 1e-9)
    if count * max(1, len(scene.measurements)) > MAXIMUM_MEASUREMENTS:
        longest = MAXIMUM_MEASUREMENTS / max(1, len(scene.measurements)) / scene.simulation.rate
        raise SimulationError(f"duration {duration:g} s is too long: at the scene's rate, give at most {longest:g} s")
    return count


def measure(
    source: MeasurementSource,
    simulator: Simulator,
    q: np.ndarray,
    v: np.ndarray,
    stamp: int,
    noise: np.random.Generator,
) -> Measurement:
    """What a source measures of a state; needs ``move``.

    Noise is white: of positions in world axes, of rotations as a rotation vector in the measured frame's axes. Forces have none.
    """
    if isinstance(source, SwitchSource):
        return ForceMeasurement(stamp, source.topic, simulator.wrenches(q, v)[source.effect].force)
    if isinstance(source, PoseSource | OrientationSource):
        position, R = simulator.pose(source.part)
        position = position + R @ np.array(source.frame.position)
        orientation = rotations.multiply(rotations.quaternion_from_matrix(R), np.array(source.frame.orientation))
        if isinstance(source, PoseSource):
            position = (position + source.position_noise * noise.normal(size=3)) / source.scale
        turned = rotations.multiply(orientation, rotations.exp(source.orientation_noise * noise.normal(size=3)))
        if isinstance(source, OrientationSource):
            return OrientationMeasurement(stamp, source.topic, turned)
        return PoseMeasurement(stamp, source.topic, position, turned)
    if isinstance(source, PointsSource):
        points = []
        for marker in source.markers:
            position, R = simulator.pose(marker.part)
            points.append(position + R @ np.array(marker.point) + (marker.noise or source.noise) * noise.normal(size=3))
        return PointsMeasurement(stamp, source.topic, np.array(points))
    assert isinstance(source, JointSource)
    true = np.array([q[simulator.tree.link(joint).q.start] for joint in source.joints.values()])
    return JointsMeasurement(
        stamp, source.topic, tuple(source.joints), true + source.noise * noise.normal(size=len(true))
    )
