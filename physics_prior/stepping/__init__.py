"""The step of a scene: whether it follows the motion, and its choice by what integrators cost and err where that is asked for."""

from physics_prior.stepping.amplification import stable
from physics_prior.stepping.choice import Choice, Measured
from physics_prior.stepping.choosing import settle

__all__ = ["Choice", "Measured", "settle", "stable"]
