"""Run every variant on simulated recordings: error, consistency and force error against microseconds a measurement."""

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from time import thread_time_ns
from typing import Any

import numpy as np
from rich.table import Table

from physics_prior.errors import PhysicsPriorError
from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.filter import Posterior
from physics_prior.estimation.lagged import Lagged
from physics_prior.estimation.measurement import Measurement
from physics_prior.estimation.square_root import normalised_error
from physics_prior.model import JointKind
from physics_prior.recording.replay import replay
from physics_prior.recording.simulate import Moment
from physics_prior.scene import Scene
from physics_prior.studies.effects.likelihood import read_measurements
from physics_prior.studies.estimator.variants import PROBLEMS, STEPS, VARIANTS, Variant
from physics_prior.studies.moving_human import moments

SECONDS, SETTLED = 8.0, 0.4  # s, and s of the beginning that do not count
WARMING = 8  # stamps that compile what is not yet
REMEMBERED = 1.0  # s, beyond a lag, by an estimator that is timed: as live
FOREVER = 1e6  # s
PAYING = 1.02  # times the errors of the most accurate steps: within it, noise is all that is left


@dataclass(frozen=True)
class Point:
    """What a variant costs and gives on a problem.

    Attributes:
        us: microseconds of the processor a measurement, the median.
        rmse_deg: of all turning freedoms, deg.
        consistency: normalised estimation error squared over its degrees of freedom, or, of a recording, innovation squared
            (NIS) over its expectation: 1 where the covariance is right.
        force_percent: error of the joints' forces, percent of the weight; nan where the process knows none.
    """

    problem: str
    series: str
    label: str
    us: float
    rmse_deg: float
    consistency: float
    force_percent: float


def run_study(names: Sequence[str], seed: int, progress: Callable[[float], None]) -> list[Point]:
    """Measure every variant on problems by name; all where none is given.

    Raises:
        PhysicsPriorError: a name that is none; SimulationError: a motion that cannot be computed.
    """
    for name in names:
        if name not in PROBLEMS:
            raise PhysicsPriorError(f"problem '{name}' is unknown: known are {list(PROBLEMS)}")
    chosen, out = names or list(PROBLEMS), []
    for index, name in enumerate(chosen):
        scene = PROBLEMS[name]()
        recording = moments(scene, SECONDS, seed)
        costs = costs_of(scene, VARIANTS, [moment.measurements for moment in recording])
        for done, (variant, us) in enumerate(zip(VARIANTS, costs, strict=True)):
            out.append(measure(name, scene, variant, recording, us))
            progress((index + (done + 1) / len(VARIANTS)) / len(chosen))
    return out


def measure(name: str, scene: Scene, variant: Variant, recording: Sequence[Moment], us: float) -> Point:
    """Run one variant, whose cost is known, on a recording."""
    fed, measured = _Fed(scene, variant, FOREVER), recording[:: variant.every]
    for moment in measured:
        fed.feed(moment.measurements)
    true = {moment.stamp: moment for moment in measured}
    begun = recording[0].stamp + round(SETTLED * 1e9)
    pairs = [(true[stamp], posterior) for stamp, posterior in fed.told().items() if stamp >= begun]
    rmse, nees, force = _errors(fed.estimator, pairs)
    return Point(name, variant.series, variant.label, us, rmse, nees, force)


class _Fed:
    """An estimator run as a variant says, that remembers what was measured for some seconds."""

    def __init__(self, scene: Scene, variant: Variant, seconds: float) -> None:
        self.estimator = Estimator(variant.of(scene), variant.process, seconds)
        self._lag = round(variant.lag * 1e9)
        self._lagged = Lagged(self.estimator, self._lag, FOREVER)
        self._told: dict[int, Posterior] = {}

    def feed(self, measurements: Sequence[Measurement]) -> float:
        """Take in what was measured at a stamp; return the microseconds of the processor that one measurement took."""
        start = thread_time_ns()
        for measurement in measurements:
            self.estimator.add(measurement)
        due = list(self._lagged.due(measurements[-1].stamp)) if self._lag > 0 else []
        taken = (thread_time_ns() - start) / 1e3 / len(measurements)
        self._told |= {each.stamp: each for each in due}
        return taken

    def told(self) -> dict[int, Posterior]:
        """The posterior of each stamp, told by its lag."""
        if self._lag > 0:
            return self._told
        return {node.measurement.stamp: node.posterior for node in self.estimator.history.nodes}


def costs_of(scene: Scene, variants: Sequence[Variant], stamps: Sequence[Sequence[Measurement]]) -> list[float]:
    """Microseconds of the processor that each variant takes a measurement: medians, all taking turns at every stamp.

    In another order each time: a turn is the slower for the memory that the one before it took from the caches.
    """
    order = np.random.default_rng(0)
    for warm in (True, False):  # what is not compiled yet is so the first time
        fed = [_Fed(scene, variant, REMEMBERED + variant.lag) for variant in variants]
        times: list[list[float]] = [[] for _ in variants]
        for index, measurements in enumerate(stamps[:WARMING] if warm else stamps):
            for turn in order.permutation(len(variants)):
                if index % variants[turn].every == 0:
                    times[turn].append(fed[turn].feed(measurements))
    return [float(np.median(taken)) for taken in times]


def run_recording(bag: Path, scene: Scene, reference: str, progress: Callable[[float], None]) -> list[Point]:
    """Replay a recording by every step, and without physics, against a JointState topic.

    Raises:
        RecordingError: as of ``replay``; SimulationError: a motion that cannot be computed.
    """
    out, stamps = [], _measured(bag, scene)
    variants = [*STEPS, Variant(process="kinematic")]
    costs = costs_of(scene, variants, stamps)
    for done, (variant, us) in enumerate(zip(variants, costs, strict=True)):
        figures = replay(bag, variant.of(scene), process=variant.process, references=[reference]).summary()
        score, nis = figures["reference"] or {}, figures["nis"]
        angles, forces = (_number(score.get(key)) for key in ("position_rmse_deg", "force_rmse_percent_weight"))
        consistency = nis["mean"] / nis["expected"] if nis["mean"] is not None else float("nan")
        out.append(Point(scene.name, variant.series, variant.label, us, angles, consistency, forces))
        progress((done + 1) / len(variants))
    return out


def _measured(bag: Path, scene: Scene) -> list[list[Measurement]]:
    """What a recording measured, stamp by stamp."""
    stamps: dict[int, list[Measurement]] = {}
    for measurement in read_measurements(bag, scene):
        stamps.setdefault(measurement.stamp, []).append(measurement)
    return list(stamps.values())


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


def _errors(estimator: Estimator, pairs: Sequence[tuple[Moment, Posterior]]) -> tuple[float, float, float]:
    """Root mean square error, deg; mean NEES over its degrees of freedom; force error, percent of the weight."""
    simulator, process = estimator.simulator, estimator.filter.process
    turning = np.zeros(simulator.nv, dtype=bool)
    for link in simulator.tree.links:
        turning[link.v][-3:] = link.joint.kind is not JointKind.PRISMATIC
    squares, nees, freedom, forces = [], 0.0, 0, []
    for moment, posterior in pairs:
        state, n = posterior.state, 2 * simulator.nv
        error = process.difference(state, process.start(moment.q, moment.v))[:n]
        squares.append(error[: simulator.nv][turning] ** 2)
        value, rank = normalised_error(posterior.factor[:n], error)
        nees, freedom = nees + value, freedom + rank
        if not len(state.acceleration):
            estimator.filter.enter(posterior)
            off = simulator.wrench_array(moment.q, moment.v) - simulator.wrench_array(state.q, state.v)
            forces.append(np.sum(off[:, :3] ** 2, axis=1))
    weight = simulator.tree.mass * 9.81
    force = 100.0 * float(np.sqrt(np.mean(forces))) / weight if forces else float("nan")
    return float(np.degrees(np.sqrt(np.mean(squares)))), nees / freedom, force


def enough(points: Sequence[Point], problem: str) -> Point:
    """The cheapest of a problem's steps that is as good as the shortest of Runge and Kutta's, within PAYING.

    In angles, in forces and in how far its covariance can be trusted: more accurate steps gain what noise hides.

    Raises:
        PhysicsPriorError: the errors are not known.
    """
    own = [point for point in points if point.problem == problem and point.series in ("rk4", "semi_implicit_euler")]
    finest = [point for point in own if point.series == "rk4"][-1]
    if np.isnan(finest.rmse_deg):
        raise PhysicsPriorError(f"'{problem}' has no angles to score: give a --reference topic that names its joints")

    def worse(point: Point) -> bool:
        return any(
            getattr(point, key) > PAYING * getattr(finest, key) for key in ("rmse_deg", "force_percent", "consistency")
        )

    return min((point for point in own if not worse(point)), key=lambda point: point.us)


def card(points: Sequence[Point]) -> dict[str, Any]:
    """Every figure, for JSON; None where there is none."""
    rows = [{key: None if value != value else value for key, value in asdict(point).items()} for point in points]
    problems = dict.fromkeys(point.problem for point in points)
    return {"points": rows, "enough": {name: asdict(enough(points, name)) for name in problems}}


def table(points: Sequence[Point]) -> Table:
    """The figures for people; what is enough is marked."""
    out = Table(
        title=f"what accuracy costs the estimator; * is enough: cheapest step within {100 * (PAYING - 1):.0f} % of the finest"
    )
    for column in ("problem", "by", "", "us a measurement", "RMSE, deg", "consistency", "force, % of weight"):
        out.add_column(column, justify="left" if column in ("problem", "by") else "right")
    for point in points:
        mark = "*" if point == enough(points, point.problem) else ""
        force = "" if np.isnan(point.force_percent) else f"{point.force_percent:.3g}"
        out.add_row(
            point.problem,
            point.series,
            point.label + mark,
            f"{point.us:.0f}",
            f"{point.rmse_deg:.4g}",
            f"{point.consistency:.2f}",
            force,
        )
    return out
