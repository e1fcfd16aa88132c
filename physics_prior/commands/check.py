"""Explain a scene: what is simulated, why, and what it costs.

Prints the parts and joints of the model, the effects and why each is on, constraint rows and their rank, the size of the
state, what is measured, read out and published, and what one step costs on this machine. Only the effects that are listed
are compiled into the step; --show-step prints its source.

Examples:
  physics-prior check four_bar
  physics-prior check my_scene.yaml
  physics-prior check four_bar --show-step
"""

import argparse


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `check`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a shipped scene")
    parser.add_argument("--show-step", action="store_true", help="print the source of the compiled step instead")


def run(args: argparse.Namespace) -> int:
    """Explain the scene; 0."""
    from physics_prior.commands.explanation import explain, step_text
    from physics_prior.scene import load_scene

    scene = load_scene(args.scene)
    if args.show_step:
        print(step_text(scene), end="")
    else:
        explain(scene)
    return 0
