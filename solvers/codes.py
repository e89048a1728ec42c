"""Codes: names for whole numbers, that NumPy and Ctrl-C get along with."""

from __future__ import annotations

from enum import IntEnum

import numpy as np

__all__ = ["Code"]


class Code(IntEnum):
    """Base of statuses, kinds, columns and slots: a member is its number, in arrays, comparisons and kernels.

    NumPy looks for `__array_ufunc__` and `__array_function__` at the class of each operand. Without them, Python 3.11
    runs a method of EnumType in the search, and NumPy clears whatever it raises: a Ctrl-C that comes meanwhile would be
    lost. With those of ndarray, which stand for NumPy's own behaviour, nothing is run, and `array == member` takes a
    fifth of the time.
    """

    __array_ufunc__ = np.ndarray.__array_ufunc__
    __array_function__ = np.ndarray.__array_function__
