"""The launch file, with recorders in place of the launch packages, which PyPI does not have."""

import importlib.util
import sys
from pathlib import Path
from types import ModuleType
from unittest.mock import MagicMock

from physics_prior.resources import share_directory


def test_the_launch_file_runs_the_node_with_the_shipped_parameters(monkeypatch):
    modules = ("launch", "launch.actions", "launch.substitutions", "launch_ros", "launch_ros.actions")
    for name in (*modules, "ament_index_python", "ament_index_python.packages"):
        monkeypatch.setitem(sys.modules, name, MagicMock(spec=ModuleType))
    recorded = {}
    for module, name in (
        ("launch", "LaunchDescription"),
        ("launch.actions", "DeclareLaunchArgument"),
        ("launch.substitutions", "LaunchConfiguration"),
        ("launch_ros.actions", "LifecycleNode"),
    ):
        recorded[name] = MagicMock(side_effect=lambda *arguments, **options: (arguments, options))
        setattr(sys.modules[module], name, recorded[name])
    sys.modules["ament_index_python.packages"].get_package_share_directory = lambda package: share_directory()

    path = share_directory() / "launch" / "physics_prior.launch.py"
    spec = importlib.util.spec_from_file_location("launch_file", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    module.generate_launch_description()

    (node,) = (call.kwargs for call in recorded["LifecycleNode"].call_args_list)
    assert (node["package"], node["executable"], node["name"]) == (
        "physics_prior",
        "physics_prior_node",
        "physics_prior",
    )
    declared = {call.args[0]: call.kwargs for call in recorded["DeclareLaunchArgument"].call_args_list}
    used = {call.args[0] for call in recorded["LaunchConfiguration"].call_args_list}
    assert declared.keys() == used == {"scene", "params_file", "namespace"}
    assert all(options["description"] for options in declared.values())
    assert Path(declared["params_file"]["default_value"]) == share_directory() / "config" / "node.yaml"
    assert "default_value" not in declared["scene"]  # it would win over the scene of a user's own file
