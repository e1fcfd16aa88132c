"""Run the hard cases on which engines break, and compare what is measured with what may be.

One line a case: the figure closest to its bound, the bound, how many times the figure fits into it, and what other engines
do there. All 30 take some ten minutes; the first time, kernels are compiled besides. CASE is a number or a name of the
list in docs/stability.md. Exit code 1 if a case fails.

Examples:
  physics-prior stability
  physics-prior stability 3 18 dzhanibekov --json stability.json
  physics-prior stability 10 --plot pictures
"""

import argparse
from pathlib import Path

from physics_prior.commands.terminal import STDOUT, console, progress, require_folder, require_plot_folder, write_json

PASSED, FAILED = 0, 1
LINE_WIDTH = 260  # one line a case, where it is not a terminal that is narrower


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `stability`."""
    parser.add_argument("cases", metavar="CASE", nargs="*", help="numbers or names of cases; all where none is given")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON; - prints that and nothing else")
    parser.add_argument("--plot", metavar="DIR", type=Path, help="draw margins and motions into a folder")


def run(args: argparse.Namespace) -> int:
    """Run the cases; 0 if all pass, 1 if not."""
    require_folder("--json", args.json)
    if args.plot is not None:
        require_plot_folder(args.plot)
    from physics_prior.studies.stability.registry import chosen
    from physics_prior.studies.stability.suite import figures, run_cases, table

    cases = chosen(args.cases)
    with progress("hard cases") as report:
        outcomes = run_cases(cases, report)
    found = figures(outcomes)
    if args.plot is not None:
        from physics_prior.studies.stability.drawing import draw

        draw(outcomes, args.plot)
    if args.json is not None:
        write_json(args.json, found)
    if args.json != STDOUT:
        console(LINE_WIDTH).print(table(outcomes))
    return FAILED if found["failed"] else PASSED
