"""Estimates the motion of articulated bodies with physics as the prior.

Noisy poses in; joint states, covariances and constraint forces out: from a recording or live, as a ROS 2 node. Where to
begin: `physics_prior.scene.load_scene` reads a scene, `physics_prior.dynamics.simulator.Simulator` moves it,
`physics_prior.estimation.estimator.Estimator` follows it. The rooms and what may import what: docs/architecture.md.
"""

__version__ = "0.1.0"
