"""The contacts of an object with a table."""

from __future__ import annotations

import numpy as np

from sim.mechanism.contact import Contact
from sim.mechanism.shapes import Solid

__all__ = ["on_table"]


def on_table(item: str, shape: Solid, table: float, rounded: float = 0.0) -> list[Contact]:
    """Contacts of an object that stands on its corners or on the balls at its ends.

    Args:
        item: name of the object.
        shape: its shape; the larger one of its friction and that of the table counts.
        table: friction of the table.
        rounded: radius of corners [m] (default 0).

    Returns:
        A contact per corner or ball.
    """
    friction, stance = max(table, float(shape.friction or 0.0)), shape.stance()
    assert stance is not None  # objects with balls and corners only
    feet = shape.place(stance.points - rounded * np.sign(stance.points))
    return [Contact(item, point, stance.radius + rounded, friction=friction) for point in feet]
