"""Without ROS: what the node says, and that nothing else needs it."""

import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
NO_ROS = "import sys; sys.modules['rclpy'] = None\n"


def run(code):
    return subprocess.run(
        [sys.executable, "-c", NO_ROS + code], cwd=ROOT, capture_output=True, text=True, timeout=120, check=False
    )


def test_the_node_says_in_one_sentence_what_to_install():
    ended = run("import physics_prior.node")
    assert ended.returncode == 2
    assert len(ended.stderr.splitlines()) == 1
    assert "pip install physics_prior[ros]" in ended.stderr


def test_the_interface_needs_no_ros():
    code = (
        "import physics_prior.interface, physics_prior.interface.warm_up, physics_prior.recording.replay; print('fine')"
    )
    assert run(code).stdout == "fine\n"
