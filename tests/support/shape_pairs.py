"""Pairs of shapes for tests: their contact points, and random poses at a chosen distance."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from sim.model.shape_kinds import OUT, Pair, Shape, count
from support.collide import collide, collide_rows

Array = np.ndarray
NO_HULL = np.zeros((1, 4))
TABLES = {"POLYTOPE", "FIELD"}  # test_collision_table.py covers polytopes, test_signed_distance.py fields
SIMPLE = [p for p in Pair if p < Pair.POLYTOPE_POLYTOPE and not TABLES & set(p.name.split("_"))]
CORE = [p for p in SIMPLE if not {"CYLINDER", "HALFSPACE", "STRING", "ELLIPSOID"} & set(p.name.split("_"))]
NAMES = {p: p.name.lower() for p in Pair}


def touch(kind: Pair, feature: int, sizes: Array, R: Array, r: Array) -> Array:
    out = np.empty(OUT)
    collide(int(kind), feature, sizes, NO_HULL, np.ascontiguousarray(R).ravel(), np.ascontiguousarray(r), out)
    return out


def contacts_at(kind: int, feature: int, sizes: Array, Rs: Array, rs: Array) -> Array:
    """Distance, normal and point (n, 7) at poses (n, 3, 3), (n, 3); NaN where the feature has no contact."""
    out = collide_rows(int(kind), feature, sizes, NO_HULL, Rs.reshape(-1, 9), rs)[:, :7]
    out[out[:, 0] >= 1e8] = np.nan
    return out


def features(kind: Pair, sizes: Array, R: Array, r: Array) -> list[Array]:
    """Results of `collide` for the existing contact points."""
    outs = [touch(kind, f, sizes, R, r) for f in range(count(kind))]
    return [out for out in outs if out[0] < 1e8]


def deepest(kind: Pair, sizes: Array, R: Array, r: Array) -> Array:
    return min(features(kind, sizes, R, r), key=lambda out: out[0])


def shapes(kind: Pair) -> tuple[Shape, Shape]:
    first, *second = kind.name.split("_")
    return Shape[first], Shape[second[0] if second else first]


def random_pose(
    rng: np.random.Generator, kind: Pair, sizes: Array, depth: float, aligned: bool = False
) -> tuple[Array, Array]:
    """A random orientation (small if aligned), and a centre along a random direction where the distance is -depth."""
    R = Rotation.from_rotvec(0.2 * rng.normal(size=3)) if aligned else Rotation.random(random_state=rng)
    R = R.as_matrix()
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    if kind.name.endswith("HALFSPACE"):
        direction[2] = 0.0
        return R, direction + (-depth - deepest(kind, sizes, R, direction)[0]) * np.array([0.0, 0.0, 1.0])
    if kind == Pair.STRING:
        return R, direction * (sizes[0] + depth)
    low, high = 0.0, 3.0
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if deepest(kind, sizes, R, middle * direction)[0] > -depth else (middle, high)
    return R, high * direction
