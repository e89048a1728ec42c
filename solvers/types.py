"""Types of arrays, once: float64, int64 and bool; C-contiguous where kernels take them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]  # of any shape
Vector = NDArray[np.float64]  # (n,)
Matrix = NDArray[np.float64]  # (rows, columns)
Cube = NDArray[np.float64]  # (n, rows, columns)
Stack = NDArray[np.float64]  # of matrices: (n, rows, columns)
Flags = NDArray[np.bool_]  # of any shape
Integers = NDArray[np.int64]  # (n,)
IntegerMatrix = NDArray[np.int64]  # (rows, columns)
