"""Estimate motion and constraint forces from a recording, as fast as it goes and without ROS.

The bag is a rosbag2 folder or a bare .mcap file; the scene says which topics are read. Prints what became of the
measurements, whether the filter's own uncertainty holds (NIS), its health and, with --reference, its errors from 0.2 s on.
The same recording gives the same numbers as the live node, bit for bit.

Examples:
  physics-prior replay my_bag --scene double_pendulum
  physics-prior replay my_bag --scene double_pendulum --smooth -o estimates --plot estimates.png
  physics-prior replay my_bag --scene double_pendulum --lag 0.05
  physics-prior replay my_bag --scene my_scene.yaml --reference /truth/joint_states --json -
  physics-prior replay my_walk --scene my_person.yaml --smooth --reference /force_plate/1 --reference /force_plate/2
"""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from physics_prior.commands.terminal import STDOUT, progress, require_folder, whole_file, write_json

if TYPE_CHECKING:
    from physics_prior.recording.replay import ReplayResult
    from physics_prior.scene import Scene

LONGEST_LAG = 3600.0  # s


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `replay`."""
    add_estimation(parser)
    parser.add_argument(
        "-o", "--output", metavar="OUTBAG", type=Path, help="a bag to write, with the topics that the node publishes"
    )
    parser.add_argument("--plot", metavar="FILE", help="draw the readouts: .png, .svg or .pdf; see also `plot`")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON; - prints that and nothing else")


def add_estimation(parser: argparse.ArgumentParser) -> None:
    """Describe what is estimated, how, and what it is compared with."""
    parser.add_argument("bag", metavar="BAG", type=Path, help="the recording: a rosbag2 folder or an .mcap file")
    parser.add_argument("--scene", required=True, help="a scene file, or the name of a shipped scene")
    told = parser.add_mutually_exclusive_group()
    told.add_argument("--smooth", action="store_true", help="estimate every moment from the whole recording")
    told.add_argument(
        "--lag",
        metavar="SECONDS",
        type=lag,
        default=0.0,
        help="estimate every moment from what was measured up to so much later, as the node's parameter `lag` does"
        " (default: 0, causal)",
    )
    parser.add_argument(
        "--process",
        choices=("physics", "kinematic"),
        default="physics",
        help="what carries the state on between measurements: the scene's physics, or constant acceleration without"
        " any, to see what physics buys",
    )
    parser.add_argument(
        "--reference",
        metavar="TOPIC",
        action="append",
        default=[],
        help="a JointState topic of the bag to compare with, or a WrenchStamped of a force plate; may be repeated",
    )


def lag(text: str) -> float:
    """A lag in s; ArgumentTypeError if it is none."""
    try:
        seconds = float(text)
    except ValueError:
        seconds = math.nan
    if not 0.0 <= seconds <= LONGEST_LAG:
        raise argparse.ArgumentTypeError(f"{text} is not a lag: give 0 to {LONGEST_LAG:g} s, or --smooth")
    return seconds


def replayed(
    args: argparse.Namespace, scene: "Scene", references: Sequence[str], out: Path | None = None
) -> "ReplayResult":
    """Replay with the arguments of ``add_estimation``, and tell how far it is."""
    from physics_prior.commands.compilation import compiling
    from physics_prior.interface.warm_up import warm_up
    from physics_prior.recording.replay import replay

    with compiling(scene, "carry"):
        warm_up(scene)
    with progress(f"replaying {args.bag.name}") as report:
        return replay(
            args.bag,
            scene,
            out=out,
            smooth=args.smooth,
            lag=args.lag,
            process=args.process,
            references=references,
            progress=report,
        )


def run(args: argparse.Namespace) -> int:
    """Replay the bag; 0."""
    require_folder("--json", args.json)
    require_folder("--plot", args.plot)
    from physics_prior.commands.compilation import load_settled
    from physics_prior.commands.replay_report import print_report

    if args.plot is not None:
        from physics_prior.studies.plot import plot_replay, require_format

        require_format(Path(args.plot))
    scene, _ = load_settled(args.scene)
    result = replayed(args, scene, args.reference, args.output)
    if args.plot is not None:
        with whole_file(Path(args.plot)) as partial:
            plot_replay(result, partial)
    if args.json is not None:
        write_json(args.json, result.summary())
    if args.json != STDOUT:
        print_report(result, [str(file) for file in (args.output, args.plot, args.json) if file is not None])
    return 0
