"""Pictures of a replayed motion: every joint with its uncertainty, forces of the ground against plates, and figures of sticks."""

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from physics_prior.dynamics.formulations.kinematics import kinematics
from physics_prior.estimation.force_score import COMPONENTS
from physics_prior.model import JointKind, Tree
from physics_prior.model.coordinates import coordinate_names, coordinates
from physics_prior.recording.replay import ReplayResult
from physics_prior.rotations import rotate
from physics_prior.studies.plot import LINES, MOST_POINTS, REFERENCE, SIGMAS, UNDERLAY, legend, limit, require_format

COLUMNS = 3  # of joints
FRAMES = 9  # of the figures
SIDES = {"left": LINES[0], "right": LINES[1], "": "#555555"}
"""Colours by the side that a part's name begins with."""
FAINTEST = 0.25  # opacity of the first figure; the last one's is 1
APART = 0.03  # of all that is drawn: moments that are nearer are not all told
FAR = 0.7  # of the longest way
SHORT = 1e-3  # of the model's size: a stick that would not be seen


def plot_joints(result: ReplayResult, path: Path) -> None:
    """Draw every joint's coordinates over time, with two standard deviations, into a file, PNG, SVG or PDF by its ending.

    Raises:
        PhysicsPriorError: another ending.
    """
    require_format(path)
    tree = result.scene.tree
    panels = _panels(tree)
    columns = min(COLUMNS, len(panels))
    rows = math.ceil(len(panels) / columns)
    figure = Figure(figsize=(13.0, 1.0 + 1.9 * rows), dpi=110, layout="constrained")
    order = np.argsort(result.stamps, kind="stable")
    order = order[:: 1 + len(order) // MOST_POINTS]
    stamps = result.stamps[order]
    values = np.array([coordinates(tree, q) for q in result.q[order]])
    spread = SIGMAS * result.spread[order]
    for index, (title, unit, scale, freedoms) in enumerate(panels):
        axes = figure.add_subplot(rows, columns, index + 1, xlim=(stamps[0], stamps[-1]))
        shown = []
        for color, (label, column) in zip(LINES, freedoms, strict=False):
            value = np.unwrap(values[:, column]) if unit == "deg" else values[:, column]
            band = spread[:, column]
            axes.plot(stamps, scale * value, color=color, lw=1.0, label=label)
            axes.fill_between(stamps, scale * (value - band), scale * (value + band), color=color, alpha=0.25, lw=0)
            shown.append(value[:, None] + np.median(band) * np.array([-1.0, 1.0]))
        limit(axes, scale * np.concatenate(shown))
        if len(freedoms) > 1:
            legend(axes)
        typical = scale * float(np.median(spread[:, [column for _, column in freedoms]]))
        axes.set_title(f"{title.replace('_', ' ')}, ±{typical:.2g} {unit}", loc="left", fontsize=8)
        axes.set_ylabel(f"[{unit}]", fontsize=7)
        if index >= len(panels) - columns:
            axes.set_xlabel("time [s]", fontsize=7)
        _quiet(axes)
    _finish(figure, result, f"joints \u00b1{SIGMAS:g} standard deviations", path)


def plot_forces(result: ReplayResult, path: Path) -> None:
    """Draw the forces of the ground against force plates, by component; as ``plot_joints``. There must be some."""
    require_format(path)
    count = len(result.forces)
    figure = Figure(figsize=(13.0, 1.0 + 2.2 * count), dpi=110, layout="constrained")
    for row, (name, comparison) in enumerate(result.forces.items()):
        figures = comparison.figures(result.weight)
        stamps = (comparison.stamps - result.epoch) * 1e-9
        between = np.diff(stamps)
        gaps = np.flatnonzero(between > 1.5 * np.median(between)) + 1 if len(between) else np.zeros(0, dtype=int)
        for column, component in enumerate(COMPONENTS):
            axes = figure.add_subplot(count, 3, 3 * row + column + 1)
            for forces, style in (
                (comparison.measured, {"color": REFERENCE, **UNDERLAY, "label": "plate"}),
                (comparison.estimated, {"color": LINES[0], "lw": 1.1, "label": "estimate"}),
            ):
                axes.plot(np.insert(stamps, gaps, np.nan), np.insert(forces[:, column], gaps, np.nan), **style)
            own = figures[component]
            told = [f"RMSE {own['percent_weight']:.2g} % of weight"]
            if own["rrmse_percent"] is not None:
                told.append(f"{own['rrmse_percent']:.2g} % of range")
            if own["r"] is not None:
                told.append(f"r {own['r']:.3f}")
            axes.set_title(f"{name}, {component.replace('_', '-')}\n{', '.join(told)}", loc="left", fontsize=7)
            axes.set_ylabel("[N]", fontsize=7)
            if row == count - 1:
                axes.set_xlabel("time [s]", fontsize=7)
            if row == column == 0:
                axes.legend(fontsize=6, frameon=False)
            _quiet(axes)
    _finish(figure, result, "forces of the ground", path)


def plot_figures(result: ReplayResult, path: Path) -> None:
    """Draw the body as sticks from joint to joint at moments in turn, seen across the way that it goes; as ``plot_joints``."""
    require_format(path)
    order = np.argsort(result.stamps, kind="stable")
    chosen = order[np.unique(np.linspace(0, len(order) - 1, FRAMES).round().astype(int))]
    bodies = [_sticks(result.scene.tree, q) for q in result.q[chosen]]
    ends = np.array([[stick[1:] for stick in body] for body in bodies])  # (frames, sticks, 2, 3)
    across = _across(ends)
    tips, size, told = _tips(ends), float(np.ptp(ends.reshape(-1, 3), axis=0).max()), list[tuple[float, float]]()
    figure = Figure(figsize=(13.0, 5.5), dpi=110, layout="constrained")
    axes = figure.add_subplot(aspect="equal", adjustable="datalim")
    for frame, body in enumerate(bodies):
        opacity = FAINTEST + (1.0 - FAINTEST) * (frame / max(1, len(bodies) - 1))
        for side, begin, end in body:
            line = np.array([begin, end])
            axes.plot(line @ across, line[:, 2], color=SIDES[side], alpha=opacity, lw=2.0, solid_capstyle="round")
        place = tips[frame] @ across, tips[frame, 2]
        if all(math.dist(place, other) > APART * size for other in told):
            told.append(place)
            axes.annotate(
                f"{result.stamps[chosen[frame]]:.2f} s",
                place,
                xytext=(0, 5 if tips[frame, 2] > ends[frame, ..., 2].mean() else -10),
                textcoords="offset points",
                ha="center",
                fontsize=6,
            )
    sides = {side for side, _, _ in bodies[0]}
    if len(sides) > 1:
        handles = [Line2D([], [], color=SIDES[side], label=side or "middle") for side in SIDES if side in sides]
        axes.legend(handles=handles, fontsize=7, frameon=False)
    axes.set_xlabel("along the motion [m]", fontsize=8)
    axes.set_ylabel("height [m]", fontsize=8)
    _quiet(axes)
    _finish(figure, result, f"{len(bodies)} moments, the first faintest", path)


def _panels(tree: Tree) -> list[tuple[str, str, float, list[tuple[str, int]]]]:
    """Of each panel: title, unit, what to multiply by, and label and freedom of each line."""
    out = []
    degrees = 180.0 / np.pi
    for link in tree.links:
        kind, name = link.joint.kind, link.joint.name
        own = list(zip(coordinate_names(tree)[name], range(link.v.start, link.v.stop), strict=True))
        if kind is JointKind.FREE:
            out.append((f"{name}, position", "m", 1.0, own[:3]))
            own = own[3:]
        linear = kind is JointKind.PRISMATIC
        out.append((name, "m" if linear else "deg", 1.0 if linear else degrees, own))
    return out


def _sticks(tree: Tree, q: np.ndarray) -> list[tuple[str, np.ndarray, np.ndarray]]:
    """Side, begin and end (3,) m of each stick: from joint to joint, and from each last one on through its centre of mass."""
    motion = kinematics(tree, q, np.zeros(tree.nv))
    parents = {link.parent for link in tree.links}
    out = []
    for index, link in enumerate(tree.links):
        side = next((each for each in SIDES if each and link.part.startswith(each)), "")
        origin = motion.position[index]
        if link.parent >= 0:
            out.append((side, motion.position[link.parent], origin))
        if index not in parents:
            out.append((side, origin, origin + rotate(motion.orientation[index], 2.0 * _reach(tree, index))))
    return out


def _reach(tree: Tree, index: int) -> np.ndarray:
    """(3,) m in a link's axes, half the stick of one that carries none: to its centre of mass, or half its longest edge."""
    link = tree.links[index]
    center = np.asarray(link.mass_properties.center_of_mass)
    shape = tree.part(link.part).shape
    if shape is None or np.linalg.norm(center) > SHORT * float(np.max(shape.size)):
        return center
    longest = int(np.argmax(shape.size))
    return 0.5 * rotate(np.asarray(shape.orientation), float(shape.size[longest]) * np.eye(3)[longest])


def _across(ends: np.ndarray) -> np.ndarray:
    """(3,) the level direction along which most of a motion is, positive the way that it goes."""
    level = ends[..., :2].reshape(-1, 2)
    _, _, axes = np.linalg.svd(level - level.mean(axis=0), full_matrices=False)
    way = ends[-1, ..., :2].mean(axis=(0, 1)) - ends[0, ..., :2].mean(axis=(0, 1))
    return np.array([*(axes[0] if axes[0] @ way >= 0.0 else -axes[0]), 0.0])


def _tips(ends: np.ndarray) -> np.ndarray:
    """(frames, 3) m of each figure's highest end among those that go far."""
    points = ends.reshape(len(ends), -1, 3)
    far = np.ptp(points, axis=0).max(axis=1)
    heights = np.where(far >= FAR * far.max(), points[..., 2].mean(axis=0), -np.inf)
    return np.asarray(points[:, int(np.argmax(heights))])


def _quiet(axes: Axes) -> None:
    axes.spines[["top", "right"]].set_visible(False)
    axes.grid(color="#000000", alpha=0.08, lw=0.6)
    axes.tick_params(labelsize=7)


def _finish(figure: Figure, result: ReplayResult, what: str, path: Path) -> None:
    figure.suptitle(f"{result.scene.name}, {result.kind}: {what}", x=0.012, ha="left", fontsize=11)
    figure.savefig(path)
