"""Contact, friction and stops: what rests stays at rest, what bounces ends, and nothing gains energy."""

import numpy as np

from physics_prior.studies.problems.mechanism import Mechanism
from physics_prior.studies.problems.touching import (
    EDGE,
    RADIUS,
    block_on_incline,
    bouncing_ball,
    stack,
    stopped_arm,
    stopped_pendulum,
)
from physics_prior.studies.stability.case import Check, Curve, Measurements, Picture, case

G = 9.81
STEP = 1e-3  # s


@case(15, "A heavy box on a light one, 100 : 1 and 1000 : 1", "dart #3442: sinks in fully from 100 : 1 on")
def heavy_on_light(thorough: bool) -> Measurements:
    """1 s at rest: how far the boxes sink into each other and into the ground, and how far they slip."""
    curves = []
    for ratio in (100.0, 1000.0):
        run, sunk, times = stack(1.0, ratio).run(), [], []
        for _ in range(100):
            run.advance(STEP, 10)
            low, high = run.q[2], run.q[9]
            sunk.append(max(0.5 * EDGE - low, EDGE - (high - low)))
            times.append(run.time)
        slip = float(np.max(np.abs(run.q[[0, 1, 7, 8]])))
        yield Check(f"overlap over 1 s, {ratio:g} : 1", max(sunk), 1e-4, "m")
        yield Check(f"slip over 1 s, {ratio:g} : 1", slip, 1e-4, "m")
        curves.append(Curve(f"{ratio:g} : 1", np.array(times), np.maximum(sunk, 1e-17)))
    yield Picture(
        "heavy_on_light",
        "Heavy box on a light one: overlap",
        "time [s]",
        "overlap [m]",
        curves,
        "y",
        (("bound", 1e-4),),
    )


@case(
    26,
    "A joint's stop, hit and rested on",
    "MuJoCo overshoots by 0.034 rad, set to its hardest 1.7e-3",
)
def joint_stop(thorough: bool) -> Measurements:
    """A rod that falls onto a stop and stays there, and a double pendulum whose upper rod does."""
    stop, curves = 0.3, []
    for name, mechanism in (
        ("rod", stopped_pendulum(stop)),
        ("rod that bounces", stopped_pendulum(stop, 0.5)),
        ("double pendulum", stopped_arm(stop)),
    ):
        times, angles, rates, energies = _followed(mechanism, 4.0)
        yield Check(f"overshoot, {name}", max(0.0, stop - float(angles.min())), 1e-3, "rad")
        if name != "double pendulum":
            rise = float(np.max(np.diff(energies))) / G
            yield Check(f"largest rise of the energy in a step, {name}, of its weight times 1 m", rise, 1e-9)
            late = rates[times > 3.0]
            yield Check(
                f"changes of sign of the rate after 3 s, {name}", float(np.sum(np.diff(np.sign(late)) != 0.0)), 0.0
            )
            yield Check(f"largest rate after 3 s, {name}", float(np.max(np.abs(late))), 1e-9, "rad/s")
        else:
            rise = float(np.max(energies - energies[0])) / (2.0 * G)
            yield Check(f"energy above that of the start, {name}, of its weight times 1 m", rise, 1e-6)
        curves.append(Curve(name, times, angles))
    yield Picture(
        "joint_stop",
        "Falling onto a joint's stop",
        "time [s]",
        "angle [rad]",
        curves,
        "",
        (("stop", stop), ("MuJoCo's default passes it to", stop - 0.034)),
    )


def _followed(mechanism: Mechanism, seconds: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Times, first coordinate and rate, and energy, each (k,), step by step."""
    run = mechanism.run()
    rows = [(0.0, run.q[0], run.v[0], run.energy())]
    for _ in range(round(seconds / STEP)):
        run.advance(STEP)
        rows.append((run.time, run.q[0], run.v[0], run.energy()))
    times, angles, rates, energies = np.array(rows).T
    return times, angles, rates, energies


@case(
    27,
    "A bouncing ball comes to rest (Zeno), e = 0.5, 0.9",
    "drake PR #7943",
)
def zeno_ball(thorough: bool) -> Measurements:
    """Dropped from 1 m: every bounce is e^2 as high, and the ball rests after t1 (1 + e) / (1 - e)."""
    curves, first = [], np.sqrt(2.0 / G)
    for e in (0.5, 0.9):
        ends = first * (1.0 + e) / (1.0 - e)
        run = bouncing_ball(e).run()
        rows = [(0.0, run.q[2] - RADIUS, run.v[2])]
        for _ in range(round(1.2 * ends / STEP)):
            run.advance(STEP)
            rows.append((run.time, run.q[2] - RADIUS, run.v[2]))
        times, heights, rates = np.array(rows).T
        tops = _tops(heights, rates)
        tops = tops[tops > 1e-3]
        expected = e ** (2.0 * np.arange(len(tops)))
        yield Check(
            f"height of {len(tops)} bounces less e^2 each, e = {e}", float(np.max(np.abs(tops / expected - 1.0))), 1e-2
        )
        moving = times[np.abs(rates) > 1e-9]
        yield Check(
            f"time at which it rests less t1 (1 + e)/(1 - e), e = {e}, relative",
            abs(float(moving[-1]) / ends - 1.0),
            1e-2,
        )
        yield Check(f"deepest point, e = {e}", max(0.0, -float(heights.min())), 1e-4, "m")
        curves.append(Curve(f"e = {e}", times, heights))
    yield Picture("zeno_ball", "A ball that bounces for ever shorter times", "time [s]", "height [m]", curves)


def _tops(heights: np.ndarray, rates: np.ndarray) -> np.ndarray:
    """Heights to which energy would carry the ball between one impact and the next, the first of its fall, m."""
    reach = heights + rates**2 / (2.0 * G)
    ups = np.flatnonzero((rates[:-1] < 0.0) & (rates[1:] > 0.0)) + 1
    return np.concatenate([reach[:1], reach[ups]])


@case(28, "A block on an incline, friction 1 % off its slope", "textbook")
def incline(thorough: bool) -> Measurements:
    """It sticks, or slides with g sin(slope) / 100."""
    curves = []
    for slope in np.radians((10.0, 30.0)):
        for share in (1.01, 0.99):
            run = block_on_incline(float(slope), share * float(np.tan(slope))).run()
            start, times, rates = run.q[:3].copy(), [], []
            for _ in range(100):
                run.advance(STEP, 10)
                times.append(run.time)
                rates.append(float(np.linalg.norm(run.v[:3])))
            angle = np.degrees(slope)
            if share > 1.0:
                yield Check(f"largest speed, friction 1 % above {angle:.0f} deg", max(rates), 1e-6, "m/s")
                yield Check(
                    f"way in 1 s, friction 1 % above {angle:.0f} deg",
                    float(np.linalg.norm(run.q[:3] - start)),
                    1e-6,
                    "m",
                )
            else:
                exact = G * (np.sin(slope) - share * np.tan(slope) * np.cos(slope))
                slides = float(np.polyfit(times, rates, 1)[0])
                yield Check(
                    f"acceleration, friction 1 % below {angle:.0f} deg, relative", abs(slides / exact - 1.0), 1e-2
                )
            curves.append(
                Curve(
                    f"{angle:.0f} deg, friction {'above' if share > 1.0 else 'below'}", np.array(times), np.array(rates)
                )
            )
    yield Picture("incline", "A block on an incline, friction 1 % above and below", "time [s]", "speed [m/s]", curves)
