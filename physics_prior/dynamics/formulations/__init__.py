"""Three formulations of one motion in readable NumPy: the textbook, and the oracle of the kernels.

``maximal``: every link a free body, joints as explicit constraints with Lagrange multipliers. ``quaternion``:
the same with quaternions as coordinates. ``generalized``: only the freedoms of the joints, remaining
constraints beside them. Their ``accelerations`` agree on every tree and state.
"""

from physics_prior.dynamics.formulations.constrained_motion import ConstrainedMotion

__all__ = ["ConstrainedMotion"]
