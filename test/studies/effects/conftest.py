"""A damped rod and one without damping, seen for some seconds: recordings of which the right effects are known."""

import pytest

from physics_prior.studies.effects.likelihood import simulated_measurements
from physics_prior.studies.effects.variant import SceneText

DAMPING = 0.3  # N m s/rad: the rod's swing decays within about 2 s


@pytest.fixture(scope="session")
def free_rod():
    """The shipped pendulum, with the integrator for which other tests compile these effects."""
    text = SceneText.read("pendulum")
    return SceneText(text.path, dict(text.data) | {"step": {"integrator": "rk4", "size": "5 ms"}})


@pytest.fixture(scope="session")
def damped_rod(free_rod):
    return free_rod.added({"joint_damping": {"coefficients": {"pivot": f"{DAMPING} N m s/rad"}}})


@pytest.fixture(scope="session")
def damped_measurements(damped_rod):
    return simulated_measurements(damped_rod.build(), seed=1, duration=2.0)


@pytest.fixture(scope="session")
def free_measurements(free_rod):
    return simulated_measurements(free_rod.build(), seed=2, duration=2.0)


@pytest.fixture(scope="session")
def sliding_cube():
    """The cube of the shipped scene, pushed along the table."""
    text = SceneText.read("cube_toss")
    start = {
        "positions": {"cube": {"position": [0, 0, "52.4 mm"]}},
        "velocities": {"cube": {"linear": ["1 m/s", 0, 0], "angular": [0, 0, 0]}},
    }
    return SceneText(text.path, dict(text.data) | {"initial": start})
