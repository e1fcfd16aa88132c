"""What every test shares: a ROS graph of its own, reproducible properties, the data beside the repository."""

import functools
import os
import secrets
from pathlib import Path

import numpy as np
import pytest
from hypothesis import settings

# Set before any message class is imported: rclpy reads them once.
# Without the check a field of the wrong type goes out as junk.
os.environ["ROS_PYTHON_CHECK_FIELDS"] = "1"
os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"
# Workers of pytest-xdist differ in parity, so that two of them never hear each other.
WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))
os.environ["ROS_DOMAIN_ID"] = str(2 * secrets.randbelow(25) + 1 + WORKER % 2)

# No deadline: the first example of a test may compile kernels.
settings.register_profile("physics_prior", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("physics_prior")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture
def other_domain() -> str:
    """A ROS domain for processes of a test's own, which this process is not in."""
    return str(51 + 2 * secrets.randbelow(25) + WORKER % 2)


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of recordings and reference data that lies beside the repository."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.skip("missing ../shared: recordings and reference data beside the repository")
    return folder


def _looked_at(method):
    """The same method of a filter, whose posterior's covariance is looked at."""

    @functools.wraps(method)
    def look(*args, **kwargs):
        posterior = method(*args, **kwargs)
        S = posterior.factor
        P = S @ S.T
        assert np.isfinite(P).all()
        assert np.array_equal(P, P.T)
        values = np.linalg.eigvalsh(P)
        assert values[0] >= -1e-12 * values[-1]
        return posterior

    return look


@pytest.fixture(scope="session", autouse=True)
def covariances_are_looked_at():
    """At every step of every filter of every test: finite, symmetric, positive semi-definite."""
    from physics_prior.estimation.filter import Filter  # after ROS is set up

    with pytest.MonkeyPatch.context() as patch:
        for name in ("predict", "update"):
            patch.setattr(Filter, name, _looked_at(getattr(Filter, name)))
        yield
