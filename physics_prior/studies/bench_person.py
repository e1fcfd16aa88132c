"""Time the estimate of a person who walks, with muscles and ground forces: markers in, everything that is published out.

The scene is ``walk_lemouel``, 45 markers on the whole body; the walk is made up on its body (simulated_walk.py).
"""

from collections.abc import Callable
from dataclasses import replace
from time import thread_time_ns
from typing import Any

import numpy as np
from rich.table import Table

from physics_prior.estimation.estimator import Estimator
from physics_prior.estimation.measurement import Measurement
from physics_prior.interface import Output, take_in
from physics_prior.recording.cdr import encode
from physics_prior.recording.simulate import message_of
from physics_prior.scene import Scene, load_scene
from physics_prior.studies.simulated_walk import Walk, moments

SCENE, RATE = "walk_lemouel", 100.0  # Hz
SECONDS, LAPS = 2.0, 3
NAME = f"person_at_{RATE:g}_hz"  # of the factor among the figures' ``real_time``
SETTLED = 10  # frames after the start, not counted
WORST = 99.0  # percentile


def time_person(progress: Callable[[float], None] = lambda share: None) -> dict[str, float]:
    """Microseconds of the processor a frame, medians.

    ``person_filter``, message in to posterior; ``person_outputs``, all that is published of it, encoded; ``person``, both;
    and ``person_worst``, their percentile WORST.
    """
    scene = walking(SECONDS)
    walk = Walk(scene, scene.simulator())
    frames = [each for _, _, measured in moments(scene, walk, 0, SECONDS) for each in measured]
    run_frames(scene, frames[: 2 * SETTLED])  # what is not compiled yet is now
    times = []
    for lap in range(LAPS):
        times.append(run_frames(scene, frames)[SETTLED:])
        progress((lap + 1) / LAPS)
    told = np.concatenate(times)  # (frames, filter and outputs)
    both = told.sum(axis=1)
    return {
        "person_filter": float(np.median(told[:, 0])),
        "person_outputs": float(np.median(told[:, 1])),
        "person": float(np.median(both)),
        "person_worst": float(np.percentile(both, WORST)),
    }


def walking(seconds: float) -> Scene:
    """The scene, whose body walks so long at RATE."""
    scene = load_scene(SCENE)
    return replace(scene, simulation=scene.simulation.model_copy(update={"rate": RATE, "duration": seconds}))


def run_frames(scene: Scene, frames: list[Measurement]) -> np.ndarray:
    """(frames, 2) microseconds of the processor that each takes to be told, and to be published, as the node does both."""
    estimator = Estimator(scene)
    output, (source,) = Output(scene, estimator.simulator), scene.measurements
    out = np.zeros((len(frames), 2))
    for row, frame in zip(out, frames, strict=True):
        message = message_of(frame, scene.frame_id)
        data = encode(message)
        begin = thread_time_ns()
        take_in(estimator, source, message.ros_type, data)
        told = thread_time_ns()
        if estimator.ready:
            for _, each in output.states(estimator.estimate()):
                encode(each)
        row[:] = told - begin, thread_time_ns() - told
    return out / 1e3


def real_time_factor(us: dict[str, float]) -> float:
    """How many times faster than real time a person is estimated at RATE, with all that is published."""
    return 1e6 / RATE / us["person"]


def table(figures: dict[str, Any]) -> Table:
    """The figures for people."""
    us = figures["us"]
    out = Table(
        title=f"a person who walks: 40 degrees of freedom, muscles and ground forces, 45 markers at {RATE:g} Hz"
    )
    for column in ("what", "us a frame"):
        out.add_column(column, justify="left" if column == "what" else "right")
    for name, what in (
        ("person_filter", "message in, predict and update"),
        ("person_outputs", "all outputs with their deviations, encoded"),
        ("person", "both"),
        ("person_worst", f"both, {WORST:g}th percentile"),
    ):
        out.add_row(what, f"{us[name]:.0f}")
    out.add_row("times real time", f"{figures['real_time'][NAME]:.1f}")
    return out
