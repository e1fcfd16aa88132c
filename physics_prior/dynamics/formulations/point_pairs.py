"""Point pairs as rows e(x) = 0 on free bodies: residual, A = de/dx and the rate of A (equation 4)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from physics_prior import rotations
from physics_prior.dynamics.formulations.newton_euler import WORLD, Bodies, C, Q, V, W
from physics_prior.effects.effect import Anchor, PointPair
from physics_prior.errors import SimulationError


@dataclass(frozen=True)
class BodyPair:
    """A point pair in body frames: indices of the bodies (-1: world), points and directions in their axes."""

    a: int
    point_a: np.ndarray
    b: int
    point_b: np.ndarray
    directions: np.ndarray
    length: float | None

    @property
    def rows(self) -> int:
        """Number of equality rows."""
        return len(self.directions) if self.length is None else 1


def body_pairs(bodies: Bodies, pairs: Sequence[PointPair]) -> list[BodyPair]:
    """Restate point pairs of parts in the frames of the bodies that carry them."""
    out = []
    for pair in pairs:
        a, point_a, turn = _on_body(bodies, pair.a)
        b, point_b, _ = _on_body(bodies, pair.b)
        out.append(BodyPair(a, point_a, b, point_b, rotations.rotate(turn, pair.directions), pair.length))
    return out


def residual(pairs: Sequence[BodyPair], state: np.ndarray) -> np.ndarray:
    """e(x), (rows,) m, at the states (n, 13) of the bodies: d . (b - a), of a rod |b - a| - length."""
    states = np.vstack([state, WORLD])
    out = [np.zeros(0)]
    for pair in pairs:
        a, b = _Point(states, pair.a, pair.point_a), _Point(states, pair.b, pair.point_b)
        out.append(_directions(pair, a, b) @ (b.position - a.position) - (pair.length or 0.0))
    return np.concatenate(out)


def rows(pairs: Sequence[BodyPair], state: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return A (rows, 6 n), with edot = A xdot, and gamma = -(dA/dt) xdot (rows,), so that A xddot = gamma.

    xdot is (v, w') of all bodies. Directions turn with a's part, so a row's rate is that of b as seen from a:
    b's velocity less the velocity of the point of a's part that is at b just now, which then has a Coriolis
    term.

    Raises:
        SimulationError: the two points of a rod coincide, so it has no direction.
    """
    n, m = len(state), sum(pair.rows for pair in pairs)
    A, gamma = np.zeros((m, n + 1, 6)), np.zeros(m)  # the world's columns, last, are dropped at the end
    states = np.vstack([state, WORLD])
    start = 0
    for pair in pairs:
        a, b = _Point(states, pair.a, pair.point_a), _Point(states, pair.b, pair.point_b)
        if pair.length is None:
            a = _Point(states, pair.a, a.R.T @ (b.position - a.center))
        d = _directions(pair, a, b)
        approach = b.velocity - a.velocity
        if pair.length is None:
            turning = -2.0 * d @ np.cross(a.angular_velocity, approach)
        else:
            along = d @ approach
            turning = (approach @ approach - along**2) / np.linalg.norm(b.position - a.position)
        here = slice(start, start + pair.rows)
        A[here, pair.b] += b.row(d)
        A[here, pair.a] -= a.row(d)
        gamma[here] = -(d @ (b.centripetal - a.centripetal) + turning)
        start += pair.rows
    return A[:, :n].reshape(m, 6 * n), gamma


def forces(pairs: Sequence[BodyPair], state: np.ndarray, multipliers: np.ndarray) -> np.ndarray:
    """f_c = -A^T lambda as forces, (pairs, 3) N, on b's part at b, world axes; multipliers (rows,)."""
    out = np.zeros((len(pairs), 3))
    states = np.vstack([state, WORLD])
    start = 0
    for i, pair in enumerate(pairs):
        a, b = _Point(states, pair.a, pair.point_a), _Point(states, pair.b, pair.point_b)
        out[i] = -multipliers[start : start + pair.rows] @ _directions(pair, a, b)
        start += pair.rows
    return out


def _on_body(bodies: Bodies, anchor: Anchor) -> tuple[int, np.ndarray, np.ndarray]:
    """Index of an anchor's body, its point in that body's frame, and the turn from part to body axes."""
    frame = bodies.tree.frame(anchor.part)
    point = frame.position + rotations.rotate(frame.orientation, anchor.point)
    if frame.link < 0:
        return -1, point, frame.orientation
    to_body = rotations.conjugate(bodies.axes[frame.link])
    point = rotations.rotate(to_body, point - bodies.center[frame.link])
    return frame.link, point, rotations.multiply(to_body, frame.orientation)


def _directions(pair: BodyPair, a: "_Point", b: "_Point") -> np.ndarray:
    """(rows, 3) unit directions of a pair in world axes."""
    if pair.length is None:
        return np.asarray(pair.directions @ a.R.T)
    gap = b.position - a.position
    distance = np.linalg.norm(gap)
    if distance < 1e-12 * pair.length:
        raise SimulationError(f"a rod of {pair.length:g} m has both ends in one point: it has no direction")
    return np.asarray((gap / distance)[None])


class _Point:
    """A point fixed on a body, given in the body's axes about its centre of mass; all else in world axes."""

    def __init__(self, states: np.ndarray, body: int, point: np.ndarray) -> None:
        own = states[body]
        self.R = rotations.matrix_from_quaternion(own[Q])
        self.center = own[C]
        self.reach = self.R @ point
        self.angular_velocity = self.R @ own[W]
        self.position = self.center + self.reach
        self.velocity = own[V] + np.cross(self.angular_velocity, self.reach)
        self.centripetal = np.cross(self.angular_velocity, np.cross(self.angular_velocity, self.reach))

    def row(self, d: np.ndarray) -> np.ndarray:
        """(rows, 6) from (vdot, w'dot) of the body to the point's acceleration along d (rows, 3)."""
        return np.hstack([d, -d @ rotations.skew(self.reach) @ self.R])
