"""Estimates out: the messages that a scene publishes at each, whoever sends or files them."""

import math
from collections.abc import Mapping

import numpy as np

from physics_prior.dynamics.simulator import Simulator
from physics_prior.errors import SimulationError
from physics_prior.estimation.estimate import Counts, Estimate, Health
from physics_prior.interface import diagnostics, markers, states
from physics_prior.interface.geometry import header_of, wrench_of
from physics_prior.interface.topics import (
    CENTER_OF_MASS,
    DIAGNOSTICS,
    ENERGY,
    JOINT_DEVIATIONS,
    JOINT_STATES,
    MARKERS,
    MULTI_DOF_JOINT_STATES,
    ODOMETRY,
    STATE_COVARIANCE,
    TRANSFORMS,
    ball_links,
    deviation_topic,
    force_topics,
    free_links,
    published_names,
    scalar_links,
    topics_of,
    vector_links,
)
from physics_prior.recording.messages import Float64, Header, WrenchStamped
from physics_prior.recording.wire import Message
from physics_prior.scene import Scene

Publication = tuple[str, Message]
"""A topic, relative but for /diagnostics, and a message on it."""


class Output:
    """Makes messages of a scene's estimates.

    Attributes:
        topics: topic -> message type, all that there will ever be.
    """

    def __init__(self, scene: Scene, simulator: Simulator, lag: float = 0.0) -> None:
        """lag: s after each estimate that measurements told it, infinite for all of a recording."""
        self._lag = {} if lag == 0.0 else {"lag s": "the whole recording" if math.isinf(lag) else f"{lag:g}"}
        self.topics = topics_of(scene)
        self._scene, self._simulator = scene, simulator
        self._joints = states.Joints(scalar_links(scene.tree), ball_links(scene.tree))
        self._free, self._vectors = free_links(scene.tree), vector_links(scene.tree)
        self._forces = force_topics(scene)
        self._published = published_names(scene)
        self._names = scene.tree.freedom_names

    def states(self, estimate: Estimate) -> list[Publication]:
        """Joints, odometry, centre of mass, energy, covariance and constraint forces, these with their standard deviations.

        A force is what acts ON the named part BY the constraint, in the frame of the header, at the estimate's stamp.

        Raises:
            SimulationError: a number of the estimate is not finite; nothing of it is published then.
        """
        _require_finite(estimate)
        header = self._header(estimate.stamp)
        out: list[Publication] = []
        self._simulator.move(estimate.q, estimate.v)
        if self._joints.names:
            out.append((JOINT_STATES, states.joint_states(header, self._joints, estimate)))
            out.append((JOINT_DEVIATIONS, states.joint_deviations(header, self._joints, estimate)))
        if self._vectors:
            joints = states.multi_dof_joint_states(header, self._vectors, estimate, self._simulator)
            out.append((MULTI_DOF_JOINT_STATES, joints))
        if self._free:
            out.append((ODOMETRY, states.odometry(header, self._free[0], estimate)))
            out.append((TRANSFORMS, states.transforms(header, self._free, estimate)))
        out.append((CENTER_OF_MASS, states.center_of_mass(header, estimate, self._simulator)))
        out.append((ENERGY, Float64(self._simulator.energy())))
        out.append((STATE_COVARIANCE, states.state_covariance(self._names, estimate)))
        for name, topic in self._forces.items():
            wrench, deviation = estimate.wrenches[name], estimate.wrench_deviations[name]
            out.append((topic, WrenchStamped(header, wrench_of(wrench.force, wrench.moment))))
            out.append((deviation_topic(topic), WrenchStamped(header, wrench_of(deviation[:3], deviation[3:]))))
        return self._named(out)

    def markers(self, estimate: Estimate) -> list[Publication]:
        """What to draw. Raises SimulationError as ``states`` does."""
        _require_finite(estimate)
        header = self._header(estimate.stamp)
        return self._named([(MARKERS, markers.markers(header, list(self._forces), estimate, self._simulator))])

    def diagnostics(
        self,
        stamp: int,
        health: Health,
        counts: Counts,
        estimate: Estimate | None = None,
        more: Mapping[str, object] = {},
    ) -> list[Publication]:
        """Health at a stamp, ns, with its cause and numbers; ``more`` adds named values of the caller's own."""
        header = self._header(stamp)
        status = diagnostics.diagnostics(
            header, self._scene, self._simulator, health, counts, estimate, {**self._lag, **more}
        )
        return [(DIAGNOSTICS, status)]

    def active_effects(self, estimate: Estimate) -> list[str]:
        """The names of the effects that act in an estimate, as its diagnostics tell them."""
        return diagnostics.active_effects(self._scene, self._simulator, estimate)

    def _named(self, publications: list[Publication]) -> list[Publication]:
        return [(self._published[topic], message) for topic, message in publications]

    def _header(self, stamp: int) -> Header:
        return header_of(stamp, self._scene.frame_id)


def _require_finite(estimate: Estimate) -> None:
    numbers = [estimate.q, estimate.v, estimate.covariance, estimate.vdot, estimate.effort]
    numbers += [array for wrench in estimate.wrenches.values() for array in (wrench.force, wrench.moment, wrench.point)]
    numbers += estimate.wrench_deviations.values()
    if not np.isfinite(np.concatenate(numbers, axis=None)).all():
        raise SimulationError(f"the estimate at {estimate.stamp} ns is not finite: it is not published")
