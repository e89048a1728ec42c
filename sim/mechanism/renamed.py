"""Old names of attributes, keywords and module members, which work for one version and warn."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import Any

__all__ = ["renamed", "renamed_keywords", "warn_renamed"]


def warn_renamed(old: str, new: str, level: int = 3) -> None:
    """Warn that a name has changed, at the line that uses it.

    Args:
        old: the old name.
        new: the new one.
        level: frames from here to that line.
    """
    warnings.warn(f"{old} is now {new}; the old name goes with version 0.2", DeprecationWarning, stacklevel=level)


class renamed:
    """An attribute of a class under its old name: `knot = renamed("solved_steps")`."""

    def __init__(self, new: str) -> None:
        self._new = new

    def __set_name__(self, owner: type, name: str) -> None:
        self._old = name

    def __get__(self, instance: Any, owner: type) -> Any:
        if instance is None:  # the class is asked, as by help()
            return self
        kind = type(instance).__name__
        warn_renamed(f"{kind}.{self._old}", f"{kind}.{self._new}")
        return getattr(instance, self._new)

    def __set__(self, instance: Any, value: Any) -> None:  # with it, help() lists an attribute, not a method
        raise AttributeError(f"{type(instance).__name__}.{self._old} is now {self._new}, and can only be read")


def renamed_keywords(call: str, given: dict[str, Any], new_names: Mapping[str, str]) -> None:
    """Give keywords of a call their new names.

    Args:
        call: name of the function, whose caller the warning shows.
        given: the keywords with their values; changed in place.
        new_names: new names by old name.
    """
    for old in new_names.keys() & given.keys():
        warn_renamed(f"{call}({old}=...)", f"{call}({new_names[old]}=...)", level=4)
        given[new_names[old]] = given.pop(old)
