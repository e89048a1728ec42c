"""Contacts of a shape with the ground: the points and balls by which it stands, as it does on a half-space.

    sphere     itself          capsule    a ball at either end          box, polytope    its corners

On a plane these are all there is to touch. On curved ground the rest of the surface touches nothing: a hump between
two corners, or a ridge below an edge, goes into the shape. So it is for ground whose humps are wider than the shape.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.mechanism.parts import Body, Contact
from sim.mechanism.shapes import rotation_matrix


def shape_contacts(call: str, body: Body, **options: Any) -> list[Contact]:
    """Contacts of the shape of a body; options: of Contact.   ValueError: it has none, a cylinder or an ellipsoid."""
    shape = body.shape
    stance = None if shape is None else shape.stance()
    if shape is None or stance is None:
        found = "has no shape" if shape is None else f"has the shape {type(shape).__name__}"
        raise ValueError(f"{call}: body {body.name!r} {found}; expected a Sphere, Capsule, Box or Polytope")
    part, points, radius = stance
    places = points @ rotation_matrix(shape.orientation).T + np.asarray(shape.center)
    names = [f"{body.name}_{part}{k}" if len(places) > 1 else f"{body.name}_{part}" for k in range(len(places))]
    return [Contact(body.name, p, radius, name=name, **options) for p, name in zip(places, names, strict=True)]
