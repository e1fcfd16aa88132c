"""The forces of a scene that names none: the compiler finds nothing to do here."""

from physics_prior.dynamics.kernel import inline_kernel


@inline_kernel
def forces(parameters, links, work, q, v, tau):
    """Add nothing."""


@inline_kernel
def differentiate_forces(parameters, links, work, q, v, tau_q, tau_v):
    """Add nothing."""
