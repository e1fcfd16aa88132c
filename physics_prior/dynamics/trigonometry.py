"""Sine and cosine as polynomials: no call, which would empty all registers, and the same bits on every machine.

Source: the kernels of fdlibm (Sun Microsystems 1993), errors below one unit in the last place up to a quarter turn's half.
"""

import math
from typing import Any

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from physics_prior.dynamics.algebra import fma
from physics_prior.dynamics.blocks import at_most, beside, either, lane, size
from physics_prior.dynamics.kernel import inline_kernel

EIGHTH = math.pi**2 / 16.0  # square of an eighth of a turn, to which the polynomials reach
QUARTER, QUARTER_REST = math.pi / 2.0, 6.123233995736766e-17  # of a turn, in two numbers
WHOLE = 1.5 * 2.0**52  # what is added to it is rounded to a whole number
FARTHEST = 1e6  # rad: beyond, two numbers for a quarter turn are too few


@inline_kernel
def sine_over(square: float) -> float:
    """Sin(x) / x of the square of x, |x| at most an eighth of a turn."""
    z = square
    p = fma(z, fma(z, 1.58969099521155010221e-10, -2.50507602534068634195e-8), 2.75573137070700676789e-6)
    p = fma(z, fma(z, fma(z, p, -1.98412698298579493134e-4), 8.33333333332248946124e-3), -1.66666666666666324348e-1)
    return fma(z, p, 1.0)


@inline_kernel
def cosine_of(square: float) -> float:
    """Cos(x) of the square of x, |x| at most an eighth of a turn."""
    z = square
    p = fma(z, fma(z, -1.13596475577881948265e-11, 2.08757232129817482790e-9), -2.75573143513906633035e-7)
    p = fma(z, fma(z, fma(z, p, 2.48015872894767294178e-5), -1.38888888888741095749e-3), 4.16666666666666019037e-2)
    return fma(z, fma(z, p, -0.5), 1.0)


@inline_kernel
def sine_and_cosine(angle: Any) -> tuple[Any, Any]:
    """Sine and cosine of an angle, rad, or of a block of four."""
    quarters = fma(angle, 1.0 / QUARTER, WHOLE)
    turns = quarters - WHOLE
    x = fma(-turns, QUARTER_REST, fma(-turns, QUARTER, angle))
    square = x * x
    sine, cosine = _turned(quarters, x * sine_over(square), cosine_of(square))
    far = size(angle)
    if not at_most(far, FARTHEST):
        a, b, c, d = lane(angle, 0), lane(angle, 1), lane(angle, 2), lane(angle, 3)
        sine = either(far, FARTHEST, sine, beside(angle, math.sin(a), math.sin(b), math.sin(c), math.sin(d)))
        cosine = either(far, FARTHEST, cosine, beside(angle, math.cos(a), math.cos(b), math.cos(c), math.cos(d)))
    return sine, cosine


@intrinsic
def _turned(_typing_context: Any, quarters: Any, sine: Any, cosine: Any) -> Any:
    """Sine and cosine so many quarter turns on, WHOLE being added to their number, which its last bits then are."""

    def build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        number = arguments[0].type
        whole = ir.IntType(64) if number == ir.DoubleType() else ir.VectorType(ir.IntType(64), number.count)
        one, two, up = (whole(each if whole == ir.IntType(64) else [each] * number.count) for each in (1, 2, 62))
        n = builder.bitcast(arguments[0], whole)
        swap = builder.icmp_unsigned("!=", builder.and_(n, one), whole(0 if whole == ir.IntType(64) else None))
        sine, cosine = builder.select(swap, *arguments[:0:-1]), builder.select(swap, *arguments[1:])
        out = []
        for value, count in ((sine, n), (cosine, builder.add(n, one))):
            sign = builder.shl(builder.and_(count, two), up)
            out.append(builder.bitcast(builder.xor(builder.bitcast(value, whole), sign), number))
        return context.make_tuple(builder, signature.return_type, out)

    return types.UniTuple(sine, 2)(quarters, sine, cosine), build
