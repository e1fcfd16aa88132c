"""What every test shares: a ROS graph of its own, reproducible properties, the data beside the repository."""

import os
import secrets
from pathlib import Path

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
