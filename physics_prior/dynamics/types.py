"""The types of the kernels' arguments. Numba infers its own; these are for people and for mypy."""

from typing import Any

import numpy as np

Array = np.ndarray
"""Floats in C order; a docstring gives the shape."""
Vector = tuple[float, float, float]
Symmetric = tuple[float, float, float, float, float, float]
"""A symmetric 3x3 matrix: xx, xy, xz, yy, yz, zz."""
Matrix = tuple[float, float, float, float, float, float, float, float, float]
"""A 3x3 matrix, row-major."""
Spatial = tuple[Vector, Vector]
"""(angular, linear) of a motion, (moment, force) of a force."""
Record = Any
"""One record of records.py or derivatives.py, whose fields Numba knows by name."""
Records = Any
"""An array of such records."""
