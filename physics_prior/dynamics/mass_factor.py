"""The mass matrix factored along the branches of the tree, for many right sides at once: M = L^T D L.

Source: Featherstone 2008, ch. 6.5: L has entries only where one degree of freedom carries another, so that no branch meets
another. Columns run innermost, where the compiler makes vectors of them.
"""

from physics_prior.dynamics.algebra import fma
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.types import Array, Records


@kernel
def factorize_mass(freedom_records: Records, M: Array) -> None:
    """Replace M (nv, nv), of which entries below the diagonal are read, by L and, in the diagonal, the inverse of D."""
    for k in range(M.shape[0] - 1, -1, -1):
        inverse = 1.0 / M[k, k]
        i = freedom_records[k].parent
        while i >= 0:
            share = M[k, i] * inverse
            j = i
            while j >= 0:
                M[i, j] -= share * M[k, j]
                j = freedom_records[j].parent
            M[k, i] = share
            i = freedom_records[i].parent
        M[k, k] = inverse


@kernel
def solve_mass(freedom_records: Records, M: Array, columns: Array) -> None:
    """Replace columns (nv, k), generalized forces, by the accelerations M^-1 of them; M is factored.

    Two rows a pass, so that the one they change is seldom moved. What a freedom carries follows it without a gap.
    """
    nv = M.shape[0]
    for i in range(nv - 1, -1, -1):
        own = columns[i]
        k = i + 1
        while k < nv and freedom_records[k].parent >= i:
            if k + 1 < nv and freedom_records[k + 1].parent >= i:
                _subtract_two(M[k, i], columns[k], M[k + 1, i], columns[k + 1], own)
                k += 2
            else:
                _subtract_two(M[k, i], columns[k], 0.0, columns[k], own)
                k += 1
    for k in range(nv):
        own, inverse = columns[k], M[k, k]
        for c in range(own.shape[0]):
            own[c] *= inverse
        i = freedom_records[k].parent
        while i >= 0:
            j = freedom_records[i].parent
            if j >= 0:
                _subtract_two(M[k, i], columns[i], M[k, j], columns[j], own)
                j = freedom_records[j].parent
            else:
                _subtract_two(M[k, i], columns[i], 0.0, columns[i], own)
            i = j


@inline_kernel
def _subtract_two(s: float, a: Array, t: float, b: Array, out: Array) -> None:
    """Take s a + t b from out, of the same length."""
    for c in range(out.shape[0]):
        out[c] = fma(-t, b[c], fma(-s, a[c], out[c]))
