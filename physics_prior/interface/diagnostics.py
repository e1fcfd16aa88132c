"""Diagnostics out: health with its cause, and the numbers that tell why."""

from collections.abc import Mapping

from physics_prior.dynamics.simulator import Simulator
from physics_prior.estimation.estimate import Counts, Estimate, Health
from physics_prior.recording.messages import DiagnosticArray, DiagnosticStatus, Header, KeyValue
from physics_prior.scene import Scene


def diagnostics(
    header: Header,
    scene: Scene,
    simulator: Simulator,
    health: Health,
    counts: Counts,
    estimate: Estimate | None,
    more: Mapping[str, object],
) -> DiagnosticArray:
    """One status; ``estimate`` is None before the first, ``more`` is what its caller alone knows."""
    values: dict[str, object] = {f"measurements {name}": count for name, count in vars(counts).items()}
    values["active effects"] = ", ".join(active_effects(scene, simulator, estimate)) or "none"
    if simulator.touching:
        values["touching"] = ", ".join(_touching(simulator, estimate)) or "nothing"
        values["contact residual"] = f"{simulator.contact_residual:.3g}"
    if estimate is not None:
        nis, dimension = estimate.nis
        values |= {
            "constraint rows": estimate.rows,
            "constraint rank": estimate.rank,
            "constraint error m": f"{estimate.constraint_error:.3g}",
            "nis": f"{nis:.4g}",
            "nis expected": dimension,
        }
        if estimate.rank < estimate.rows:
            values["forces"] = "the motion is unique, the split of the constraint forces is not"
    status = DiagnosticStatus(
        int(health.level),
        f"physics_prior: {scene.name}",
        health.cause or health.level.name,
        values=[KeyValue(key, str(value)) for key, value in (values | dict(more)).items()],
    )
    return DiagnosticArray(header, [status])


def active_effects(scene: Scene, simulator: Simulator, estimate: Estimate | None) -> list[str]:
    """The labels of the effects that act: those that always do, and those that hold, touch something or are switched on now."""
    holding = simulator.switches.holding if estimate is None else estimate.holding
    acting = {*holding, *_touching(simulator, estimate)}
    reactions = {effect.label: effect.reactions(scene.tree) for effect in scene.effects}
    return [
        label
        for label, names in reactions.items()
        if (label in holding if label in simulator.switches.labels else not names or acting.intersection(names))
    ]


def _touching(simulator: Simulator, estimate: Estimate | None) -> list[str]:
    names = [*simulator.touching, *(foot.name for foot in simulator.unknown.feet)]
    return [name for name in names if estimate is not None and estimate.wrenches[name].acts]
