"""Contacts of a shape with the ground: the points and balls by which it stands, as it does on a half-space.

    sphere     itself          capsule    a ball at either end          box, polytope    its corners

On a plane these are all there is to touch. On curved ground the rest of the surface touches nothing: a hump between
two corners, or a ridge below an edge, goes into the shape. So it is for ground whose humps are wider than the shape.
"""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np

from sim.mechanism.parts import Body, Contact
from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import Box, Capsule, Sphere, rotation_matrix


def shape_contacts(call: str, body: Body, **options: Any) -> list[Contact]:
    """Contacts of the shape of a body; options: of Contact.   ValueError: it has none, or a cylinder."""
    shape = body.shape
    if isinstance(shape, Sphere):
        part, points, radius = "ball", np.zeros((1, 3)), shape.radius
    elif isinstance(shape, Capsule):
        part, points, radius = "end", np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]]) * shape.length, shape.radius
    elif isinstance(shape, Box):
        part, radius = "corner", 0.0
        points = 0.5 * np.array([shape.x, shape.y, shape.z]) * np.array(list(product((-1.0, 1.0), repeat=3)))
    elif isinstance(shape, Polytope):
        part, points, radius = "corner", np.asarray(shape.vertices), 0.0
    else:
        found = "has no shape" if shape is None else f"is a {type(shape).__name__}"
        raise ValueError(f"{call}: body {body.name!r} {found}; expected a Sphere, Capsule, Box or Polytope")
    places = points @ rotation_matrix(shape.orientation).T + np.asarray(shape.center)
    names = [f"{body.name}_{part}{k}" if len(places) > 1 else f"{body.name}_{part}" for k in range(len(places))]
    return [Contact(body.name, p, radius, name=name, **options) for p, name in zip(places, names, strict=True)]
