"""A calibrated person as a scene file."""

import json
import math
import textwrap

import numpy as np
from scipy import constants

from physics_prior.calibration.person import Calibration
from physics_prior.dynamics.simulator import Simulator
from physics_prior.model import JointKind
from physics_prior.scene import MarkerSet

LEAST_NOISE = 1e-3  # m: cameras and labels leave as much
UNKNOWN = 10.0  # rad/s^2 sqrt(s) and m/s^2 sqrt(s): accelerations by what is not modelled, muscles first of all
BESIDE = 15.0  # rad/s^2 sqrt(s): accelerations of a joint by what is not modelled, where muscles are
MUSCLE = 3000.0  # rad/s^3 sqrt(s): jerk of a joint by its muscles
CALM = ("neck", "shoulder", "elbow", "radioulnar", "wrist")  # joints that no landing foot shakes
CALM_BESIDE, CALM_MUSCLE = 4.0, 50.0  # of these
CONSTANT = 1.0  # s, over which torques of muscles and forces of the ground are forgotten
VERTICAL, HORIZONTAL, MOMENT = 1.0, 0.2, 0.08  # of the ground's force, of the weight; of its moment, m of the weight
GATE = 0.999999  # of markers: skin that drifts stays off for tenths of a second, and its segment would go astray without it
TONE = 10.0  # 1/s: what joints that no marker tells come to rest by


def scene_text(
    found: Calibration, markers: MarkerSet, topic: str, frame_id: str, origin: str, scale: float, forces: bool = False
) -> str:
    """The text of a scene: the person, the markers of a topic where they are on it, and noise to track it by.

    topic, frame_id: of a recording, and so quoted. origin: one line that says what it was made from. scale: of the
    markers' noise over what is left of them in the trial. forces: whether muscles and the ground are to be found.
    """
    human, ease = found.human, _ease(found)
    lengths = "\n".join(
        f"      {name}: {human.lengths[name]:.4f}  # +-{found.deviations[name]:.4f}" for name in found.informed
    )
    rigid = textwrap.fill(", ".join(human.rigid), 110, initial_indent="      ", subsequent_indent="      ").strip()
    lines = []
    for name, marker in markers.markers.items():
        point, spread = (
            ", ".join(f"{x + 0.0:.4f}" for x in np.round(each, 4))
            for each in (found.places[name], found.place_deviations[name])
        )
        noise = scale * max(found.noise[name], LEAST_NOISE)
        lines.append(
            f"        - {{name: {name}, part: {marker.part}, point: [{point}], noise: {noise:.5f}}}  # +-[{spread}]"
        )
    pelvis = found.q[0][:7]
    position, orientation = (", ".join(f"{x:.4f}" for x in each) for each in (pelvis[:3], pelvis[3:]))
    return (
        f"""# {origin}
description: >-
  A person of {human.mass:g} kg and {human.height:.2f} m with the markers of '{markers.name}', calibrated from
  {found.frames} frames; they fit to {1e3 * found.rms:.1f} mm per axis, root mean square.
frame_id: {json.dumps(frame_id)}
model:
  human:
    mass: {human.mass:g} kg
    height: {human.height:.4f}  # +-{found.deviations["height"]:.4f}
    sex: {human.sex}
    table: {human.table}
    lengths:
{lengths}
    rigid: [{rigid}]
effects:
  - gravity
  - joint_damping:
      # muscles that hold: a joint by itself comes to rest within {1.0 / TONE:g} s
      coefficients:
{_damping(found, ease)}
{_unknown(found, ease) if forces else ""}measurements:
  - points:
      topic: {json.dumps(topic)}
      noise: {scale * max(found.rms, LEAST_NOISE):.5f}
      markers:
"""
        + "\n".join(lines)
        + f"""
noise:
{_white(found, ease, forces)}
  jerk: 300
  velocity: 2
gate: {{probability: {GATE}}}  # skin drifts: wrong labels are further off
step: {{size: 5 ms}}
initial:
  positions:
    pelvis: {{position: [{position}], orientation: [{orientation}]}}
readouts:
  - energy: total
"""
    )


def _ease(found: Calibration) -> np.ndarray:
    """(nv,) acceleration of each freedom by a unit force on it alone, in the trial's first posture."""
    return np.diag(np.linalg.inv(Simulator(found.human.tree(), ()).mass_matrix(found.q[0])))


def _damping(found: Calibration, ease: np.ndarray) -> str:
    joints = [link for link in found.human.tree().links if link.joint.kind is not JointKind.FREE]
    return "\n".join(f"        {link.joint.name}: {TONE / np.median(ease[link.v]):.2g}" for link in joints)


def _calm(found: Calibration) -> np.ndarray:
    """(nv,) bool: freedoms of joints that no landing foot shakes."""
    out = np.zeros(found.human.tree().nv, dtype=bool)
    for link in found.human.tree().links:
        out[link.v] = any(name in link.joint.name for name in CALM)
    return out


def _by_joint(found: Calibration, values: np.ndarray, indent: int) -> str:
    """A line for each inner joint with its own of values (nv,)."""
    lines = []
    for link in found.human.tree().links:
        if link.joint.kind is not JointKind.FREE:
            own = [f"{value:.2g}" for value in values[link.v]]
            lines.append(f"{' ' * indent}{link.joint.name}: {own[0] if len(own) == 1 else '[' + ', '.join(own) + ']'}")
    return "\n".join(lines)


def _unknown(found: Calibration, ease: np.ndarray) -> str:
    jerks = np.where(_calm(found), CALM_MUSCLE, MUSCLE)
    return f"""  - muscle:
      # jerks of {MUSCLE:g} rad/s^3 sqrt(s) of each joint by itself, of {CALM_MUSCLE:g} in neck and arms
      time_constant: {CONSTANT:g} s
      strength:
{_by_joint(found, jerks * math.sqrt(0.5 * CONSTANT) / ease, 8)}
{_feet(found)}
"""


def _white(found: Calibration, ease: np.ndarray, forces: bool) -> str:
    root = found.human.tree().links[0]
    if forces:
        text = (
            f"{BESIDE:g} rad/s^2 sqrt(s) of each joint by itself, of {CALM_BESIDE:g} in neck and arms;"
            " nothing holds the whole but the ground"
        )
        own, accelerations = "0", np.where(_calm(found), CALM_BESIDE, BESIDE)
    else:
        text = f"{UNKNOWN:g} rad/s^2 sqrt(s), or m/s^2 sqrt(s), of each joint by itself"
        linear, angular = (UNKNOWN / ease[root.v])[[0, 4]]
        own, accelerations = f"{{linear: {linear:.2g}, angular: {angular:.2g}}}", np.full(len(ease), UNKNOWN)
    lines = _by_joint(found, accelerations / ease, 4)
    return f"  # unknown accelerations of {text}\n  force:\n    {root.joint.name}: {own}\n{lines}"


def _feet(found: Calibration) -> str:
    weight = found.human.mass * constants.g
    strength = f"vertical: {VERTICAL * weight:.0f} N, horizontal: {HORIZONTAL * weight:.0f} N, moment: {MOMENT * weight:.0f} N m"
    return "\n".join(
        f"  - ground_reaction: {{name: {side}_sole, part: {side}_sole, {strength}, time_constant: {CONSTANT:g} s}}"
        for side in ("left", "right")
    )
