"""Very light on very heavy, very small beside very large, and many in a row."""

from time import perf_counter_ns

import numpy as np

from physics_prior.effects.attachment import Attachment
from physics_prior.errors import SimulationError
from physics_prior.inertia import MassProperties
from physics_prior.model import Joint, JointKind, Part, Tree
from physics_prior.studies.problems.chain import arm, chain, hung_human, scaled, thrown_human
from physics_prior.studies.problems.four_bar import four_bar
from physics_prior.studies.problems.mechanism import Mechanism, Run
from physics_prior.studies.problems.pendulum import DOWN, double_pendulum, uneven_pendulum
from physics_prior.studies.stability.case import Check, Curve, Measurements, Picture, case

ROUNDS, BURST = 1000, 4  # of timing: how often, and how many steps


def energies(run: Run, seconds: float, h: float, samples: int = 100) -> tuple[np.ndarray, np.ndarray, float]:
    """Times (k,), energies less the first (k,), J, and the largest kinetic energy, J, of a run."""
    times, found, moving = [run.time], [run.energy()], run.kinetic_energy()
    for k in range(1, samples + 1):
        run.to(seconds * k / samples, h)
        times.append(run.time)
        found.append(run.energy())
        moving = max(moving, run.kinetic_energy())
    return np.array(times), np.array(found) - found[0], moving


@case(13, "Mass ratios of 1e6 and 1e9 in a chain", "MuJoCo RK4 2.2e-12 at 1e6")
def mass_ratios(thorough: bool) -> Measurements:
    """Double pendulums, heavy above and heavy below; energy error of the largest kinetic energy."""
    for ratio in (1e6, 1e9):
        for name, masses in (("below", (1.0, ratio)), ("above", (ratio, 1.0))):
            _, error, moving = energies(uneven_pendulum(*masses).run(), 10.0, 1e-3)
            what = f"energy over 10 s, {ratio:.0e} times as heavy {name}, relative"
            yield Check(what, float(np.max(np.abs(error))) / moving, 1e-8)


@case(
    14,
    "Mass ratio of 1e6 through attachments",
    "MuJoCo's joint opens 1.3e-3 to 0.15 m; Jolt #1392",
)
def attached_mass_ratios(thorough: bool) -> Measurements:
    """The same pendulums as free bodies, held by attachments, in 3D: the gap of the joints, and the tree's motion."""
    seconds = 10.0 if thorough else 2.0
    for name, masses in (("below", (1.0, 1e6)), ("above", (1e6, 1.0))):
        run, tree = _loose_pendulum(*masses).run(), uneven_pendulum(*masses).run()
        gap = apart = 0.0
        for k in range(1, 101):
            for each in (run, tree):
                each.to(seconds * k / 100.0, 1e-3)
            gap = max(gap, run.residual())
            tips = [each.point("lower", (0.0, -1.0, 0.0)) for each in (run, tree)]
            apart = max(apart, float(np.linalg.norm(tips[0] - tips[1])))
        yield Check(f"gap of the joints over {seconds:g} s, heavy {name}, of a rod's length", gap, 1e-6)
        yield Check(f"tip less that of the tree, heavy {name}", apart, 1e-6, "m")


def _loose_pendulum(upper: float, lower: float) -> Mechanism:
    """The uneven pendulum of free bodies."""
    tree = uneven_pendulum(upper, lower).tree
    flights = [Joint(f"{part.name}_flight", JointKind.FREE, "world", part.name) for part in tree.parts]
    first, second = (np.array([np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)]) for angle in (0.5, 1.0))
    elbow = np.array([np.sin(0.5), -np.cos(0.5), 0.0])
    q = np.concatenate([np.zeros(3), first, elbow, second])
    held = (
        Attachment(name="shoulder", part="upper"),
        Attachment(name="elbow", part="lower", to="upper", at=(0.0, -1.0, 0.0)),
    )
    # a thin rod has no inertia about its own axis, which nothing else gives a free one
    parts = [
        Part(part.name, MassProperties(part.mass_properties.mass, part.mass_properties.center_of_mass, _thick(part)))
        for part in tree.parts
    ]
    return Mechanism(Tree(parts, flights), (DOWN, *held), q, np.zeros(12))


def _thick(part: Part) -> np.ndarray:
    """The inertia of a rod with some about its axis, which is y."""
    return part.mass_properties.inertia + 1e-3 * part.mass_properties.mass * np.diag([0.0, 1.0, 0.0])


@case(
    16,
    "A chain of 100 links",
    "MuJoCo: 26 to 35 times the cost of 10 links; bullet3 #471",
)
def long_chain(thorough: bool) -> Measurements:
    """10 m of chain, let go from 45 deg; energy error of the largest kinetic energy, and what ten times the links cost."""
    run = chain(100).run()
    times, error, moving = energies(run, 10.0 if thorough else 0.5, 1e-3)
    yield Check(f"energy over {times[-1]:g} s, RK4, 1 ms, relative", float(np.max(np.abs(error))) / moving, 1e-6)
    if thorough:
        yield Check("cost of a step, 100 links over 10", _cost_ratio(), 12.0)
    yield Picture(
        "chain",
        "Chain of 100 links, RK4, 1 ms: energy",
        "time [s]",
        "energy error, of the largest kinetic energy",
        [Curve("100 links", times[1:], np.maximum(np.abs(error[1:]) / moving, 1e-17))],
        "y",
        (("bound", 1e-6),),
    )


def _cost_ratio() -> float:
    """Median time of a step of 100 links over that of 10, swinging, in turns and in bursts too short to be disturbed."""
    runs, taken = (chain(10).run(), chain(100).run()), np.zeros((2, ROUNDS))
    for run in runs:
        run.to(1.0, 1e-3)
    for turn in range(ROUNDS):
        for own, run in zip(taken, runs, strict=True):
            q, v = run.q.copy(), run.v.copy()
            run.simulator.advance(q, v, 1e-4)
            begin = perf_counter_ns()
            run.simulator.advance(q, v, 1e-4, BURST)
            own[turn] = perf_counter_ns() - begin
    short, long = np.median(taken, axis=1)
    return float(long / short)


@case(17, "Arms and people let go", "newton #4269: NaN within 0.27 s")
def let_go(thorough: bool) -> Measurements:
    """10 s without friction, hands at their ends as light as 10 g: finite, and where the steps are small, right."""
    for name, mechanism in (("arm of 7", arm()), ("hung human", hung_human()), ("thrown human", thrown_human())):
        lost = 0
        for h in (1e-3, 5e-3):
            try:
                mechanism.run().to(10.0, h)
            except SimulationError:
                lost += 1
        yield Check(f"10 s that were not finite, of 1 and 5 ms, {name}", float(lost), 0.0)
        _, error, moving = energies(mechanism.run(), 2.0, 1e-4 if thorough else 5e-4, 20)
        yield Check(f"energy over 2 s, small steps, {name}, relative", float(np.max(np.abs(error))) / moving, 1e-6)


@case(25, "Tiny links, and other units", "mujoco #168, #989")
def scales(thorough: bool) -> Measurements:
    """A link of 1e-12 of its neighbour's inertia; the same motion in millimetres and grams, and in kilometres and tons."""
    for name, mechanism in (("at the tip", _tiny(at_tip=True)), ("between", _tiny(at_tip=False))):
        _, error, moving = energies(mechanism.run(), 2.0, 1e-4, 50)
        what = f"energy over 2 s, a link of 1e-12 of the inertia {name}, relative"
        yield Check(what, float(np.max(np.abs(error))) / moving, 1e-6)
    for length, mass, units in ((1e3, 1e3, "mm, g"), (1e-3, 1e-3, "km, t")):
        for name, own in (
            ("double pendulum", double_pendulum()),
            ("hung human", hung_human()),
            ("four-bar", four_bar(1)),
        ):
            plain, other = own.run(), scaled(own, length, mass).run()
            for run in (plain, other):
                run.to(1.0, 1e-3)
            apart = float(np.max(np.abs(plain.q - other.q)))
            yield Check(f"angles after 1 s in {units} less those in m, kg, {name}", apart, 1e-9, "rad")


def _tiny(at_tip: bool) -> Mechanism:
    """Rods in a row, 1 m and 1 kg, one of them 1 cm and 1e-8 kg: 1e-12 of the inertia."""
    sizes = ((1.0, 1.0), (1e-8, 1e-2)) if at_tip else ((1.0, 1.0), (1e-8, 1e-2), (1.0, 1.0))
    parts, joints = [], []
    for i, (mass, length) in enumerate(sizes):
        body = MassProperties(
            mass, np.array([0.0, -0.5 * length, 0.0]), mass * length**2 / 12.0 * np.diag([1.0, 0.0, 1.0])
        )
        place = np.array([0.0, -sizes[i - 1][1], 0.0]) if i else np.zeros(3)
        parts.append(Part(f"rod{i}", body))
        joints.append(Joint(f"joint{i}", JointKind.REVOLUTE, f"rod{i - 1}" if i else "world", f"rod{i}", place))
    return Mechanism(Tree(parts, joints), (DOWN,), np.full(len(sizes), 0.4), np.zeros(len(sizes)))
