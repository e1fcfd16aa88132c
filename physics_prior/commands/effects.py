"""Tell which effects recordings call for, and how strong they are.

All effects of the scene and each one proposed with --try are fitted together: their strengths (coefficients of damping, of
friction, of drag, stiffnesses), whatever --fit names, and nothing that --hold names. Then each effect is left out in turn, all
else fitted anew; what that does to the likelihood of the recordings decides, against what chance would give (the Bayesian
information criterion). Sides that an effect can do without, such as the friction of a contact, are tried as effects are. Fitted
numbers of the scene that remains come with 95 % intervals. Of several bags each counts as much as its measurements do. Without
BAG the scene's own simulated motion is used, which tells what a recording could. An effect that is left out or added makes
another step, which is compiled once.

A path names a number of the scene file, or a list or mapping of them: model.parts.link1.mass, noise.force,
measurements.0.pose.scale (of lengths), effects.gravity.acceleration (its size and direction; .2 is its third number),
effects.joint_damping.coefficients.pivot (an effect by its kind or name).

Examples:
  physics-prior effects uw_double_pendulum my_bag --try "drag: {part: link2, linear: 1e-4 N s/m}"
  physics-prior effects cube_toss toss_1 toss_2 --fit measurements.0.pose.scale
  physics-prior effects double_pendulum bags/double_pendulum --fit effects.gravity.acceleration --json -
"""

import argparse
import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

from physics_prior.commands.terminal import STDOUT, console, progress, require_folder, table, whole_file, write_json
from physics_prior.errors import PhysicsPriorError

if TYPE_CHECKING:
    from physics_prior.scene import Scene

SIMULATED_SECONDS = 5.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `effects`."""
    parser.add_argument("scene", metavar="SCENE", help="a scene file, or the name of a shipped scene")
    parser.add_argument("bags", metavar="BAG", nargs="*", type=Path, help="recordings; simulated where there is none")
    parser.add_argument(
        "--try",
        dest="proposed",
        metavar="EFFECT",
        action="append",
        default=[],
        help="an effect, as a scene would have it",
    )
    parser.add_argument("--fit", metavar="PATH", nargs="+", default=[], help="numbers of the scene file to estimate")
    parser.add_argument(
        "--hold", metavar="PATH", nargs="+", default=[], help="strengths that are known: they are not fitted"
    )
    parser.add_argument("--reference", metavar="TOPIC", help="a JointState topic of the bags to compare estimates with")
    parser.add_argument("--seed", type=int, default=0, help="of the simulated recording (0)")
    parser.add_argument("--plot", metavar="FILE", type=Path, help="draw the evidence: .png, .svg or .pdf")
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON; - prints that and nothing else")


def run(args: argparse.Namespace) -> int:
    """Study the effects; 0."""
    require_folder("--json", args.json)
    require_folder("--plot", None if args.plot is None else str(args.plot))
    from physics_prior.commands.compilation import compiling, load_settled
    from physics_prior.interface.warm_up import warm_up
    from physics_prior.studies.effects.ablation import ablate
    from physics_prior.studies.effects.drawing import draw
    from physics_prior.studies.effects.likelihood import read_measurements, simulated_measurements
    from physics_prior.studies.effects.variant import SceneText
    from physics_prior.studies.plot import require_format

    if args.plot is not None:
        require_format(args.plot)
    if args.reference is not None and not args.bags:
        raise PhysicsPriorError("--reference needs a BAG that holds the topic: a simulated motion has none")
    text = SceneText.read(args.scene).stepped(load_settled(args.scene)[0].step)
    proposed = [_entry(each) for each in args.proposed]
    scene = text.build()
    if not scene.measurements:
        raise PhysicsPriorError(f"scene '{scene.name}' measures nothing: add 'measurements' to study its effects")
    with compiling(scene, "carry"):
        warm_up(scene)
    recordings = [read_measurements(bag, scene) for bag in args.bags]
    if not recordings:
        recordings = [simulated_measurements(scene, args.seed, SIMULATED_SECONDS)]

    def scored(variant: "Scene") -> float | None:
        return _error(variant, args.bags, args.reference)

    with progress("effects") as report:
        study = ablate(text, recordings, proposed, args.fit, args.hold, scored, report)
        verdicts, fitted = study.verdicts, study.fit.parameters()
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


def _error(scene: "Scene", bags: list[Path], reference: str | None) -> float | None:
    """Root mean square error of angles, deg, or else of lengths, m, against a reference; None where there is none."""
    from physics_prior.recording.replay import replay

    if reference is None:
        return None
    errors = []
    for bag in bags:
        score = replay(bag, scene, references=[reference]).score or {}
        error = score.get("position_rmse_deg") or score.get("position_rmse_m")
        if error is not None:
            errors.append(error)
    return math.sqrt(sum(error**2 for error in errors) / len(errors)) if errors else None


def _figures(each: Any) -> dict[str, Any]:
    ends = [end if math.isfinite(end) else None for end in (each.low, each.high)]
    error = each.model_error if math.isfinite(each.model_error) else None
    return {"path": each.path, "start": each.start, "value": each.value, "interval95": ends, "model_error": error}


def _print(verdicts: Any, fitted: Any) -> None:
    out = console()
    if fitted:
        rows = table("fitted numbers", "path", "file", "estimate", "95 % interval", "model error", numbers=4)
        for each in fitted:
            interval = f"{each.low:.5g} to {each.high:.5g}" if math.isfinite(each.low) else "not determined"
            error = f"{each.model_error:.2f}" if math.isfinite(each.model_error) else "-"
            rows.add_row(each.path, f"{each.start:.5g}", f"{each.value:.5g}", interval, error)
        out.print(rows)
        out.print()
    columns = ["log-likelihood", "needed", "us a step", "NIS with, without", "forecast"]
    scored = any(each.rmse_with is not None for each in verdicts)
    columns += ["RMSE"] if scored else []
    rows = table("effects", "effect", *columns, numbers=len(columns))
    for each in verdicts:
        rmse = [f"{_shown(each.rmse_with, '.3g')}, {_shown(each.rmse_without, '.3g')}"] if scored else []
        rows.add_row(
            f"{each.name} (proposed)" if each.proposed else each.name,
            _shown(each.delta_log_likelihood, "+.4g"),
            f"{each.threshold:.3g}",
            _shown(each.us_per_step, ".2g"),
            f"{_shown(each.nis_with, '.3f')}, {_shown(each.nis_without, '.3f')}",
            f"{_shown(each.forecast_with, '.3g')}, {_shown(each.forecast_without, '.3g')}",
            *rmse,
        )
    out.print(rows)
    out.print()
    for each in verdicts:
        out.print(each.evidence)


def _shown(value: float | None, form: str) -> str:
    return "-" if value is None else format(value, form)
