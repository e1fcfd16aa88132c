"""Time the kernels on a human-like tree of 16 bodies and 35 degrees of freedom, alone or against other engines.

With --peers, Pinocchio and MuJoCo (their PyPI wheels, extra 'bench') take turns with ours in one run on one core; a ratio
above 1 means that we are faster. Before anything is timed, the engines' results are compared. Then the estimator, predict and
update with its covariance, on the same tree in motion: its split, and, where biorbd is installed, that one's Kalman filter.
Last a person who walks, with muscles and ground forces and all outputs: how many times faster than real time, at 100 Hz.

With --effects, each built-in effect is taken out of a copy of the program instead, and scenes that do not name it are compiled
and run in both: the same bits, the same instructions. Then scenes that name little and much are compiled from a cold cache and
stepped. Takes some ten minutes.

With --sleep, boxes at rest beside a pendulum are stepped with sleep and without.

With --chain, chains and rows of four-bars of 10 to 300 links are stepped: cost grows in proportion to bodies. --plot draws it.

Examples:
  physics-prior bench
  physics-prior bench --sleep
  physics-prior bench --effects
  physics-prior bench --chain --plot docs/chain.png
  physics-prior bench --peers --json bench.json
"""

import argparse
from pathlib import Path

from physics_prior.commands.terminal import STDOUT, console, progress, require_folder, whole_file, write_json
from physics_prior.errors import PhysicsPriorError


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `bench`."""
    parser.add_argument("--peers", action="store_true", help="time Pinocchio, MuJoCo and biorbd too")
    parser.add_argument(
        "--effects", action="store_true", help="show that effects cost nothing where they are not named"
    )
    parser.add_argument("--sleep", action="store_true", help="tell what sleep saves where islands rest")
    parser.add_argument("--chain", action="store_true", help="tell how cost grows with the number of bodies")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="draw what --chain tells: .png, .svg or .pdf")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON; - prints that and nothing else")


def run(args: argparse.Namespace) -> int:
    """Time the kernels; 0."""
    require_folder("--json", args.json)
    if args.chain:
        return _chain(args)
    if args.plot is not None:
        raise PhysicsPriorError("--plot draws what --chain tells: give both")
    if args.effects:
        return _effects(args)
    if args.sleep:
        return _sleep(args)
    from physics_prior.studies import bench_estimator, bench_person
    from physics_prior.studies.bench import run_bench, table

    with progress("timing") as report:
        figures = run_bench(args.peers, report)
    if args.json is not None:
        write_json(args.json, figures)
    if args.json != STDOUT:
        console().print(table(figures))
        console().print(bench_estimator.table(figures))
        console().print(bench_person.table(figures))
    return 0


def _effects(args: argparse.Namespace) -> int:
    from physics_prior.studies import effect_costs, scene_costs

    with progress("building and running") as report:
        figures = effect_costs.run_effect_costs(progress=report) | scene_costs.run_scene_costs(report)
    if args.json is not None:
        write_json(args.json, figures)
    if args.json != STDOUT:
        console().print(effect_costs.table(figures), soft_wrap=True)
        console().print()
        console().print(scene_costs.table(figures), soft_wrap=True)
    return 0


def _sleep(args: argparse.Namespace) -> int:
    from physics_prior.studies.sleep_costs import run_sleep_costs, table

    with progress("timing") as report:
        figures = run_sleep_costs(report)
    if args.json is not None:
        write_json(args.json, figures)
    if args.json != STDOUT:
        console().print(table(figures), soft_wrap=True)
    return 0


def _chain(args: argparse.Namespace) -> int:
    from physics_prior.studies.chain_costs import card, draw, run_chain_costs, table
    from physics_prior.studies.plot import require_format

    if args.plot is not None:
        require_folder("--plot", str(args.plot))
        require_format(args.plot)
    with progress("timing") as report:
        costs = run_chain_costs(progress=report)
    if args.plot is not None:
        with whole_file(args.plot) as partial:
            draw(costs, partial)
    if args.json is not None:
        write_json(args.json, card(costs))
    if args.json != STDOUT:
        console().print(table(costs), soft_wrap=True)
    return 0
