"""Scene files read: from YAML to a checked Scene, every error naming file, line and field."""

from pathlib import Path
from typing import Any, get_args

import numpy as np
from pydantic import BaseModel

from physics_prior.dynamics.compose import structure_of
from physics_prior.effects import REGISTRY, Effect
from physics_prior.effects.plug_ins import effect_loaders
from physics_prior.effects.unknown_force import check_together
from physics_prior.errors import PhysicsPriorError, SceneError
from physics_prior.model import Tree
from physics_prior.resources import scene_path
from physics_prior.scene.freedoms import read_initial, read_noise
from physics_prior.scene.measurements import SOURCES, MeasurementSource, SwitchSource
from physics_prior.scene.parts import build_tree
from physics_prior.scene.quantity import parse_quantity, stated_units
from physics_prior.scene.readouts import READOUTS, Readout, Subject
from physics_prior.scene.scene import Scene
from physics_prior.scene.schema import SceneFile, check_name
from physics_prior.scene.section import choose, relocate, require_known, validate
from physics_prior.scene.yaml_file import Place, read_yaml


def load_scene(name_or_path: str | Path) -> Scene:
    """Load a shipped scene by its name, or any scene file by its path.

    Raises:
        SceneError: no such scene, or one sentence `FILE:LINE: FIELD: what is wrong and what would be valid`.
    """
    return build_scene(read_yaml(scene_path(name_or_path)))


def build_scene(top: Place) -> Scene:
    """Build the scene that the top of a file describes.

    Raises:
        SceneError: as ``load_scene``.
    """
    path = top.path
    file = validate(SceneFile, top)
    tree = build_tree(top["model"])
    effects = _read_effects(top.get("effects"), tree)
    touching = structure_of(tree, effects).touching
    if file.step.sleep is not None and not touching:
        raise top["step"]["sleep"].error("is not valid where nothing may touch: name a contact or a joint_limit")
    if file.accuracy is not None:
        _check_accuracy(top, touching)
    measurements = _read_measurements(top.get("measurements"), tree, effects)
    if measurements and file.noise is None:
        raise top.error("'noise' is missing: say how far to trust the model, for example 'noise: {force: 1e-3}'")
    return Scene(
        name=path.stem,
        path=path,
        description=file.description.strip(),
        frame_id=file.frame_id,
        tree=tree,
        effects=effects,
        measurements=measurements,
        noise=read_noise(top.get("noise"), tree),
        readouts=_read_readouts(top.get("readouts"), Subject(tree, effects)),
        gate=file.gate,
        health=file.health,
        step=file.step,
        initial=read_initial(top.get("initial"), tree),
        simulation=file.simulation,
        accuracy=file.accuracy,
    )


def _check_accuracy(top: Place, touching: bool) -> None:
    """Refuse an accuracy beside a step, or where it cannot be measured."""
    if "step" in top.value and top["step"].value is not None:
        raise top["step"].error("is not valid beside 'accuracy', which chooses the step: give one of them")
    if touching:
        raise top["accuracy"].error(
            "is not valid where something may touch: the error of a motion with impacts does not fall with the step as"
            " that of a smooth one, so none can be promised; give 'step' instead"
        )


def _read_effects(place: Place, tree: Tree) -> tuple[Effect, ...]:
    effects: list[Effect] = []
    joints = [joint.name for joint in tree.joints]
    known = list(tree.frames) + joints
    loaders = effect_loaders(REGISTRY)
    for entry in place.entries():
        _, load, inner = choose(entry, loaders, "an effect")
        try:
            effect_type = load()
        except SceneError as error:
            raise entry.error(str(error)) from None
        effect = validate(effect_type, inner, _in_si_units(effect_type, inner, effect_type.words))
        try:
            check_name(effect.label)
            effect.check(tree)
            held = _check_finite(effect, tree)
        except PhysicsPriorError as error:
            raise relocate(inner, error, known) from None
        except ValueError as error:
            raise inner.inside(("name",)).error(str(error)) from None
        if effect.label in [other.label for other in effects]:
            name = inner.inside(("name",))
            raise name.error(f"'{effect.label}' is another effect's name: give this one its own 'name'")
        if held and effect.label in joints:
            raise inner.inside(("name",)).error(f"'{effect.label}' is a joint's name: give this effect its own")
        effects.append(effect)
        try:
            check_together(tree, effects)
        except PhysicsPriorError as error:
            raise relocate(inner, error, known) from None
    return tuple(effects)


def _in_si_units(model: type[BaseModel], place: Place, words: frozenset[str] = frozenset()) -> dict[str, Any]:
    """Fields of an effect as plain values, quantities in SI units, which its own descriptions state; words stay texts."""
    values = {}
    for key, entry in place.items():
        field = model.model_fields.get(key)
        units = stated_units(field.description) if field is not None else ()
        inner = _model_of(field.annotation) if field is not None else None
        if inner is not None and entry.is_mapping and not units:
            values[key] = _in_si_units(inner, entry)
        elif units and not (isinstance(entry.value, str) and entry.value in words):
            values[key] = _converted(entry, units)
        else:
            values[key] = entry.value
    return values


def _model_of(annotation: Any) -> type[BaseModel] | None:
    """The model that a field holds, if it holds one, optional or not."""
    kinds = [kind for kind in (annotation, *get_args(annotation)) if isinstance(kind, type)]
    return next((kind for kind in kinds if issubclass(kind, BaseModel)), None)


def _converted(place: Place, units: tuple[str, ...]) -> Any:
    if place.is_mapping:
        return {key: _converted(entry, units) for key, entry in place.items()}
    if place.is_list:
        return [_converted(entry, units) for entry in place.entries()]
    try:
        return parse_quantity(place.value, *units) if isinstance(place.value, str) else place.value
    except ValueError as error:
        raise place.error(str(error)) from None


def _check_finite(effect: Effect, tree: Tree) -> bool:
    """Refuse an effect that makes numbers that are not finite; return whether it holds something.

    A zero axis, say, passes an effect's own check of types and gives directions of NaN.
    """
    with np.errstate(all="ignore"):
        pairs = effect.point_pairs(tree)
        arrays = [effect.field(), effect.parameters(tree)]
        arrays += [array for noise in effect.noise(tree) for array in (noise.at.point, noise.density)]
        arrays += [array for pair in pairs for array in (pair.a.point, pair.b.point, pair.directions)]
        arrays += [pair.motion.table(np.eye(3)) for pair in pairs if pair.motion is not None]
    if not all(np.all(np.isfinite(array)) for array in arrays):
        raise SceneError("makes numbers that are not finite: an axis must not be zero")
    return len(pairs) > 0


def _read_measurements(place: Place, tree: Tree, effects: tuple[Effect, ...]) -> tuple[MeasurementSource, ...]:
    switchable = [effect.label for effect in effects if effect.switchable(tree)]
    sources: list[MeasurementSource] = []
    for entry in place.entries():
        _, source_type, inner = choose(entry, SOURCES, "a measurement")
        source = validate(source_type, inner)
        source.check(tree, inner)
        if isinstance(source, SwitchSource):
            require_known(inner["effect"], source.effect, switchable, "effect that can be switched")
        if source.topic in [other.topic for other in sources]:
            raise inner["topic"].error(f"'{source.topic}' is read twice: give each measurement its own topic")
        sources.append(source)
    return tuple(sources)


def _read_readouts(place: Place, subject: Subject) -> tuple[Readout, ...]:
    readouts: list[Readout] = []
    for entry in place.entries():
        _, readout_type, inner = choose(entry, READOUTS, "a readout")
        readout = validate(readout_type, inner)
        readout.check(subject, inner)
        if readout.name in [other.name for other in readouts]:
            raise inner.inside(("name",)).error(f"'{readout.name}' is another readout's name: give each its own")
        readouts.append(readout)
    return tuple(readouts)
