"""Fast spin: tops that are held and tops that fly, bodies made of two, and the norm of quaternions."""

import numpy as np
from scipy.special import ellipk, ellipkinc

from physics_prior import inertia, rotations
from physics_prior.effects import Effect
from physics_prior.effects.attachment import Weld
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.mechanism import Mechanism, turn
from physics_prior.studies.problems.tops import FLIP_PERIOD, free_top, heavy_top
from physics_prior.studies.stability.case import Check, Curve, Measurements, Picture, case


@case(
    10,
    "Heavy top at 150 rad/s, 1 s",
    "energy, 1 ms: MuJoCo RK4 5e-6, implicit 4.8e-2, Euler 3.8e7",
)
def fast_heavy_top(thorough: bool) -> Measurements:
    """Bruels, Cardona and Arnold: attitude and energy."""
    benchmark = heavy_top()
    run, energies = benchmark.run(), []
    times = 1e-3 * np.arange(1, 1001)
    start = run.energy()
    for time in times:
        run.to(float(time), 1e-3)
        energies.append(abs(run.energy() - start) / abs(start))
    yield Check("attitude after 1 s, RK4, 1 ms", turn(run.q, benchmark.values[-1]), 5e-4, "rad")
    yield Check("energy over 1 s, RK4, 1 ms, relative", max(energies), 1e-5)
    _, best = benchmark.errors(benchmark.run(), 5e-5)
    yield Check("attitude over 1 s, RK4, 0.05 ms", float(best.max()), 1e-7, "rad")
    euler, spun = benchmark.run("semi_implicit_euler"), []
    for time in times:
        euler.to(float(time), 1e-3)
        spun.append(abs(euler.energy() - start) / abs(start))
    yield Picture(
        "heavy_top",
        "Heavy top at 150 rad/s, steps of 1 ms: energy",
        "time [s]",
        "energy error, relative",
        [Curve("RK4", times, np.array(energies)), Curve("semi-implicit Euler", times, np.array(spun))],
        "y",
        (("bound", 1e-5), ("MuJoCo RK4", 5.2e-6), ("MuJoCo implicit", 4.8e-2), ("MuJoCo Euler", 3.8e7)),
    )


@case(
    11,
    "Dzhanibekov's flips for 50 s",
    "MuJoCo Euler 2.1e-2 rad, 0.58 % of energy in 5 s; avian #993",
)
def dzhanibekov(thorough: bool) -> Measurements:
    """Momentum, energy and the moments of the flips, against their elliptic functions."""
    benchmark = free_top()
    moments = np.array([1.0, 2.0, 3.0])
    run = benchmark.run()
    samples = [run.q[3:].copy()]
    rates = [run.v[3:].copy()]
    for _ in range(50_000):
        run.advance(1e-3)
        samples.append(run.q[3:].copy())
        rates.append(run.v[3:].copy())
    w, times = np.array(rates), 1e-3 * np.arange(50_001)
    momentum = rotations.rotate(np.array(samples), moments * w)
    length = float(np.linalg.norm(momentum[0]))
    yield Check("angular momentum in the world, relative", _worst(momentum - momentum[0]) / length, 1e-10)
    energy = 0.5 * np.sum(moments * w * w, axis=1)
    yield Check("energy, relative", _worst(energy[:, None] - energy[0]) / energy[0], 1e-10)
    excess = energy - length**2 / (2.0 * moments[1])
    yield Check("drift to the steady spin, of the distance from it", _worst((excess / excess[0] - 1.0)[:, None]), 1e-3)
    flips = _crossings(times, w[:, 1])
    expected = _flip_times(moments, w[0])[: len(flips)]
    yield Check(f"times of {len(flips)} flips", _worst((flips - expected)[:, None]), 1e-3, "s")
    cycle = (flips[-1] - flips[0]) / (len(flips) - 1) * 2.0
    yield Check("cycle of two flips", abs(cycle - FLIP_PERIOD), 1e-3, "s")
    yield Check("flips that did not come", float(len(_flip_times(moments, w[0])) - len(flips)), 0.0)
    _, best = benchmark.errors(benchmark.run(), 1e-3)
    yield Check("attitude over 50 s, RK4, 1 ms", float(best.max()), 1e-5, "rad")
    yield Picture(
        "dzhanibekov",
        "Free body spun about its middle axis: it flips for ever",
        "time [s]",
        "rate about the middle axis [rad/s]",
        [
            Curve("RK4, 1 ms", times[::20], w[::20, 1]),
            Curve("flips as Jacobi's functions have them", expected, np.zeros(len(expected)), dots=True),
        ],
    )


def _worst(vectors: np.ndarray) -> float:
    """Length of the longest of vectors (k, n)."""
    return float(np.max(np.linalg.norm(vectors, axis=1)))


def _crossings(times: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Times at which values (k,) change their sign, between samples by a straight line."""
    before = np.flatnonzero(np.sign(values[:-1]) * np.sign(values[1:]) < 0.0)
    share = values[before] / (values[before] - values[before + 1])
    return np.asarray(times[before] + share * (times[before + 1] - times[before]))


def _flip_times(moments: np.ndarray, w: np.ndarray) -> np.ndarray:
    """When the rate about the middle axis changes its sign within 50 s (Landau and Lifshitz 1976, section 37).

    With L^2 > 2 T I2 it is b sn(p t + u), so that it vanishes at p t + u = 2 K, 4 K, ...
    """
    a, b, c = moments
    twice_energy, square = float(np.sum(moments * w * w)), float(np.sum((moments * w) ** 2))
    low, high = square - twice_energy * a, twice_energy * c - square
    p, m = np.sqrt((c - b) * low / (a * b * c)), (b - a) * high / ((c - b) * low)
    begin = ellipkinc(np.arcsin(w[1] / np.sqrt(high / (b * (c - b)))), m)
    times = (2.0 * ellipk(m) * np.arange(1, 20) - begin) / p
    return np.asarray(times[times < 50.0])


@case(
    12,
    "One body, or two joined or welded, at 60 rad/s",
    "mujoco #3553: BADQACC when nested",
)
def welded(thorough: bool) -> Measurements:
    """The same body three ways: one part, two parts on a fixed joint, two free parts held by a weld."""
    core, wing = inertia.box(1.0, (0.3, 0.2, 0.1)), inertia.box(0.4, (0.1, 0.4, 0.05))
    place, tilt = np.array([0.2, 0.1, 0.05]), rotations.exp([0.3, -0.5, 0.7])
    moved = wing.transformed(rotations.matrix_from_quaternion(tilt), place)
    flight, wing_flight = (Joint(f"{name}_flight", JointKind.FREE, "world", name) for name in ("core", "wing"))
    pinned = Joint("wing_mount", JointKind.FIXED, "core", "wing", place, tilt)
    v = np.array([0.1, 0.2, 0.3, 60.0, 5.0, -10.0])
    one = Mechanism(
        one_tree := Tree([Part("core", inertia.combine([core, moved]))], [flight]), (), one_tree.neutral(), v
    )
    nested = Tree([Part("core", core), Part("wing", wing)], [flight, pinned])
    two = Tree([Part("core", core), Part("wing", wing)], [flight, wing_flight])
    weld = Weld(part="wing", to="core", at=tuple(place), orientation=tuple(tilt))
    w_wing = rotations.rotate(rotations.conjugate(tilt), v[3:])
    v_wing = v[:3] + np.cross(v[3:], place)
    joined: tuple[Effect, ...] = (weld,)
    both = Mechanism(two, joined, np.concatenate([one.q, place, tilt]), np.concatenate([v, v_wing, w_wing]))
    seconds, h = (1.0 if thorough else 0.2), 5e-5
    runs = {"by a fixed joint": Mechanism(nested, (), one.q, v).run(), "by a weld": both.run()}
    whole = one.run()
    whole.to(seconds, h)
    for how, run in runs.items():
        run.to(seconds, h)
        apart = max(float(np.linalg.norm(run.q[:3] - whole.q[:3])), turn(run.q[3:7], whole.q[3:7]))
        yield Check(f"pose after {seconds:g} s, two parts {how}, {1e3 * h:g} ms, m or rad", apart, 1e-10)


@case(22, "Norm of quaternions over 1e6 steps", "drake #14800, pinocchio #328")
def quaternion_norm(thorough: bool) -> Measurements:
    """Quaternions stay unit; one that is not at the start moves as if it were."""
    for name, mechanism in (("free top", free_top()), ("heavy top", heavy_top())):
        run, worst = mechanism.run(), 0.0
        for _ in range(100):
            run.advance(1e-3, 10_000 if thorough else 200)
            worst = max(worst, abs(float(np.linalg.norm(run.q[-4:])) - 1.0))
        yield Check(f"norm less 1, over the steps, {name}", worst, 1e-12)
    for off in (1e-3, -1e-3):
        mechanism = heavy_top()
        right, scaled = mechanism.run(), mechanism.run()
        scaled.q *= 1.0 + off
        for run in (right, scaled):
            run.advance(1e-4, 100)
        apart = float(np.max(np.abs(right.q - scaled.q)))
        yield Check(f"motion from a norm of {1.0 + off:g} less that from 1", apart, 1e-12)
