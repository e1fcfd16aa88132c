"""The study from problem to problem: points of all who take part."""

from collections.abc import Callable, Sequence

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
            points = measure(
                problem, schemes, lambda part, i=index, p=problem: progress((i + part) / len(problems), p.key)
            )
            out[problem.key] = (problem, points)
    return out
