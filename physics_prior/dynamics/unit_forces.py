"""Unit forces of constraint rows, run through the articulated-body factors side by side: a row has a lane of each block."""

from typing import Any

from physics_prior.dynamics.algebra import (
    cross,
    dot,
    fma,
    get3,
    get6,
    get9,
    minus,
    plus,
    rows_crossed,
    scale,
    sum9,
    symmetric_times,
    transposed_times,
)
from physics_prior.dynamics.blocks import lane, lanes_of
from physics_prior.dynamics.kernel import inline_kernel, kernel
from physics_prior.dynamics.records import FREE, PRISMATIC, REVOLUTE
from physics_prior.dynamics.types import Array, Matrix, Records, Vector


@kernel
def push(
    links: Records,
    work: Records,
    link_index: int,
    point: Vector,
    forces: Matrix,
    count: int,
    alone: bool,
    y: Array,
    z: Array,
) -> None:
    """Run forces at a world point on a link inward through the factors: add S^T w to y and D^-1 S^T w to z.

    forces is a 3x3 matrix whose first ``count`` rows are forces; y and z (count, w) have the columns of the degrees of freedom
    that constraints move. y_r . z_s of two forces is their entry of A M^-1 A^T. Entries of ball joints are in world
    axes. The wrench left after a joint moves on to its parent; a force on the world does nothing. ``alone`` puts in place of
    adding.
    """
    if link_index >= 0:
        moments = rows_crossed(minus(point, get3(work[link_index].origin)), forces)
        push_wrenches(links, work, link_index, moments, forces, count, alone, y, z)


@kernel
def push_joint(links: Records, work: Records, i: int, force: float, y: Array, z: Array) -> None:
    """Do as ``push`` with the force or torque of a revolute or prismatic joint; y and z are (1, w)."""
    link, here = links[i], work[i]
    share = force * here.D
    y[0, link.column] += force
    z[0, link.column] += share
    if link.parent >= 0:
        a, b, c = scale(-share, get3(here.U_force))
        force_left = (a, b, c, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
        a, b, c = scale(-share, get3(here.U_moment))
        moment_left = sum9((a, b, c, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0), rows_crossed(get3(here.arm), force_left))
        push_wrenches(links, work, link.parent, moment_left, force_left, 1, False, y, z)


@kernel
def push_wrenches(
    links: Records,
    work: Records,
    link_index: int,
    moments: Matrix,
    forces: Matrix,
    count: int,
    alone: bool,
    y: Array,
    z: Array,
) -> None:
    """Do as ``push`` with wrenches: the first ``count`` rows of moments about the link's origin and of forces."""
    i = link_index
    m, f = columns(moments), columns(forces)  # each a block, of which every row has its lane
    while i >= 0:
        link, here = links[i], work[i]
        k = link.column
        if link.kind == REVOLUTE or link.kind == PRISMATIC:
            s = dot(m if link.kind == REVOLUTE else f, get3(here.axis))
            share = here.D * s
            put_column(y, k, count, alone, s)
            put_column(z, k, count, alone, share)
            m, f = minus_scaled(m, share, get3(here.U_moment)), minus_scaled(f, share, get3(here.U_force))
            m = plus(m, cross(get3(here.arm), f))
        else:
            turn = symmetric_times(get6(here.J_inverse), m)
            f = minus(f, transposed_times(get9(here.K), m))
            if link.kind == FREE:
                put_columns(y, k, count, alone, f)
                put_columns(z, k, count, alone, symmetric_times(get6(here.M_inverse), f))
                k += 3
            put_columns(y, k, count, alone, m)
            put_columns(z, k, count, alone, turn)
            m = cross(get3(here.arm), f)
        i = link.parent


@inline_kernel
def columns(a: Matrix) -> Any:
    """The columns of a matrix, each a block."""
    return lanes_of(a[0], a[3], a[6]), lanes_of(a[1], a[4], a[7]), lanes_of(a[2], a[5], a[8])


@inline_kernel
def minus_scaled(a: Any, s: Any, u: Vector) -> Any:
    """The vector of blocks a - s u, s a block."""
    return fma(-s, u[0], a[0]), fma(-s, u[1], a[1]), fma(-s, u[2], a[2])


@inline_kernel
def put_column(out: Array, k: int, count: int, alone: bool, u: Any) -> None:
    """Put the first ``count`` numbers of a block into the k-th column of rows, or add them."""
    out[0, k] = lane(u, 0) if alone else out[0, k] + lane(u, 0)
    if count > 1:
        out[1, k] = lane(u, 1) if alone else out[1, k] + lane(u, 1)
    if count > 2:
        out[2, k] = lane(u, 2) if alone else out[2, k] + lane(u, 2)


@inline_kernel
def put_columns(out: Array, k: int, count: int, alone: bool, a: Any) -> None:
    """Do so with a vector of blocks, from the k-th column on."""
    put_column(out, k, count, alone, a[0])
    put_column(out, k + 1, count, alone, a[1])
    put_column(out, k + 2, count, alone, a[2])
