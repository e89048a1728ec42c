"""Collisions of a mechanism with itself: all pairs of shapes, except neighbours and initial overlaps."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import combinations, product

import numpy as np

from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.joint import WORLD, Joint
from sim.mechanism.pose import HERE, Pose
from sim.mechanism.shapes import HalfSpace, Solid, String
from solvers.types import Floats

__all__ = ["self_collisions", "separation"]

_ONE = 1e3  # weight of the convexity constraint against distances in units of the shapes
_REACH = 0.01  # times the extent of a robot: the gap below which its links act on one another
_TOUCHING = 1e-5  # of the size of two shapes: nearer ones overlap


def self_collisions(
    bodies: Sequence[Body], joints: Sequence[Joint], loops: Sequence[Joint], q: Floats, world: Sequence[Solid] = ()
) -> tuple[list[Collision], list[str]]:
    """Collisions of all pairs of shapes, but those of links that a joint connects, and those that overlap.

    Links without mass between two others, and fixed joints, those that close loops included, do not part neighbours.

    Args:
        bodies: the bodies.
        joints: the joints of the tree, parents first.
        loops: the joints that close loops.
        q: (nq,) coordinates at which shapes may not overlap.
        world: shapes of parts that are fixed to the world, world axes (default: none).

    Returns:
        (the collisions, the names of the pairs that overlap).
    """
    at, near = body_poses(joints, q), _neighbors(bodies, joints, loops)
    reach = _REACH * _extent(bodies, at)
    found, overlapping = [], []
    for a, b in combinations([body for body in bodies if body.shapes], 2):
        if frozenset((a.name, b.name)) in near:
            continue
        for (one, label_a), (other, label_b) in product(_labeled(a), _labeled(b)):
            name = f"{label_a}-{label_b}"
            if separation(at[a.name], one, at[b.name], other) > 0.0:
                shapes = (None if len(a.shapes) == 1 else one), (None if len(b.shapes) == 1 else other)
                found.append(Collision(a.name, b.name, *shapes, name=name, reach=reach))
            else:
                overlapping.append(name)
    for body in (body for body in bodies if body.shapes and frozenset((body.name, WORLD)) not in near):
        for (one, label), (number, part) in product(_labeled(body), enumerate(world)):
            name = f"{part.name or f'{WORLD}.{number}'}-{label}"
            if separation(at[body.name], one, HERE, part) > 0.0:
                own = None if len(body.shapes) == 1 else one
                found.append(Collision(body.name, None, own, part, name=name, reach=reach))
            else:
                overlapping.append(name)
    return found, overlapping


def _extent(bodies: Sequence[Body], at: Mapping[str, Pose]) -> float:
    """Largest side of the box around the shapes of all bodies [m]."""
    ends = [_points(at[body.name], shape) for body in bodies for shape, _ in _labeled(body)]
    if not ends:
        return 1.0
    low = np.min([points.min(axis=0) - radius for points, radius in ends], axis=0)
    high = np.max([points.max(axis=0) + radius for points, radius in ends], axis=0)
    return float((high - low).max())


def _labeled(body: Body) -> Iterator[tuple[Solid, str]]:
    """The shapes with an end, with their names as in contacts."""
    for number, shape in enumerate(body.shapes):
        if not isinstance(shape, HalfSpace | String):
            yield shape, body.name if len(body.shapes) == 1 else f"{body.name}.{shape.name or number}"


def _neighbors(bodies: Sequence[Body], joints: Sequence[Joint], loops: Sequence[Joint]) -> set[frozenset[str]]:
    """Pairs of bodies, or of a body and the world, that a joint connects, or that are one."""
    solid = {body.name: body.mass > 0.0 for body in bodies}
    parent = {joint.child: joint for joint in joints}
    home = {WORLD: WORLD}  # the first body that a body is fixed to
    for joint in joints:
        fixed = joint.nv == 0 and joint.parent != WORLD
        home[joint.child] = home[joint.parent or ""] if fixed else joint.child
    for weld in loops:  # as of the share of a body that carries a damper or a motor of a closing joint (loop_joints.py)
        if weld.nv == 0 and weld.parent != WORLD:
            one, other = home[weld.parent or ""], home[weld.child]
            home = {name: one if whole == other else whole for name, whole in home.items()}

    def above(name: str) -> str:
        """The next body with mass from here on."""
        while name != WORLD and not solid[name]:
            name = parent[name].parent or WORLD
        return name if name == WORLD else home[name]

    near = {frozenset((home[joint.child], above(joint.parent or WORLD))) for joint in (*joints, *loops)}
    names = list(home)
    return {
        frozenset((a, b))
        for a, b in combinations(names, 2)
        if home[a] == home[b] or frozenset((home[a], home[b])) in near
    }


def separation(at_a: Pose, a: Solid, at_b: Pose, b: Solid) -> float:
    """Distance of two shapes [m], less a hundred thousandth of their size; below zero where they overlap.

    Args:
        at_a: pose of the first body.
        a: its shape.
        at_b: pose of the second body.
        b: its shape.

    Returns:
        The distance, not the depth of an overlap.

    Raises:
        NotImplementedError: a shape has no outline.
    """
    (first, ra), (second, rb) = _points(at_a, a), _points(at_b, b)
    middle = first.mean(axis=0) - second.mean(axis=0)
    size = sum(float(np.linalg.norm(p - p.mean(axis=0), axis=1).max()) for p in (first, second))
    slack = _TOUCHING * (size + ra + rb)
    apart = float(np.linalg.norm(middle)) - size
    return (apart if apart > ra + rb else _distance(first, second)) - ra - rb - slack


def _points(at: Pose, shape: Solid) -> tuple[Floats, float]:
    """Points in the world whose hull, with a ball of a radius around it, is the shape."""
    stance = shape.stance()
    points, radius = (shape.outline(), 0.0) if stance is None else (stance.points, stance.radius)
    return np.array([at.at(point) for point in shape.place(points)]), radius


def _distance(first: Floats, second: Floats) -> float:
    """Distance of the convex hulls of points (n, 3) and (m, 3) [m]."""
    from scipy.optimize import nnls  # .3 s, which only robots that collide with themselves need

    count, unit = len(first), float(np.abs(first - second[0]).max()) or 1.0
    rows = np.zeros((5, count + len(second)))
    rows[:3, :count], rows[:3, count:] = (first - second[0]).T / unit, -(second - second[0]).T / unit
    rows[3, :count] = rows[4, count:] = _ONE
    weights, _ = nnls(rows, np.array([0.0, 0.0, 0.0, _ONE, _ONE]))
    return float(np.linalg.norm(rows[:3] @ weights)) * unit
