"""Which forces a foot on the ground can bear: never a pull, within friction, the pressure within the sole.

These inequalities are linear in the wrench; what is beyond one is moved onto it by the covariance, to the state nearest in its
metric (Simon 2010).
"""

import math
from typing import TYPE_CHECKING

import numpy as np

from physics_prior.dynamics.algebra import dots
from physics_prior.dynamics.arrays import accumulate, clear
from physics_prior.dynamics.covariance import add_rows
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.kinematics import move
from physics_prior.dynamics.manifold import displace
from physics_prior.dynamics.sole import sole_pose
from physics_prior.dynamics.types import Array, Record, Records
from physics_prior.estimation.process import State

if TYPE_CHECKING:
    from physics_prior.estimation.forced_process import ForcedProcess

SWEEPS = 10  # over the inequalities that are not kept
KEPT = 1e-9  # of the weight: a force that is less beyond a bound keeps it
LEAST_TILT = 0.1  # cosine: a sole that is more upright stands on an edge of this share of its shorter side


def admit(process: "ForcedProcess", state: State, factor: np.ndarray) -> bool:
    """Move a state in place, as its factor lets it, to where its feet can bear their forces; return whether it had to be."""
    memory, n = process.simulator.memory, process.n
    system = (memory.links, memory.work, process.unknown.soles, state.grounded, state.q, state.v, state.force)
    U, rows, scratch = np.ascontiguousarray(factor.T), np.empty((6, 6)), np.empty((2, n))
    return bool(bring_within(*system, U, KEPT * process.scale, rows, scratch))


@kernel
def bring_within(
    links: Records,
    work: Records,
    soles: Records,
    grounded: Array,
    q: Array,
    v: Array,
    force: Array,
    U: Array,
    kept: float,
    rows: Array,
    scratch: Array,
) -> bool:
    """Move q (nq,), v (nv,) and the unknown forces (nf,), of errors with the factor U (n, n), P = U^T U, to within the bounds.

    grounded (feet,): which stand; kept, N: so much beyond a bound is within. rows (6, 6), scratch (2, n). Return whether they
    had to be moved by the covariance.
    """
    nv, n, moved = v.shape[0], U.shape[0], False
    spread, error = scratch[0], scratch[1]
    move(links, work, q, v)
    for _ in range(SWEEPS):
        all_kept = True
        for index in range(soles.shape[0]):
            if not grounded[index]:
                continue
            sole = soles[index]
            own, first = force[sole.force : sole.force + 6], 2 * nv + sole.force
            fill_bounds(work, sole, own, rows)
            for k in range(6):
                excess, square = -_share(rows[k], own), 0.0
                if excess <= kept:
                    continue
                for i in range(n):
                    spread[i] = _share(rows[k], U[i, first : first + 6])
                    square += spread[i] * spread[i]
                if square == 0.0:
                    continue
                all_kept, moved = False, True
                for i in range(n):
                    spread[i] *= excess / square
                clear(error)
                add_rows(spread, U, error)
                displace(links, q, error[:nv], q)
                accumulate(1.0, error[nv : 2 * nv], v)
                accumulate(1.0, error[2 * nv :], force)
                move(links, work, q, v)
                fill_bounds(work, sole, own, rows)
        if all_kept:
            break
    for index in range(soles.shape[0]):
        if grounded[index]:
            cut(work, soles[index], force[soles[index].force : soles[index].force + 6], rows)
    return moved


@inline_kernel
def _share(row: Array, wrench: Array) -> float:
    """The inner product of six numbers."""
    return dots(row[3], row[4], row[5], wrench[3], wrench[4], wrench[5]) + dots(
        row[0], row[1], row[2], wrench[0], wrench[1], wrench[2]
    )


@kernel
def fill_bounds(work: Records, sole: Record, wrench: Array, rows: Array) -> None:
    """Fill rows a (6, 6) with a . wrench >= 0 for what a foot can bear; needs the poses.

    Vertical force; friction along the present horizontal force; pressure between the edges of the sole as it stands on
    the ground, at the point where the wrench has no horizontal moment.
    """
    middle, R = sole_pose(work, sole)
    drop = sole.height - middle[2]
    clear(rows)
    rows[0, 2] = 1.0
    size = max(math.sqrt(wrench[0] * wrench[0] + wrench[1] * wrench[1]), 1e-300)
    rows[1, 0], rows[1, 1], rows[1, 2] = -wrench[0] / size, -wrench[1] / size, sole.friction
    # vertical force times the centre of pressure less the point under the middle, in halves of the sole's edges
    x, y = sole.half[0], sole.half[1]
    a, b, c, d = edges_inverse(R[0] * x, R[1] * y, R[3] * x, R[4] * y, LEAST_TILT * min(x, y))
    for side in range(2):
        p, q = (a, b) if side == 0 else (c, d)
        for sign, row in ((1.0, rows[2 + 2 * side]), (-1.0, rows[3 + 2 * side])):
            row[0], row[1], row[2], row[3], row[4] = sign * p * drop, sign * q * drop, 1.0, sign * q, -sign * p


@kernel
def edges_inverse(a: float, b: float, c: float, d: float, least: float) -> tuple[float, float, float, float]:
    """The inverse of the matrix ((a, b), (c, d)), the sole seen from above, with no singular value below the least."""
    # its right singular vectors are (x, y) and (-y, x), its left ones (u, w) and (-w, u)
    apart, across = a * a + c * c - b * b - d * d, 2.0 * (a * b + c * d)
    size = math.sqrt(apart * apart + across * across)
    if size == 0.0:  # a square: any will do
        apart, size = 1.0, 1.0
    if apart >= 0.0:
        x = math.sqrt(0.5 + 0.5 * apart / size)
        y = 0.5 * across / (size * x)
    else:
        y = math.sqrt(0.5 - 0.5 * apart / size)
        x = 0.5 * across / (size * y)
    u, w = a * x + b * y, c * x + d * y
    largest = math.sqrt(u * u + w * w)
    u, w = u / largest, w / largest
    second = u * (d * x - c * y) - w * (b * x - a * y)
    r, s = 1.0 / max(largest, least), 1.0 / max(abs(second), least)
    if second < 0.0:
        s = -s
    return r * x * u + s * y * w, r * x * w - s * y * u, r * y * u - s * x * w, r * y * w + s * x * u


@kernel
def cut(work: Records, sole: Record, wrench: Array, rows: Array) -> None:
    """Put a wrench (6,) in place within the bounds by itself: what the sweeps have left. rows (6, 6); needs the poses."""
    wrench[2] = max(wrench[2], 0.0)
    size = math.sqrt(wrench[0] * wrench[0] + wrench[1] * wrench[1])
    if size > sole.friction * wrench[2]:
        for c in range(2):
            wrench[c] *= sole.friction * wrench[2] / size
    fill_bounds(work, sole, wrench, rows)
    rows[2, 2], rows[4, 2] = 0.0, 0.0  # what is left are the levers across the sole and along it
    p, q = _share(rows[2], wrench), _share(rows[4], wrench)
    p, q = p - min(max(p, -wrench[2]), wrench[2]), q - min(max(q, -wrench[2]), wrench[2])
    scale = rows[2, 3] * rows[4, 4] - rows[2, 4] * rows[4, 3]
    if p != 0.0 or q != 0.0:
        wrench[3] -= (p * rows[4, 4] - q * rows[2, 4]) / scale
        wrench[4] -= (q * rows[2, 3] - p * rows[4, 3]) / scale
