"""Every pair of shapes that can collide: distance, frame, derivatives against independent ones; near, touching, deep.

    python benchmarks/collision_pairs.py

distance    of the nearest points, against the largest separation of the two along any direction, found from their
            support functions alone: phi = max over n of (min n.x over a) - (max n.y over b), negative inside
frame       how far the two points that the contact names, p + phi/2 n and p - phi/2 n, are from the surfaces of a and b
derivative  of distance, normal and point of every contact point, against central differences
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

import dojo_opt as dojo
from sim.collision.axes import OPEN
from sim.collision.collide import arrange, choose, collide, collide_chosen
from sim.collision.kinds import OUT, SIZES, Pair, Shape, count, pair
from sim.collision.polytope import EDGES
from sim.polytope import hull_table

Array = np.ndarray
DEPTHS = {"near": -0.1, "touching": -1e-9, "deep": 0.05}  # [m]
POLYTOPES = ("sphere_polytope", "capsule_polytope", "box_polytope", "polytope_polytope")
PAIRS = [*(p.name.lower() for p in Pair if p != Pair.POLYTOPE_POLYTOPE), *POLYTOPES]
TRIALS = 6


def shapes(kind: Pair) -> tuple[Shape, Shape]:
    """Shapes a and b of a pair, in its order."""
    return next((a, b) for a in Shape for b in Shape if pair(a, b) == (kind, False))


class Case(NamedTuple):
    """Two shapes: sizes (8,) of both and tables of polytopes as `collide` takes them, corners of the polytopes."""

    kind: Pair
    sizes: Array
    hull: Array
    points: tuple[Array, Array]


def random_case(name: str, rng: np.random.Generator) -> Case:
    """A pair of shapes with random sizes."""
    if name not in POLYTOPES:
        none = np.zeros((0, 3))
        return Case(Pair[name.upper()], rng.uniform(0.15, 0.5, 2 * SIZES), np.zeros((1, 4)), (none, none))
    solids = []
    for word in name.split("_"):
        size = rng.uniform(0.2, 0.5, 3)
        ball = rng.normal(size=(12, 3))
        ball /= np.linalg.norm(ball, axis=1, keepdims=True)
        solids.append(
            {
                "sphere": dojo.Sphere(size[0]),
                "capsule": dojo.Capsule(0.5 * size[0], size[1]),
                "box": dojo.Box(*size),
                "polytope": dojo.Polytope.about_centroid(size * ball),
            }[word]
        )
    (a, ra), (b, rb) = (hull_table(solid) for solid in solids)
    sizes = np.array([0.0, ra, 0.0, 0.0, len(a), rb, 0.0, 0.0])
    points = (a[1 : 1 + int(a[0, 0]), :3], b[1 : 1 + int(b[0, 0]), :3])
    return Case(Pair.POLYTOPE_POLYTOPE, sizes, np.vstack([a, b]), points)


def features(case: Case) -> int:
    """How many contact points there may be."""
    if case.kind != Pair.POLYTOPE_POLYTOPE:
        return count(case.kind)
    return sum(len(p) for p in case.points) + (EDGES if len(case.points[0]) > 1 else 0)


def support(case: Case, side: int, n: Array) -> Array:
    """Largest n.x over the points x of shape a or b (side 0, 1) about its own origin, for directions n (m, 3)."""
    shape, sizes = shapes(case.kind)[side], case.sizes[SIZES * side :]
    if shape == Shape.POLYTOPE:
        return (n @ case.points[side].T).max(axis=1) + sizes[1]
    if shape == Shape.BOX:
        return np.abs(n) @ sizes[:3]
    if shape == Shape.CAPSULE:
        return sizes[0] + sizes[1] * np.abs(n[:, 2])
    if shape == Shape.CYLINDER:
        return sizes[0] * np.hypot(n[:, 0], n[:, 1]) + sizes[1] * np.abs(n[:, 2])
    return np.full(len(n), sizes[0] if shape == Shape.SPHERE else 0.0)


def widest(separation: Callable[[Array], Array], rng: np.random.Generator) -> float:
    """Largest value of a function of directions (m, 3): 4000 of them, then ever closer around the best."""
    n = rng.normal(size=(4000, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    n = np.vstack([n, np.eye(3), -np.eye(3)])
    value = separation(n)
    best = n[np.argsort(value)[-20:]]
    width = 0.1
    while width > 1e-9:
        n = np.repeat(best, 30, axis=0)
        n += width * rng.normal(size=n.shape)
        n = np.vstack([best, n / np.linalg.norm(n, axis=1, keepdims=True)])
        best = n[np.argsort(separation(n))[-10:]]
        width *= 0.7
    return float(separation(best).max())


def distance(case: Case, R: Array, r: Array, rng: np.random.Generator) -> float:
    """Signed distance of the shapes of a pair, from their support functions."""
    if case.kind == Pair.STRING:
        return float(case.sizes[0] - np.linalg.norm(r))
    if shapes(case.kind)[1] == Shape.HALFSPACE:
        return float(r[2] - support(case, 0, -R[2:3])[0])
    return widest(lambda n: n @ r - support(case, 0, -n @ R) - support(case, 1, n), rng)


def off_surface(case: Case, side: int, x: Array, rng: np.random.Generator) -> float:
    """Distance of a point from the surface of shape a or b about its own origin."""
    shape = shapes(case.kind)[side]
    if shape == Shape.HALFSPACE:
        return abs(float(x[2]))
    if shape == Shape.STRING:
        return 0.0
    return abs(widest(lambda n: n @ x - support(case, side, n), rng))


def contacts(case: Case, R: Array, r: Array) -> list[Array]:
    """What `collide` says of every contact point; NaN for those that do not exist."""
    outs = []
    for feature in range(features(case)):
        out = np.empty(OUT)
        pose = np.ascontiguousarray(R).ravel(), np.ascontiguousarray(r)
        collide(int(case.kind), feature, case.sizes, case.hull, *pose, out)
        outs.append(out if out[0] < 1e8 else np.full(OUT, np.nan))
    return outs


def nearest(case: Case, R: Array, r: Array) -> Array:
    """The contact point of least distance."""
    return min((out for out in contacts(case, R, r) if out[0] < 1e8), key=lambda out: out[0])


def turn(w: Array) -> Array:
    """Rotation by the vector w."""
    angle = np.linalg.norm(w)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = w / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def pose(case: Case, depth: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """A random pose of a in the frame of b at which the least distance is -depth."""
    R = turn(rng.normal(size=3) * rng.choice([0.2, 2.0]))
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    if case.kind == Pair.STRING:
        return R, direction * (case.sizes[0] + depth)
    if shapes(case.kind)[1] == Shape.HALFSPACE:
        direction[2] = 0.0
        return R, direction - (depth + nearest(case, R, direction)[0]) * np.array([0.0, 0.0, 1.0])
    low, high = 0.0, 3.0
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if nearest(case, R, middle * direction)[0] > -depth else (middle, high)
    return R, high * direction


def derivative_error(case: Case, R: Array, r: Array) -> float:
    """Largest error of d(phi, n, p)/d(twist of a), relative to the largest entry, over all contact points.

    Of the elements of the shapes that are in contact at this pose, which a step keeps while it is solved.
    """
    flat = np.ascontiguousarray(R).ravel()
    faces = arrange(int(case.kind), case.sizes, flat, r, OPEN)
    found = []
    for feature in range(features(case)):
        out = np.empty(OUT)
        code = choose(int(case.kind), feature, faces, case.sizes, case.hull, flat, r, out)
        if code != 0:
            found.append((feature, code, out))

    def moved(twist: Array) -> Array:
        T = turn(twist[3:])
        outs = np.empty((len(found), OUT))
        pose = (T @ R).ravel(), T @ r + twist[:3]
        for out, (feature, code, _) in zip(outs, found, strict=True):
            collide_chosen(int(case.kind), feature, code, case.sizes, case.hull, *pose, out)
        return outs[:, :7]

    worst = 0.0
    estimates = []
    for e in (1e-4, 1e-5):
        steps = e * np.eye(6)
        columns = [(8 * (moved(s) - moved(-s)) - (moved(2 * s) - moved(-2 * s))) / (12 * e) for s in steps]
        estimates.append(np.stack(columns, axis=-1))
    for (_, _, out), *expected in zip(found, *estimates, strict=True):
        n, p = out[1:4], out[4:7]
        J = np.vstack([np.append(n, np.cross(p, n)), out[7:].reshape(6, 6)])
        worst = max(worst, min(np.abs(J - D).max() / max(1.0, np.abs(D).max()) for D in expected))
    return worst


def check(name: str) -> dict[str, float]:
    """Largest errors of a pair over random sizes and poses: "distance near", "frame deep", "derivative touching", ...

    name: one of PAIRS. Distances and frames in metres, derivatives relative.
    """
    rng = np.random.default_rng(PAIRS.index(name))
    errors = {}
    for where, depth in DEPTHS.items():
        worst = np.zeros(3)
        for _ in range(TRIALS):
            case = random_case(name, rng)
            R, r = pose(case, depth, rng)
            out = nearest(case, R, r)
            phi, n, p = out[0], out[1:4], out[4:7]
            ends = [off_surface(case, 0, R.T @ (p + 0.5 * phi * n - r), rng)]
            ends.append(off_surface(case, 1, p - 0.5 * phi * n, rng))
            now = [abs(phi - distance(case, R, r, rng)), max(ends), derivative_error(case, R, r)]
            worst = np.maximum(worst, now)
        for what, value in zip(("distance", "frame", "derivative"), worst, strict=True):
            errors[f"{what} {where}"] = float(value)
    return errors


def main() -> None:
    """Print a row per pair."""
    columns = [f"{what} {where}" for what in ("distance", "frame", "derivative") for where in DEPTHS]
    print(f"{'':<20}" + "".join(f"{c.replace('derivative', 'deriv.'):>18}" for c in columns))
    for name in PAIRS:
        errors = check(name)
        print(f"{name:<20}" + "".join(f"{errors[c]:>18.0e}" for c in columns), flush=True)


if __name__ == "__main__":
    main()
