"""The mass matrix factored along the branches of the tree, for many right sides at once: M = L^T D L.

Source: Featherstone 2008, ch. 6.5: L has entries only where one degree of freedom carries another, so that no branch meets
another. Columns run innermost, where the compiler makes vectors of them.
"""

from physics_prior.dynamics.kernel import kernel
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
    """Replace columns (nv, k), generalized forces, by the accelerations M^-1 of them; M is factored."""
    for k in range(M.shape[0] - 1, -1, -1):
        own = columns[k]
        i = freedom_records[k].parent
        while i >= 0:
            share, other = M[k, i], columns[i]
            for c in range(own.shape[0]):
                other[c] -= share * own[c]
            i = freedom_records[i].parent
        inverse = M[k, k]
        for c in range(own.shape[0]):
            own[c] *= inverse
    for k in range(M.shape[0]):
        own = columns[k]
        i = freedom_records[k].parent
        while i >= 0:
            share, other = M[k, i], columns[i]
            for c in range(own.shape[0]):
                own[c] -= share * other[c]
            i = freedom_records[i].parent
