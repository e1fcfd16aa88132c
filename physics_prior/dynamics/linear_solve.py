"""Small dense systems: the triangular factors of a square matrix, rows exchanged for the largest pivot."""

from physics_prior.dynamics.kernel import kernel
from physics_prior.dynamics.types import Array


@kernel
def factorize_square(matrix: Array, pivots: Array) -> None:
    """Replace a matrix (n, n) by L and U, the diagonal of U inverted; fill pivots (n,) with the rows exchanged.

    A singular matrix leaves entries that are not finite.
    """
    n = matrix.shape[0]
    for k in range(n):
        best, largest = k, abs(matrix[k, k])
        for i in range(k + 1, n):
            if abs(matrix[i, k]) > largest:
                best, largest = i, abs(matrix[i, k])
        pivots[k] = best
        if best != k:
            for j in range(n):
                matrix[k, j], matrix[best, j] = matrix[best, j], matrix[k, j]
        inverse = 1.0 / matrix[k, k]
        matrix[k, k] = inverse
        own = matrix[k]
        for i in range(k + 1, n):
            other = matrix[i]
            share = other[k] * inverse
            other[k] = share
            for j in range(k + 1, n):
                other[j] -= share * own[j]


@kernel
def solve_square(factors: Array, pivots: Array, columns: Array) -> None:
    """Replace columns (n, k) by the solutions of the system that ``factorize_square`` left."""
    n, width = columns.shape
    for k in range(n):  # all of them first: L stands in the order that they lead to
        best = int(pivots[k])
        if best != k:
            for c in range(width):
                columns[k, c], columns[best, c] = columns[best, c], columns[k, c]
    for k in range(n):
        for i in range(k + 1, n):
            share = factors[i, k]
            for c in range(width):
                columns[i, c] -= share * columns[k, c]
    for k in range(n - 1, -1, -1):
        inverse = factors[k, k]
        for c in range(width):
            columns[k, c] *= inverse
        for i in range(k):
            share = factors[i, k]
            for c in range(width):
                columns[i, c] -= share * columns[k, c]
