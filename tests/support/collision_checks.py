"""Errors of a pair of shapes: near (0.1 m apart), touching and deep (0.05 m inside).

distance    of the nearest points, against the largest separation of the two along any direction [m]
frame       how far the points that the contact names, p + phi/2 n and p - phi/2 n, are from the surfaces of a and b [m]
derivative  of distance, normal and point of every contact point, against central differences; relative

Of six pairs of random sizes and poses each; the point of a cylinder's rim that is nearest to a face is rounded, by 1e-4
of its radius.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sim.contact.collision.cylinder_contacts import choose_on_cylinder, collide_with_cylinder
from sim.contact.collision.edge_axes import OPEN
from sim.model.shape_kinds import OUT, Pair, Shape
from support.collide import arrange, choose, collide_chosen
from support.solids import PAIRS, PairCase, distance, features, off_surface, random_case, shapes

Floats = NDArray[np.float64]

DEPTHS = {"near": -0.1, "touching": -1e-9, "deep": 0.05}  # [m]
BARS = {"distance": 1e-5, "frame": 1e-5, "derivative": 1e-6}
CYLINDERS = (Pair.POLYTOPE_CYLINDER, Pair.CYLINDER_CYLINDER)
ROUNDED = dict.fromkeys(  # bars of distance and frame [m]
    ("cylinder_halfspace", "box_cylinder", "polytope_cylinder", "cylinder_cylinder"), 1e-4
)
TRIALS = 6


def bar(name: str, measure: str) -> float:
    """The bar of a measure of a pair ("distance near", ...)."""
    what = measure.partition(" ")[0]
    return BARS[what] if what == "derivative" else ROUNDED.get(name, BARS[what])


def chosen(case: PairCase, R: Floats, r: Floats) -> list[tuple[int, int]]:
    """The existing contact points at a pose, each with its elements of the shapes."""
    pose = np.ascontiguousarray(R).ravel(), np.ascontiguousarray(r)
    number, out = features(case), np.empty(OUT)
    if case.kind in CYLINDERS:
        codes = np.zeros(number, dtype=np.int64)
        choose_on_cylinder(int(case.kind), case.sizes, case.hull, pose, np.empty(12), codes, 0, out)
        return [(feature, int(code)) for feature, code in enumerate(codes) if code != 0]
    faces = arrange(int(case.kind), case.sizes, case.hull, *pose, OPEN)
    found = [choose(int(case.kind), k, faces, case.sizes, case.hull, *pose, out) for k in range(number)]
    return [(feature, int(code)) for feature, code in enumerate(found) if code != 0]


def contact(case: PairCase, feature: int, code: int, R: Floats, r: Floats) -> Floats:
    """The kernels' data of a contact point of these elements, (43,)."""
    pose = np.ascontiguousarray(R).ravel(), np.ascontiguousarray(r)
    out = np.empty(OUT)
    if case.kind in CYLINDERS:
        collide_with_cylinder(int(case.kind), feature, code, case.sizes, case.hull, pose, np.empty(12), out)
    else:
        collide_chosen(int(case.kind), feature, code, case.sizes, case.hull, *pose, out)
    return out


def nearest(case: PairCase, R: Floats, r: Floats) -> Floats:
    """The contact point of least distance."""
    outs = (contact(case, feature, code, R, r) for feature, code in chosen(case, R, r))
    return min(outs, key=lambda out: float(out[0]))


def turn(w: Floats) -> Floats:
    """Rotation by the vector w."""
    angle = np.linalg.norm(w)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = w / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + np.sin(angle) * K + (1.0 - np.cos(angle)) * K @ K


def pose(case: PairCase, depth: float, rng: np.random.Generator) -> tuple[Floats, Floats]:
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


def derivative_error(case: PairCase, R: Floats, r: Floats) -> float:
    """Largest error of d(phi, n, p)/d(twist of a), relative to the largest entry, over all contact points.

    Of the elements of the shapes that are in contact at this pose, which a step keeps while it is solved.
    """
    found = [(feature, code, contact(case, feature, code, R, r)) for feature, code in chosen(case, R, r)]

    def moved(twist: Floats) -> Floats:
        T = turn(twist[3:])
        pose = T @ R, T @ r + twist[:3]
        return np.stack([contact(case, feature, code, *pose)[:7] for feature, code, _ in found])

    worst = 0.0
    estimates = []
    for e in (1e-4, 1e-5):
        steps = e * np.eye(6)
        columns = [(8 * (moved(s) - moved(-s)) - (moved(2 * s) - moved(-2 * s))) / (12 * e) for s in steps]
        estimates.append(np.stack(columns, axis=-1))
    for (_, _, out), *expected in zip(found, *estimates, strict=True):
        n, p = out[1:4], out[4:7]
        J = np.vstack([np.append(n, np.cross(p, n)), out[7:].reshape(6, 6)])
        worst = np.maximum(worst, min(np.abs(J - D).max() / max(1.0, np.abs(D).max()) for D in expected))
    return float(worst)


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
