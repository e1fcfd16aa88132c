"""A person's own lengths and marker places from a recorded trial."""

from physics_prior.calibration.consistency import noise_ratio
from physics_prior.calibration.person import Calibration, calibrate
from physics_prior.calibration.scene_text import scene_text

__all__ = ["Calibration", "calibrate", "noise_ratio", "scene_text"]
