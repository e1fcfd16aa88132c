"""Draw what a recording tells: joints with their uncertainty, forces against plates, figures of sticks, and readouts.

Estimates as `physics-prior replay` does, and writes pictures into a folder: joints.png, figures.png, readouts.png where the scene
has readouts, and forces.png where the scene stands on the ground and the bag has force plates (WrenchStamped; all of them where
no --reference names some).

Examples:
  physics-prior plot bags/double_pendulum --scene double_pendulum --smooth
  physics-prior plot my_walk --scene my_person.yaml --lag 0.05 -o pictures
"""

import argparse
from pathlib import Path

from physics_prior.commands.replay import add_estimation, replayed
from physics_prior.commands.terminal import console, require_plot_folder, whole_file


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `plot`."""
    add_estimation(parser)
    parser.add_argument(
        "-o", "--output", metavar="FOLDER", type=Path, help="where to put the pictures (default: BAG_plots, here)"
    )


def run(args: argparse.Namespace) -> int:
    """Replay the bag and draw; 0."""
    folder = args.output or Path(f"{args.bag.resolve().stem}_plots")
    from physics_prior.commands.compilation import load_settled
    from physics_prior.recording.reader import open_bag
    from physics_prior.recording.references import plates_of
    from physics_prior.studies.plot import plot_replay
    from physics_prior.studies.plot_motion import plot_figures, plot_forces, plot_joints

    scene, _ = load_settled(args.scene)
    references = args.reference or plates_of(open_bag(args.bag), scene)
    require_plot_folder(folder, "-o")
    result = replayed(args, scene, references)
    drawings = {
        "joints.png": plot_joints,
        "figures.png": plot_figures,
        "readouts.png": plot_replay if result.readouts else None,
        "forces.png": plot_forces if result.forces else None,
    }
    for name, draw in drawings.items():
        if draw is not None:
            with whole_file(folder / name) as partial:
                draw(result, partial)
            console().print(f"written: {folder / name}", soft_wrap=True)
    return 0
