"""What sleep saves: boxes that lie on the ground beside a pendulum that swings, or hangs, stepped with sleep and without."""

from collections.abc import Callable
from time import perf_counter
from typing import Any

import numpy as np

from physics_prior.dynamics.contact.memory import Sleep
from physics_prior.dynamics.simulator import Simulator
from physics_prior.effects.contact import Contact
from physics_prior.effects.gravity import Gravity
from physics_prior.inertia import box, point_mass
from physics_prior.model import Joint, JointKind, Part, Shape, Tree

H, SLEEP = 1e-3, Sleep(velocity=1e-4, duration=0.1)
EDGE, APART = 0.2, 1.0  # m
ROUNDS, STEPS = 31, 100  # of the timing: bursts in turns
CASES = ((1, 60.0), (2, 60.0), (4, 60.0), (2, 0.0))
"""Boxes, and the angle from which the pendulum is let go, degrees."""


def run_sleep_costs(progress: Callable[[float], None] = lambda done: None) -> dict[str, Any]:
    """Time each case, from 0.2 s on, when the boxes sleep: ``cases``, a list of figures.

    ``us_always`` and ``us_sleeping`` a step, medians over bursts in turns, their ratio, which parts slept, and how far boxes lay
    apart from those without sleep in the end, m.
    """
    cases = []
    for done, (boxes, angle) in enumerate(CASES):
        cases.append(_case(boxes, angle))
        progress((done + 1) / len(CASES))
    return {"cases": cases}


def boxes_and_pendulum(count: int, sleep: Sleep | None) -> Simulator:
    """Boxes of 1 kg a metre apart on the ground, and a pendulum of 1 m that stands beside them."""
    size = np.full(3, EDGE)
    names = [f"box{index}" for index in range(count)]
    parts = [Part(name, box(1.0, size), Shape("box", size)) for name in names]
    joints = [Joint(f"{name}_joint", JointKind.FREE, "world", name) for name in names]
    parts.append(Part("bob", point_mass(1.0, (0.0, 0.0, -1.0))))
    joints.append(
        Joint("pivot", JointKind.REVOLUTE, "world", "bob", np.array([0, 3.0, 2.0]), axis=np.array([0, 1.0, 0]))
    )
    touching = [Contact(name=name, part=name, friction=0.5) for name in names]
    return Simulator(Tree(parts, joints), [Gravity(), *touching], interval=H, sleep=sleep)


def table(figures: dict[str, Any]) -> str:
    """The figures as a table of Markdown."""
    rows = []
    for each in figures["cases"]:
        does = "swings" if each["swings"] else "hangs still"
        times = f"{each['us_always']:.1f} | {each['us_sleeping']:.1f} | {each['ratio']:.0f}"
        rows.append(f"| {each['boxes']} | {does} | {times} | {each['apart']:.0e} m |")
    head = "| boxes | the pendulum | always on | with sleep | ratio | boxes apart after |"
    return "\n".join([head, "|---|---|---|---|---|---|", *rows])


def _case(boxes: int, angle: float) -> dict[str, Any]:
    simulators = [boxes_and_pendulum(boxes, sleep) for sleep in (None, SLEEP)]
    states = []
    for simulator in simulators:
        q = simulator.tree.neutral()
        q[:-1:7] = APART * np.arange(boxes)
        q[2:-1:7], q[-1] = 0.5 * EDGE, np.radians(angle)
        v = np.zeros(simulator.nv)
        simulator.begin(q, v)
        simulator.advance(q, v, H, 2 * STEPS)
        states.append((q, v))
    spans: list[list[float]] = [[], []]
    for _ in range(ROUNDS):
        for simulator, (q, v), own in zip(simulators, states, spans, strict=True):
            begun = perf_counter()
            simulator.advance(q, v, H, STEPS)
            own.append(1e6 / STEPS * (perf_counter() - begun))
    always, sleeping = (float(np.median(own)) for own in spans)
    return {
        "boxes": boxes,
        "swings": angle != 0.0,
        "asleep": list(simulators[1].asleep),
        "us_always": always,
        "us_sleeping": sleeping,
        "ratio": always / sleeping,
        "apart": float(np.max(np.abs(states[0][0][:-1] - states[1][0][:-1]))),
    }
