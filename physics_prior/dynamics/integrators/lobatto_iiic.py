"""Lobatto IIIC of two stages: order 2, for stiff forces (Hairer and Wanner 1996, IV.5).

Algebraically and L-stable, and the second stage is the step's end. Of the modes exp(z) it makes 1 / (1 - z + z^2/2), which is
positive for real z < 0: what is damped, however strongly, decays without changing its sign.
"""

import numpy as np

STAGES = 2
A = np.array([[0.5, -0.5], [0.5, 0.5]])
B = np.array([0.5, 0.5])
C = np.array([0.0, 1.0])
D = np.array([0.0, 1.0])  # B A^-1: v+ = v + sum of D (V - v), which needs no acceleration
