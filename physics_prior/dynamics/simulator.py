"""A model and its effects, compiled: the one object that moves a body, differentiates its motion and tells its forces."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics import anchor_motion, constraint, kinematics, manifold, newton_euler, projection
from physics_prior.dynamics.compose import GRAVITY, pack_parameters, step_module, structure_of
from physics_prior.dynamics.constraint_errors import place, position_error
from physics_prior.dynamics.contact import impulse
from physics_prior.dynamics.contact.memory import Sleep, candidates_in, contact_memory, residual_in, rested_in
from physics_prior.dynamics.contact.reactions import candidates_by_name, reaction
from physics_prior.dynamics.contact.records import candidate_records
from physics_prior.dynamics.covariance import carry_step
from physics_prior.dynamics.entry import Step, require_state
from physics_prior.dynamics.failure import failure, require_finite
from physics_prior.dynamics.inertia_check import check_inertia
from physics_prior.dynamics.integrators import DEFAULT, INTEGRATORS, TOLERATED, IntegratorName
from physics_prior.dynamics.memory import SPARE, TIME, TOLERANCE, Memory, correction_size, tangent_size
from physics_prior.dynamics.reactions import tell_wrenches
from physics_prior.dynamics.records import FREE_LINK, LINK, link_records, motion_tables, moved_freedoms, pair_records
from physics_prior.dynamics.switches import Switches
from physics_prior.dynamics.unknown_forces import UnknownForces
from physics_prior.dynamics.wrench import Wrench
from physics_prior.effects.effect import Effect, PointPair
from physics_prior.errors import ModelError
from physics_prior.model import Tree


class Simulator:
    """The compiled step of a model with just the effects it is given.

    State: q (nq,), v (nv,) as Tree says. Methods that move a state do it in place and without allocating.

    tolerance is the error of a step that an adaptive integrator allows, m and rad, m/s and rad/s. With sleep given, ``advance``
    lets islands at rest sleep (contact/sleep.py); all else sees them as ever.

    Attributes:
        tree, effects, integrator: what it was built from.
        nq, nv, rows: sizes of configuration, velocity and constraint rows; firsts: where each constraint effect's pairs begin.
        wrench_names: whose wrenches there are: moving joints, then effects that hold something, what touches, and feet.
        touching: contacts and limits, each with the indices of its records in ``candidates``.
        held: whether anything, a joint or an effect, can exert a wrench: not so of free bodies that nothing holds.
        unknown: the unknown forces and the values that they have now (unknown_forces.py).
        switches: which of the effects act now, and what happens when they take hold (switches.py).
        still: (nv,) zeros: no velocity, no force.
        interval: s, over which impulses of contact are told as forces: the step size.
        step, memory: the compiled step (entry.py) and the array it works in (memory.py).
        rank: rank of the constraint rows at the last evaluation (below ``rows`` where some are redundant: then the motion is
            unique, the split of forces is not).

    Raises:
        ModelError: a joint that moves no inertia; an effect that does not fit the tree; sleep where nothing may touch.
    """

    def __init__(
        self,
        tree: Tree,
        effects: Sequence[Effect] = (),
        integrator: IntegratorName = DEFAULT,
        tolerance: float = TOLERATED,
        interval: float = 1e-3,
        sleep: Sleep | None = None,
    ) -> None:
        if integrator not in INTEGRATORS:
            raise ModelError(f"integrator '{integrator}' is unknown: known are {list(INTEGRATORS)}")
        for effect in effects:
            effect.check(tree)
        self.tree, self.effects, self.integrator = tree, tuple(effects), integrator
        labels: list[tuple[str, int, int]] = []
        pairs: list[PointPair] = []
        for effect in effects:
            own = effect.point_pairs(tree)
            if own:
                labels.append((effect.label, len(pairs), len(pairs) + len(own)))
                pairs.extend(own)
        touching = [pair for effect in effects for pair in effect.touching_pairs(tree)]
        ranges = [each for effect in effects for each in effect.joint_ranges(tree)]
        candidates = candidate_records(tree, ranges, touching)
        if sleep is not None and not len(candidates):
            raise ModelError("'sleep' is not valid where nothing may touch: it spares contact, and there is none")
        self.touching = candidates_by_name(tree, effects)
        self.interval, self.rank = interval, 0
        structure = structure_of(tree, effects)
        self.nq, self.nv = tree.nq, tree.nv
        self.firsts = np.array([*(first for _, first, _ in labels), len(pairs)])
        self.rows = sum(1 if pair.length is not None else len(pair.directions) for pair in pairs)
        records, parameters = pair_records(tree, pairs), pack_parameters(tree, effects)
        tables = motion_tables(tree, pairs, records, len(parameters))
        needs = INTEGRATORS[integrator]
        own_size = tangent_size(len(tree.links), self.rows, self.nv, needs.stages)
        self._tangent_size = own_size + 2 * (2 * self.nv) ** 2  # F and G of a step
        width = moved_freedoms(tree, records, candidates)
        memory = Memory(
            link_records(tree, records, candidates).view(FREE_LINK if structure.free else LINK),
            records,
            width,
            np.concatenate([parameters, tables]),
            self.nq,
            self.nv,
            SPARE + needs.vectors,
            own_size if needs.implicit else 0,
            contact_memory(candidates, self.rows, width, self.nq, sleep) if len(candidates) else None,
        )
        memory.array[TOLERANCE] = tolerance
        self.memory, self.unknown = memory, UnknownForces(tree, effects, memory.parameters)
        self.wrench_names = [
            *(link.joint.name for link in tree.links),
            *(label for label, _, _ in labels),
            *self.touching,
            *(foot.name for foot in self.unknown.feet),
        ]
        self.held = not structure.free or bool(pairs) or bool(self.unknown.feet)
        self._links, self._work, self._pairs = memory.links, memory.work, memory.pairs
        self.candidates = candidates_in(memory.contact_part)
        self._gravity = memory.parameters[:GRAVITY]
        self.step = Step(step_module(effects, structure, integrator, sleep is not None))
        self._rotations, self._origins = self._work["rotation"].reshape(-1, 3, 3), self._work["origin"]
        self._frames: dict[Any, tuple[int, np.ndarray, np.ndarray]] = {}
        self.still, self._vdot, self._tangent = np.zeros(self.nv), np.zeros(self.nv), np.zeros(0)
        self._stores = any(effect.compiled is not None and effect.compiled.energy is not None for effect in effects)
        self._posed = np.zeros(self.nq)
        self.switches = Switches(self, {label: (first, last) for label, first, last in labels})
        check_inertia(tree)

    def acceleration(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray | None = None) -> np.ndarray:
        """(nv,) vdot at q and v under the effects and generalized forces tau (nv,); fills ``rank``.

        Raises:
            SimulationError: not finite, where a posture leaves a joint no inertia (a straight chain of thin rods).
        """
        vdot = np.zeros(self.nv)
        self._evaluate(q, v, tau, vdot)
        return vdot

    def acceleration_derivatives(
        self, q: np.ndarray, v: np.ndarray, tau: np.ndarray | None = None
    ) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (nv, nv) of ``acceleration`` by the tangent of q and by v, at constant tau; not of what touches."""
        extra, nv = require_state(self, q, v, tau), self.nv
        self.rank = self.step.differentiate_acceleration(self.memory.array, self.tangent_array(), q, v, extra)
        by_state = self.tangent_array()[: 2 * nv * nv].reshape(nv, 2 * nv)
        return by_state[:, :nv].copy(), by_state[:, nv:].copy()

    def advance(self, q: np.ndarray, v: np.ndarray, h: float, count: int = 1, tau: np.ndarray | None = None) -> None:
        """Move q and v in place by count steps of h seconds, under constant extra forces tau (nv,).

        Raises:
            SimulationError: the motion left the numbers or came apart, or an integrator found no solution (a step far too
                large for it).
        """
        extra = require_state(self, q, v, tau)
        self.moved(self.step.advance(self.memory.array, q, v, extra, h, count), h)

    def linearise(
        self, q: np.ndarray, v: np.ndarray, h: float, force_noise: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Move q and v in place by one step as ``advance`` does; return F and G, (2 nv, 2 nv) each.

        F is the derivative of the new error state (tangent of q, v) by the old. G G^T is the covariance that white
        generalized forces of density force_noise (nv,) [N sqrt(s) or N m sqrt(s)] add, or those that the columns of one
        (nv, nv) make. Both lie in the tangent space of the constraints.

        Raises:
            SimulationError: as of ``advance``.
        """
        require_state(self, q, v, None)
        noise = np.diag(force_noise) if force_noise.ndim == 1 else force_noise
        W = carry_step(self, q, v, h, np.eye(2 * self.nv), noise)
        return W[:, : 2 * self.nv], W[:, 2 * self.nv :]

    def project(self, q: np.ndarray, v: np.ndarray) -> float:
        """Put q and v onto the constraints in place, in the mass metric; return the position error left, m."""
        if self.rows == 0:
            return 0.0
        own = self.memory
        system = (own.links, own.work, own.pairs, own.rows, own.known, q)
        self._move_anchors()
        constraint.refresh(*system)
        return float(projection.project(*system, v, own.spare, constraint.ROUNDING))

    def project_velocity(self, q: np.ndarray, v: np.ndarray) -> None:
        """Put v onto the constraints in place, as they are at q, in the mass metric."""
        if self.rows:
            own = self.memory
            self._move_anchors()
            constraint.refresh(own.links, own.work, own.pairs, own.rows, own.known, q)
            projection.project_velocity(own.links, own.work, own.pairs, own.rows, v, own.spare)

    def switch(self, label: str, on: bool, q: np.ndarray, v: np.ndarray) -> dict[str, Wrench]:
        """Have an effect take hold or let go at q and v: ``Switches.switch``."""
        return self.switches.switch(label, on, q, v)

    def begin(self, q: np.ndarray, v: np.ndarray) -> None:
        """Begin the scene at q and v: time zero, and what holds then takes hold; SimulationError if it cannot."""
        rested_in(self.memory.contact_part)[:] = 0.0
        self.switches.begin(q, v)

    def displaced(self, q: np.ndarray, delta: np.ndarray) -> np.ndarray:
        """(nq,) q moved by a tangent vector (nv,), or what begins with one, as Tree.integrate does, compiled."""
        out = np.empty(self.nq)
        manifold.displace(self._links, q, delta, out)
        return out

    def constrain(self, q: np.ndarray, v: np.ndarray, factor: np.ndarray) -> None:
        """Put q and v, and the columns of a factor (2 nv, k) of their errors, onto the constraints, in place."""
        if self.rows:
            self.project(q, v)
            scratch = np.empty(correction_size(self.rows, self.nv, factor.shape[1]))
            columns = np.ascontiguousarray(factor)
            self.step.project_columns(self.memory.array, *self.tangent_rows(q, v), columns, scratch, True)
            if columns is not factor:
                factor[:] = columns

    def tangent_rows(self, q: np.ndarray, v: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Constraint Jacobian A (rows, nv) and the derivative of A v by the tangent of q (rows, nv)."""
        A, A_q = np.zeros((self.rows, self.nv)), np.zeros((self.rows, self.nv))
        if self.rows:
            self.step.tangent_rows(self.memory.array, self.tangent_array(), q, v, A, A_q)
        return A, A_q

    def constraint_error(self, q: np.ndarray, v: np.ndarray) -> np.ndarray:
        """(rows,) how far q is off the constraints, m."""
        out = np.zeros(self.rows)
        self.move(q, v)
        if self.rows:
            self._move_anchors()
            place(self._work, self._pairs)
            position_error(self._pairs, out)
        return -out

    def move(self, q: np.ndarray, v: np.ndarray) -> None:
        """Bring the kinematics up to date for ``pose``, ``velocity``, ``jacobian`` and ``energy``."""
        kinematics.move(self._links, self._work, q, v)
        self._posed[:] = q

    def pose(self, part: str) -> tuple[np.ndarray, np.ndarray]:
        """Position (3,) m and rotation matrix (3, 3), part to world, of a part's frame; needs ``move``."""
        link, position, own = self.frame(part)
        if link < 0:
            return position.copy(), own.copy()
        R = self._rotations[link]
        return self._origins[link] + R @ position, R @ own

    def velocity(self, part: str) -> tuple[np.ndarray, np.ndarray]:
        """Linear and angular velocity, (3,) m/s and (3,) rad/s, world axes, of a part's frame; needs ``move``."""
        link, position, _ = self.frame(part)
        if link < 0:
            return np.zeros(3), np.zeros(3)
        here = self._work[link]
        return here["velocity"] + np.cross(here["omega"], self._rotations[link] @ position), here["omega"].copy()

    def jacobian(self, part: str, point: np.ndarray) -> np.ndarray:
        """(6, nv): angular velocity of a part and velocity of a point in its frame (3,), world axes, per v; needs ``move``."""
        link, position, own = self.frame(part)
        out = np.zeros((6, self.nv))
        kinematics.point_jacobian(self._links, self._work, link, position + own @ point, out)
        return out

    def mass_matrix(self, q: np.ndarray) -> np.ndarray:
        """(nv, nv) generalized inertia at q."""
        M = np.zeros((self.nv, self.nv))
        self.move(q, self.still)
        newton_euler.mass_matrix(self._links, self._work, M)
        return M

    def inverse_dynamics(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray) -> np.ndarray:
        """(nv,) generalized forces that produce vdot beside gravity; effects that push are not counted in."""
        tau = np.zeros(self.nv)
        self.move(q, v)
        newton_euler.inverse_dynamics(self._links, self._work, vdot, self._gravity, tau)
        return tau

    def energy(self) -> float:
        """Kinetic energy plus that in the uniform field, J, zero height at the world's origin, plus that in the effects.

        Needs ``move``, or ``wrench_array``.
        """
        stored = self.step.potential(self.memory.array, self._posed) if self._stores else 0.0
        return float(kinematics.energy(self._links, self._work, self._gravity) + stored)

    def frame(
        self,
        part: str,
        position: Sequence[float] = (0.0, 0.0, 0.0),
        orientation: Sequence[float] = (1.0, 0.0, 0.0, 0.0),
    ) -> tuple[int, np.ndarray, np.ndarray]:
        """Link (-1 the world), position (3,) m and rotation matrix (3, 3) on it, of a frame placed so in a part's.

        Raises:
            ModelError: an unknown part.
        """
        key = (part, tuple(position), tuple(orientation))
        if key not in self._frames:
            own = self.tree.frame(part)
            R = rotations.matrix_from_quaternion(own.orientation)
            place = own.position + R @ np.array(position)
            self._frames[key] = (own.link, place, R @ rotations.matrix_from_quaternion(np.array(orientation)))
        return self._frames[key]

    def wrench_array(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray | None = None) -> np.ndarray:
        """(len(wrench_names), 6): force and moment ON a part BY each joint and constraint effect, world axes.

        About the joint, or the constraint's point. They go with the scene's own acceleration; with vdot given (a motion that
        was measured, not predicted) they are what that motion needs, and those of constraint effects are zero: inverse
        dynamics cannot tell them from joint forces.

        Raises:
            SimulationError: as ``acceleration``.
        """
        out = np.zeros((len(self.wrench_names), 6))
        if vdot is None:
            self._evaluate(q, v, None, self._vdot)
            self._posed[:] = q
            if not self.held:
                return out
            tell_wrenches(self._links, self._work, self._pairs, self.firsts, out)
            for row, indices in enumerate(self.touching.values(), start=len(self._links) + len(self.firsts) - 1):
                push = reaction(self.tree, self._work, self.candidates[indices])
                out[row, :3], out[row, 3:] = push.force, push.moment
            out[len(out) - len(self.unknown.feet) :] = self.unknown.wrench_rows()
        else:
            self._posed[:] = q
            self.candidates[["force", "moment", "point"]] = 0.0
            kinematics.move(self._links, self._work, q, v)
            newton_euler.spread(self._links, self._work, vdot, self._gravity)
            tell_wrenches(self._links, self._work, self._pairs[:0], self.firsts[:1], out)
        return out

    def wrenches(self, q: np.ndarray, v: np.ndarray, vdot: np.ndarray | None = None) -> dict[str, Wrench]:
        """``wrench_array`` by name, each with its point."""
        array = self.wrench_array(q, v, vdot)
        place(self._work, self._pairs)
        points = [
            *self._work["origin"],
            *self._pairs["b"][self.firsts[:-1]],
            *(reaction(self.tree, self._work, self.candidates[each]).point for each in self.touching.values()),
            *self.unknown.points(self),
        ]
        return {
            name: Wrench(row[:3], row[3:], np.array(point))
            for name, row, point in zip(self.wrench_names, array, points, strict=True)
        }

    @property
    def time(self) -> float:
        """The time since the scene's beginning, s, which steps move on; settable."""
        return float(self.memory.array[TIME])

    @time.setter
    def time(self, value: float) -> None:
        self.memory.array[TIME] = value

    @property
    def contact_residual(self) -> float:
        """How far contact was from solved when last asked for, relative: above 1e-6 it jams, and is only nearly told."""
        return residual_in(self.memory.contact_part)

    @property
    def asleep(self) -> tuple[str, ...]:
        """The parts that carry joints of what sleeps now."""
        rested = rested_in(self.memory.contact_part)
        return tuple(link.part for link, time in zip(self.tree.links, rested, strict=False) if time == np.inf)

    @property
    def effort(self) -> np.ndarray:
        """(nv,) generalized forces of the effects at the last ``acceleration`` or ``wrenches``; no wrenches on parts."""
        return np.array(self.memory.spare[2])

    def tangent_array(self) -> np.ndarray:
        """What derivatives need beside the memory (memory.py), made when first needed."""
        if not len(self._tangent):
            self._tangent = np.zeros(self._tangent_size)
        return self._tangent

    def moved(self, rank: int, h: float) -> None:
        """Take in what a step of h seconds returned: its rank, or SimulationError where that is negative."""
        self.rank = rank
        if rank < 0:
            raise failure(self, rank, h)

    def _move_anchors(self) -> None:
        """Bring moving anchors to the present time."""
        anchor_motion.move_anchors(self._work, self._pairs, self.memory.parameters, self.memory.array[TIME])

    def _evaluate(self, q: np.ndarray, v: np.ndarray, tau: np.ndarray | None, vdot: np.ndarray) -> None:
        array, h, extra = self.memory.array, self.interval, require_state(self, q, v, tau)
        self.rank = self.step.evaluate(array, q, v, extra, 0.0, vdot)
        if self.touching:
            # contact forces are the impulses of a step to come, over its time; anchors stand where it ends
            now, self.time = self.time, self.time + h
            self._move_anchors()
            impulse.resolve(array, q, v + h * vdot, h, False)
            self.time = now
            self.step.evaluate(array, q, v, extra, 0.0, vdot)
            impulse.load_contacts(array, h)
            vdot += self.memory.spare[1] / h
        require_finite(self, vdot)
