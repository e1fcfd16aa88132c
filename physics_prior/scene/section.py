"""How one section of a scene file is validated against its model, every error one sentence with its place."""

import json
import re
from collections.abc import Mapping
from typing import Any, ClassVar, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError, model_validator
from pydantic_core import ErrorDetails, PydanticCustomError

from physics_prior.errors import PhysicsPriorError, SceneError
from physics_prior.scene.yaml_file import Place, shown, suggestion

Model = TypeVar("Model", bound=BaseModel)
Kind = TypeVar("Kind")


class Section(BaseModel):
    """Base of all sections: unknown keys are refused, null is an empty section, instances do not change.

    A section with a ``shorthand`` may be written as that one value: ``joint: free`` means ``{kind: free}``.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    shorthand: ClassVar[str | None] = None

    @model_validator(mode="before")
    @classmethod
    def _check_keys(cls, value: Any) -> Any:
        if isinstance(value, cls):
            return value
        if value is None:
            return {}
        if not isinstance(value, dict):
            if cls.shorthand is None:
                raise ValueError(f"{shown(value)} is not valid: give a mapping with {list(cls.model_fields)}")
            return {cls.shorthand: value}
        for key in value:
            if key not in cls.model_fields:
                message = _unknown_key(key, list(cls.model_fields))
                raise PydanticCustomError("unknown_key", "{message}", {"message": message, "key": key})
        return value


def validate(model: type[Model], place: Place, value: Any = None) -> Model:
    """Return the model that a place of the file describes, or ``value`` if its content was prepared before.

    Sections parse their numbers as quantities; the plain fields of any other model take JSON's types as they
    are, so that no text passes for a number.

    Raises:
        SceneError: one sentence with file, line and field.
    """
    value = place.value if value is None else value
    try:
        return model.model_validate_json(json.dumps(value), strict=None if issubclass(model, Section) else True)
    except ValidationError as error:
        raise _scene_error(error, model, place) from None


def choose(place: Place, kinds: Mapping[str, Kind], noun: str) -> tuple[str, Kind, Place]:
    """Return key, meaning and place of the content of a one-key mapping such as ``gravity: {...}``.

    The key alone, ``gravity``, stands for one without content.

    Raises:
        SceneError: not exactly one key, or one that is not among the kinds.
    """
    value = place.value
    keys = [value] if isinstance(value, str) else list(value) if place.is_mapping else []
    if len(keys) != 1:
        raise place.error(f"{shown(place.value)} is not {noun}: give one of {list(kinds)} with its fields")
    if keys[0] not in kinds:
        near = suggestion(keys[0], list(kinds))
        raise place.error(f"{shown(keys[0])} is not {noun}{near}; known are {list(kinds)}", keys[0])
    return keys[0], kinds[keys[0]], place.get(keys[0])


def require_known(place: Place, name: str, known: list[str], noun: str, key: str | None = None) -> None:
    """Refuse a name, the value of a place or a ``key`` in it, that is not among the known ones of its kind.

    Raises:
        SceneError: naming the nearest known name, and all of them.
    """
    if name not in known:
        article = "an" if noun[0] in "aeiou" else "a"
        raise place.error(
            f"{shown(name)} is not {article} {noun}{suggestion(name, known)}; known {noun}s are {known}", key
        )


def relocate(place: Place, error: PhysicsPriorError, known: list[str]) -> SceneError:
    """Return the error of something built from a place, saying where it stands and the nearest known name.

    Such errors quote the culprit: it stands where the first quoted word does that is at or below the place.
    """
    quoted = re.findall(r"'([^']+)'", str(error))
    near = suggestion(quoted[0], known) if quoted and quoted[0] not in known else ""
    for word in quoted:
        found = place.find(word)
        if found is not None:
            return found.error(f"{error}{near}", word)
    return place.error(f"{error}{near}")


def _scene_error(error: ValidationError, model: type[BaseModel], place: Place) -> SceneError:
    """Say the one error that explains the others best: a misspelt key comes before what it left missing."""
    details = error.errors()
    first = next((each for each in details if each["type"] == "extra_forbidden"), details[0])
    location, kind, context = first["loc"], first["type"], first.get("ctx", {})
    if location and location[-1] == "[key]":  # pydantic's way to say that a key itself is wrong
        location = location[:-1]
    shorthand = model.shorthand if issubclass(model, Section) else None
    if location[:1] == (shorthand,) and place.value is not None and not place.is_mapping:
        location = location[1:]  # the value stands where the section would
    if kind == "unknown_key":
        return place.inside(location).error(context["message"], context["key"])
    if kind == "extra_forbidden":
        known = list(model.model_fields) if len(location) == 1 else []
        return place.inside(location[:-1]).error(_unknown_key(str(location[-1]), known), str(location[-1]))
    if kind == "missing" and isinstance(location[-1], int):  # a tuple that is too short
        short = place.inside(location[:-1])
        size = sum(each["type"] == "missing" and each["loc"][:-1] == location[:-1] for each in details)
        size += len(short.value)
        return short.error(f"{shown(short.value)} has {len(short.value)} entries: give {size}")
    if kind == "missing":
        return place.inside(location[:-1]).error(f"'{location[-1]}' is missing")
    culprit = place.inside(location)
    return culprit.error(_sentence(first, shown(culprit.value)))


def _sentence(error: ErrorDetails, value: str) -> str:
    """Return what is wrong with a value and what would be valid."""
    kind, context = error["type"], error.get("ctx", {})
    bounds = {"greater_than": ">", "greater_than_equal": ">=", "less_than": "<", "less_than_equal": "<="}
    if kind in bounds:
        (bound,) = (context[name] for name in ("gt", "ge", "lt", "le") if name in context)
        return f"{value} is out of range: give a number {bounds[kind]} {bound:g}"
    if kind == "too_long":
        return f"{value} has {context['actual_length']} entries: give {context['max_length']}"
    if kind == "too_short":
        return f"{value} has {context['actual_length']} entries: give at least {context['min_length']}"
    if kind == "literal_error":
        known = context["expected"].replace("'", "").replace(" or ", ", ").split(", ")
        return f"{value} is not valid{suggestion(error['input'], known)}: give one of {known}"
    if kind == "value_error":
        return str(context["error"])
    expected = {
        "float_type": "a number",
        "int_type": "a whole number",
        "int_from_float": "a whole number",
        "string_type": "a text",
        "bool_type": "true or false",
        "tuple_type": "a list",
        "list_type": "a list",
        "dict_type": "a mapping",
    }.get(kind)
    return f"{value} is not valid: {'give ' + expected if expected else error['msg']}"


def _unknown_key(key: str, known: list[str]) -> str:
    listed = f"; known keys are {known}" if known else ""
    return f"unknown key {shown(key)}{suggestion(key, known)}{listed}"
