"""Clusters of contacts: those on one body against one direction, and the ball around them (inactive.py)."""

from __future__ import annotations

import numpy as np

from sim.mechanism.shapes import cross_matrix
from sim.model.model import Law, Model
from solvers.types import Floats

_LINEAR = int(Law.LINEAR)

MANY = 8  # contacts of a cluster, as of a box: more are a mesh
STIFFNESS = 1000.0  # largest e (inactive.py) of an omitted contact, in units of the tolerance


def pack_clusters(model: Model) -> None:
    """Contacts that follow one another on one body, against one direction: the ball around them (inactive.py)."""
    count = len(model.contact_height)
    level = model.contact_terrain == 0
    joined = (np.diff(model.contact_body[:count]) == 0) & level[1:] & level[:-1]
    joined &= np.diff(model.contact_hold[:count]) == 0
    joined &= np.all(model.contact_frame[1:] == model.contact_frame[:-1], axis=1)
    ends = [*(1 + np.flatnonzero(~joined)).tolist(), count]
    for first, end in zip([0, *ends[:-1]], ends if count else [], strict=False):
        points, radii = model.contact_point[first:end], model.contact_radius[first:end]
        center = 0.5 * (points.min(axis=0) + points.max(axis=0))
        around = float(np.max(np.linalg.norm(points - center, axis=1) + radii))
        arm = float(np.max(np.linalg.norm(points, axis=1) + radii))
        body = int(model.contact_body[first])
        mass, turning = _mobility(model, body)
        inertia, easy = model.body_inertia[body], turning**0.5
        swing = float(np.max(_swings(inertia, points) + radii * easy))
        spread = float(np.max(np.linalg.norm(points - center, axis=1)))
        mobility = mass + swing * swing + 2.0 * spread * swing * easy
        friction = model.contact_friction[first:end].max()
        model.cluster_end[first] = end
        turn = float(_swings(inertia, points.mean(axis=0, keepdims=True))[0]) * easy
        several = float(np.count_nonzero(model.contact_body[:count] == body))
        others = radii.any() or model.contact_terrain[first] or np.any(model.contact_law[first:end] == _LINEAR)
        corners = end - first > MANY and not others
        lengths = model.moment_friction[first:end].max(axis=0) if len(model.moment_friction) else np.zeros(2)
        moments = (0.0, 0.0, 0.0)
        if lengths.any():
            corners = False  # the sums of corners have no moments
            total, largest = float(lengths.sum()), float(lengths.max())
            moments = total, largest**2 * turning, total * (mobility * turning) ** 0.5
        model.cluster[first] = *center, around, arm, mobility, friction, turn, several, corners, *moments


def _swings(inertia: Floats, points: Floats) -> Floats:
    """Largest |J^-1/2 (p x f)| (n,) of a unit force f at each of the points (n, 3): how easily it turns a body."""
    values, axes = np.linalg.eigh(inertia.reshape(3, 3))
    moments = np.array([axes.T @ cross_matrix(p) for p in points])
    return np.asarray(np.linalg.norm(moments / np.sqrt(values)[:, None], ord=2, axis=(1, 2)))


def _mobility(model: Model, body: int) -> tuple[float, float]:
    """1/m and 1/J, J the least principal moment of inertia: no joint makes a body easier to move."""
    least = float(np.linalg.eigvalsh(model.body_inertia[body].reshape(3, 3))[0])
    mass = float(model.body_mass[body])
    return (1.0 / mass, 1.0 / least) if mass > 0.0 else (np.inf, np.inf)
