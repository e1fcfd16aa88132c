"""The step of a scene that asks for an accuracy: chosen by what integrators cost and err on its own motion."""

from physics_prior.stepping.choice import Choice, Measured
from physics_prior.stepping.choosing import settle

__all__ = ["Choice", "Measured", "settle"]
