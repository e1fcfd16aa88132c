"""Prescribed motion of an anchor: a treadmill, a shaker, a path of keyframes."""

import math

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

Vector = tuple[float, float, float]
FOR_EVER = 1e12  # s: no scene lasts longer
KEYFRAMES = 1000


class Sine(BaseModel):
    """A displacement of amplitude sin(2 pi frequency t + phase)."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    amplitude: Vector = Field(description="m, in the frame of `to`")
    frequency: float = Field(gt=0.0, description="Hz")
    phase: float = Field(default=0.0, description="rad")


class Keyframes(BaseModel):
    """Displacements at given times; between them a cubic spline, twice continuously differentiable, at rest at both ends."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    times: tuple[float, ...] = Field(min_length=2, max_length=KEYFRAMES, description="s, increasing")
    positions: tuple[Vector, ...] = Field(min_length=2, max_length=KEYFRAMES, description="m, in the frame of `to`")

    @model_validator(mode="after")
    def _check(self) -> "Keyframes":
        if len(self.times) != len(self.positions):
            raise ValueError(f"{len(self.times)} times and {len(self.positions)} positions: give as many of both")
        if not np.all(np.diff(self.times) > 0.0):
            raise ValueError(f"times {list(self.times)} are not valid: give increasing ones")
        return self


class AnchorMotion(BaseModel):
    """How an anchor on the world is displaced from where it is given, as a function of the time since the scene's beginning.

    One of: a constant ``velocity`` from time zero on, a ``sine``, or ``keyframes``, before and after which it stays.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    velocity: Vector | None = Field(default=None, description="m/s, in the frame of `to`")
    sine: Sine | None = None
    keyframes: Keyframes | None = None

    @model_validator(mode="after")
    def _check_one(self) -> "AnchorMotion":
        given = [name for name in type(self).model_fields if getattr(self, name) is not None]
        if len(given) != 1:
            raise ValueError(f"{given} is not valid: give one of {list(type(self).model_fields)}")
        return self

    def table(self, R: np.ndarray) -> np.ndarray:
        """The numbers that the step evaluates (dynamics/anchor_motion.py), turned by R (3, 3) into world axes."""
        if self.sine is not None:
            omega = 2.0 * math.pi * self.sine.frequency
            return np.array([0.0, omega, self.sine.phase, *(R @ np.array(self.sine.amplitude))])
        if self.keyframes is not None:
            from scipy.interpolate import CubicSpline  # here: it takes longer to load than all else of an effect

            spline = CubicSpline(self.keyframes.times, np.array(self.keyframes.positions), bc_type="clamped")
            times, coefficients = spline.x, spline.c[::-1].transpose(1, 0, 2)
        else:
            times, coefficients = np.array([0.0, FOR_EVER]), np.zeros((1, 4, 3))
            coefficients[0, 1] = self.velocity
        pieces = coefficients @ R.T
        return np.concatenate([[len(pieces)], np.zeros(5), times, pieces.ravel()])
