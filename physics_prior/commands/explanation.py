"""A scene, explained in tables: what is simulated, what is measured and told, what a step costs."""

import statistics
import time
from math import degrees

from rich.table import Table

from physics_prior.commands.compilation import compiling
from physics_prior.commands.terminal import console, table
from physics_prior.dynamics.compose import kinds_of_rows, step_source
from physics_prior.dynamics.contact.geometry.manifold import SLOTS
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects import Effect
from physics_prior.interface import topics_of
from physics_prior.scene import (
    AngleReadout,
    ForceReadout,
    JointReadout,
    JointSource,
    MeasurementSource,
    OrientationSource,
    PointReadout,
    PointsSource,
    PoseSource,
    Readout,
    Scene,
    SwitchSource,
)

MOST_POINTS = {"sphere": 1, "ellipsoid": 1, "capsule": 2, "box": SLOTS, "plane": SLOTS}
"""At how many points a surface can touch another."""
ROUNDS, STEPS, LINEARISATIONS = 15, 100, 10  # of timing: medians over rounds


def explain(scene: Scene) -> None:
    """Print everything about a scene; compiles its step where it is not yet."""
    with compiling(scene, "carry"):
        simulator = scene.simulator()
        state = _state(scene, simulator)
    out = console()
    out.print(scene.name, style="bold")
    out.print(scene.description)
    for part in (_model(scene), _effects(scene), _measurements(scene), _readouts(scene), state):
        out.print()
        out.print(part)


def step_text(scene: Scene) -> str:
    """The source of the scene's compiled step."""
    constrained, touching = kinds_of_rows(scene.tree, scene.effects)
    return step_source(scene.effects, constrained, scene.step.integrator, touching)


def _model(scene: Scene) -> Table:
    out = table("model", "part", "joint", "kind", "on", "mass [kg]", "q", "v", numbers=3)
    for part, joint in zip(scene.tree.parts, scene.tree.joints, strict=True):
        mass = f"{part.mass_properties.mass:.4g}"
        out.add_row(part.name, joint.name, joint.kind.name.lower(), joint.parent, mass, str(joint.nq), str(joint.nv))
    out.add_row("", "", "", "all", f"{scene.tree.mass:.4g}", str(scene.tree.nq), str(scene.tree.nv), style="bold")
    return out


def _effects(scene: Scene) -> Table:
    out = table("effects: these and nothing else", "effect", "kind", "what it does", "rows", numbers=1)
    for effect in scene.effects:
        equal, unequal = _rows(scene, effect)
        rows = f"up to {unequal}" if unequal else str(equal or "")
        out.add_row(effect.label, effect.kind, effect.explain(scene.tree), rows)
    if not scene.effects:
        out.add_row("none", "", "nothing acts on the body", "")
    return out


def _rows(scene: Scene, effect: Effect) -> tuple[int, int]:
    """Rows of an effect: those that hold, and at most how many while something touches (contact/geometry tells points)."""
    equal = sum(1 if pair.length is not None else len(pair.directions) for pair in effect.point_pairs(scene.tree))
    unequal = len(effect.joint_ranges(scene.tree))
    for pair in effect.touching_pairs(scene.tree):
        points = min(MOST_POINTS[surface.kind] for surface in (pair.a, pair.b))
        unequal += points * (1 + 2 * (pair.friction > 0.0) + 2 * (pair.rolling > 0.0))
    return equal, unequal


def _measurements(scene: Scene) -> Table:
    out = table("measurements", "topic", "what", "noise", "message types")
    for source in scene.measurements:
        what, noise = _measured(source)
        types = " or ".join(kind.rsplit("/", 1)[-1] for kind in source.message_types)
        out.add_row(source.topic, what, noise, types)
    if not scene.measurements:
        out.add_row("none", "", "", "")
    return out


def _measured(source: MeasurementSource) -> tuple[str, str]:
    """What a source measures and how noisily, for people."""
    match source:
        case PoseSource():
            noise = f"{source.position_noise * 1e3:.3g} mm, {degrees(source.orientation_noise):.3g} deg"
            return f"pose of {source.part}", noise
        case OrientationSource():
            return f"orientation of {source.part}", f"{degrees(source.orientation_noise):.3g} deg"
        case PointsSource():
            return f"{len(source.markers)} markers", f"{source.noise * 1e3:.3g} mm"
        case JointSource():
            return f"joints {', '.join(source.joints.values())}", f"{source.noise:.3g}"
        case SwitchSource():
            return f"force of {source.effect}", f"on above {source.above:.3g} N, off below {source.below:.3g} N"
    raise AssertionError(f"{type(source).__name__} is not described")


def _readouts(scene: Scene) -> Table:
    out = table("readouts", "name", "what")
    for readout in scene.readouts:
        out.add_row(readout.name, _read(readout))
    if not scene.readouts:
        out.add_row("none", "")
    return out


def _read(readout: Readout) -> str:
    """What a readout reads, for people."""
    match readout:
        case JointReadout():
            return f"coordinate of joint {readout.joint}"
        case AngleReadout():
            return f"angle of {readout.part} about {_axis(readout.axis)}, rad"
        case PointReadout():
            point = ", ".join(f"{number:g}" for number in readout.point)
            return f"point ({point}) of {readout.part} along {_axis(readout.axis)}, m"
        case ForceReadout():
            return f"force of {readout.constraint}, {readout.component}, N"
    return "total energy, J"


def _axis(axis: tuple[float, float, float]) -> str:
    names = {(1.0, 0.0, 0.0): "x", (0.0, 1.0, 0.0): "y", (0.0, 0.0, 1.0): "z"}
    return names.get(axis) or "({:.3g}, {:.3g}, {:.3g})".format(*axis)


def _state(scene: Scene, simulator: Simulator) -> Table:
    step, with_derivatives = _cost(scene, simulator)
    out = table("state and step", "", "")
    out.add_row("state", f"q {simulator.nq}, v {simulator.nv}; error state {2 * simulator.nv}")
    out.add_row("constraints", _constraints(scene, simulator))
    own = [topic for topic in topics_of(scene) if not topic.endswith("/stddev")]
    out.add_row("publishes", ", ".join(own) + "; of joints and forces also TOPIC/stddev")
    out.add_row("step", f"{scene.step.integrator}, {scene.step.size * 1e3:g} ms")
    out.add_row("cost of a step", f"{step:.3g} us here; with its derivatives {with_derivatives:.3g} us")
    out.add_row("faster than real time", f"{scene.step.size / step * 1e6:,.0f}x, one core")
    return out


def _constraints(scene: Scene, simulator: Simulator) -> str:
    most = sum(_rows(scene, effect)[1] for effect in scene.effects)
    return _equalities(simulator) + (f"; up to {most} rows while something touches" if most else "")


def _equalities(simulator: Simulator) -> str:
    if simulator.rows == 0:
        return "none beside the joints"
    acting = simulator.switches.rows
    rows = f"{acting} rows of rank {simulator.rank}"
    if acting < simulator.rows:
        rows += f" at the start, {simulator.rows} where all holds"
    if simulator.rank < simulator.switches.rows:
        return f"{rows}: the motion is unique, the split of forces is not (the smallest is given)"
    return rows


def _cost(scene: Scene, simulator: Simulator) -> tuple[float, float]:
    """Microseconds of a step, plain and with its derivatives: medians, from the scene's start."""
    plain, with_derivatives = [], []
    for _ in range(ROUNDS):
        q, v = scene.initial.q.copy(), scene.initial.v.copy()
        begin = time.perf_counter()
        simulator.advance(q, v, scene.step.size, STEPS)
        between = time.perf_counter()
        for _ in range(LINEARISATIONS):
            simulator.linearise(q, v, scene.step.size, scene.noise.force)
        plain.append((between - begin) / STEPS)
        with_derivatives.append((time.perf_counter() - between) / (LINEARISATIONS))
    return 1e6 * statistics.median(plain), 1e6 * statistics.median(with_derivatives)
