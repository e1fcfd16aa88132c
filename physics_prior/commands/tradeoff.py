"""Measure what accuracy costs the estimator: step size, integrator, update rate, smoothing and no physics at all.

Simulated recordings at 50 Hz, the same for all: error of angles and of joint forces, and NEES, which is 1 where the covariance is
right, against processor time a measurement. Marked is what is enough: the cheapest step whose error is within 2 % of the
least, below which noise hides all that a better integration gains. Takes some minutes; the first time, kernels are compiled
besides.

PROBLEM: double_pendulum, four_bar, moving_human.

Examples:
  physics-prior tradeoff
  physics-prior tradeoff double_pendulum --plot tradeoff.png --json tradeoff.json
"""

import argparse
from pathlib import Path

from physics_prior.commands.terminal import STDOUT, console, progress, require_folder, write_json


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `tradeoff`."""
    parser.add_argument("problems", metavar="PROBLEM", nargs="*", help="names of problems; all where none is given")
    parser.add_argument("--seed", type=int, default=0, help="of the simulated recordings (default: 0)")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON; - prints that and nothing else")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="draw the picture: .png, .svg or .pdf")


def run(args: argparse.Namespace) -> int:
    """Measure; 0."""
    require_folder("--json", args.json)
    from physics_prior.studies.estimator.study import card, run_study, table

    if args.plot is not None:
        from physics_prior.studies.plot import require_format

        require_folder("--plot", str(args.plot))
        require_format(args.plot)
    with progress("estimating") as report:
        points = run_study(args.problems, args.seed, report)
    if args.plot is not None:
        from physics_prior.studies.estimator.drawing import draw

        draw(points, args.plot)
    if args.json is not None:
        write_json(args.json, card(points))
    if args.json != STDOUT:
        console().print(table(points), soft_wrap=True)
    return 0
