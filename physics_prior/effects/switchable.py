"""Effects that come and go: at times that the scene tells, by command, or as a measured force says."""

from typing import Any, Literal, Self

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, field_validator, model_validator

from physics_prior.effects.effect import Effect


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


class Switchable(Effect):
    """Base of effects that may come and go.

    What only pushes does so where the scene says when or how it begins, and only there does the step ask whether it acts.
    """

    when: tuple[Window, ...] = Field(
        default=(), description="s; windows of time in which it acts; always if there is none"
    )
    initially: Literal["on", "off"] | None = Field(
        default=None, description="whether it acts before any command; on where left out"
    )

    @field_validator("when", mode="before")
    @classmethod
    def _read_when(cls, value: Any) -> Any:
        return (value,) if isinstance(value, dict | Window) else as_tuple(value)

    @model_validator(mode="after")
    def _check_switching(self) -> Self:
        if self.when and self.initially is not None:
            raise ValueError("give either 'when' or 'initially': windows of time say themselves how it begins")
        return self

    @property
    def comes_and_goes(self) -> bool:
        return bool(self.when) or self.initially is not None

    def _spans(self) -> str:
        """When it acts, for ``explain``; nothing where it does so for ever."""
        if not self.when:
            return ", on command" if self.initially == "off" else ""
        spans = (f"from {w.begin:g} s" + ("" if w.until is None else f" until {w.until:g} s") for w in self.when)
        return ", " + " and ".join(spans)

    def active_at(self, time: float) -> bool:
        now = _stamp(time)
        if not self.when:
            return self.initially != "off"
        return any(
            _stamp(window.begin) <= now and (window.until is None or now < _stamp(window.until)) for window in self.when
        )

    def switch_times(self) -> tuple[float, ...]:
        edges = sorted({time for window in self.when for time in (window.begin, window.until) if time})
        return tuple(time for time in edges if self.active_at(time) != self.active_at(time - 1e-9))


def _stamp(time: float) -> int:
    """A time, s, in whole nanoseconds, as stamps count it."""
    return round(time * 1e9)


def as_tuple(value: Any) -> Any:
    """Lists and arrays, as YAML and users give them, as tuples."""
    return tuple(as_tuple(each) for each in value) if isinstance(value, list | np.ndarray) else value
