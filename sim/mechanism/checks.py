"""Checks of arguments: every message names the call, the expected and the given value."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence, Set
from difflib import get_close_matches
from math import isfinite
from os import PathLike, fsencode, fspath
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from solvers.types import Floats

_MOST_LISTED, _MOST_CLOSE = 20, 5  # words in a message, and those that look like a given one
_LEAST_LETTERS, _MOST_LETTERS = 4, 60  # of a word whose letters are looked for in others
_LONG = 8192  # numbers; OpenBLAS divides products of 10,000 and more among threads
_LONGEST = 200  # characters of a value in a message
UNIT = 1e-3  # by how much the length of a quaternion may be off, as one typed with four digits is
_ROUNDED_LENGTH = 4.0 * float(np.finfo(np.float64).eps)  # off 1: that of a vector that was scaled
LARGEST = 2**53  # up to which floats hold all whole numbers
_FLOAT = np.dtype(np.float64)  # `is` takes a tenth of the time of ==


def shown(value: Any) -> str:
    """A value for a message, cut where it is long."""
    try:
        text = repr(value)
    except Exception:  # integers of thousands of digits refuse, and so may classes of users
        return f"a {type(value).__name__}"
    return text if len(text) <= _LONGEST else text[: _LONGEST - 3] + "..."


def floats(call: str, value: Any) -> Floats:
    """`value` as a C-contiguous float64 array; complex numbers, text and ragged lists are refused.

    A read-only array is copied: kernels would be compiled again for it, because it is another type.
    """
    if type(value) is np.ndarray and (value.dtype is _FLOAT or value.dtype == _FLOAT) and value.flags.carray:
        return value
    if isinstance(value, np.ma.MaskedArray) and np.ma.is_masked(value):
        raise ValueError(f"{call}: expected real numbers, got an array with masked entries")
    try:
        with np.errstate(all="ignore"):
            raw = np.asarray(value)
            if raw.dtype.kind not in "biufO" or (raw.dtype.kind == "O" and any(x is None for x in raw.flat)):
                raise TypeError
            return np.array(raw, dtype=np.float64, order="C")
    except (TypeError, ValueError, OverflowError):
        raise ValueError(f"{call}: expected real numbers, got {shown(value)}") from None


def shape(call: str, value: Any) -> tuple[int, ...]:
    """The shape of an array-like; ragged lists are refused."""
    try:
        return np.shape(value)
    except ValueError:
        raise ValueError(f"{call}: expected real numbers, got {shown(value)}") from None


def ndim(call: str, value: Any) -> int:
    """The number of axes of an array-like."""
    return len(shape(call, value))


def whole_numbers(call: str, value: Any) -> NDArray[np.int64]:
    """`value` as an array of whole numbers, with at least one axis."""
    shape(call, value)
    out = np.atleast_1d(np.asarray(value))
    if out.dtype.kind not in "iu":
        raise ValueError(f"{call}: expected whole numbers, got {shown(value)}")
    return out


def all_finite(values: Floats) -> bool:
    """Whether all entries are finite numbers."""
    # the sum of squares shows it at a third of the cost, without a warning, unless it overflows itself; of long arrays
    # BLAS takes it with threads, which cost more than they gain, and milliseconds where other processes have the cores
    if values.size < _LONG and isfinite(np.vdot(values, values)):  # where `dot` overflows, it warns
        return True
    return bool(np.isfinite(values).all())


def _fits(shape: tuple[int, ...], wanted: tuple[int | str | None, ...]) -> bool:
    """Whether a shape is the wanted one, in which None and letters stand for any length."""
    if len(shape) != len(wanted):
        return False
    for n, m in zip(shape, wanted, strict=True):  # `all` of a generator takes three times as long
        if n != m and isinstance(m, int):
            return False
    return True


def array(call: str, value: Any, shape: tuple[int | str | None, ...]) -> Floats:
    """`value` as a finite float64 array of the given shape; None or a letter stands for any length."""
    out = floats(call, value)
    fits = out.shape == shape or _fits(out.shape, shape)
    if fits and all_finite(out):
        return out
    if not fits:
        wanted = ", ".join("any" if n is None else str(n) for n in shape) + ("," if len(shape) == 1 else "")
        raise ValueError(f"{call}: expected shape ({wanted}), got {out.shape}")
    index = tuple(int(i) for i in np.argwhere(~np.isfinite(out))[0])
    where = f" at index {index[0] if len(index) == 1 else index}" if index else ""
    raise ValueError(f"{call}: expected finite numbers, got {out[index]}{where}")


def points(call: str, value: Any) -> Floats:
    """`value` as finite places (..., 3)."""
    out = floats(call, value)
    if out.shape[-1:] != (3,):
        raise ValueError(f"{call}: expected shape (..., 3), got {out.shape}")
    return array(call, out, out.shape)


def number(
    call: str, value: Any, at_least: float | None = None, above: float | None = None, *, finite: bool = True
) -> float:
    """`value` as a float within the bounds; an infinite one only with finite=False."""
    if type(value) is float and isfinite(value):
        out = value
    elif ndim(call, value) != 0:
        raise ValueError(f"{call}: expected one number, got {shown(value)}")
    elif not finite and np.isinf(floats(call, value)):
        out = float(floats(call, value))
    else:
        out = float(array(call, value, ()))
    if at_least is not None and out < at_least:
        raise ValueError(f"{call}: expected a number >= {at_least:g}, got {out:g}")
    if above is not None and out <= above:
        raise ValueError(f"{call}: expected a number > {above:g}, got {out:g}")
    return out


def vector(call: str, value: Any, length: int) -> tuple[float, ...]:
    """`value` as a tuple of finite floats."""
    if type(value) is tuple and len(value) == length and all(type(x) is float and isfinite(x) for x in value):
        return value  # as most are that come from files: an array takes ten times as long
    return tuple(float(x) for x in array(call, value, (length,)))


def spread(call: str, value: Any, length: int) -> Floats:
    """(length,) numbers, NaN excepted: as many, or one for all."""
    out = floats(call, value)
    if out.shape not in ((), (length,)) or np.isnan(out).any():
        raise ValueError(f"{call}: expected one number or {length}, got {shown(value)}")
    return np.array(np.broadcast_to(out, (length,)))


def names(call: str, value: Any) -> tuple[str, ...]:
    """`value` as a tuple of names."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise TypeError(f"{call}: expected a list of names, got {shown(value)}")
    return tuple(name(call, one) for one in value)


def mapping(call: str, value: Any) -> Mapping[Any, Any]:
    """`value` as a dict; None is an empty one."""
    if value is None:
        return {}
    if not isinstance(value, Mapping):
        raise TypeError(f"{call}: expected a dict, {{name: value}}, got {shown(value)}")
    return value


def direction(call: str, value: Any) -> tuple[float, ...]:
    """`value` scaled to a unit vector."""
    out = array(call, value, (3,))
    length = float(np.linalg.norm(out))
    if length < 1e-9:
        raise ValueError(f"{call}: expected a direction, got the zero vector")
    return _scaled(out, length)


def quaternion(call: str, value: Any) -> tuple[float, ...]:
    """`value` scaled to a unit quaternion (w, x, y, z); refused when its length is off by more than UNIT."""
    out = array(call, value, (4,))
    length = float(np.linalg.norm(out))
    if abs(length - 1.0) > UNIT:
        raise ValueError(f"{call}: expected a unit quaternion (w, x, y, z), got length {length:g}")
    return _scaled(out, length)


def _scaled(vector: Floats, length: float) -> tuple[float, ...]:
    """The vector over its length; as it is where that is 1 but for rounding: loaded parts have the same bits."""
    return tuple(vector.tolist() if abs(length - 1.0) <= _ROUNDED_LENGTH else (vector / length).tolist())


def name(call: str, value: Any) -> str:
    """`value` as a name that is not empty."""
    if not isinstance(value, str) or not value:
        raise ValueError(f"{call}: expected a name, got {shown(value)}")
    try:
        value.encode()
    except UnicodeEncodeError:  # half a character, as of bytes that are not UTF-8
        raise ValueError(f"{call}: expected a name of whole characters, got {shown(value)}") from None
    return value


def name_or(call: str, value: Any, default: str) -> str:
    """`value` as a name; the default for an empty one and for None."""
    return default if value is None or (isinstance(value, str) and not value) else name(call, value)


def items(call: str, value: Any, kind: type) -> tuple[Any, ...]:
    """`value` as a tuple of objects of a class."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise TypeError(f"{call}: expected a list of {kind.__name__}, got {shown(value)}")
    found = tuple(value)
    for one in found:
        if not isinstance(one, kind):
            raise ValueError(f"{call}: expected a list of {kind.__name__}, got {shown(one)}")
    return found


def path(call: str, value: Any) -> Path:
    """`value` as the path of a file."""
    text = fspath(value) if isinstance(value, str | PathLike) else value
    if not isinstance(text, str):
        raise TypeError(f"{call}: expected the path of a file, got {shown(value)}")
    try:
        fsencode(text)
    except UnicodeEncodeError:  # half a character
        text = ""
    if not text or "\0" in text:
        raise ValueError(f"{call}: expected the path of a file, got {shown(value)}")
    return Path(text)


def one_of(call: str, value: Any, known: Iterable[str], elsewhere: Mapping[str, str] | None = None) -> str:
    """`value` as one of the known words; elsewhere: words for some of them in other libraries, which are suggested."""
    words = known if isinstance(known, Mapping | Sequence) and not isinstance(known, str) else list(known)
    if not isinstance(value, str) or value not in words:
        same = (elsewhere or {}).get(value) if isinstance(value, str) else None
        hint = f"; did you mean {same!r}?" if same in words else nearest(value, words)
        raise ValueError(f"{call}: {shown(value)} is not one of: {listed(words, value)}{hint}")
    return value


def listed(known: Iterable[str], like: Any = None) -> str:
    """The known words for a message; of many those that look like a word, or the first."""
    words = list(known)
    if len(words) <= _MOST_LISTED:
        return ", ".join(words) if words else "(none)"
    return ", ".join(_close(like, words) or words[:_MOST_LISTED]) + f", ... ({len(words)} in all)"


def nearest(value: Any, known: Iterable[str]) -> str:
    """The end of a message: "did you mean", when `value` looks like one of the known words; else nothing."""
    words = list(known)
    close = _close(value, words) if len(words) > 1 else []
    return f"; did you mean {close[0]!r}?" if close else ""


def _close(value: Any, words: Sequence[str]) -> list[str]:
    """Up to five words that look like a value, or have all its letters in order, as panda_finger_joint1 has finger1."""
    if not isinstance(value, str):
        return []
    close = get_close_matches(value, words, n=_MOST_CLOSE, cutoff=0.6)
    if close or not _LEAST_LETTERS <= len(value) <= _MOST_LETTERS:
        return close
    letters = re.compile(".*".join(map(re.escape, value.lower())), re.DOTALL)
    return sorted((word for word in words if letters.search(word.lower())), key=len)[:_MOST_CLOSE]


def no_attribute(module: str, name: str, known: Iterable[str]) -> AttributeError:
    """The error of a module for a name that it does not have, with those that it has."""
    words = list(known)
    has = f"it has {', '.join(words)}{nearest(name, words)}"
    return AttributeError(f"module {module!r} has no attribute {name!r}; {has}")


def keywords(call: str, given: Iterable[str], known: Iterable[str]) -> None:
    """Refuse keywords that a call does not have, with those that it has."""
    words = list(known)
    for word in given:
        if word not in words:
            raise TypeError(f"{call}: no keyword {word!r}; there are {listed(words)}{nearest(word, words)}")


def distinct(call: str, names: Iterable[str]) -> None:
    """Refuse a name that is given twice."""
    seen: set[str] = set()
    for n in names:
        if n in seen:
            raise ValueError(f"{call}: the name {n!r} is used twice")
        seen.add(n)


def bounds(call: str, pair: Any) -> tuple[float, float]:
    """(lo, hi) with lo < hi; None stands for no bound."""
    try:
        if isinstance(pair, str | bytes | Set | Mapping):
            raise TypeError
        ends = [s * np.inf if x is None else x for x, s in zip(pair, (-1, 1), strict=True)]
        lo, hi = (float(x) for x in floats(call, ends).reshape(2))
    except (TypeError, ValueError):
        raise ValueError(f"{call}: expected a pair (lo, hi), got {shown(pair)}") from None
    if not lo < hi or lo == np.inf or hi == -np.inf:
        raise ValueError(f"{call}: expected lo < hi, got ({lo:g}, {hi:g})")
    return lo, hi


def fraction(call: str, value: Any) -> float:
    """A number from 0 to 1."""
    fraction = number(call, value, at_least=0.0)
    if fraction > 1.0:
        raise ValueError(f"{call}: expected a number from 0 to 1, got {fraction:g}")
    return fraction


def flag(call: str, value: Any) -> bool:
    """`value` as True or False, or 1 or 0."""
    if isinstance(value, bool | np.bool_ | int | np.integer):
        return bool(value)
    raise TypeError(f"{call}: expected True or False, got {shown(value)}")


def whole_number(call: str, value: Any, least: int = 1) -> int:
    """`value` as a whole number of at least `least`, and at most 2^53, which floats hold."""
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or value < least:
        raise ValueError(f"{call}: expected a whole number >= {least}, got {shown(value)}")
    if value > LARGEST:
        raise ValueError(f"{call}: expected a whole number <= 2^53, got {shown(value)}")
    return int(value)


def within_range(call: str, result: Any) -> Floats:
    """A result of finite arguments; one that has overflowed is refused."""
    out = np.asarray(result)
    if not all_finite(out):
        raise ValueError(f"{call}: the result is not finite: an argument is too large")
    return out
