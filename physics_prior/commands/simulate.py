"""Record a bag of a scene: seeded noisy measurements on the scene's topics, and the truth beside them under /truth.

The bag is laid out as rosbag2 does it. The same scene, seed and duration give the same bag, bit for bit.

Examples:
  physics-prior simulate double_pendulum -o my_bag
  physics-prior simulate my_scene.yaml -o my_bag --seed 7 --duration 30
"""

import argparse
from math import inf
from pathlib import Path

from physics_prior.commands.terminal import progress


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `simulate`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a shipped scene")
    parser.add_argument(
        "-o", "--output", metavar="BAG", type=Path, required=True, help="the bag to write; a new folder"
    )
    parser.add_argument("--seed", type=_seed, help="of all noise; the scene's where left out")
    parser.add_argument("--duration", type=_seconds, help="in seconds; the scene's where left out")


def run(args: argparse.Namespace) -> int:
    """Record the bag; 0."""
    from physics_prior.commands.compilation import compiling, load_settled
    from physics_prior.recording.simulate import simulate

    scene, _ = load_settled(args.scene)
    with compiling(scene, "advance"):
        simulator = scene.simulator()
        simulator.advance(scene.initial.q.copy(), scene.initial.v.copy(), scene.step.size)
    with progress(f"simulating {scene.name}") as report:
        simulate(scene, args.output, args.seed, args.duration, report)
    print(f"{args.output}: recorded")
    return 0


def _seed(text: str) -> int:
    if not text.isdecimal() or len(text) > 18:
        raise argparse.ArgumentTypeError(f"{text!r} is not a seed: give a whole number, 0 or more")
    return int(text)


def _seconds(text: str) -> float:
    try:
        value = float(text)
    except ValueError:
        value = inf
    if not 0.0 < value < inf:
        raise argparse.ArgumentTypeError(f"{text!r} is not a duration: give seconds, more than 0")
    return value
