"""The memory of contacts: the last part of a step's memory, empty in a scene that names none."""

from typing import Any, NamedTuple

import numpy as np

from physics_prior.dynamics.contact.geometry.pairs import ASKED, ROW, SLOTS
from physics_prior.dynamics.contact.records import CANDIDATE, CONTACT
from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.memory import CONTACT_PART
from physics_prior.dynamics.types import Array
from physics_prior.dynamics.views import FLOAT, array_at

HEAD = 10
CANDIDATE_SIZE, CONTACT_SIZE = CANDIDATE.itemsize // 8, CONTACT.itemsize // 8
VECTORS = (
    10  # of the system: bias, kinds, owners, bounds, impulses, scratch (3), velocities, impulses but for restitution
)
STATES = 15  # configurations and velocities that an event step keeps beside the present ones, and those of what sleeps
KEPT, PUSHED, RESTED, QUIET = 11, 12, 13, 14
"""Of what sleeps, among the states: its configuration, acceleration as it fell asleep, time of rest and whether it is quiet."""


class Sleep(NamedTuple):
    """When what rests falls asleep: once it has been slower than ``velocity``, m/s or rad/s, for ``duration``, s."""

    velocity: float
    duration: float


def contact_memory(
    candidates: np.ndarray, equalities: int, width: int, nq: int, sleep: Sleep | None = None
) -> np.ndarray:
    """The part's array for CANDIDATE records (C,), beside equality rows, over the degrees of freedom that rows move."""
    contacts = rows = 0
    for each in candidates:
        slots = 1 if each["is_limit"] else SLOTS
        contacts += slots
        # where it is uncertain, the estimator may try more friction than none
        slides = max(each["friction"], each["friction_deviation"]) > 0.0
        rows += slots * (1 + 2 * slides + 2 * (each["rolling"] > 0.0))
    m = equalities + rows
    sizes = [
        len(candidates) * CANDIDATE_SIZE,
        contacts * CONTACT_SIZE,
        (SLOTS + ASKED) * ROW,
        2 * m * width,
        2 * m * m,
        VECTORS * m,
        STATES * nq,
    ]
    out = np.zeros(HEAD + sum(sizes))
    out[:5] = len(candidates), contacts, m, width, nq
    out[8:HEAD] = sleep or (0.0, 0.0)
    out[HEAD : HEAD + sizes[0]].view(CANDIDATE)[:] = candidates
    return out


def candidates_in(contact_part: np.ndarray) -> np.ndarray:
    """The CANDIDATE records in the part's array, as a view."""
    count = int(contact_part[0]) if len(contact_part) else 0
    return contact_part[HEAD : HEAD + count * CANDIDATE_SIZE].view(CANDIDATE)


@inline_kernel
def _starts(n: int, c: int, m: int, w: int) -> tuple[int, int, int, int, int, int, int]:
    """Where the part's sections begin in it, for n candidates, c contacts, and m rows over w degrees of freedom."""
    contacts = HEAD + n * CANDIDATE_SIZE
    points = contacts + c * CONTACT_SIZE
    factors = points + (SLOTS + ASKED) * ROW
    matrices = factors + 2 * m * w
    vectors = matrices + 2 * m * m
    return HEAD, contacts, points, factors, matrices, vectors, vectors + VECTORS * m


@inline_kernel
def contact_sections(memory: Array) -> Any:
    """The part's sections: candidates, contacts, points, Y and Z (2, m, w), S and scratch (2, m, m), vectors, states."""
    base = int(memory[CONTACT_PART])
    n, c, m = int(memory[base]), int(memory[base + 1]), int(memory[base + 2])
    w, nq = int(memory[base + 3]), int(memory[base + 4])
    a, b, d, e, f, g, h = _starts(n, c, m, w)
    return (
        array_at(memory, base + a, n, CANDIDATE),
        array_at(memory, base + b, c, CONTACT),
        array_at(memory, base + d, (SLOTS + ASKED, ROW), FLOAT),
        array_at(memory, base + e, (2, m, w), FLOAT),
        array_at(memory, base + f, (2, m, m), FLOAT),
        array_at(memory, base + g, (VECTORS, m), FLOAT),
        array_at(memory, base + h, (STATES, nq), FLOAT),
    )


@inline_kernel
def sleep_settings(memory: Array) -> tuple[float, float]:
    """Velocity, m/s or rad/s, and duration, s, of a scene's sleep."""
    base = int(memory[CONTACT_PART])
    return float(memory[base + 8]), float(memory[base + 9])


def rested_in(contact_part: np.ndarray) -> np.ndarray:
    """How long each link has rested, s, as a view; infinite of those that sleep (entries beyond the links' number are zero)."""
    if not len(contact_part):
        return contact_part
    states = contact_part[-STATES * int(contact_part[4]) :].reshape(STATES, -1)
    return np.asarray(states[RESTED])


def residual_in(contact_part: np.ndarray) -> float:
    """What was left of the last system unsolved, of the largest velocity, in the metric of S."""
    return float(contact_part[7]) if len(contact_part) else 0.0


def solved_system(contact_part: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The contacts that were last solved for (CONTACT records), and of all rows impulses and velocities after them."""
    n, c, m, w = (int(number) for number in contact_part[:4])
    count, rows = int(contact_part[5]), int(contact_part[6])
    _, contacts, _, _, matrices, vectors, _ = _starts(n, c, m, w)
    S = contact_part[matrices : matrices + m * m].reshape(m, m)[:rows, :rows]
    bias = contact_part[vectors : vectors + rows]
    impulses = contact_part[vectors + 4 * m : vectors + 4 * m + rows]
    return contact_part[contacts : contacts + count * CONTACT_SIZE].view(CONTACT), impulses, bias + S @ impulses


@inline_kernel
def remember(memory: Array, count: int, rows: int, residual: float) -> None:
    """Keep how many contacts there are, rows of the system with them, and what is left of it unsolved."""
    base = int(memory[CONTACT_PART])
    memory[base + 5], memory[base + 6], memory[base + 7] = count, rows, residual


@inline_kernel
def remembered(memory: Array) -> tuple[int, int]:
    """Return how many contacts there were, and rows of the system with them."""
    base = int(memory[CONTACT_PART])
    return int(memory[base + 5]), int(memory[base + 6])
