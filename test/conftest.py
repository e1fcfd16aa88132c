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
os.environ["ROS_DOMAIN_ID"] = str(1 + secrets.randbelow(101))

# No deadline: the first example of a test may compile kernels.
settings.register_profile("physics_prior", deadline=None, derandomize="CI" in os.environ)
settings.load_profile("physics_prior")

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="session")
def shared() -> Path:
    """Folder of recordings and reference data that lies beside the repository."""
    folder = ROOT.parent / "shared"
    if not folder.is_dir():
        pytest.skip("missing ../shared: recordings and reference data beside the repository")
    return folder
