"""Effects from users' packages: what installed packages offer as entry points of one group, loaded when a scene names them.

An entry point's name is the effect's kind: ``[project.entry-points."physics_prior.effects"] kite = "kites.wind:KiteWind"``.
"""

import inspect
import sys
from collections.abc import Callable, Mapping
from functools import cache
from importlib.metadata import EntryPoint, EntryPoints, entry_points

from physics_prior.effects.effect import CompiledForce, Effect
from physics_prior.errors import SceneError

GROUP = "physics_prior.effects"
ARGUMENTS = {"apply": 6, "differentiate": 9, "energy": 4}  # of the functions of a CompiledForce

Loader = Callable[[], type[Effect]]


def effect_loaders(built_in: Mapping[str, type[Effect]]) -> dict[str, Loader]:
    """By kind, a function that returns the effect: the built-in ones, then those of installed packages.

    That function raises SceneError for an effect that cannot be loaded or does not keep the contract, or has a built-in's kind.
    """
    offered = {point.name: _loader(point, point.name in built_in) for point in _offered(tuple(sys.path))}
    return {kind: _known(effect) for kind, effect in built_in.items()} | offered


@cache
def _offered(path: tuple[str, ...]) -> EntryPoints:
    """What packages on a search path offer: looked up once, for reading what they say of themselves takes longer than a scene."""
    return entry_points(group=GROUP)


def _known(effect: type[Effect]) -> Loader:
    return lambda: effect


def _loader(point: EntryPoint, taken: bool) -> Loader:
    def load() -> type[Effect]:
        whose = f"effect '{point.name}' ({point.value}{f' of {point.dist.name}' if point.dist else ''})"
        if taken:
            raise SceneError(f"{whose} has the name of a built-in effect: give its entry point and its kind another")
        try:
            effect = point.load()
        except Exception as problem:  # a user's file: anything may happen in it
            raise SceneError(f"{whose} cannot be loaded: {type(problem).__name__}: {problem}") from problem
        fault = _fault(point.name, effect)
        if fault:
            raise SceneError(f"{whose} {fault}")
        found: type[Effect] = effect
        return found

    return load


def _fault(kind: str, effect: object) -> str:
    """What is wrong with an effect, and what would be right; empty where nothing is."""
    if not (isinstance(effect, type) and issubclass(effect, Effect)):
        return "is no class derived from physics_prior.effects.Effect"
    if getattr(effect, "kind", None) != kind:
        return f"has the kind {getattr(effect, 'kind', None)!r}: it must be the name of the entry point"
    if effect.explain is Effect.explain:
        return "does not explain itself: give it a method explain(self, tree) that returns one line"
    if effect.compiled is None:
        return ""
    if not isinstance(effect.compiled, CompiledForce):
        return "has a 'compiled' that is no CompiledForce"
    for name, count in ARGUMENTS.items():
        function = getattr(effect.compiled, name)
        if function is None and name == "energy":
            continue
        if not hasattr(function, "py_func"):
            return f"has a '{name}' that is no kernel: put @kernel of physics_prior.dynamics.kernel above it"
        if len(inspect.signature(function.py_func).parameters) != count:
            return f"has a '{name}' that does not take the {count} arguments that CompiledForce tells"
    return ""
