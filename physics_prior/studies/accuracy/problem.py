"""The problems of the study: benchmark mechanisms, and the step sizes that make sense on each."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from physics_prior.effects.attachment import Attachment
from physics_prior.effects.gravity import Gravity
from physics_prior.errors import PhysicsPriorError
from physics_prior.model import JointKind
from physics_prior.studies.problems.andrews import andrews
from physics_prior.studies.problems.bricard import bricard
from physics_prior.studies.problems.chain import held_human
from physics_prior.studies.problems.four_bar import four_bar
from physics_prior.studies.problems.governor import governor
from physics_prior.studies.problems.mechanism import Benchmark
from physics_prior.studies.problems.pendulum import double_pendulum, simple_pendulum
from physics_prior.studies.problems.tops import free_top, heavy_top


@dataclass(frozen=True)
class Problem:
    """A benchmark in the study.

    Attributes:
        key: its name on the command line.
        title: what it is, for people.
        unit: of its error.
        make: builds it.
        steps: s, coarse to fine.
        target: the error at which engines are compared.
        conservative: whether its energy, less the work of constant forces, stays.
    """

    key: str
    title: str
    unit: str
    make: Callable[[], Benchmark]
    steps: Sequence[float]
    target: float = 1e-6
    conservative: bool = True


def _down(coarsest: float, count: int) -> tuple[float, ...]:
    """Step sizes 1, 0.5, 0.2, 0.1, ... of the coarsest."""
    return tuple(float(f"{coarsest * part * 0.1**k:.6g}") for k in range(count // 3 + 1) for part in (1.0, 0.5, 0.2))[
        :count
    ]


PROBLEMS: dict[str, Problem] = {
    each.key: each
    for each in (
        Problem("pendulum", "Simple pendulum (A01), 10 s", "m", simple_pendulum, _down(0.05, 9)),
        Problem("double_pendulum", "Double pendulum, 10 s", "m", double_pendulum, _down(0.1, 10)),
        Problem("four_bar", "Four-bar (A02, N = 1), 10 s", "m", lambda: four_bar(1, 10.0), _down(0.05, 8)),
        Problem("four_bar_40", "40 four-bars in a row (A02), 10 s", "m", lambda: four_bar(40, 10.0), _down(0.05, 5)),
        Problem("andrews", "Andrews' squeezer (A03), 0.05 s", "rad", andrews, _down(1e-3, 8)),
        Problem("bricard", "Bricard's mechanism (A04), 10 s", "m", bricard, _down(0.1, 7)),
        Problem("governor", "Flyball governor (A05), 10 s", "m", governor, _down(0.01, 8), conservative=False),
        Problem("heavy_top", "Fast heavy top, 1 s", "rad", heavy_top, _down(0.01, 9)),
        Problem("free_top", "Torque-free top that flips, 50 s", "rad", free_top, _down(0.1, 8)),
        Problem("held_human", "Human of 35 freedoms, feet pinned, 0.5 s", "m", held_human, _down(0.01, 7)),
    )
}


def chosen(names: Sequence[str]) -> list[Problem]:
    """The problems of these names, all where none is given.

    Raises:
        PhysicsPriorError: a name that is none.
    """
    for name in names:
        if name not in PROBLEMS:
            raise PhysicsPriorError(f"problem '{name}' is unknown; known are {', '.join(PROBLEMS)}")
    return [problem for key, problem in PROBLEMS.items() if key in names or not names]


def only_pinned(benchmark: Benchmark) -> bool:
    """Whether nothing acts but gravity, and nothing holds but points: what every engine can be given alike."""
    return all(type(effect) in (Gravity, Attachment) for effect in benchmark.effects)


def only_hinges(benchmark: Benchmark) -> bool:
    """Whether all joints are hinges."""
    return all(link.joint.kind is JointKind.REVOLUTE for link in benchmark.tree.links)


def in_plane(benchmark: Benchmark) -> bool:
    """Whether all joints are hinges about z on parts that do not stand turned."""
    return only_hinges(benchmark) and all(
        np.array_equal(link.joint.axis, [0.0, 0.0, 1.0])
        and np.array_equal(link.joint.orientation, [1.0, 0.0, 0.0, 0.0])
        for link in benchmark.tree.links
    )
