"""A scene, explained in tables and figures: what is simulated, what is measured and told, what a step costs."""

import statistics
import time
from collections.abc import Sequence
from math import degrees
from typing import Any

from rich.table import Table

from physics_prior.commands.compilation import compiling
from physics_prior.commands.terminal import console, table
from physics_prior.dynamics.beside import derivatives_beside
from physics_prior.dynamics.compose import step_source, structure_of
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
from physics_prior.stepping import Choice, stable

MOST_POINTS = {"sphere": 1, "ellipsoid": 1, "capsule": 2, "box": SLOTS, "plane": SLOTS}
"""At how many points a surface can touch another."""
ROUNDS, STEPS, LINEARISATIONS = 15, 100, 10  # of timing: medians over rounds


def explain(scene: Scene, figures: dict[str, Any]) -> None:
    """Print everything about a scene, with ``scene_figures`` of it."""
    out = console()
    out.print(scene.name, style="bold")
    out.print(scene.description)
    parts = [_model(scene), _effects(figures), _measurements(scene), _readouts(scene), _state(scene, figures)]
    if figures["accuracy"] is not None:
        parts.append(_accuracy(figures["accuracy"]))
    for part in parts:
        out.print()
        out.print(part)


def scene_figures(scene: Scene, costs: Sequence[float] | None = None, choice: Choice | None = None) -> dict[str, Any]:
    """The figures of a scene, for JSON: ``effects`` in their order, ``state`` and ``step``; compiles its step if it is not yet.

    costs: what each effect adds to a step, us, where that was measured; choice: of the step, where it was chosen.
    """
    with compiling(scene, "carry"):
        simulator = scene.simulator()
        with derivatives_beside(simulator.step):
            step, with_derivatives = _cost(scene, simulator)
        follows = stable(simulator, scene.initial.q, scene.initial.v, scene.step.size)
    effects = []
    for place, effect in enumerate(scene.effects):
        equal, unequal = _rows(scene, effect)
        effects.append(
            {
                "name": effect.label,
                "kind": effect.kind,
                "why": effect.explain(scene.tree),
                "rows": equal,
                "most_rows_while_touching": unequal,
                "us_per_step": None if costs is None else costs[place],
            }
        )
    return {
        "scene": scene.name,
        "effects": effects,
        "state": {"q": simulator.nq, "v": simulator.nv, "error_state": 2 * simulator.nv},
        "constraints": {"rows": simulator.rows, "acting": simulator.switches.rows, "rank": simulator.rank},
        "step": {
            "integrator": scene.step.integrator,
            "size": scene.step.size,
            "stable": follows,
            "us": step,
            "us_with_derivatives": with_derivatives,
        },
        "accuracy": None if choice is None else choice.model_dump(exclude_unset=True),
    }


def step_text(scene: Scene) -> str:
    """The source of the scene's compiled step."""
    structure = structure_of(scene.tree, scene.effects)
    return step_source(scene.effects, structure, scene.step.integrator, scene.step.sleep is not None)


def _model(scene: Scene) -> Table:
    out = table("model", "part", "joint", "kind", "on", "mass [kg]", "q", "v", numbers=3)
    for part, joint in zip(scene.tree.parts, scene.tree.joints, strict=True):
        mass = f"{part.mass_properties.mass:.4g}"
        out.add_row(part.name, joint.name, joint.kind.name.lower(), joint.parent, mass, str(joint.nq), str(joint.nv))
    out.add_row("", "", "", "all", f"{scene.tree.mass:.4g}", str(scene.tree.nq), str(scene.tree.nv), style="bold")
    return out


def _effects(figures: dict[str, Any]) -> Table:
    columns = ("effect", "kind", "what it does", "rows", "us a step")
    out = table("effects: these and nothing else", *columns, numbers=2)
    for each in figures["effects"]:
        most, cost = each["most_rows_while_touching"], each["us_per_step"]
        rows = f"up to {most}" if most else str(each["rows"] or "")
        out.add_row(each["name"], each["kind"], each["why"], rows, _price(cost))
    if not figures["effects"]:
        out.add_row("none", "", "nothing acts on the body", "", "")
    return out


def _price(cost: float | None) -> str:
    """What an effect adds to a step, for people; what is below the clock's own noise is said to be."""
    if cost is None:
        return "see --cost"
    return f"{cost:.2f}" if abs(cost) >= 0.01 else "< 0.01"


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


def _state(scene: Scene, figures: dict[str, Any]) -> Table:
    state, step = figures["state"], figures["step"]
    out = table("state and step", "", "")
    out.add_row("state", f"q {state['q']}, v {state['v']}; error state {state['error_state']}")
    out.add_row("constraints", _constraints(figures))
    own = [topic for topic in topics_of(scene) if not topic.endswith("/stddev")]
    out.add_row("publishes", ", ".join(own) + "; of joints and forces also TOPIC/stddev")
    size = f"{step['integrator']}, {step['size'] * 1e3:g} ms"
    out.add_row(
        "step", size if step["stable"] else f"{size}: TOO LARGE, what should decay grows in it; take a smaller one"
    )
    if scene.step.sleep is not None:
        sleep = scene.step.sleep
        limits = f"slower than {sleep.velocity:g} m/s and rad/s for {sleep.duration:g} s"
        out.add_row("asleep in simulations", f"what has been {limits}, until it is touched")
    out.add_row(
        "cost of a step", f"{step['us']:.3g} us here; with its derivatives {step['us_with_derivatives']:.3g} us"
    )
    out.add_row("faster than real time", f"{step['size'] / step['us'] * 1e6:,.0f}x, one core")
    return out


def _accuracy(choice: dict[str, Any]) -> Table:
    """What was asked of the step, what was taken, and what else there was."""
    ((asked, value),) = choice["asked"].items()
    wanted = {
        "tolerance": f"an error of at most {value:g} m",
        "budget": f"at most {1e6 * value:g} us from measurement to measurement",
        "real_time_factor": f"{value:g}x real time",
    }[asked]
    cost = f"us {choice['work']}, a measurement"
    title = f"accuracy: {wanted}" + ("" if choice["kept"] else "; NO STEP KEEPS IT, this is the cheapest")
    out = table(title, "", "integrator", "step", "tolerance", "error [m]", cost, numbers=4)
    for mark, each in [("taken", choice["taken"]), *(("", other) for other in choice["others"])]:
        step = each["step"]
        tolerance = f"{step['tolerance']:g}" if "tolerance" in step else ""
        size = f"{1e3 * step['size']:.4g} ms"
        out.add_row(mark, each["scheme"], size, tolerance, f"{each['error']:.2g}", f"{each['us']:.3g}")
    span, known = choice["seconds"], choice["reference"]
    out.caption = f"errors over {span:g} s from the initial state, against a motion known to {known:.1g} m"
    out.caption_justify = "left"
    return out


def _constraints(figures: dict[str, Any]) -> str:
    most = sum(each["most_rows_while_touching"] for each in figures["effects"])
    return _equalities(figures["constraints"]) + (f"; up to {most} rows while something touches" if most else "")


def _equalities(constraints: dict[str, int]) -> str:
    total, acting, rank = constraints["rows"], constraints["acting"], constraints["rank"]
    if total == 0:
        return "none beside the joints"
    rows = f"{acting} rows of rank {rank}"
    if acting < total:
        rows += f" at the start, {total} where all holds"
    if rank < acting:
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
