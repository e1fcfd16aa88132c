"""Time the kernels on a human-like tree of 16 bodies and 35 degrees of freedom, alone or against other engines.

With --peers, Pinocchio and MuJoCo (their PyPI wheels) take turns with ours in one run on one core; a ratio above 1 means that
we are faster. Before anything is timed, the engines' results are compared.
"""

import os
import platform
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import version
from importlib.util import find_spec
from pathlib import Path
from time import perf_counter_ns
from typing import Any

import numba
import numpy as np
from rich.table import Table

from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.attachment import Attachment
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import PhysicsPriorError, SimulationError
from physics_prior.studies import bench_person
from physics_prior.studies.bench_estimator import RATIOS as ESTIMATOR_RATIOS
from physics_prior.studies.bench_estimator import time_estimator
from physics_prior.studies.bench_models import HELD_FEET, PinocchioModel, humanlike, mjcf

KERNELS_SHARE, ESTIMATOR_SHARE = 0.25, 0.55  # of the time; the rest is the person's
ROUNDS, CALLS = 200, 40  # a round times every contestant once, over so many calls
STEP_SIZE = 1e-3  # s
AGREEMENT = 1e-9  # relative: engines that differ by more do not compute the same

RATIOS = {
    "forward_dynamics_vs_pin": ("forward_dynamics", "pin.aba"),
    "held_step_vs_mujoco": ("held_step", "mujoco.mj_step"),
    "held_forward_dynamics_vs_pin": ("held_forward_dynamics", "pin.constraintDynamics"),
    "derivatives_vs_pin": ("derivatives", "pin.computeABADerivatives"),
}
"""Name of a ratio -> our contestant and the peer's."""


@dataclass(frozen=True)
class Contestant:
    """A function and two lists of arguments that its calls alternate between."""

    function: Callable[..., Any]
    arguments: Sequence[tuple[Any, ...]]


@dataclass(frozen=True)
class Posture:
    """One state and forces, in our convention: q (nq,), v (nv,), tau (nv,)."""

    q: np.ndarray
    v: np.ndarray
    tau: np.ndarray


class Ours:
    """Our simulators of the tree, free and with both feet held, and two postures that the timing alternates between.

    Both postures hold the feet at the same points; a kernel that found its last configuration again would spare itself the
    factors.
    """

    def __init__(self) -> None:
        self.tree = humanlike()
        self.gravity = np.array(Gravity().acceleration)
        rng = np.random.default_rng(0)
        start = self.tree.integrate(self.tree.neutral(), rng.normal(scale=0.3, size=self.tree.nv))
        self.free = Simulator(self.tree, [Gravity()])
        self.free.move(start, np.zeros(self.tree.nv))
        self.points = [_world_point(self.free, anchor.part, anchor.point) for anchor in HELD_FEET]
        holds = [
            Attachment(name=anchor.part, part=anchor.part, point=tuple(anchor.point), at=tuple(point))
            for anchor, point in zip(HELD_FEET, self.points, strict=True)
        ]
        self.held = Simulator(self.tree, [Gravity(), *holds], "semi_implicit_euler")
        self.postures = []
        for _ in range(2):
            q = self.tree.integrate(start, rng.normal(scale=0.05, size=self.tree.nv))
            v = rng.normal(scale=0.3, size=self.tree.nv)
            self.held.project(q, v)
            self.postures.append(Posture(q, v, rng.normal(size=self.tree.nv)))
        self.q, self.v = self.postures[0].q.copy(), self.postures[0].v.copy()

    def contestants(self) -> dict[str, Contestant]:
        """The compiled steps, called from Python on arrays that are there."""
        vdot, still = np.zeros(self.tree.nv), np.zeros(self.tree.nv)
        free, held, tangent = self.free.memory.array, self.held.memory.array, self.free.tangent_array()
        return {
            "forward_dynamics": Contestant(
                self.free.step.evaluate, [(free, p.q, p.v, p.tau, 0.0, vdot) for p in self.postures]
            ),
            "held_step": Contestant(self.held.step.advance, [(held, self.q, self.v, still, STEP_SIZE, 1)] * 2),
            "held_forward_dynamics": Contestant(
                self.held.step.evaluate, [(held, p.q, p.v, p.tau, 0.0, vdot) for p in self.postures]
            ),
            "derivatives": Contestant(
                self.free.step.differentiate_acceleration,
                [(free, tangent, p.q, p.v, p.tau) for p in self.postures],
            ),
        }

    def restart(self) -> None:
        """Put the stepped state back to the first posture."""
        self.q[:], self.v[:] = self.postures[0].q, self.postures[0].v


class Peers:
    """Pinocchio and MuJoCo on the same tree, postures and held points.

    Raises:
        SimulationError: a peer's accelerations differ from ours.
    """

    def __init__(self, ours: Ours) -> None:
        import mujoco
        import pinocchio

        self._pinocchio, self._mujoco = pinocchio, mujoco
        self._ours = ours
        self._pin = PinocchioModel(ours.tree, ours.gravity)
        self._contacts, self._contact_data = self._pin.hold(HELD_FEET, ours.points)
        self._settings = pinocchio.ProximalSettings(1e-12, 1e-12, 10)
        self._postures = [self._pin.posture(p.q, p.v, p.tau) for p in ours.postures]
        self._free = mujoco.MjModel.from_xml_string(mjcf(ours.tree, ours.gravity, STEP_SIZE))
        self._held = mujoco.MjModel.from_xml_string(mjcf(ours.tree, ours.gravity, STEP_SIZE, HELD_FEET))
        # MuJoCo takes the world's points from its zero configuration: ours are elsewhere
        for data, point in zip(self._held.eq_data, ours.points, strict=True):
            data[3:6] = point
        self._data = mujoco.MjData(self._held)
        self._compare()

    def contestants(self) -> dict[str, Contestant]:
        """Their functions, called as ours are."""
        pinocchio, model, data = self._pinocchio, self._pin.model, self._pin.data
        free = [(model, data, p.q, p.v, p.tau) for p in self._postures]
        held = [(*each, self._contacts, self._contact_data, self._settings) for each in free]
        return {
            "pin.aba": Contestant(pinocchio.aba, free),
            "mujoco.mj_step": Contestant(self._mujoco.mj_step, [(self._held, self._data)] * 2),
            "pin.constraintDynamics": Contestant(pinocchio.constraintDynamics, held),
            "pin.computeABADerivatives": Contestant(pinocchio.computeABADerivatives, free),
        }

    def restart(self) -> None:
        """Put MuJoCo's state back to the first posture."""
        self._mujoco.mj_resetData(self._held, self._data)
        self._data.qpos[:], self._data.qvel[:] = self._ours.postures[0].q, self._ours.postures[0].v

    def _compare(self) -> None:
        """Compare accelerations, free by all three engines and held by Pinocchio, and derivatives by Pinocchio."""
        ours, pin, pinocchio = self._ours, self._pin, self._pinocchio
        free_data = self._mujoco.MjData(self._free)
        for own, theirs in zip(ours.postures, self._postures, strict=True):
            free = ours.free.acceleration(own.q, own.v, own.tau)
            held = ours.held.acceleration(own.q, own.v, own.tau)
            arguments = (pin.model, pin.data, theirs.q, theirs.v, theirs.tau)
            _require("pin.aba", pinocchio.aba(*arguments), pin.acceleration(own.q, own.v, free))
            constrained = pinocchio.constraintDynamics(*arguments, self._contacts, self._contact_data, self._settings)
            _require("pin.constraintDynamics", constrained, pin.acceleration(own.q, own.v, held))
            pinocchio.computeABADerivatives(*arguments)
            derivatives = ours.free.acceleration_derivatives(own.q, own.v, own.tau)
            for name, expected, actual in zip(
                ("ddq_dq", "ddq_dv"),
                pin.acceleration_derivatives(own.q, own.v, own.tau, free, *derivatives),
                (pin.data.ddq_dq, pin.data.ddq_dv),
                strict=True,
            ):
                _require(f"pin.computeABADerivatives {name}", actual, expected)
            free_data.qpos[:], free_data.qvel[:], free_data.qfrc_applied[:] = own.q, own.v, own.tau
            self._mujoco.mj_forward(self._free, free_data)
            _require("mujoco.mj_forward", free_data.qacc, free)


def run_bench(peers: bool, progress: Callable[[float], None] = lambda share: None) -> dict[str, Any]:
    """Time ours, and with ``peers`` the others; return ``ratios``, ``us`` (medians a call), ``real_time`` and ``machine``.

    Args:
        peers: whether Pinocchio and MuJoCo, and biorbd where it is installed, take part.
        progress: is told the share that is done.

    Raises:
        PhysicsPriorError: ``pin`` or ``mujoco`` is not installed.
        SimulationError: a peer does not agree with us.
    """
    missing = [name for name in ("pinocchio", "mujoco") if peers and find_spec(name) is None]
    if missing:
        raise PhysicsPriorError(
            f"--peers needs {' and '.join(missing)}, not installed here: pip install 'physics_prior[bench]' brings them"
        )
    ours = Ours()
    contestants = ours.contestants()
    restarts = [ours.restart]
    if peers:
        theirs = Peers(ours)
        contestants |= theirs.contestants()
        restarts.append(theirs.restart)
    with one_core():
        us = _medians(contestants, restarts, lambda done, total: progress(KERNELS_SHARE * done / total))
        us |= time_estimator(peers, lambda share: progress(KERNELS_SHARE + ESTIMATOR_SHARE * share))
        us |= bench_person.time_person(
            lambda share: progress(1.0 - (1.0 - KERNELS_SHARE - ESTIMATOR_SHARE) * (1.0 - share))
        )
    ratios = {name: us[peer] / us[own] for name, (own, peer) in (RATIOS | ESTIMATOR_RATIOS).items() if peer in us}
    real_time = {bench_person.NAME: bench_person.real_time_factor(us)}
    return {"ratios": ratios, "us": us, "real_time": real_time, "machine": machine(peers)}


def table(figures: dict[str, Any]) -> Table:
    """The figures for people: one row a kernel, beside its peer."""
    out = Table(title=f"16 bodies, 35 degrees of freedom; {figures['machine']['processor']}, one core")
    out.add_column("kernel")
    out.add_column("us a call", justify="right")
    out.add_column("peer", overflow="fold")
    out.add_column("us a call", justify="right")
    out.add_column("ratio", justify="right")
    us, ratios = figures["us"], figures["ratios"]
    for name, (own, peer) in RATIOS.items():
        theirs = (peer, f"{us[peer]:.2f}", f"{ratios[name]:.2f}") if peer in us else ("", "", "")
        out.add_row(own.replace("_", " "), f"{us[own]:.2f}", *theirs)
    return out


def _medians(
    contestants: dict[str, Contestant], restarts: Sequence[Callable[[], None]], progress: Callable[[int, int], None]
) -> dict[str, float]:
    """Microseconds a call of each, taking turns, so that whatever else the machine does meets all alike."""
    times: dict[str, list[float]] = {name: [] for name in contestants}
    for done in range(ROUNDS):
        for restart in restarts:
            restart()
        for name, contestant in contestants.items():
            function, (one, other) = contestant.function, contestant.arguments
            function(*one)
            start = perf_counter_ns()
            for _ in range(CALLS // 2):
                function(*other)
                function(*one)
            times[name].append((perf_counter_ns() - start) / CALLS / 1e3)
        progress(done + 1, ROUNDS)
    return {name: float(np.median(own)) for name, own in times.items()}


@contextmanager
def one_core() -> Iterator[None]:
    """Stay on one core, where the system lets us choose."""
    if sys.platform != "linux":
        yield
        return
    before = os.sched_getaffinity(0)
    os.sched_setaffinity(0, {max(before)})
    try:
        yield
    finally:
        os.sched_setaffinity(0, before)


def machine(peers: bool) -> dict[str, Any]:
    """Processor, Python and packages, those of Pinocchio and MuJoCo with peers."""
    packages = ("numpy", "numba", *(("pin", "mujoco") if peers else ()))
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "target": numba.config.CPU_NAME or "native",
        "python": platform.python_version(),
        **{name: version(name) for name in packages},
    }


def _processor() -> str:
    """The processor's name, as far as the system tells."""
    cpuinfo = Path("/proc/cpuinfo")
    if cpuinfo.exists():
        for line in cpuinfo.read_text(encoding="utf-8").splitlines():
            if line.startswith("model name"):
                return line.split(":", 1)[1].strip()
    return platform.processor() or platform.machine()


def _world_point(simulator: Simulator, part: str, point: np.ndarray) -> np.ndarray:
    position, R = simulator.pose(part)
    return np.asarray(position + R @ point)


def _require(name: str, theirs: np.ndarray, ours: np.ndarray) -> None:
    off = float(np.max(np.abs(theirs - ours)) / np.max(np.abs(ours)))
    if not off <= AGREEMENT:
        raise SimulationError(
            f"{name} differs from ours by {off:.1e} of the largest entry: there is nothing to compare"
        )
