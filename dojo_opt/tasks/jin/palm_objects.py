"""PalmObject: what the Allegro hand turns: its body, a shape of its size, and where it starts and has to go."""

from __future__ import annotations

from math import cos, sin
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.tasks.jin.coarse_hull import coarse_hull
from dojo_opt.tasks.jin.fitted_ellipsoid import fitted_ellipsoid
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import Box, Capsule, Cylinder, Ellipsoid, Solid

__all__ = ["OBJECTS", "PalmObject"]

_ALONG_X = (0.5**0.5, 0.0, 0.5**0.5, 0.0)  # turns the axis of a capsule
_TUBE, _RING, _CORNERS = 0.015, 0.0305, 12  # of a torus: radius of its tube and of its middle [m]; points of a circle


class PalmObject(NamedTuple):
    """An object of the publication, in the frame of its mesh.

    Attributes:
        center: x and y of its starts in the mean [m].
        height: z of its starts [m].
        goal: (3,) where it has to go [m].
        shape: a shape of its size, from its centre of mass.
        mass: mass [kg].
        com: (3,) centre of mass [m].
        inertia: moments xx yy zz, and xy xz yz where they count, about it [kg m^2]; empty for those of the shape.
        friction: its coefficient of friction.
        simple: its shape in plans, from its centre of mass; None for the same shape.
        right_first: whether the turn to the right is the first of the two that trials choose from.
        corners: number of corners of its hull that plans see on the palm, instead of the simple shape: an object with
            flat sides lies still where an ellipsoid would roll; 0 for none.
        below: its shape on the palm in plans, from its centre of mass; None for that which the fingers see.
    """

    center: tuple[float, float]
    height: float
    goal: tuple[float, float, float]
    shape: Solid
    mass: float = 0.01
    com: tuple[float, float, float] = (0.0, 0.0, 0.0)
    inertia: tuple[float, ...] = ()
    friction: float = 0.5
    simple: Solid | None = None
    right_first: bool = False
    corners: int = 0
    below: Solid | None = None

    def body(self, name: str) -> Body:
        """The object as a body.

        Args:
            name: its name.

        Returns:
            The body.
        """
        if not self.inertia:
            return Body(name, self.mass, shape=self.shape)
        xx, yy, zz, xy, xz, yz = (*self.inertia, 0.0, 0.0, 0.0)[:6]
        return Body(name, self.mass, np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), shape=self.shape)

    def hulled(self, points: ArrayLike) -> PalmObject:
        """The same object with the convex hull of points as its shape.

        Plans see the ellipsoid that is nearest to it, if they see an ellipsoid of this object, and else its own shape.
        On the palm they see a hull of few corners, if this object has a number of them.

        Args:
            points: (n, 3) points in the frame of the mesh [m].

        Returns:
            The object.

        Raises:
            ValueError: for points that span no volume.
        """
        rows = checks.array("tasks.jin.allegro(hull=...)", points, (None, 3)) - np.asarray(self.com)
        shape = Polytope(rows)
        below = Polytope(coarse_hull(shape.vertices, self.corners)) if self.corners else None
        simple = self.shape if self.simple is None else fitted_ellipsoid(rows)
        return self._replace(shape=shape, simple=simple, below=below)


def _ring_hull() -> Polytope:
    """The convex hull of a torus about z, by five circles of points on it."""
    around = 2.0 * np.pi / _CORNERS * np.arange(_CORNERS)
    circles = []
    for angle in 0.25 * np.pi * np.arange(-2, 3):
        r, z = _RING + _TUBE * cos(angle), _TUBE * sin(angle)
        circles.append(np.stack([r * np.cos(around), r * np.sin(around), np.full(_CORNERS, z)], axis=1))
    return Polytope(np.concatenate(circles))


def _lump(
    size: tuple[float, float, float], center: tuple[float, float, float], kind: type[Solid] = Box
) -> dict[str, Any]:
    """Shapes of an object of this size around this centre: a box or an upright cylinder, and an ellipsoid in plans.

    Each part of the hand touches an ellipsoid in one point. The flat end of a disc has up to 25 contacts with the palm,
    most of which say the same: plans were rejected there, and discs were not turned.
    """
    x, y, z = size
    simple = Ellipsoid(0.5 * x, 0.5 * y, 0.5 * z, center=center)
    return {
        "shape": Box(x, y, z, center=center) if kind is Box else Cylinder(0.5 * x, z, center=center),
        "simple": simple,
    }


OBJECTS = {
    "cube": PalmObject((-0.03, -0.01), 0.04, (-0.01, 0.0, 0.05), Box(0.05, 0.05, 0.05), 0.1, right_first=True),
    "can": PalmObject((-0.02, 0.0), 0.04, (-0.01, 0.0, 0.06), Cylinder(0.0325, 0.065)),
    "foam brick": PalmObject((-0.01, 0.0), 0.04, (-0.01, 0.0, 0.04), Box(0.0516, 0.0753, 0.0466)),
    "stick": PalmObject(
        (-0.01, 0.0),
        0.03,
        (-0.01, 0.0, 0.03),
        Capsule(0.015, 0.1, orientation=_ALONG_X),
        0.1,
        right_first=True,
    ),
    "torus": PalmObject(
        (-0.02, 0.0), 0.04, (0.0, 0.0, 0.04), _ring_hull(), simple=Ellipsoid(_RING + _TUBE, _RING + _TUBE, _TUBE)
    ),
    "bowl": PalmObject(
        (-0.03, 0.0),
        0.04,
        (-0.03, -0.01, 0.04),
        **_lump((0.088, 0.088, 0.0455), (0.0, 0.0, -0.0034), Cylinder),
        com=(0.0, 0.0, 0.003235),
        inertia=(4.928e-6, 4.928e-6, 7.872e-6),
        corners=12,
    ),
    "airplane": PalmObject(
        (-0.03, -0.01),
        0.03,
        (-0.02, -0.01, 0.03),
        **_lump((0.0905, 0.117, 0.0328), (0.0016, 0.0003, 0.0046)),
        com=(0.006181, 7.2e-05, -0.000566),
        inertia=(2.803e-6, 4.763e-6, 7.179e-6, -2.1e-8, 9.03e-8, 0.0),
    ),
    "binoculars": PalmObject(
        (-0.03, 0.0),
        0.04,
        (-0.01, 0.0, 0.04),
        **_lump((0.0845, 0.0285, 0.065), (0.0, -0.0017, 0.0025)),
        com=(-0.00066, -0.000483, -0.002887),
        inertia=(2.902e-6, 7.966e-6, 5.822e-6, 0.0, 0.0, -5.53e-8),
        friction=0.9,
        corners=12,
    ),
    "cup": PalmObject(
        (-0.03, 0.0),
        0.03,
        (0.0, 0.0, 0.03),
        Cylinder(0.0325, 0.0768, center=(0.0, 0.0, 0.0011)),
        com=(0.0, 0.0, 0.030316),
        inertia=(5.758e-6, 5.758e-6, 4.276e-6),
        right_first=True,
    ),
    "mug": PalmObject(
        (0.0, 0.0),
        0.04,
        (0.0, 0.0, 0.04),
        **_lump((0.0734, 0.052, 0.0662), (0.0091, 0.0, 0.0027)),
        com=(-0.005149, -3.1e-05, -0.003),
        inertia=(4.23e-6, 4.755e-6, 3.719e-6, 0.0, -3.73e-8, 0.0),
    ),
    "piggy bank": PalmObject(
        (0.0, 0.0),
        0.04,
        (0.0, 0.0, 0.04),
        **_lump((0.1009, 0.065, 0.0732), (0.0015, 0.0, 0.0008)),
        com=(-0.01068, 3e-05, 0.002015),
        inertia=(4.649e-6, 7.876e-6, 7.61e-6, 9e-9, -1.979e-7, 0.0),
    ),
    "rubber duck": PalmObject(
        (-0.02, 0.0),
        0.05,
        (0.0, 0.0, 0.05),
        **_lump((0.0887, 0.065, 0.0933), (-0.0039, 0.0, 0.0134)),
        com=(-0.008837, 0.0, -0.015165),
        inertia=(7.02e-6, 9.19e-6, 5.678e-6, 0.0, -8.674e-7, 0.0),
    ),
    "teapot": PalmObject(
        (-0.02, 0.0),
        0.05,
        (0.0, 0.0, 0.05),
        **_lump((0.104, 0.0643, 0.0495), (0.0034, 0.0, 0.0044)),
        com=(-0.000466, 0.0, -0.006764),
        inertia=(2.94e-6, 4.034e-6, 4.822e-6, 0.0, 9.8e-9, 0.0),
    ),
    "water bottle": PalmObject(
        (-0.02, 0.0),
        0.06,
        (0.0, 0.0, 0.06),
        **_lump((0.046, 0.046, 0.104), (0.0, 0.0, 0.0053), Cylinder),
        com=(5.1e-05, -2.6e-05, -0.005236),
        inertia=(7.87e-6, 7.87e-6, 2.354e-6),
    ),
    "elephant": PalmObject(
        (-0.02, 0.0),
        0.04,
        (-0.01, 0.0, 0.04),
        **_lump((0.0923, 0.052, 0.068), (-0.0016, 0.0, -0.0022)),
        com=(0.006636, 0.0, 0.008348),
        inertia=(3.84e-6, 7.274e-6, 5.669e-6, 0.0, 5.809e-7, 0.0),
        right_first=True,
    ),
    "camera": PalmObject(
        (-0.03, 0.0),
        0.04,
        (-0.01, 0.0, 0.04),
        **_lump((0.091, 0.037, 0.0532), (-0.0025, -0.0045, 0.0007)),
        com=(0.003847, -0.001939, -0.004501),
        inertia=(2.694e-6, 8.189e-6, 6.85e-6, 2.342e-7, 2.43e-8, 0.0),
    ),
}
