"""Contacts of the shapes of a body with the ground: the points and balls that stand on a half-space.

    sphere     itself          capsule    a ball at either end          box, polytope    its corners

A plane touches nothing else. On curved ground the rest of the surface has no contacts: a hump between two corners, or
a ridge below an edge, penetrates the shape. So use it on ground whose humps are wider than the shape.
"""

from __future__ import annotations

from typing import Any

from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.shapes import SURFACE_FIELDS


def shape_contacts(call: str, body: Body, **options: Any) -> list[Contact]:
    """Contacts of all shapes of a body; options: of Contact, before those of the shapes.

    ValueError: it has no shape, or one that does not stand on points, a cylinder or an ellipsoid.
    """
    if not body.shapes:
        raise ValueError(f"{call}: body {body.name!r} has no shape; {_EXPECTED}")
    out = []
    for number, shape in enumerate(body.shapes):
        stance = shape.stance()
        if stance is None:
            raise ValueError(f"{call}: body {body.name!r} has the shape {type(shape).__name__}; {_EXPECTED}")
        label = body.name if len(body.shapes) == 1 else f"{body.name}.{shape.name or number}"
        own = {field: getattr(shape, field) for field in SURFACE_FIELDS}
        settings = {field: value for field, value in own.items() if value is not None} | options
        for k, point in enumerate(shape.place(stance.points)):
            name = f"{label}_{stance.part}{k}" if len(stance.points) > 1 else f"{label}_{stance.part}"
            out.append(Contact(body.name, point, stance.radius, name=name, **settings))
    return out


_EXPECTED = "expected a Sphere, Capsule, Box or Polytope"
