"""`few_positional`: parts of a mechanism whose later arguments have names only, with an error that says which."""

from __future__ import annotations

from dataclasses import Field, fields
from functools import wraps
from typing import Any, TypeVar

T = TypeVar("T", bound=type[Any])


def few_positional(part: T) -> T:
    """The dataclass, whose TypeError for too many positional arguments names those, and the others.

    A row of numbers reads as well in a wrong order as in the right one, so only the first fields of a part, which no
    one takes for one another, are positional.
    """
    made = part.__init__
    every: list[Field[Any]] = [field for field in fields(part) if field.init]
    first = [field.name for field in every if not field.kw_only]

    @wraps(made)
    def __init__(self: Any, *args: Any, **kwargs: Any) -> None:
        if len(args) > len(first):
            others = ", ".join(f"{field.name}=..." for field in every if field.kw_only)
            raise TypeError(
                f"{part.__name__}({', '.join(first)}): expected at most {len(first)} arguments without a name, got "
                f"{len(args)}; the others have names: {others}"
            )
        made(self, *args, **kwargs)

    part.__init__ = __init__
    return part
