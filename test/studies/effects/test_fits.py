"""Numbers that a fit finds: of simulated recordings the truth lies in the interval."""

import math

from physics_prior.studies.effects.fit import fit
from physics_prior.studies.effects.likelihood import simulated_measurements
from physics_prior.studies.effects.variant import SceneText

GRAVITY = "effects.gravity.acceleration"


def found(scene, start, seconds, paths=None, seed=1):
    """Fitted numbers by path: of a recording of a scene, from other numbers in it."""
    measurements = simulated_measurements(scene.build(), seed, seconds)
    return {each.path: each for each in fit(scene.changed(start), paths or list(start), [measurements]).parameters()}


def within(each, truth, precision):
    """Whether an interval holds the truth and is at most so wide, in parts of it."""
    return each.low < truth < each.high and each.high - each.low < precision * abs(truth)


def test_scale_of_a_mass(damped_rod):
    path = "model.parts.rod.mass"  # the damping is known
    assert within(found(damped_rod, {path: 1.3}, 2.0)[path], 1.0, 0.1)  # 0.932 to 1.018


def test_scale_of_lengths(free_rod):
    path = "measurements.0.pose.scale"
    short = SceneText(
        free_rod.path,
        dict(free_rod.data)
        | {
            "measurements": [
                {
                    "pose": {
                        "topic": "/rod/pose",
                        "part": "rod",
                        "frame": {"position": [0, 0, -1]},
                        "position_noise": "5 mm",
                        "orientation_noise": "2 deg",
                        "scale": 1.02,
                    }
                }
            ]
        },
    )
    assert within(found(short, {path: 1.0}, 1.0)[path], 1.02, 0.01)  # 1.0191 to 1.0211


def test_direction_of_gravity(free_rod):
    tilted = free_rod.without("gravity").added({"gravity": {"acceleration": [1.7, 0, -9.66]}})
    start = {f"{GRAVITY}.0": 0.0, f"{GRAVITY}.2": -9.80665}
    fitted = found(tilted, start, 2.0, [GRAVITY])
    assert set(fitted) == {f"{GRAVITY}.{axis}" for axis in range(3)}
    assert within(fitted[f"{GRAVITY}.0"], 1.7, 0.2)  # 1.68 to 1.86
    assert within(fitted[f"{GRAVITY}.2"], -9.66, 0.05)  # -9.79 to -9.61
    across = fitted[f"{GRAVITY}.1"]  # along the axis, where it moves nothing
    assert math.isnan(across.low)


def test_friction(sliding_cube):
    path = "effects.table.friction"
    assert within(found(sliding_cube, {path: 0.25}, 0.5)[path], 0.18, 0.3)  # 0.151 to 0.191
