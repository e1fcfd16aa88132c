"""The memory of a compiled step: one array that holds the model, the workspace and the constraints.

Each array that Python hands over costs about as much as the motion of a link, and one of records twice that. So a step takes
one array, and both sides see its sections as the records and matrices that they are.
"""

from itertools import pairwise
from typing import Any

import numpy as np

from physics_prior.dynamics.constraint_derivatives import GAP
from physics_prior.dynamics.derivatives import COMPOSITE, FREEDOM
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.records import BOUNDS, FREE_LINK, LINK, PAIR, WORK, row_bounds
from physics_prior.dynamics.types import Array
from physics_prior.dynamics.views import FLOAT, array_at

HEAD = 12
TIME, TOLERANCE, VECTORS, WORKSPACE, CONTACT_PART, OPEN = 6, 7, 8, 9, 10, 11
"""Where the head has the time since the scene's beginning, s, the integrator's tolerance, the sizes of its scratch, where
the part for contacts begins (contact/memory.py), and how far off its constraints, m, the last step ended."""
LINK_SIZE, WORK_SIZE, PAIR_SIZE = LINK.itemsize // 8, WORK.itemsize // 8, PAIR.itemsize // 8
FREEDOM_SIZE, COMPOSITE_SIZE, GAP_SIZE = FREEDOM.itemsize // 8, COMPOSITE.itemsize // 8, GAP.itemsize // 8
SPARE = 13  # vectors (nv,) of scratch that every step needs; the last four are those of ``evaluate`` at a fold


class Memory:
    """The memory, as Python sees it.

    Attributes:
        array: what compiled steps take.
        links, work, pairs: (N,) LINK or FREE_LINK, (N,) WORK and (P,) PAIR records.
        rows: (m + 3, 2 w + 2 m + BOUNDS) constraint rows over the w degrees of freedom that they move (row_system.py).
        known: (nq + 2,) the configuration whose factors and rows stand in the memory, their rank, and the position error, m,
            that projection may leave there.
        parameters: the numbers of the effects.
        contact_part: what contacts need (contact/memory.py), empty in a scene without.

    vectors (nv,) of scratch, SPARE or more, and the size of ``tangent_memory`` in it are what the integrator needs.
    """

    def __init__(
        self,
        links: np.ndarray,
        pairs: np.ndarray,
        width: int,
        parameters: np.ndarray,
        nq: int,
        nv: int,
        vectors: int = SPARE,
        workspace: int = 0,
        contact_part: np.ndarray | None = None,
    ) -> None:
        m = int(pairs["rows"].sum())
        sizes = [
            len(links) * LINK_SIZE,
            len(links) * WORK_SIZE,
            len(pairs) * PAIR_SIZE,
            (m + 3) * (2 * width + 2 * m + BOUNDS),
            nq + 2,
            nq,
            vectors * nv,
            workspace,
            len(parameters),
            0 if contact_part is None else len(contact_part),
        ]
        ends = HEAD + np.cumsum([0, *sizes])
        self.array = np.zeros(ends[-1])
        self.array[:6] = len(links), len(pairs), m, nq, nv, sizes[3]
        self.array[VECTORS], self.array[WORKSPACE], self.array[CONTACT_PART] = vectors, workspace, ends[9]
        own = [self.array[a:b] for a, b in pairwise(ends)]
        self.links, self.work, self.pairs = own[0].view(links.dtype), own[1].view(WORK), own[2].view(PAIR)
        self.rows = own[3].reshape(m + 3, 2 * width + 2 * m + BOUNDS)
        self.known, self.parameters = own[4], own[8]
        self.spare = own[6].reshape(vectors, nv)
        self.contact_part = own[9]
        if contact_part is not None:
            own[9][:] = contact_part
        records = links.view(LINK)
        own[0].view(LINK)[:], self.pairs[:], self.parameters[:] = records, pairs, parameters
        if m:
            self.rows[:m, -BOUNDS:] = row_bounds(records, pairs, width)


@inline_kernel
def sections(memory: Array) -> Any:
    """The sections of the memory, as kernels see them: links, work, pairs, rows, known, start, spare, parameters."""
    n, couples, m = int(memory[0]), int(memory[1]), int(memory[2])
    nq, nv = int(memory[3]), int(memory[4])
    a = HEAD + n * LINK_SIZE
    b = a + n * WORK_SIZE
    c = b + couples * PAIR_SIZE
    d = c + int(memory[5])
    e = d + nq + 2
    f = e + nq
    g = f + int(memory[VECTORS]) * nv
    p = g + int(memory[WORKSPACE])
    return (
        array_at(memory, HEAD, n, LINK),
        array_at(memory, a, n, WORK),
        array_at(memory, b, couples, PAIR),
        array_at(memory, c, (m + 3, (d - c) // (m + 3)), FLOAT),
        array_at(memory, d, nq + 2, FLOAT),
        array_at(memory, e, nq, FLOAT),
        array_at(memory, f, (int(memory[VECTORS]), nv), FLOAT),
        array_at(memory, p, int(memory[CONTACT_PART]) - p, FLOAT),
    )


@inline_kernel
def free_sections(memory: Array) -> Any:
    """The same of a scene without joints, whose links are FREE_LINK."""
    _, work, pairs, rows, known, start, spare, parameters = sections(memory)
    return array_at(memory, HEAD, int(memory[0]), FREE_LINK), work, pairs, rows, known, start, spare, parameters


@inline_kernel
def workspace(memory: Array) -> Array:
    """Derivatives' own scratch in the memory, of ``tangent_size``, where the integrator needs them in a plain step."""
    nv, vectors, size = int(memory[4]), int(memory[VECTORS]), int(memory[WORKSPACE])
    spare = _spare_start(memory)
    array: Array = array_at(memory, spare + vectors * nv, size, FLOAT)
    return array


@inline_kernel
def stage_configuration(memory: Array) -> Array:
    """A configuration (nq,) of scratch, in the first two vectors beyond SPARE."""
    nv = int(memory[4])
    array: Array = array_at(memory, _spare_start(memory) + SPARE * nv, int(memory[3]), FLOAT)
    return array


@inline_kernel
def _spare_start(memory: Array) -> int:
    """Where the vectors of scratch begin."""
    n, couples, nq = int(memory[0]), int(memory[1]), int(memory[3])
    return HEAD + n * (LINK_SIZE + WORK_SIZE) + couples * PAIR_SIZE + int(memory[5]) + nq + 2 + nq


def tangent_size(n: int, m: int, nv: int, stages: int) -> int:
    """Numbers that derivatives need beside the memory, for n links, m rows, nv degrees of freedom and stages (nv, 2 nv)."""
    matrices = 2 * nv * nv + (nv + 4 * m) * nv + correction_size(m, nv, 2 * nv) + stages * nv * 2 * nv
    return int(matrices + nv * FREEDOM_SIZE + n * COMPOSITE_SIZE + nv * GAP_SIZE)


@inline_kernel
def correction_size(m: int, nv: int, k: int) -> int:
    """Numbers that a correction of k columns by constraints needs: M^-1 A^T, and right sides, answers, changes (m, k)."""
    return m * nv + 3 * m * k


@inline_kernel
def correction_sections(scratch: Array, m: int, nv: int, k: int) -> Any:
    """The sections of that: M^-1 A^T transposed (m, nv), right sides, answers and changes (m, k)."""
    a = m * nv
    return (
        array_at(scratch, 0, (m, nv), FLOAT),
        array_at(scratch, a, (m, k), FLOAT),
        array_at(scratch, a + m * k, (m, k), FLOAT),
        array_at(scratch, a + 2 * m * k, (m, k), FLOAT),
    )


@inline_kernel
def tangent_sections(tangent: Array, n: int, m: int, nv: int) -> Any:
    """The sections: derivative (nv, 2 nv), matrices (nv + 4 m, nv), scratch, records, stages (s, nv, 2 nv).

    The records are those of freedoms, composites and gaps.
    """
    a = 2 * nv * nv
    b = a + (nv + 4 * m) * nv
    c = b + correction_size(m, nv, 2 * nv)
    d = c + nv * FREEDOM_SIZE
    e = d + n * COMPOSITE_SIZE
    f = e + nv * GAP_SIZE
    return (
        array_at(tangent, 0, (nv, 2 * nv), FLOAT),
        array_at(tangent, a, (nv + 4 * m, nv), FLOAT),
        array_at(tangent, b, c - b, FLOAT),
        array_at(tangent, c, nv, FREEDOM),
        array_at(tangent, d, n, COMPOSITE),
        array_at(tangent, e, nv, GAP),
        array_at(tangent, f, ((tangent.shape[0] - f) // (2 * nv * nv), nv, 2 * nv), FLOAT),
    )
