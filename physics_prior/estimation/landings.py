"""When feet met the ground, as a whole recording tells: landings that the filter decides are timed anew, and it is rolled again.

The filter lets a foot carry once it is low and slow, which some are 25 ms before they meet the ground. Before it, no force may
be there; where one may be too early or too late, what jumps within two frames is smeared over the error. Smoothed, the foot
itself tells: the ground stops its fall. That is a step of acceleration, which smoothing makes a slope, to both sides alike: the
step was where the slope is half as high as it gets.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from physics_prior.errors import SimulationError
from physics_prior.estimation.filter import Filter, Posterior
from physics_prior.estimation.forced_process import ForcedProcess
from physics_prior.estimation.history import Node

BEFORE, AFTER = 60_000_000, 80_000_000  # ns: so far from its decision a landing is looked for
IMPACT = 9.81  # m/s^2: who sets a foot down softly stops its fall more slowly than it would begin, and may load it at any time


@dataclass(frozen=True)
class Landing:
    """That a foot, by its index, was decided to stand at a stamp, ns, and met the ground after the stamp ``met``, ns."""

    foot: int
    decided: int
    met: int

    def tells(self, stamp: int) -> bool:
        """Whether it tells, against what was decided, if the foot stands at a stamp, ns."""
        return min(self.met, self.decided) <= stamp <= max(self.met, self.decided)


def timed(filter: Filter, nodes: Sequence[Node], smoothed: Sequence[Posterior]) -> Sequence[Node]:
    """The nodes of a whole recording, rolled again with feet that land when its smoothed posteriors say: the same if they do."""
    process = filter.process
    if not isinstance(process, ForcedProcess):
        return nodes
    moved = [each for each in landings(process, smoothed) if each.met != each.decided]
    if not moved:
        return nodes
    first = min(min(each.met, each.decided) for each in moved)
    out: list[Node] = []
    try:
        for node in nodes:
            stamp = node.measurement.stamp
            if stamp < first or node.posterior.start:
                out.append(node)
                continue
            process.told = {each.foot: stamp >= each.met for each in moved if each.tells(stamp)}
            prior = filter.predict(out[-1].posterior, stamp)
            out.append(Node(node.measurement, prior, filter.update(prior, node.measurement)))
    except SimulationError:  # as it was decided, it could be followed
        return nodes
    finally:
        process.told = {}
    return out


def landings(process: ForcedProcess, posteriors: Sequence[Posterior]) -> Iterator[Landing]:
    """The landings in smoothed posteriors, oldest first, of each foot that meets the ground hard enough to tell when."""
    stamps = np.array([each.stamp for each in posteriors])
    for foot in range(len(process.unknown.feet)):
        stands = np.array([each.state.grounded[foot] for each in posteriors])
        for index in (np.flatnonzero(stands[1:] & ~stands[:-1]) + 1).tolist():
            if posteriors[index].start:
                continue
            decided = posteriors[index].stamp
            left, lifted = np.flatnonzero(stands[:index]), np.flatnonzero(~stands[index:])
            begin = max(int(np.searchsorted(stamps, decided - BEFORE)), int(left[-1]) + 1 if len(left) else 0)
            end = min(
                int(np.searchsorted(stamps, decided + AFTER)), index + int(lifted[0]) if len(lifted) else len(stamps)
            )
            rates = [rate_of_height(process, foot, posteriors[index], each) for each in posteriors[begin:end]]
            met = stopped(stamps[begin:end] - decided, np.array(rates))
            if met is not None:
                yield Landing(foot, decided, int(stamps[np.searchsorted(stamps, decided + met, side="right") - 1]))


def rate_of_height(process: ForcedProcess, foot: int, landed: Posterior, posterior: Posterior) -> float:
    """How fast, m/s, that corner of a sole rises that is the lowest as the foot lands."""
    simulator, sole = process.simulator, process.unknown.feet[foot].sole
    simulator.move(landed.state.q, landed.state.v)
    corner = sole.corners[np.argmin(sole.corners @ simulator.pose(sole.part)[1][2])]
    state = posterior.state
    simulator.move(state.q, state.v)
    return float(simulator.jacobian(sole.part, corner)[5] @ state.v)


def stopped(stamps: np.ndarray, rates: np.ndarray) -> float | None:
    """When, ns, a fall was stopped of which the smoothed speed upwards is known at stamps; None where that was no impact."""
    accelerations = np.diff(rates) / np.diff(stamps) * 1e9
    at = 0.5 * (stamps[1:] + stamps[:-1])
    if not len(at) or accelerations.max() < IMPACT:
        return None
    hardest = int(np.argmax(accelerations))
    before = np.flatnonzero(accelerations[:hardest] <= 0.5 * accelerations[hardest])
    if not len(before):
        return None
    slope = slice(before[-1], before[-1] + 2)
    return float(np.interp(0.5 * accelerations[hardest], accelerations[slope], at[slope]))
