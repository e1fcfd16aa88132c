"""What an effect costs a step: the scene's step with it and without it, timed in turns."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from time import perf_counter

import numpy as np

from physics_prior.scene import Scene

ROUNDS, STEPS = 15, 200  # so many bursts of each scene, in turns, of so many steps


def effect_costs(scene: Scene, progress: Callable[[float, str], None] = lambda done, what: None) -> list[float]:
    """What each effect of a scene adds to a step, us, in their order; compiles a step without each where there is none yet.

    progress is told the share that is done, and what comes next.
    """
    variants = [scene]
    for place, effect in enumerate(scene.effects):
        progress(place / len(scene.effects), f"the step without {effect.label}")
        rest = replace(scene, effects=(*scene.effects[:place], *scene.effects[place + 1 :]))
        _burst(rest)
        variants.append(rest)
    whole, *rests = step_times(variants)
    progress(1.0, "done")
    return [float(np.median(whole - without)) for without in rests]


def extra_cost(larger: Scene, smaller: Scene) -> float:
    """What a step of one scene costs more than that of another, us: the median over bursts in turns."""
    more, less = step_times((larger, smaller))
    return float(np.median(more - less))


def step_times(scenes: Sequence[Scene]) -> np.ndarray:
    """(len(scenes), ROUNDS) us a step of each scene, from its start on, in bursts that take turns."""
    bursts = [_burst(scene) for scene in scenes]
    return np.array([[burst() for burst in bursts] for _ in range(ROUNDS)]).T


def _burst(scene: Scene) -> Callable[[], float]:
    """A function that makes STEPS steps from the scene's start and returns what one took, us; it has run once."""
    simulator, h = scene.simulator(), scene.step.size
    q, v = scene.initial.q.copy(), scene.initial.v.copy()
    simulator.begin(q, v)

    def burst() -> float:
        q_now, v_now = q.copy(), v.copy()
        simulator.time = 0.0
        begun = perf_counter()
        simulator.advance(q_now, v_now, h, STEPS)
        return 1e6 / STEPS * (perf_counter() - begun)

    burst()
    return burst
