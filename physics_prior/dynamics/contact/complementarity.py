"""The complementarity problem of contact impulses: who holds, who lets go, who sticks and who slips (design eq. 8).

Rows have velocities u = S p + b, S = A M^-1 A^T, and impulses p. A bilateral row has u = 0; a normal row 0 <= p, 0 <= u and
p u = 0; a disc, two rows of friction or rolling, has |p_t| <= c p_n and dissipates the most that it can: p_t = -c p_n u_t / |u_t|
where it slips (Coulomb's law without convex relaxation). All three say that p is its own projection of p - u / S_rr.

Projected Gauss-Seidel finds who is active, also where rows are redundant; a semismooth Newton step (Alart and Curnier 1991)
then solves that system exactly, mass ratios of a million included. Newton steps are proximal: its matrix is regularised along
the change, not along the impulse, so that redundancy does no harm to the motion.
"""

import math

from physics_prior.dynamics.arrays import copy
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array

BILATERAL, NORMAL, DISC, PARTNER = 0, 1, 2, 3
"""Kinds of rows; a disc's second row is its partner."""

SOLVED = 1e-13  # residual, of the largest velocity to be removed, in the metric of S
ENOUGH = 1e-8  # ... that will do where redundant friction at its limit makes it slow
PATIENCE = 2  # attempts before it does
SWEEPS = 8  # of Gauss-Seidel between two attempts of Newton's method
ROUNDS = 100
NEWTON_STEPS = 12  # an attempt
SHORTEST = 0.02  # share of a Newton step that is tried
REGULARISATION = 1e-11  # of the mean diagonal; later attempts cycle through a hundred and ten thousand times that


@inline_kernel
def bounded(x: float, y: float, radius: float) -> tuple[float, float]:
    """The point of the disc of this radius (none if negative) nearest to (x, y)."""
    length = math.sqrt(x * x + y * y)
    if length <= radius:
        return x, y
    shrink = max(radius, 0.0) / length
    return shrink * x, shrink * y


@inline_kernel
def stiffness(S: Array, r: int) -> float:
    """How much impulse a change of velocity of row r costs: its diagonal, of a disc the larger one."""
    return float(max(S[r, r], S[r + 1, r + 1]))


@inline_kernel
def velocity(S: Array, b: Array, p: Array, r: int, m: int) -> float:
    """The velocity of row r under impulses p."""
    total = b[r]
    for s in range(m):
        total += S[r, s] * p[s]
    return float(total)


@kernel
def sweep(S: Array, b: Array, kinds: Array, owners: Array, bounds: Array, p: Array, m: int) -> None:
    """One sweep of projected Gauss-Seidel over the impulses p (m,)."""
    for r in range(m):
        kind = kinds[r]
        if kind == PARTNER or S[r, r] <= 0.0:
            continue
        u = velocity(S, b, p, r, m)
        if kind == BILATERAL:
            p[r] -= u / S[r, r]
        elif kind == NORMAL:
            p[r] = max(0.0, p[r] - u / S[r, r])
        else:
            d, w = stiffness(S, r), velocity(S, b, p, r + 1, m)
            p[r], p[r + 1] = bounded(p[r] - u / d, p[r + 1] - w / d, bounds[r] * p[int(owners[r])])


@kernel
def residual(S: Array, b: Array, kinds: Array, owners: Array, bounds: Array, p: Array, m: int) -> float:
    """How far p (m,) is from its own projection, root of energy."""
    worst = 0.0
    for r in range(m):
        kind = kinds[r]
        if kind == PARTNER or S[r, r] <= 0.0:
            continue
        u = velocity(S, b, p, r, m)
        if kind == BILATERAL:
            error = abs(u) / math.sqrt(S[r, r])
        elif kind == NORMAL:
            error = abs(p[r] - max(0.0, p[r] - u / S[r, r])) * math.sqrt(S[r, r])
        else:
            d, w = stiffness(S, r), velocity(S, b, p, r + 1, m)
            x, y = bounded(p[r] - u / d, p[r + 1] - w / d, bounds[r] * p[int(owners[r])])
            error = math.sqrt(((p[r] - x) ** 2 + (p[r + 1] - y) ** 2) * d)
        worst = max(worst, error)
    return worst


@kernel
def admit(kinds: Array, owners: Array, bounds: Array, p: Array, m: int) -> None:
    """Put p (m,) into its cones, so that contact never pulls."""
    for r in range(m):
        if kinds[r] == NORMAL:
            p[r] = max(0.0, p[r])
    for r in range(m):
        if kinds[r] == DISC:
            p[r], p[r + 1] = bounded(p[r], p[r + 1], bounds[r] * p[int(owners[r])])


@kernel
def newton_system(
    S: Array,
    b: Array,
    kinds: Array,
    owners: Array,
    bounds: Array,
    p: Array,
    m: int,
    G: Array,
    right: Array,
    slack: float,
) -> None:
    """Fill the matrix G (m, m) and the right side (m,) of a Newton step from p, by what p makes every row do."""
    for r in range(m):
        u = velocity(S, b, p, r, m)
        kind = kinds[r]
        if kind == PARTNER:
            continue
        if kind == DISC:
            _disc_rows(S, b, int(owners[r]), bounds[r], p, m, G, right, slack, r, u)
        elif S[r, r] <= 0.0 or (kind == NORMAL and p[r] - u / S[r, r] <= 0.0):
            _nothing(G, right, p, r, m)
        else:
            _holds(S, G, right, slack, r, u, m)


@inline_kernel
def _holds(S: Array, G: Array, right: Array, slack: float, r: int, u: float, m: int) -> None:
    """The row's velocity becomes zero."""
    for s in range(m):
        G[r, s] = S[r, s]
    G[r, r] += slack
    right[r] = -u


@inline_kernel
def _nothing(G: Array, right: Array, p: Array, r: int, m: int) -> None:
    """The row's impulse becomes zero."""
    for s in range(m):
        G[r, s] = 0.0
    G[r, r] = 1.0
    right[r] = -p[r]


@kernel
def _disc_rows(
    S: Array,
    b: Array,
    owner: int,
    bound: float,
    p: Array,
    m: int,
    G: Array,
    right: Array,
    slack: float,
    r: int,
    u: float,
) -> None:
    """The two rows of a disc: stick, slip (its direction differentiated too), or nothing where the owner lets go."""
    d, w = stiffness(S, r), velocity(S, b, p, r + 1, m)
    limit = bound * p[owner]
    if limit <= 0.0 or d <= 0.0:
        _nothing(G, right, p, r, m)
        _nothing(G, right, p, r + 1, m)
        return
    x, y = p[r] - u / d, p[r + 1] - w / d
    length = math.sqrt(x * x + y * y)
    if length <= limit:
        _holds(S, G, right, slack, r, u, m)
        _holds(S, G, right, slack, r + 1, w, m)
        return
    x, y = x / length, y / length
    share = limit / length
    xx, xy, yy = share * y * y, -share * x * y, share * x * x  # share (1 - n n^T)
    for s in range(m):
        G[r, s] = (xx * S[r, s] + xy * S[r + 1, s]) / d
        G[r + 1, s] = (xy * S[r, s] + yy * S[r + 1, s]) / d
    G[r, r] += 1.0 - xx
    G[r, r + 1] -= xy
    G[r + 1, r] -= xy
    G[r + 1, r + 1] += 1.0 - yy
    G[r, owner] -= bound * x
    G[r + 1, owner] -= bound * y
    right[r] = limit * x - p[r]
    right[r + 1] = limit * y - p[r + 1]


@kernel
def solve_dense(G: Array, x: Array, m: int) -> bool:
    """Solve G (m, m) x = x (m,) in place by elimination with row pivots; false if it is singular."""
    for k in range(m):
        best = k
        for r in range(k + 1, m):
            if abs(G[r, k]) > abs(G[best, k]):
                best = r
        if not abs(G[best, k]) > 0.0:
            return False
        if best != k:
            for s in range(k, m):
                G[k, s], G[best, s] = G[best, s], G[k, s]
            x[k], x[best] = x[best], x[k]
        for r in range(k + 1, m):
            factor = G[r, k] / G[k, k]
            if factor != 0.0:
                for s in range(k + 1, m):
                    G[r, s] -= factor * G[k, s]
                x[r] -= factor * x[k]
    for k in range(m - 1, -1, -1):
        for s in range(k + 1, m):
            x[k] -= G[k, s] * x[s]
        x[k] /= G[k, k]
    return math.isfinite(x[0])


@kernel
def complement(
    S: Array, b: Array, kinds: Array, owners: Array, bounds: Array, p: Array, m: int, G: Array, scratch: Array
) -> float:
    """Solve for the impulses p (>= m,), which hold a first guess; return the residual left, of the largest velocity.

    S (>= m, >= m), b, kinds, owners (of a disc its normal row), bounds (of a disc its coefficient), each (>= m,); G
    (>= m, >= m) and scratch (3, >= m) are spoiled. Residuals are in the metric of S, so units of rows do not matter.
    """
    scale, mean = 0.0, 0.0
    for r in range(m):
        mean += S[r, r] / m
        if S[r, r] > 0.0:
            scale = max(scale, abs(b[r]) / math.sqrt(S[r, r]))
    if m == 0 or scale == 0.0:
        for r in range(m):
            p[r] = 0.0
        return 0.0
    trial, right, best = scratch[0], scratch[1], scratch[2]
    least = math.inf
    for attempt in range(ROUNDS):
        for _ in range(SWEEPS + attempt):
            sweep(S, b, kinds, owners, bounds, p, m)
        copy(p[:m], trial[:m])
        error = residual(S, b, kinds, owners, bounds, trial, m)
        if error < least:
            least = error
            copy(trial[:m], best[:m])
        slack = REGULARISATION * mean * 100.0 ** (attempt % 3)
        for _ in range(NEWTON_STEPS):
            if error <= SOLVED * scale:
                break
            newton_system(S, b, kinds, owners, bounds, trial, m, G, right, slack)
            if not solve_dense(G, right, m):
                break
            for r in range(m):
                trial[r] += right[r]
            step = 1.0
            now = residual(S, b, kinds, owners, bounds, trial, m)
            while not now < error and step > SHORTEST:
                step *= 0.5
                for r in range(m):
                    trial[r] -= step * right[r]
                now = residual(S, b, kinds, owners, bounds, trial, m)
            error = now
            if error < least:
                least = error
                copy(trial[:m], best[:m])
        if least <= (SOLVED if attempt < PATIENCE else ENOUGH) * scale:
            break
    copy(best[:m], p[:m])
    admit(kinds, owners, bounds, p, m)
    return least / scale
