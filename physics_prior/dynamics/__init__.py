"""How the body moves: readable formulations, compiled kernels, constraints, integrators."""
