"""Values that no argument expects, and what a call may make of them: a result without NaN, or a refusal by name."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

import dojo_opt as dojo

VALUES: tuple[Any, ...] = (
    *(np.nan, np.inf, -np.inf, 1j, 1e300, 1e150, 1e-320, -1, 0, 1.5, 10**30, True),
    *("abc", "a\0b", "", "\ud800", b"a", None, object(), ValueError, np.datetime64("2020-01-01")),
    *([], {}, {1, 2}, (None, None), [[1], [1, 2]], ["a", "b"], {"a": np.nan}),
    *(np.zeros(0), np.zeros((2, 3, 4)), np.ma.masked_all(3)),
)


def wrong(value: Any) -> Iterator[Any]:
    """VALUES, and where `value` is an array of numbers, such arrays that are spoilt."""
    yield from VALUES
    try:
        array = np.asarray(value, dtype=np.float64)
    except (TypeError, ValueError):
        return
    if array.size == 0 or array.ndim == 0:
        return
    last = np.arange(array.size).reshape(array.shape) == array.size - 1
    yield from (np.where(last, np.nan, array), np.where(last, np.inf, array), array + 1j, array.astype(str))
    yield from (np.full(array.shape, 1e300), np.full(array.shape, 1e150), np.full(array.shape, None))
    yield from (array[:-1], array[None], np.concatenate([array, array]), np.ma.masked_all(array.shape))


def _numbers(value: Any, depth: int = 0) -> Iterator[np.ndarray[Any, Any]]:
    """Arrays of a result."""
    if isinstance(value, float | np.ndarray):
        yield np.asarray(value)
    elif isinstance(value, tuple | list) and depth < 2:
        for one in value:
            yield from _numbers(one, depth + 1)
    elif is_dataclass(value) and depth < 1:
        for field in fields(value):
            yield from _numbers(getattr(value, field.name), depth + 1)


def fault(call: Callable[..., Any], names: tuple[str, ...], **given: Any) -> str:
    """What is wrong with the answer of a call, or nothing; a refusal contains one of the names."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            result = call(**given)
        except (ValueError, TypeError) as error:
            refused = type(error) in (ValueError, TypeError) and any(name in str(error) for name in names)
            return "" if refused else f"{type(error).__name__}: {error}"
        except dojo.SimulationError:  # a status
            return ""
        except Exception as error:  # whatever it is
            return f"{type(error).__name__}: {error}"
    if not np.all(getattr(result, "success", True)):
        return ""
    found = [a for a in _numbers(result) if a.dtype.kind == "f" and np.isnan(a).any()]
    return f"NaN in {found[0].shape}" if found else ""
