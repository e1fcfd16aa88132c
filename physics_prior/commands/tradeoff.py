"""Measure what accuracy costs the estimator: step size, integrator, update rate, smoothing and no physics at all.

Simulated recordings at 50 Hz, the same for all: error of angles and of joint forces, and NEES, which is 1 where the covariance is
right, against processor time a measurement. Marked is what is enough: the cheapest step that is within 2 % of the finest, so
that noise hides all that a better integration gains. Takes some minutes; the first time, kernels are compiled besides.

With --bag a recording is replayed instead, by every step and without physics, and scored against a JointState topic.

PROBLEM: double_pendulum, four_bar, moving_human.

Examples:
  physics-prior tradeoff
  physics-prior tradeoff double_pendulum --plot tradeoff.png --json tradeoff.json
  physics-prior tradeoff --bag BAG --scene double_pendulum --reference /truth/joint_states
"""

import argparse
from pathlib import Path

from physics_prior.commands.terminal import STDOUT, console, progress, require_folder, write_json
from physics_prior.errors import PhysicsPriorError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `tradeoff`."""
    parser.add_argument("problems", metavar="PROBLEM", nargs="*", help="names of problems; all where none is given")
    parser.add_argument("--bag", metavar="BAG", type=Path, help="a recording to replay instead of simulated ones")
    parser.add_argument("--scene", metavar="SCENE", help="the recording's scene: a file or a shipped scene's name")
    parser.add_argument("--reference", metavar="TOPIC", help="a JointState topic of the recording to score against")
    parser.add_argument("--seed", type=int, default=0, help="of the simulated recordings (default: 0)")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON; - prints that and nothing else")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="draw the picture: .png, .svg or .pdf")


def run(args: argparse.Namespace) -> int:
    """Measure; 0."""
    require_folder("--json", args.json)
    if (args.bag is None) != (args.scene is None) or (args.bag is None) != (args.reference is None):
        raise PhysicsPriorError("a recording needs --bag, --scene and --reference together: give all three or none")
    from physics_prior.commands.compilation import load_settled
    from physics_prior.studies.estimator.study import card, run_recording, run_study, table

    if args.plot is not None:
        from physics_prior.studies.plot import require_format

        require_folder("--plot", str(args.plot))
        require_format(args.plot)
    with progress("estimating") as report:
        if args.bag is not None:
            points = run_recording(args.bag, load_settled(args.scene)[0], args.reference, report)
        else:
            points = run_study(args.problems, args.seed, report)
    if args.plot is not None:
        from physics_prior.studies.estimator.drawing import draw

        draw(points, args.plot)
    if args.json is not None:
        write_json(args.json, card(points))
    if args.json != STDOUT:
        console().print(table(points), soft_wrap=True)
    return 0
