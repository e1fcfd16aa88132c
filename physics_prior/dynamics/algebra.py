"""3-vectors as tuples and 3x3 matrices as 9-tuples (row-major), symmetric ones as 6-tuples (xx, xy, xz, yy, yz, zz).

Tuples become scalars in registers: nothing is allocated, and the kernels above read like the textbook. Sums of products are
written with fused multiply-adds, half the instructions; the optimiser may fuse none by itself, so that bits do not depend on
where a function is inlined.
"""

from collections.abc import Callable
from typing import Any

from numba import types
from numba.extending import intrinsic

from physics_prior.dynamics.blocks import BlockType, fused, spread
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.types import Array, Matrix, Symmetric, Vector

ZERO = (0.0, 0.0, 0.0)
IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@intrinsic
def _fma(_typing_context: Any, a: Any, b: Any, c: Any) -> Any:
    block = next((each for each in (a, b, c) if isinstance(each, BlockType)), None)

    def build(_context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        return (
            builder.fma(*arguments)
            if block is None
            else fused(builder, *spread(builder, block, signature.args, arguments))
        )

    kinds = [each if isinstance(each, BlockType) else types.float64 for each in (a, b, c)]
    return (block or types.float64)(*kinds), build


fma: Callable[[float, float, float], float] = _fma
"""The sum a b + c, rounded once."""


@inline_kernel
def dot_on(s: float, a: float, b: float, c: float, x: float, y: float, z: float) -> float:
    """The sum s + a x + b y + c z."""
    return fma(c, z, fma(b, y, fma(a, x, s)))


@inline_kernel
def dots(a: float, b: float, c: float, x: float, y: float, z: float) -> float:
    """The sum a x + b y + c z."""
    return fma(c, z, fma(b, y, a * x))


@inline_kernel
def determinant(a: float, b: float, c: float, d: float) -> float:
    """The difference a b - c d."""
    return fma(a, b, -(c * d))


@inline_kernel
def get3(a: Array) -> Vector:
    """The vector stored in array a."""
    return a[0], a[1], a[2]


@inline_kernel
def put3(a: Array, u: Vector) -> None:
    """Store vector u in array a."""
    a[0], a[1], a[2] = u[0], u[1], u[2]


@inline_kernel
def add3(a: Array, u: Vector) -> None:
    """Add vector u to array a."""
    a[0] += u[0]
    a[1] += u[1]
    a[2] += u[2]


@inline_kernel
def get9(a: Array) -> Matrix:
    """The matrix stored in array a (9,)."""
    return a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8]


@inline_kernel
def put9(a: Array, m: Matrix) -> None:
    """Store matrix m in array a (9,)."""
    a[0], a[1], a[2], a[3], a[4], a[5], a[6], a[7], a[8] = m


@inline_kernel
def get6(a: Array) -> Symmetric:
    """The symmetric matrix stored in array a (6,)."""
    return a[0], a[1], a[2], a[3], a[4], a[5]


@inline_kernel
def put6(a: Array, m: Symmetric) -> None:
    """Store symmetric matrix m in array a (6,)."""
    a[0], a[1], a[2], a[3], a[4], a[5] = m


@inline_kernel
def plus(u: Vector, w: Vector) -> Vector:
    """The sum u + w."""
    return u[0] + w[0], u[1] + w[1], u[2] + w[2]


@inline_kernel
def minus(u: Vector, w: Vector) -> Vector:
    """The difference u - w."""
    return u[0] - w[0], u[1] - w[1], u[2] - w[2]


@inline_kernel
def scale(s: float, u: Vector) -> Vector:
    """The product s u."""
    return s * u[0], s * u[1], s * u[2]


@inline_kernel
def dot(u: Vector, w: Vector) -> float:
    """The inner product u . w."""
    return dots(u[0], u[1], u[2], w[0], w[1], w[2])


@inline_kernel
def cross(u: Vector, w: Vector) -> Vector:
    """The vector product u x w."""
    return (
        determinant(u[1], w[2], u[2], w[1]),
        determinant(u[2], w[0], u[0], w[2]),
        determinant(u[0], w[1], u[1], w[0]),
    )


@inline_kernel
def times(m: Matrix, u: Vector) -> Vector:
    """The product m u of a 3x3 matrix and a vector."""
    return (
        dots(m[0], m[1], m[2], u[0], u[1], u[2]),
        dots(m[3], m[4], m[5], u[0], u[1], u[2]),
        dots(m[6], m[7], m[8], u[0], u[1], u[2]),
    )


@inline_kernel
def transposed_times(m: Matrix, u: Vector) -> Vector:
    """The product m^T u."""
    return (
        dots(m[0], m[3], m[6], u[0], u[1], u[2]),
        dots(m[1], m[4], m[7], u[0], u[1], u[2]),
        dots(m[2], m[5], m[8], u[0], u[1], u[2]),
    )


@inline_kernel
def transposed(m: Matrix) -> Matrix:
    """The matrix m^T."""
    return m[0], m[3], m[6], m[1], m[4], m[7], m[2], m[5], m[8]


@inline_kernel
def symmetric_product(a: Symmetric, h: Matrix) -> Matrix:
    """The product of a symmetric 6-tuple and a 9-tuple."""
    return (
        dots(a[0], a[1], a[2], h[0], h[3], h[6]),
        dots(a[0], a[1], a[2], h[1], h[4], h[7]),
        dots(a[0], a[1], a[2], h[2], h[5], h[8]),
        dots(a[1], a[3], a[4], h[0], h[3], h[6]),
        dots(a[1], a[3], a[4], h[1], h[4], h[7]),
        dots(a[1], a[3], a[4], h[2], h[5], h[8]),
        dots(a[2], a[4], a[5], h[0], h[3], h[6]),
        dots(a[2], a[4], a[5], h[1], h[4], h[7]),
        dots(a[2], a[4], a[5], h[2], h[5], h[8]),
    )


@inline_kernel
def symmetric_times(m: Symmetric, u: Vector) -> Vector:
    """The product m u of a symmetric matrix (6-tuple) and a vector."""
    return (
        dots(m[0], m[1], m[2], u[0], u[1], u[2]),
        dots(m[1], m[3], m[4], u[0], u[1], u[2]),
        dots(m[2], m[4], m[5], u[0], u[1], u[2]),
    )


@inline_kernel
def product(a: Matrix, b: Matrix) -> Matrix:
    """The product a b of 3x3 matrices."""
    return (
        dots(a[0], a[1], a[2], b[0], b[3], b[6]),
        dots(a[0], a[1], a[2], b[1], b[4], b[7]),
        dots(a[0], a[1], a[2], b[2], b[5], b[8]),
        dots(a[3], a[4], a[5], b[0], b[3], b[6]),
        dots(a[3], a[4], a[5], b[1], b[4], b[7]),
        dots(a[3], a[4], a[5], b[2], b[5], b[8]),
        dots(a[6], a[7], a[8], b[0], b[3], b[6]),
        dots(a[6], a[7], a[8], b[1], b[4], b[7]),
        dots(a[6], a[7], a[8], b[2], b[5], b[8]),
    )


@inline_kernel
def minus9(a: Matrix) -> Matrix:
    """The matrix -a."""
    return -a[0], -a[1], -a[2], -a[3], -a[4], -a[5], -a[6], -a[7], -a[8]


@inline_kernel
def minus_outer(a: Matrix, u: Vector, w: Vector) -> Matrix:
    """The matrix a - u w^T."""
    return (
        fma(-u[0], w[0], a[0]),
        fma(-u[0], w[1], a[1]),
        fma(-u[0], w[2], a[2]),
        fma(-u[1], w[0], a[3]),
        fma(-u[1], w[1], a[4]),
        fma(-u[1], w[2], a[5]),
        fma(-u[2], w[0], a[6]),
        fma(-u[2], w[1], a[7]),
        fma(-u[2], w[2], a[8]),
    )


@inline_kernel
def scale6(s: float, a: Symmetric) -> Symmetric:
    """The symmetric matrix s a."""
    return s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5]


@inline_kernel
def scale9(s: float, a: Matrix) -> Matrix:
    """The matrix s a."""
    return s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5], s * a[6], s * a[7], s * a[8]


@inline_kernel
def sum9(a: Matrix, b: Matrix) -> Matrix:
    """The matrix a + b."""
    return (
        a[0] + b[0],
        a[1] + b[1],
        a[2] + b[2],
        a[3] + b[3],
        a[4] + b[4],
        a[5] + b[5],
        a[6] + b[6],
        a[7] + b[7],
        a[8] + b[8],
    )


@inline_kernel
def rows_crossed(u: Vector, a: Matrix) -> Matrix:
    """The matrix whose rows are u x (row of a)."""
    p, q, r = cross(u, (a[0], a[1], a[2])), cross(u, (a[3], a[4], a[5])), cross(u, (a[6], a[7], a[8]))
    return p[0], p[1], p[2], q[0], q[1], q[2], r[0], r[1], r[2]


@inline_kernel
def full(m: Symmetric) -> Matrix:
    """A symmetric 6-tuple as a 9-tuple."""
    return m[0], m[1], m[2], m[1], m[3], m[4], m[2], m[4], m[5]


@inline_kernel
def rotated_inertia(R: Matrix, m: Symmetric) -> Symmetric:
    """The symmetric matrix R m R^T, m a symmetric 6-tuple."""
    a = product(R, full(m))
    return (
        dots(a[0], a[1], a[2], R[0], R[1], R[2]),
        dots(a[0], a[1], a[2], R[3], R[4], R[5]),
        dots(a[0], a[1], a[2], R[6], R[7], R[8]),
        dots(a[3], a[4], a[5], R[3], R[4], R[5]),
        dots(a[3], a[4], a[5], R[6], R[7], R[8]),
        dots(a[6], a[7], a[8], R[6], R[7], R[8]),
    )


@inline_kernel
def rotated_diagonal(R: Matrix, m: Symmetric) -> Symmetric:
    """The symmetric matrix R m R^T of a diagonal m (6-tuple), R a rotation: c 1 + (a - c) r r^T + (b - c) s s^T."""
    rest = m[5]
    a, b = m[0] - rest, m[3] - rest
    r, s = (R[0], R[3], R[6]), (R[1], R[4], R[7])
    p, q = scale(a, r), scale(b, s)
    return (
        fma(q[0], s[0], fma(p[0], r[0], rest)),
        fma(q[0], s[1], p[0] * r[1]),
        fma(q[0], s[2], p[0] * r[2]),
        fma(q[1], s[1], fma(p[1], r[1], rest)),
        fma(q[1], s[2], p[1] * r[2]),
        fma(q[2], s[2], fma(p[2], r[2], rest)),
    )


@inline_kernel
def symmetric_adjugate(m: Symmetric) -> tuple[Symmetric, float]:
    """The cofactors of a symmetric 6-tuple, and one over its determinant: their product is its inverse."""
    c0 = determinant(m[3], m[5], m[4], m[4])
    c1 = determinant(m[2], m[4], m[1], m[5])
    c2 = determinant(m[1], m[4], m[2], m[3])
    c3, c4 = determinant(m[0], m[5], m[2], m[2]), determinant(m[1], m[2], m[0], m[4])
    c5 = determinant(m[0], m[3], m[1], m[1])
    return (c0, c1, c2, c3, c4, c5), 1.0 / dots(m[0], m[1], m[2], c0, c1, c2)


@inline_kernel
def symmetric_inverse(m: Symmetric) -> Symmetric:
    """The inverse of a symmetric 6-tuple."""
    adjugate, d = symmetric_adjugate(m)
    return scale6(d, adjugate)


@inline_kernel
def inverse9(m: Matrix) -> Matrix:
    """The inverse of a 3x3 matrix (9-tuple) by cofactors."""
    a, b, c = (m[0], m[3], m[6]), (m[1], m[4], m[7]), (m[2], m[5], m[8])
    p, q, r = cross(b, c), cross(c, a), cross(a, b)
    d = 1.0 / dot(a, p)
    return p[0] * d, p[1] * d, p[2] * d, q[0] * d, q[1] * d, q[2] * d, r[0] * d, r[1] * d, r[2] * d


@inline_kernel
def rotation_of(w: float, x: float, y: float, z: float) -> Matrix:
    """The rotation matrix of a unit quaternion (design eq. 1, the element (1, 3) corrected)."""
    a, b, c = 2.0 * x, 2.0 * y, 2.0 * z
    return (
        fma(-b, y, fma(-c, z, 1.0)),
        determinant(a, y, c, w),
        fma(a, z, b * w),
        fma(a, y, c * w),
        fma(-a, x, fma(-c, z, 1.0)),
        determinant(b, z, a, w),
        determinant(a, z, b, w),
        fma(b, z, a * w),
        fma(-a, x, fma(-b, y, 1.0)),
    )
