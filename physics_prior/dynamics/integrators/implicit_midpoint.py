"""The implicit midpoint rule: order 2, structure preserving; the Gauss method of one stage (Hairer, Lubich and Wanner 2006).

vm = v + h/2 vdot(q [+] h/2 vm, vm), then q+ = q [+] h vm and v+ = 2 vm - v. What is quadratic in v is kept at any h, as the
energy and the angular momentum of a body that nothing turns; energies that are not quadratic stay bounded.
"""

import numpy as np

STAGES = 1
A = np.array([[0.5]])
B = np.array([1.0])
C = np.array([0.5])
D = np.array([2.0])  # B A^-1: v+ = v + sum of D (V - v), which needs no acceleration
