"""The study from problem to problem: points of all who take part."""

from collections.abc import Callable, Sequence
from functools import partial

from physics_prior.studies.accuracy.measure import Point, measure
from physics_prior.studies.accuracy.problem import Problem
from physics_prior.studies.accuracy.schemes import own_schemes, peer_schemes
from physics_prior.studies.bench import one_core


def run_study(
    problems: Sequence[Problem], peers: bool, progress: Callable[[float, str], None]
) -> dict[str, tuple[Problem, list[Point]]]:
    """Measure the problems one after the other, on one core.

    Raises:
        PhysicsPriorError: a peer that is asked for is not installed.
    """
    out = {}
    with one_core():
        for index, problem in enumerate(problems):
            schemes = own_schemes(problem) + (peer_schemes(problem) if peers else [])
            report = partial(part_of, progress, index, problems)
            out[problem.key] = (problem, measure(problem, schemes, report))
    return out


def part_of(progress: Callable[[float, str], None], index: int, problems: Sequence[Problem], part: float) -> None:
    """Tell how far the whole study is when part of a problem is."""
    progress((index + part) / len(problems), problems[index].key)
