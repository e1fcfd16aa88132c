"""Write a scene's model as URDF, for robot_state_publisher, RViz and other engines.

A ball joint becomes three hinges NAME_y, NAME_x and NAME_z with massless links between, in which order its rotation is
Ry Rx Rz. A free root is left out: its part is the root link.

Examples:
  physics-prior urdf my_person.yaml -o my_person.urdf
  physics-prior urdf double_pendulum
"""

import argparse
from pathlib import Path

from physics_prior.commands.terminal import require_folder, whole_file


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `urdf`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a shipped scene")
    parser.add_argument("-o", "--output", metavar="FILE", type=Path, help="the file to write; printed where left out")


def run(args: argparse.Namespace) -> int:
    """Write the file; 0."""
    if args.output is not None:
        require_folder("--output", str(args.output))
    from physics_prior.model.urdf_out import urdf_from_tree
    from physics_prior.scene import load_scene

    scene = load_scene(args.scene)
    text = urdf_from_tree(scene.tree, scene.name)
    if args.output is None:
        print(text, end="")
    else:
        with whole_file(args.output) as partial:
            partial.write_text(text, encoding="utf-8")
        print(f"{args.output}: written")
    return 0
