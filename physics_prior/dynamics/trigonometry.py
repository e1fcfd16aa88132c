"""Sine and cosine as polynomials: no call, which would empty all registers, and the same bits on every machine.

Source: the kernels of fdlibm (Sun Microsystems 1993), errors below one unit in the last place up to a quarter turn's half.
"""

import math

from physics_prior.dynamics.algebra import fma
from physics_prior.dynamics.kernel import inline_kernel

EIGHTH = math.pi**2 / 16.0  # square of an eighth of a turn, to which the polynomials reach
QUARTER, QUARTER_REST = math.pi / 2.0, 6.123233995736766e-17  # of a turn, in two numbers
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
def sine_and_cosine(angle: float) -> tuple[float, float]:
    """Sine and cosine of an angle, rad."""
    if not abs(angle) < FARTHEST:
        return math.sin(angle), math.cos(angle)
    turns = math.floor(fma(angle, 1.0 / QUARTER, 0.5))
    x = fma(-turns, QUARTER_REST, fma(-turns, QUARTER, angle))
    square, quadrant = x * x, int(turns) & 3
    sine, cosine = x * sine_over(square), cosine_of(square)
    if quadrant & 1:
        sine, cosine = cosine, sine
    return -sine if quadrant & 2 else sine, -cosine if (quadrant + 1) & 2 else cosine
