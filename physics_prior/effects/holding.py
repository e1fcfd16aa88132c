"""Effects that hold: for ever or for a time, where they are told or where the part is, still or moving."""

from typing import Any, ClassVar, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from physics_prior.effects.anchor_motion import AnchorMotion
from physics_prior.effects.effect import Anchor
from physics_prior.effects.two_points import TwoPoints, Vector
from physics_prior.errors import ModelError
from physics_prior.model import Tree

HERE = "here"


class Window(BaseModel):
    """A span of time in which an effect acts: from its beginning on, and no longer at its end."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False, populate_by_name=True)

    begin: float = Field(default=0.0, ge=0.0, alias="from", description="s since the scene's beginning")
    until: float | None = Field(default=None, gt=0.0, description="s since the scene's beginning; for ever if left out")

    @model_validator(mode="after")
    def _check_order(self) -> "Window":
        if self.until is not None and self.until <= self.begin:
            raise ValueError(f"until {self.until:g} s is not valid: give more than from, {self.begin:g} s")
        return self


class Holding(TwoPoints):
    """Base of all effects that hold a point: how what holds it moves, and when it does."""

    words: ClassVar[frozenset[str]] = frozenset({HERE})
    catches: ClassVar[bool] = False
    """Whether it may take hold wherever its part is."""

    at: Vector | None = Field(  # type: ignore[assignment]  # what only pushes has a place where it does
        default=(0.0, 0.0, 0.0),
        description="m, in the frame of `to`; 'here' (None) is where the point is on taking hold",
    )
    motion: AnchorMotion | None = Field(default=None, description="how the anchor is displaced from `at`")
    when: tuple[Window, ...] = Field(
        default=(), description="s; windows of time in which it holds; always if there is none"
    )
    initially: Literal["on", "off"] = Field(default="on", description="whether it holds before any command")

    @field_validator("at", mode="before")
    @classmethod
    def _read_at(cls, value: Any) -> Any:
        if value is None or (isinstance(value, str) and value != HERE):
            raise ValueError(f"{value!r} is not valid: give three numbers or '{HERE}'")
        here = isinstance(value, str)
        if here and not cls.catches:
            raise ValueError(f"'{HERE}' is not valid: a {cls.kind} cannot take hold wherever it is, give three numbers")
        return None if here else _as_tuple(value)

    @field_validator("when", mode="before")
    @classmethod
    def _read_when(cls, value: Any) -> Any:
        return (value,) if isinstance(value, dict | Window) else _as_tuple(value)

    @model_validator(mode="after")
    def _check_switching(self) -> Self:
        if self.when and "initially" in self.model_fields_set:
            raise ValueError("give either 'when' or 'initially': windows of time say themselves how it begins")
        return self

    def check(self, tree: Tree) -> None:
        super().check(tree)
        if self.motion is not None and tree.frame(self.to).link >= 0:
            raise ModelError(
                f"'{self.to}' moves by itself: an anchor with a motion is on the world or on what is fixed to it"
            )

    def anchors(self) -> tuple[Anchor, Anchor]:
        return Anchor(self.to, np.array(self.at or (0.0, 0.0, 0.0))), Anchor(self.part, np.array(self.point))

    def caught(self, position: np.ndarray, orientation: np.ndarray) -> Self:
        """The same, with the anchor where the part is: its point (3,), m, and axes, a quaternion (4,), in the frame of `to`."""
        return self.model_copy(update={"at": tuple(position.tolist())})

    def _spans(self) -> str:
        """When it holds, for ``explain``; nothing where it does so for ever."""
        if not self.when:
            return "" if self.initially == "on" else ", on command"
        spans = (f"from {w.begin:g} s" + ("" if w.until is None else f" until {w.until:g} s") for w in self.when)
        return ", " + " and ".join(spans)

    def active_at(self, time: float) -> bool:
        now = _stamp(time)
        if not self.when:
            return self.initially == "on"
        return any(
            _stamp(window.begin) <= now and (window.until is None or now < _stamp(window.until)) for window in self.when
        )

    def switch_times(self) -> tuple[float, ...]:
        edges = sorted({time for window in self.when for time in (window.begin, window.until) if time})
        return tuple(time for time in edges if self.active_at(time) != self.active_at(time - 1e-9))


def _stamp(time: float) -> int:
    """A time, s, in whole nanoseconds, as stamps count it."""
    return round(time * 1e9)


def _as_tuple(value: Any) -> Any:
    return tuple(_as_tuple(each) for each in value) if isinstance(value, list | np.ndarray) else value
