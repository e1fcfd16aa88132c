"""Tell which effects a recording calls for, and how strong they are.

Each effect of the scene is left out in turn, and each one proposed with --try is added with its numbers fitted; what that does
to the likelihood of the recording decides, against what chance would give (the Bayesian information criterion). --fit
estimates numbers of the scene by maximum likelihood, with 95 % intervals, and has them free in every comparison. Without
BAG the scene's own simulated motion is used, which tells what a recording could. An effect that is left out or added makes
another step, which is compiled once.

A path names a number of the scene file: model.parts.link1.mass, noise.force, effects.gravity.acceleration.2 (the third of a
list), effects.joint_damping.coefficients.pivot (an effect by its kind or name).

Examples:
  physics-prior effects uw_double_pendulum my_bag --try "drag: {part: link2, linear: 1e-4 N s/m}"
  physics-prior effects double_pendulum bags/double_pendulum --fit effects.gravity.acceleration.2 --json -
"""

import argparse
import math
from pathlib import Path
from typing import Any

from physics_prior.commands.terminal import STDOUT, console, progress, require_folder, table, whole_file, write_json
from physics_prior.errors import PhysicsPriorError

SIMULATED_SECONDS = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `effects`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a shipped scene")
    parser.add_argument("bag", metavar="BAG", nargs="?", type=Path, help="the recording; simulated where there is none")
    parser.add_argument(
        "--try",
        dest="proposed",
        metavar="EFFECT",
        action="append",
        default=[],
        help="an effect, as a scene would have it",
    )
    parser.add_argument("--fit", metavar="PATH", nargs="+", default=[], help="numbers of the scene file to estimate")
    parser.add_argument("--seed", type=int, default=0, help="of the simulated recording (0)")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="draw the evidence: .png, .svg or .pdf")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON; - prints that and nothing else")


def run(args: argparse.Namespace) -> int:
    """Study the effects; 0."""
    require_folder("--json", args.json)
    require_folder("--plot", None if args.plot is None else str(args.plot))
    from physics_prior.commands.compilation import compiling
    from physics_prior.interface.warm_up import warm_up
    from physics_prior.studies.effects.ablation import ablate
    from physics_prior.studies.effects.drawing import draw
    from physics_prior.studies.effects.fit import Fitted, fit
    from physics_prior.studies.effects.likelihood import read_measurements, simulated_measurements
    from physics_prior.studies.effects.variant import SceneText
    from physics_prior.studies.plot import require_format

    if args.plot is not None:
        require_format(args.plot)
    text = SceneText.read(args.scene)
    proposed = [_entry(each) for each in args.proposed]
    scene = text.build()
    if not scene.measurements:
        raise PhysicsPriorError(f"scene '{scene.name}' measures nothing: add 'measurements' to study its effects")
    with compiling(scene, "carry"):
        warm_up(scene)
    if args.bag is None:
        measurements = simulated_measurements(scene, args.seed, SIMULATED_SECONDS)
    else:
        measurements = read_measurements(args.bag, scene)
    fitted: list[Fitted] = []
    if args.fit:
        with progress(f"fitting {len(args.fit)} numbers") as report:
            found = fit(text, args.fit, measurements, lambda count: report(0.0, f"fitting, replay {count}"))
        fitted, text = found.parameters, found.scene
    with progress("effects") as report:
        verdicts = ablate(text, measurements, proposed, args.fit, report)
    if args.plot is not None:
        with whole_file(args.plot) as partial:
            draw(verdicts, fitted, partial)
    if args.json is not None:
        write_json(
            args.json, {"effects": [each.figures() for each in verdicts], "fit": [_figures(each) for each in fitted]}
        )
    if args.json != STDOUT:
        _print(verdicts, fitted)
    return 0


def _entry(text: str) -> Any:
    """An effect as a scene's list would have it; PhysicsPriorError if it is no YAML."""
    from physics_prior.scene.yaml_file import parse_yaml

    place = parse_yaml(Path("--try"), f"effects:\n  - {text}\n")
    return place.value["effects"][0]


def _figures(each: Any) -> dict[str, Any]:
    ends = [end if math.isfinite(end) else None for end in (each.low, each.high)]
    return {"path": each.path, "start": each.start, "value": each.value, "interval95": ends}


def _print(verdicts: Any, fitted: Any) -> None:
    out = console()
    if fitted:
        rows = table("fitted numbers", "path", "file", "estimate", "95 % interval", numbers=3)
        for each in fitted:
            interval = f"{each.low:.5g} to {each.high:.5g}" if math.isfinite(each.low) else "not determined"
            rows.add_row(each.path, f"{each.start:.5g}", f"{each.value:.5g}", interval)
        out.print(rows)
        out.print()
    rows = table(
        "effects", "effect", "log-likelihood", "needed", "us a step", "NIS with, without", "forecast", numbers=5
    )
    for each in verdicts:
        rows.add_row(
            f"{each.name} (proposed)" if each.proposed else each.name,
            _shown(each.delta_log_likelihood, "+.4g"),
            f"{each.threshold:.3g}",
            _shown(each.us_per_step, ".2g"),
            f"{_shown(each.nis_with, '.3f')}, {_shown(each.nis_without, '.3f')}",
            f"{_shown(each.forecast_with, '.3g')}, {_shown(each.forecast_without, '.3g')}",
        )
    out.print(rows)
    out.print()
    for each in verdicts:
        out.print(each.evidence)


def _shown(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
