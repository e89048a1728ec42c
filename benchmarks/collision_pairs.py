"""Every pair of shapes that can collide: distance, frame, derivatives against independent ones; near, touching, deep.

    python benchmarks/collision_pairs.py

distance    of the nearest points, against the largest separation of the two along any direction, found from their
            support functions alone: phi = max over n of (min n.x over a) - (max n.y over b), negative inside
frame       how far the two points that the contact names, p + phi/2 n and p - phi/2 n, are from the surfaces of a and b
derivative  of distance, normal and point of every contact point, against central differences
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from sim.collision.collide import collide
from sim.collision.kinds import OUT, SIZES, SWAPPED, Pair, Shape, count, pair

Array = np.ndarray
DEPTHS = {"near": -0.1, "touching": -1e-9, "deep": 0.05}  # [m]
PAIRS = [p.name.lower() for p in Pair]
TRIALS = 6


def shapes(kind: Pair) -> tuple[Shape, Shape]:
    """Shapes a and b of a pair, in its order."""
    return next((a, b) for a in Shape for b in Shape if pair(a, b) == (kind, False))


def support(shape: Shape, sizes: Array, n: Array) -> Array:
    """Largest n.x over the points x of a shape about its own origin, for directions n (m, 3)."""
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


def distance(kind: Pair, sizes: Array, R: Array, r: Array, rng: np.random.Generator) -> float:
    """Signed distance of the shapes of a pair, from their support functions."""
    a, b = shapes(kind)
    if kind == Pair.STRING:
        return float(sizes[0] - np.linalg.norm(r))
    if b == Shape.HALFSPACE:
        return float(r[2] - support(a, sizes[:SIZES], -R[2:3])[0])
    return widest(lambda n: n @ r - support(a, sizes[:SIZES], -n @ R) - support(b, sizes[SIZES:], n), rng)


def off_surface(shape: Shape, sizes: Array, x: Array, rng: np.random.Generator) -> float:
    """Distance of a point from the surface of a shape about its own origin."""
    if shape == Shape.HALFSPACE:
        return abs(float(x[2]))
    if shape == Shape.STRING:
        return 0.0
    return abs(widest(lambda n: n @ x - support(shape, sizes, n), rng))


def contacts(kind: int, sizes: Array, R: Array, r: Array) -> list[Array]:
    """What `collide` says of every contact point; NaN for those that do not exist."""
    outs = []
    for feature in range(count(Pair(kind % SWAPPED))):
        out = np.empty(OUT)
        collide(kind, feature, sizes, np.ascontiguousarray(R).ravel(), np.ascontiguousarray(r), out)
        outs.append(out if out[0] < 1e8 else np.full(OUT, np.nan))
    return outs


def nearest(kind: Pair, sizes: Array, R: Array, r: Array) -> Array:
    """The contact point of least distance."""
    return min((out for out in contacts(kind, sizes, R, r) if out[0] < 1e8), key=lambda out: out[0])


def turn(w: Array) -> Array:
    """Rotation by the vector w."""
    angle = np.linalg.norm(w)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = w / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def pose(kind: Pair, sizes: Array, depth: float, rng: np.random.Generator) -> tuple[Array, Array]:
    """A random pose of a in the frame of b at which the least distance is -depth."""
    R = turn(rng.normal(size=3) * rng.choice([0.2, 2.0]))
    direction = rng.normal(size=3)
    direction /= np.linalg.norm(direction)
    if kind == Pair.STRING:
        return R, direction * (sizes[0] + depth)
    if kind.name.endswith("HALFSPACE"):
        direction[2] = 0.0
        return R, direction - (depth + nearest(kind, sizes, R, direction)[0]) * np.array([0.0, 0.0, 1.0])
    low, high = 0.0, 3.0
    while high - low > 1e-13:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if nearest(kind, sizes, R, middle * direction)[0] > -depth else (middle, high)
    return R, high * direction


def derivative_error(kind: Pair, sizes: Array, R: Array, r: Array) -> float:
    """Largest error of d(phi, n, p)/d(twist of a), relative to the largest entry, over all contact points."""

    def moved(twist: Array) -> Array:
        T = turn(twist[3:])
        return np.array(contacts(kind, sizes, T @ R, T @ r + twist[:3]))[:, :7]

    worst = 0.0
    estimates = []
    for e in (1e-4, 1e-5):
        steps = e * np.eye(6)
        columns = [(8 * (moved(s) - moved(-s)) - (moved(2 * s) - moved(-2 * s))) / (12 * e) for s in steps]
        estimates.append(np.stack(columns, axis=-1))
    for out, *expected in zip(contacts(kind, sizes, R, r), *estimates, strict=True):
        if np.isnan(out[0]) or np.isnan(expected).any():
            continue
        n, p = out[1:4], out[4:7]
        J = np.vstack([np.append(n, np.cross(p, n)), out[7:].reshape(6, 6)])
        worst = max(worst, min(np.abs(J - D).max() / max(1.0, np.abs(D).max()) for D in expected))
    return worst


def check(name: str) -> dict[str, float]:
    """Largest errors of a pair over random sizes and poses: "distance near", "frame deep", "derivative touching", ...

    name: one of PAIRS. Distances and frames in metres, derivatives relative.
    """
    kind = Pair[name.upper()]
    rng = np.random.default_rng(int(kind))
    a, b = shapes(kind)
    errors = {}
    for where, depth in DEPTHS.items():
        worst = np.zeros(3)
        for _ in range(TRIALS):
            sizes = rng.uniform(0.15, 0.5, 2 * SIZES)
            R, r = pose(kind, sizes, depth, rng)
            out = nearest(kind, sizes, R, r)
            phi, n, p = out[0], out[1:4], out[4:7]
            ends = [off_surface(a, sizes[:SIZES], R.T @ (p + 0.5 * phi * n - r), rng)]
            ends.append(off_surface(b, sizes[SIZES:], p - 0.5 * phi * n, rng))
            now = [abs(phi - distance(kind, sizes, R, r, rng)), max(ends), derivative_error(kind, sizes, R, r)]
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
