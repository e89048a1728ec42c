"""Two random shapes that can collide, and their distance found without the collision kernels.

From support functions alone: phi = max over directions n of (min n.x over a) - (max n.y over b), negative inside; a
point is as far from the surface of a shape as that says of a point and the shape.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sim.mechanism.polytope import Polytope, hull_table
from sim.mechanism.shapes import Box, Capsule, Cylinder, Ellipsoid, Sphere
from sim.model.shape_kinds import SIZES, Pair, Shape, count

Floats = NDArray[np.float64]

POLYTOPES = ("sphere_polytope", "capsule_polytope", "box_polytope", "polytope_polytope")
ON_CYLINDERS = ("capsule_cylinder", "box_cylinder", "polytope_cylinder")
ON_ELLIPSOIDS = ("sphere_ellipsoid", "capsule_ellipsoid", "box_ellipsoid", "polytope_ellipsoid")
ELLIPSOIDS = ("ellipsoid_halfspace", "ellipsoid_ellipsoid", "cylinder_ellipsoid", *ON_ELLIPSOIDS)
_OF_POLYTOPES = (Pair.POLYTOPE_POLYTOPE, Pair.POLYTOPE_CYLINDER)
_OWN_TESTS = (
    "ELLIPSOID",
    "FIELD",
)  # ellipsoids are below; those of level sets are in tests/sim/test_signed_distance.py
_SIMPLE = (p.name.lower() for p in Pair if p not in _OF_POLYTOPES and not any(shape in p.name for shape in _OWN_TESTS))
PAIRS = (*_SIMPLE, *POLYTOPES, *ON_CYLINDERS, *ELLIPSOIDS)


def shapes(kind: Pair) -> tuple[Shape, Shape]:
    """Shapes a and b of a pair, in its order."""
    first, *second = kind.name.split("_")
    return Shape[first], Shape[second[0] if second else first]


class PairCase(NamedTuple):
    """Two shapes: sizes (8,) of both and tables of polytopes as `collide` takes them, corners of the polytopes."""

    kind: Pair
    sizes: Floats
    hull: Floats
    points: tuple[Floats, Floats]


def random_case(name: str, rng: np.random.Generator) -> PairCase:
    """A pair of shapes with random sizes."""
    if name not in (*POLYTOPES, *ON_CYLINDERS, *ON_ELLIPSOIDS):
        none = np.zeros((0, 3))
        return PairCase(Pair[name.upper()], rng.uniform(0.15, 0.5, 2 * SIZES), np.zeros((1, 4)), (none, none))
    solids = []
    for word in name.split("_"):
        size = rng.uniform(0.2, 0.5, 3)
        ball = rng.normal(size=(12, 3))
        ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        solids.append(
            {
                "sphere": Sphere(size[0]),
                "capsule": Capsule(0.5 * size[0], size[1]),
                "box": Box(*size),
                "polytope": Polytope.about_centroid(size * ball),
                "cylinder": Cylinder(size[0], 2.0 * size[1]),
                "ellipsoid": Ellipsoid(*size),
            }[word]
        )
    if isinstance(solids[1], Cylinder | Ellipsoid):
        table, radius = hull_table(solids[0])
        sizes = np.zeros(8)
        sizes[1], sizes[4 : 4 + len(solids[1].sizes())] = radius, solids[1].sizes()
        kind = Pair.POLYTOPE_CYLINDER if isinstance(solids[1], Cylinder) else Pair.POLYTOPE_ELLIPSOID
        return PairCase(kind, sizes, table, (table[1 : 1 + int(table[0, 0]), :3], np.zeros((0, 3))))
    (a, ra), (b, rb) = (hull_table(solid) for solid in solids)
    sizes = np.array([0.0, ra, 0.0, 0.0, len(a), rb, 0.0, 0.0])
    points = (a[1 : 1 + int(a[0, 0]), :3], b[1 : 1 + int(b[0, 0]), :3])
    return PairCase(Pair.POLYTOPE_POLYTOPE, sizes, np.vstack([a, b]), points)


def features(case: PairCase) -> int:
    """How many contact points there may be."""
    return count(case.kind, (len(case.points[0]), len(case.points[1])))


def support(case: PairCase, side: int, n: Floats) -> Floats:
    """Largest n.x over the points x of shape a or b (side 0, 1) about its own origin, for directions n (m, 3)."""
    shape, sizes = shapes(case.kind)[side], case.sizes[SIZES * side :]
    if shape == Shape.POLYTOPE:
        return (n @ case.points[side].T).max(axis=1) + sizes[1]
    if shape == Shape.BOX:
        return np.abs(n) @ sizes[:3]
    if shape == Shape.ELLIPSOID:
        return np.linalg.norm(n * sizes[:3], axis=1)
    if shape == Shape.CAPSULE:
        return sizes[0] + sizes[1] * np.abs(n[:, 2])
    if shape == Shape.CYLINDER:
        return sizes[0] * np.hypot(n[:, 0], n[:, 1]) + sizes[1] * np.abs(n[:, 2])
    return np.full(len(n), sizes[0] if shape == Shape.SPHERE else 0.0)


def widest(separation: Callable[[Floats], Floats], rng: np.random.Generator) -> float:
    """Largest value of a function of directions (m, 3): 4000 of them, then ever closer around the best.

    Around many while maxima may still be apart. Down to steps of 1e-6: the value is then within 3e-7 m at edges, too.
    """
    n = rng.normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    best, width = _best(np.vstack([n, np.eye(3), -np.eye(3)]), separation, 60), 0.05
    while width > 1e-6:
        n = np.repeat(best, 15, axis=0)
        n += width * rng.normal(size=n.shape)
        n /= np.sqrt((n * n).sum(axis=1, keepdims=True))
        best = _best(np.concatenate([best, n]), separation, 60 if width > 0.02 else 10)
        width *= 0.7
    return float(separation(best).max())


def _best(n: Floats, separation: Callable[[Floats], Floats], count: int) -> Floats:
    """The directions with the largest values."""
    return n[np.argpartition(separation(n), -count)[-count:]]


def distance(case: PairCase, R: Floats, r: Floats, rng: np.random.Generator) -> float:
    """Signed distance of the shapes of a pair, from their support functions."""
    if case.kind == Pair.STRING:
        return float(case.sizes[0] - np.linalg.norm(r))
    if shapes(case.kind)[1] == Shape.HALFSPACE:
        return float(r[2] - support(case, 0, -R[2:3])[0])
    return widest(lambda n: n @ r - support(case, 0, -n @ R) - support(case, 1, n), rng)


def off_surface(case: PairCase, side: int, x: Floats, rng: np.random.Generator) -> float:
    """Distance of a point from the surface of shape a or b about its own origin."""
    shape = shapes(case.kind)[side]
    if shape == Shape.HALFSPACE:
        return abs(float(x[2]))
    if shape == Shape.STRING:
        return 0.0
    return abs(widest(lambda n: n @ x - support(case, side, n), rng))
