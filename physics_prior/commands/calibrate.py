"""Fit a person to a trial of markers, and write the scene that tracks it.

Segment lengths, joint centres and places of the markers are found by least squares over frames of the whole trial, static or
moving, with published proportions and anatomical places as priors, so that what the trial does not show stays as they say. Each
number is written with its standard deviation. The ground is z = 0, z up. The same trial gives the same scene.

--subject takes mass=KG and sex=female|male, and height=M (found where left out) and table=de_leva|dumas.

Examples:
  physics-prior calibrate my_trial --subject mass=60.8,sex=male --markers anatomical_45 -o my_person.yaml
  physics-prior calibrate my_trial --subject mass=60.8,sex=male --markers anatomical_45 --forces -o my_person.yaml
  physics-prior calibrate my_trial --subject mass=70,sex=female,height=1.68 --markers my_set.yaml -o my_person.yaml
"""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from physics_prior.commands.terminal import STDOUT, console, progress, require_folder, table, whole_file, write_json
from physics_prior.errors import PhysicsPriorError

if TYPE_CHECKING:
    import numpy as np

    from physics_prior.calibration import Calibration

FIELDS = ("mass", "sex", "height", "table")
ROUNDS = 3  # of finding the markers' noise: it hardly changes in the last


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Describe the arguments of `calibrate`."""
    parser.add_argument("bag", metavar="BAG", type=Path, help="the recording of the trial")
    parser.add_argument("--subject", required=True, type=_subject, help="mass=KG,sex=SEX[,height=M][,table=TABLE]")
    parser.add_argument(
        "--markers", metavar="SET", required=True, help="a marker set's file, or the name of a shipped one"
    )
    parser.add_argument("--topic", default="/markers", help="the PoseArray of the markers (/markers)")
    parser.add_argument("-o", "--output", metavar="SCENE", type=Path, required=True, help="the scene to write")
    parser.add_argument(
        "--forces", action="store_true", help="have muscles' torques and the ground's forces found, too"
    )
    parser.add_argument("--json", metavar="FILE", help="write the figures as JSON; - prints that and nothing else")


def run(args: argparse.Namespace) -> int:
    """Calibrate and write the scene; 0."""
    require_folder("--json", args.json)
    require_folder("--output", str(args.output))
    from physics_prior.calibration import calibrate, noise_ratio, scene_text
    from physics_prior.commands.compilation import compiling
    from physics_prior.estimation.measurement import PointsMeasurement
    from physics_prior.interface.warm_up import warm_up
    from physics_prior.model.human import Human
    from physics_prior.scene import build_scene, load_marker_set
    from physics_prior.scene.yaml_file import parse_yaml

    markers = load_marker_set(args.markers)
    subject = args.subject
    height = subject.get("height")
    human = Human(subject["mass"], height or 1.7, subject["sex"], subject.get("table", "de_leva"))
    stamps, points, frame_id = _trial(args.bag, args.topic)
    with progress("calibrating") as report:
        found = calibrate(1e-9 * (stamps - stamps[0]), points, markers, human, height is not None, progress=report)
    words = ",".join(
        f"{key}={value:g}" if isinstance(value, float) else f"{key}={value}" for key, value in subject.items()
    )
    options = f"--subject {words} --markers {args.markers} {'--forces ' * args.forces}-o {args.output.name}"
    origin = f"physics-prior calibrate {args.bag.name} {options}"
    measurements = [
        PointsMeasurement(stamp, args.topic, each) for stamp, each in zip(stamps.tolist(), points, strict=True)
    ]
    scale = 1.0
    for index in range(ROUNDS):
        text = scene_text(found, markers, args.topic, frame_id, origin, scale, args.forces)
        scene = build_scene(parse_yaml(args.output, text))
        if index == 0:
            with compiling(scene, "carry"):
                warm_up(scene)
        with progress("noise") as report:
            report(index / ROUNDS)
            scale *= noise_ratio(scene, measurements)
    with whole_file(args.output) as partial:
        partial.write_text(
            scene_text(found, markers, args.topic, frame_id, origin, scale, args.forces), encoding="utf-8"
        )
    if args.json is not None:
        write_json(args.json, _figures(found))
    if args.json != STDOUT:
        _print(found, args.output)
    return 0


def _subject(text: str) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for word in text.split(","):
        key, _, value = word.partition("=")
        if key not in FIELDS or not value or key in out:
            raise argparse.ArgumentTypeError(
                f"{word!r} is not valid: give each of {list(FIELDS)} once, as mass=70,sex=male"
            )
        try:
            out[key] = float(value) if key in ("mass", "height") else value
        except ValueError:
            raise argparse.ArgumentTypeError(f"{key} {value!r} is not a number") from None
    if "mass" not in out or out.get("sex") not in ("female", "male"):
        raise argparse.ArgumentTypeError(f"{text!r} lacks 'mass=KG' or 'sex=female' or 'sex=male'")
    return out


def _trial(bag: Path, topic: str) -> "tuple[np.ndarray, np.ndarray, str]":
    """Stamps (n,) ns and markers (n, k, 3) m of a bag in order, and their frame; what cannot be read is left out."""
    import numpy as np

    from physics_prior.interface.geometry import NANOSECONDS, array_of
    from physics_prior.recording.cdr import decode
    from physics_prior.recording.messages import PoseArray
    from physics_prior.recording.reader import open_bag

    reader = open_bag(bag)
    reader.require_topic(topic, PoseArray.ros_type)
    frames: dict[int, np.ndarray] = {}
    frame_id = ""
    for record in reader.read([topic]):
        message = decode(record.message_type, record.data)
        assert isinstance(message, PoseArray)
        stamp = message.header.stamp.sec * NANOSECONDS + message.header.stamp.nanosec
        frames.setdefault(stamp, np.array([array_of(pose.position) for pose in message.poses]).reshape(-1, 3))
        frame_id = message.header.frame_id
    if len({len(each) for each in frames.values()}) != 1:
        raise PhysicsPriorError(f"{bag}: topic '{topic}' has frames of different numbers of markers, or none")
    stamps = sorted(frames)
    return np.array(stamps), np.array([frames[stamp] for stamp in stamps]), frame_id or "world"


def _figures(found: "Calibration") -> dict[str, Any]:
    human = found.human
    return {
        "height": {"value": human.height, "deviation": found.deviations["height"]},
        "lengths": {
            name: {
                "value": human.lengths[name],
                "deviation": found.deviations[name],
                "informed": name in found.informed,
            }
            for name in human.lengths
        },
        "markers": {
            name: {
                "point": found.places[name].tolist(),
                "deviation": found.place_deviations[name].tolist(),
                "rms": found.noise[name],
            }
            for name in found.places
        },
        "rms": found.rms,
        "frames": found.frames,
    }


def _print(found: "Calibration", output: Path) -> None:
    rows = table("lengths", "name", "told by", "m", "+-", numbers=2)
    rows.add_row("height", "", f"{found.human.height:.4f}", f"{found.deviations['height']:.4f}")
    for name, value in found.human.lengths.items():
        told = "trial" if name in found.informed else "stature"
        rows.add_row(name, told, f"{value:.4f}", f"{found.deviations[name]:.4f}")
    out = console()
    out.print(rows)
    worst = max(found.noise, key=lambda name: found.noise[name])
    out.print(
        f"markers fit to {1e3 * found.rms:.1f} mm per axis, root mean square, of {found.frames} frames;"
        f" worst is {worst}, {1e3 * found.noise[worst]:.1f} mm"
    )
    out.print(f"{output}: written")
