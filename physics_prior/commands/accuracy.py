"""Measure what accuracy costs in time on benchmark mechanisms: every formulation, integrator and step size.

Of each setting: the largest error against a reference of other origin, the change of energy, how far what holds was open,
processor time per simulated second. Printed is the Pareto front, what is worth taking; --json has everything and --plot draws
it. With --peers MuJoCo, Pinocchio and Exudyn take turns with ours on the problems that they can be given alike. All ten
problems take the better part of an hour; the first time, kernels are compiled besides. --compare sets the times of an earlier
card beside.

With --knob the tolerances 1e-2 to 1e-8 are asked for instead, as a scene's `accuracy: {tolerance: ...}` would: told is what the
step that is chosen errs over what was asked, and what it costs over the best of the study.

PROBLEM: pendulum, double_pendulum, four_bar, four_bar_40, andrews, bricard, governor, heavy_top, free_top, held_human.

Examples:
  physics-prior accuracy double_pendulum four_bar --peers --plot pictures
  physics-prior accuracy --peers --json docs/accuracy/0.1.0.json
  physics-prior accuracy --knob --json docs/accuracy/0.1.0_knob.json
  physics-prior accuracy --compare docs/accuracy/0.1.0.json
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from physics_prior.commands.terminal import STDOUT, console, progress, require_folder, require_plot_folder, write_json
from physics_prior.errors import PhysicsPriorError

if TYPE_CHECKING:
    from physics_prior.studies.accuracy.problem import Problem

LINE_WIDTH = 160  # where it is not a terminal that is narrower


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `accuracy`."""
    parser.add_argument("problems", metavar="PROBLEM", nargs="*", help="names of problems; all where none is given")
    parser.add_argument("--peers", action="store_true", help="measure MuJoCo, Pinocchio and Exudyn too")
    parser.add_argument("--knob", action="store_true", help="ask for tolerances, and judge the steps chosen")
    parser.add_argument("--json", metavar="FILE", help="write every figure as JSON; - prints that and nothing else")
    parser.add_argument("--plot", metavar="DIR", type=Path, help="draw one picture a problem into a folder")
    parser.add_argument("--compare", metavar="CARD", type=Path, help="an earlier --json file, to set beside")


def run(args: argparse.Namespace) -> int:
    """Measure; 0."""
    require_folder("--json", args.json)
    if args.plot is not None:
        require_plot_folder(args.plot)
    from physics_prior.studies.accuracy.card import (
        card,
        comparison_table,
        front_table,
        ratio_table,
        read_card,
        unmeasured_table,
    )
    from physics_prior.studies.accuracy.problem import chosen
    from physics_prior.studies.accuracy.study import run_study

    problems = chosen(args.problems)
    if args.knob:
        return _knob(args, problems)
    before = None if args.compare is None else read_card(args.compare)
    with progress("accuracy") as report:
        found = run_study(problems, args.peers, report)
    data = card(found, args.peers)
    if args.json is not None:
        write_json(args.json, data)
    if args.plot is not None:
        from physics_prior.studies.accuracy.drawing import draw

        for problem, points in found.values():
            draw(problem, points, args.plot)
    if args.json != STDOUT:
        out = console(LINE_WIDTH)
        out.print(front_table(data))
        if args.peers:
            out.print(ratio_table(data))
        unmeasured = unmeasured_table(data)
        if unmeasured.row_count:
            out.print(unmeasured)
        if before is not None:
            out.print(comparison_table(data, before))
    return 0


def _knob(args: argparse.Namespace, problems: "list[Problem]") -> int:
    from physics_prior.studies.accuracy.knob import knob_card, knob_table, run_knob

    if args.peers or args.plot is not None or args.compare is not None:
        raise PhysicsPriorError("--knob takes neither --peers nor --plot nor --compare: it judges our own choices")
    with progress("accuracy") as report:
        found = run_knob(problems, report)
    if args.json is not None:
        write_json(args.json, knob_card(found))
    if args.json != STDOUT:
        console(LINE_WIDTH).print(knob_table(found))
    return 0
