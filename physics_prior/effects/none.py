"""The forces of a scene that names none: the compiler finds nothing to do here."""

from physics_prior.dynamics.kernel import inline_kernel
from physics_prior.dynamics.types import Array, Records


@inline_kernel
def forces(parameters: Array, links: Records, work: Records, q: Array, v: Array, tau: Array) -> None:
    """Add nothing."""


@inline_kernel
def differentiate_forces(
    parameters: Array,
    links: Records,
    work: Records,
    freedoms: Records,
    composites: Records,
    q: Array,
    v: Array,
    tau_q: Array,
    tau_v: Array,
) -> None:
    """Add nothing."""


@inline_kernel
def potential_energy(parameters: Array, links: Records, work: Records, q: Array) -> float:
    """Nothing is stored."""
    return 0.0
