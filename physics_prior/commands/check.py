"""Explain a scene: what is simulated, why, and what it costs.

Prints the parts and joints of the model, the effects and why each is on, constraint rows and their rank, the size of the
state, what is measured, read out and published, and what one step costs on this machine. Only the effects that are listed
are compiled into the step; --show-step prints its source.

Of a scene that asks for an accuracy it tells which step was chosen for it, and what others would err and cost.

--cost tells what each effect adds to a step: the step with it and without it, from the scene's start, in turns. The steps
without one are compiled once, some 10 s each; that is why it has to be asked for.

Examples:
  physics-prior check four_bar
  physics-prior check my_scene.yaml --cost
  physics-prior check four_bar --cost --json -
  physics-prior check four_bar --show-step
"""

import argparse

from physics_prior.commands.terminal import STDOUT, progress, require_folder, write_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `check`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a shipped scene")
    parser.add_argument("--cost", action="store_true", help="time the step without each effect too")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON; - prints that and nothing else")
    parser.add_argument("--show-step", action="store_true", help="print the source of the compiled step instead")


def run(args: argparse.Namespace) -> int:
    """Explain the scene; 0."""
    require_folder("--json", args.json)
    from physics_prior.commands.compilation import load_settled
    from physics_prior.commands.explanation import explain, scene_figures, step_text
    from physics_prior.studies.effects.cost import effect_costs

    scene, choice = load_settled(args.scene)
    if args.show_step:
        print(step_text(scene), end="")
        return 0
    costs = None
    if args.cost:
        with progress("timing") as report:
            costs = effect_costs(scene, report)
    figures = scene_figures(scene, costs, choice)
    if args.json is not None:
        write_json(args.json, figures)
    if args.json != STDOUT:
        explain(scene, figures)
    return 0
