"""Types of arrays, once: float64 and int64, C-contiguous where kernels take them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]  # (n,)
Matrix = NDArray[np.float64]  # (rows, columns)
Cube = NDArray[np.float64]  # (n, rows, columns)
Integers = NDArray[np.int64]  # (n,)
IntegerMatrix = NDArray[np.int64]  # (rows, columns)
