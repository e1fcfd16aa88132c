"""Run the node: `ros2 launch physics_prior physics_prior.launch.py scene:=four_bar`."""

from pathlib import Path

from ament_index_python.packages import get_package_share_directory
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode

from launch import LaunchDescription

PARAMETERS = Path(get_package_share_directory("physics_prior"), "config", "node.yaml")


def generate_launch_description() -> LaunchDescription:
    scene = DeclareLaunchArgument("scene", description="a shipped scene or the path of a scene file")
    parameters = DeclareLaunchArgument(
        "params_file", default_value=str(PARAMETERS), description="all other parameters of the node"
    )
    namespace = DeclareLaunchArgument("namespace", default_value="", description="namespace of the node and its topics")
    node = LifecycleNode(
        package="physics_prior",
        executable="physics_prior_node",
        name="physics_prior",
        namespace=LaunchConfiguration("namespace"),
        # the later one holds: the scene given here, not the file's
        parameters=[LaunchConfiguration("params_file"), {"scene": LaunchConfiguration("scene")}],
        output="screen",
    )
    return LaunchDescription([scene, parameters, namespace, node])
