"""Time the estimator on the moving human (moving_human.py), stamp by stamp, and what of it goes where.

With peers, biorbd's kinematic extended Kalman filter (KalmanReconsMarkers, which knows no physics and tells no covariance) takes
turns with ours on the same markers of a like model: Euler angles for ball joints, as it has no other.
"""

import tempfile
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter_ns, thread_time_ns
from typing import Any

import numpy as np
from rich.table import Table

from physics_prior.dynamics import manifold
from physics_prior.errors import SimulationError
from physics_prior.estimation import observation, reflection
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import PointsMeasurement
from physics_prior.interface.intake import measurement_of
from physics_prior.model import JointKind, Tree
from physics_prior.recording.cdr import decode, encode
from physics_prior.recording.simulate import Moment, message_of
from physics_prior.scene import Scene, Step, load_scene
from physics_prior.studies.moving_human import MARKERS, RATE, moments, moving_human

STEP = Step(integrator="rk4", size=20e-3)  # one a stamp: the study `tradeoff` tells what shorter ones gain
SECONDS, LAPS = 8.0, 3
SETTLED = 10  # stamps after the start, not counted
PENDULUM_SECONDS = 5.0
WORST = 99.9  # percentile
FAR = 0.2  # m: a peer further from the markers than this does not compute the same

PEER = "biorbd.KalmanReconsMarkers"
RATIOS = {"estimator_vs_biorbd": ("estimator_markers", PEER)}
"""Name of a ratio -> our contestant and the peer's."""
SPLIT = ("dynamics", "covariance", "python", "messages")
"""Where the time of ``estimator_poses`` goes; messages come on top: CDR decoded and translated."""


class Split:
    """Microseconds of the processor that compiled functions take within a run, told by clocks around them."""

    def __init__(self) -> None:
        self.us: dict[str, float] = {}

    def around(self, name: str, function: Callable[..., Any]) -> Callable[..., Any]:
        """The function, with a clock around it."""
        self.us[name] = 0.0

        def clocked(*arguments: Any) -> Any:
            start = thread_time_ns()
            out = function(*arguments)
            self.us[name] += (thread_time_ns() - start) / 1e3
            return out

        return clocked


def time_estimator(peers: bool, progress: Callable[[float], None] = lambda share: None) -> dict[str, float]:
    """Microseconds a stamp, medians: with poses and with markers, their worst, the split, and, if it is installed, the peer.

    Of the double pendulum: a measurement, of two poses a stamp at 100 Hz.

    Raises:
        SimulationError: the peer strays from the markers.
    """
    peers = peers and find_spec("biorbd") is not None  # its wheels are not for every system
    scenes = {"estimator_poses": moving_human("poses", STEP), "estimator_markers": moving_human("markers", STEP)}
    recordings = {name: moments(scene, SECONDS, seed=0) for name, scene in scenes.items()}
    peer = Biorbd(scenes["estimator_poses"].tree) if peers else None
    times: dict[str, list[float]] = {name: [] for name in [*scenes, *([PEER] if peers else [])]}
    for scene, recording in zip(scenes.values(), recordings.values(), strict=True):
        _feed(Estimator(scene), recording[:SETTLED])  # what is not compiled yet is now
    for lap in range(LAPS):
        estimators = {name: Estimator(scene) for name, scene in scenes.items()}
        if peer is not None:
            peer.restart()
        for index in range(len(recordings["estimator_poses"])):
            for name, estimator in estimators.items():
                times[name].append(_feed(estimator, [recordings[name][index]]))
            if peer is not None:
                times[PEER].append(peer.take(_points(recordings["estimator_markers"][index])))
        if peer is not None:
            peer.require_close(_points(recordings["estimator_markers"][-1]))
        progress((lap + 1) / (LAPS + 1))
    count = len(recordings["estimator_poses"])
    settled = {
        name: np.concatenate([own[lap * count + SETTLED :][: count - SETTLED] for lap in range(LAPS)])
        for name, own in times.items()
    }
    us = {name: float(np.median(own)) for name, own in settled.items()}
    us |= {f"{name}_worst": float(np.percentile(settled[name], WORST)) for name in scenes}
    us |= {
        f"estimator_poses_{name}": value
        for name, value in _split(scenes["estimator_poses"], recordings["estimator_poses"]).items()
    }
    us["estimator_double_pendulum"] = _pendulum()
    progress(1.0)
    return us


def _feed(estimator: Estimator, recording: list[Moment], clock: Callable[[], int] = perf_counter_ns) -> float:
    """Give an estimator what is measured; return the microseconds."""
    start = clock()
    for moment in recording:
        for measurement in moment.measurements:
            estimator.add(measurement)
    return (clock() - start) / 1e3


def _points(moment: Moment) -> np.ndarray:
    """(k, 3) the markers of a stamp."""
    (measurement,) = moment.measurements
    assert isinstance(measurement, PointsMeasurement)
    return measurement.points


def _pendulum() -> float:
    """Microseconds a measurement of the double pendulum."""
    scene = load_scene("double_pendulum")
    recording = moments(scene, PENDULUM_SECONDS, seed=0)
    _feed(Estimator(scene), recording)
    estimator = Estimator(scene)
    stamps = [_feed(estimator, [moment]) for moment in recording]
    return float(np.median(stamps[SETTLED:])) / len(scene.measurements)


def _split(scene: Scene, recording: list[Moment]) -> dict[str, float]:
    """Microseconds a stamp that go into each of SPLIT: means of the processor's, with clocks around what is compiled."""
    estimator, split = Estimator(scene), Split()
    simulator, source_of = estimator.simulator, {source.topic: source for source in scene.measurements}
    raw = [
        [(each.topic, encode(message_of(each, scene.frame_id))) for each in moment.measurements] for moment in recording
    ]
    _feed(estimator, recording[:SETTLED])
    with ExitStack() as stack:
        for place, name in (
            (simulator.step, "carry"),
            (reflection, "reflect"),
            (reflection, "apply"),
            (observation, "see_frame"),
            (manifold, "displace"),
        ):
            stack.enter_context(_replaced(place, name, split.around(name, getattr(place, name))))
        total = _feed(estimator, recording[SETTLED:], thread_time_ns)
    # the same steps of a covariance that is zero: their products and reflections have nothing to do
    bare = Split()
    nothing, T = np.zeros((2 * simulator.nv, 2 * simulator.nv)), np.empty((4 * simulator.nv, 2 * simulator.nv))
    carry, noise = bare.around("carry", simulator.step.carry), np.zeros((simulator.nv, simulator.nv))
    array, tangent, still = simulator.memory.array, simulator.tangent_array(), np.zeros(simulator.nv)
    for moment in recording[SETTLED:]:
        carry(array, tangent, moment.q.copy(), moment.v.copy(), still, 1.0 / RATE, 1, noise, nothing, T, False)
    start = thread_time_ns()
    for stamp in raw:
        for topic, data in stamp:
            measurement_of(source_of[topic], decode(source_of[topic].message_types[0], data), scene)
    messages = (thread_time_ns() - start) / 1e3
    count = len(recording) - SETTLED
    covariance = split.us["reflect"] + split.us["apply"] + split.us["carry"] - bare.us["carry"]
    dynamics = sum(split.us.values()) - covariance
    figures = (dynamics, covariance, total - dynamics - covariance)
    return dict(zip(SPLIT, [*(each / count for each in figures), messages / len(raw)], strict=True))


@contextmanager
def _replaced(place: Any, name: str, by: Any) -> Iterator[None]:
    before = getattr(place, name)
    setattr(place, name, by)
    try:
        yield
    finally:
        setattr(place, name, before)


class Biorbd:
    """biorbd's filter on the tree with three markers a body."""

    def __init__(self, tree: Tree) -> None:
        import biorbd

        self._biorbd = biorbd
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "human.bioMod"
            path.write_text(bio_mod(tree), encoding="utf-8")
            self.model = biorbd.Model(str(path))
        self.restart()

    def restart(self) -> None:
        """Begin a recording."""
        self._filter = self._biorbd.KalmanReconsMarkers(self.model, self._biorbd.KalmanParam(RATE))
        self.q = self._biorbd.GeneralizedCoordinates(self.model)
        self._rates = self._biorbd.GeneralizedVelocity(self.model), self._biorbd.GeneralizedAcceleration(self.model)

    def take(self, points: np.ndarray) -> float:
        """Give it the markers (k, 3) of a stamp; return the microseconds."""
        flat = points.reshape(-1)
        start = perf_counter_ns()
        self._filter.reconstructFrame(self.model, flat, self.q, *self._rates)
        return (perf_counter_ns() - start) / 1e3

    def require_close(self, points: np.ndarray) -> None:
        """Raise SimulationError if it is not where the markers (k, 3) are."""
        own = np.array([each.to_array() for each in self.model.markers(self.q)])
        off = float(np.max(np.linalg.norm(own - points, axis=1)))
        if not off <= FAR:
            raise SimulationError(f"{PEER} is {off:.2g} m off the markers: there is nothing to compare")


def bio_mod(tree: Tree) -> str:
    """Return the tree as a biorbd model of version 4 with MARKERS on each part."""
    turns = {JointKind.FREE: "xyz", JointKind.SPHERICAL: "xyz"}
    lines = ["version 4", "gravity 0 0 -9.81"]
    for link in tree.links:
        joint, body = link.joint, link.mass_properties
        lines.append(f"segment {link.part}")
        if link.parent >= 0:
            lines.append(f"parent {tree.links[link.parent].part}")
        lines += ["rtinmatrix 0", f"rt 0 0 0 xyz {_numbers(joint.position)}"]
        if joint.kind is JointKind.FREE:
            lines.append("translations xyz")
        lines += [
            f"rotations {turns.get(joint.kind, 'xyz'[int(np.argmax(joint.axis))])}",
            f"mass {body.mass!r}",
            "inertia",
        ]
        lines += [_numbers(row) for row in body.inertia]
        lines += [f"com {_numbers(body.center_of_mass)}", "endsegment"]
        for k, at in enumerate(MARKERS):
            lines += [
                f"marker {link.part}_{k}",
                f"parent {link.part}",
                f"position {_numbers(np.array(at))}",
                "endmarker",
            ]
    return "\n".join(lines) + "\n"


def table(figures: dict[str, Any]) -> Table:
    """The figures for people: a row a contestant, then where its time goes."""
    us = figures["us"]
    out = Table(title="estimator: predict and update with the covariance, all measurements of a stamp")
    for column in ("measured", "us a stamp", f"{WORST:g}th percentile", "times real time", "peer's us", "ratio"):
        out.add_column(column, justify="left" if column == "measured" else "right")
    for name, measured in (("estimator_poses", "16 poses"), ("estimator_markers", "48 markers")):
        peer = (
            [f"{us[PEER]:.0f}", f"{us[PEER] / us[name]:.2f}"]
            if PEER in us and name == RATIOS["estimator_vs_biorbd"][0]
            else []
        )
        out.add_row(measured, f"{us[name]:.0f}", f"{us[f'{name}_worst']:.0f}", f"{1e6 / RATE / us[name]:.0f}", *peer)
    for name in SPLIT:
        out.add_row(f"  16 poses: {name}", f"{us[f'estimator_poses_{name}']:.0f}")
    out.add_row("double pendulum, one pose", f"{us['estimator_double_pendulum']:.0f}")
    return out


def _numbers(values: np.ndarray) -> str:
    return " ".join(repr(float(value)) for value in values)
