"""The command line, `physics-prior`: which subcommands there are, and what an error looks like.

A subcommand's module is imported only when it is the one that was asked for. Exit codes: 0 done, 1 a study that did not
pass, 2 bad input (one sentence on stderr), 130 interrupted.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from importlib import import_module
from typing import NoReturn

from physics_prior import __version__
from physics_prior.errors import PhysicsPriorError

COMMANDS = {
    "check": ("physics_prior.commands.check", "explain a scene: its parts, effects, constraints and what a step costs"),
    "urdf": ("physics_prior.commands.urdf", "write a scene's model for RViz and other engines"),
    "calibrate": ("physics_prior.commands.calibrate", "fit a person to a trial of markers, and write its scene"),
    "simulate": ("physics_prior.commands.simulate", "record a bag of a scene: noisy measurements and the truth"),
    "replay": ("physics_prior.commands.replay", "estimate motion and forces from a recording"),
    "plot": ("physics_prior.commands.plot", "draw joints, forces and figures of a recording"),
    "effects": ("physics_prior.commands.effects", "tell which effects a recording calls for, and fit their numbers"),
    "stability": ("physics_prior.commands.stability", "run the hard cases on which engines break"),
    "accuracy": ("physics_prior.commands.accuracy", "measure what accuracy costs in time, beside other engines"),
    "tradeoff": (
        "physics_prior.commands.tradeoff",
        "measure what accuracy costs the estimator, and how much is enough",
    ),
    "bench": ("physics_prior.commands.bench", "time the kernels, alone or against other engines"),
}
"""Module and one line of help of every subcommand."""

DONE, BAD_INPUT, INTERRUPTED = 0, 2, 130

EPILOG = """\
Examples:
  physics-prior check double_pendulum
  physics-prior simulate double_pendulum -o my_bag --seed 1
  physics-prior replay my_bag --scene double_pendulum --reference /truth/joint_states --plot my_bag.png

SCENE is a scene file or the name of a shipped scene. Each subcommand has its own --help.
"""


class Parser(argparse.ArgumentParser):
    """Refuses bad arguments in one sentence, as everything else does."""

    def error(self, message: str) -> NoReturn:
        self.exit(BAD_INPUT, f"physics-prior: {message}; see '{self.prog} --help'\n")


def main(argv: Sequence[str] | None = None) -> int:
    """Run one subcommand; return the exit code."""
    words = list(sys.argv[1:] if argv is None else argv)
    try:
        args = make_parser(words).parse_args(words)
        if args.run is None:
            raise PhysicsPriorError(f"give a command: {', '.join(COMMANDS)}; see 'physics-prior --help'")
        return int(args.run(args))
    except PhysicsPriorError as error:
        print(f"physics-prior: {error}", file=sys.stderr)
        return BAD_INPUT
    except KeyboardInterrupt:
        print("physics-prior: interrupted", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # who reads our output has seen enough (`| head`); Python would complain once more when it flushes
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except OSError as error:
        print(f"physics-prior: {error.filename or 'a file'}: {error.strerror}", file=sys.stderr)
        return BAD_INPUT


def make_parser(words: Sequence[str]) -> argparse.ArgumentParser:
    """The parser of a command line, with the arguments of the subcommand that it begins with."""
    parser = Parser(
        prog="physics-prior",
        description="Estimates the motion of articulated bodies with physics as the prior.",
        epilog=EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("-V", "--version", action="version", version=f"physics-prior {__version__}")
    parser.set_defaults(run=None)
    commands = parser.add_subparsers(title="commands", metavar="COMMAND")
    for name, (module_name, summary) in COMMANDS.items():
        command = commands.add_parser(name, help=summary, formatter_class=argparse.RawDescriptionHelpFormatter)
        if list(words[:1]) == [name]:
            module = import_module(module_name)
            command.description = module.__doc__
            module.add_arguments(command)
            command.set_defaults(run=module.run)
    return parser


if __name__ == "__main__":
    sys.exit(main())
