"""Effects of the parameters on the inertias that dampers see, see mechanism/damper_inertia.py.

With the twists V_b of the bodies in the motion x_d, about the origin of the world, and H the momentum of the bodies
that joint j carries, a geometry that displaces these by a twist X changes 2 T = x_d.M x_d by

    2 H.(V x X)      V: twist of the bodies before the displacement

An axis that turns takes along the bodies behind it, which turn back about its joint point. All three rotations of a
joint, or all three of its translations, have no directions that turn.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence

import numpy as np
from numpy.typing import NDArray

from sim.derivatives.parameters.directions import Effect
from sim.derivatives.parameters.parameter import Parameter, Term
from sim.mechanism.damper_inertia import BEND, Bent, bent, damper_motions, joint_columns
from sim.mechanism.shapes import cross_matrix
from sim.model.model import Model
from solvers.types import Floats

Rates = dict[tuple[int, int, int], Floats]  # by effect, index and component: (number of damped dofs,)

_OF_JOINTS = frozenset((Effect.PARENT_POINT, Effect.CHILD_POINT, Effect.ORIENTATION, Effect.AXIS, Effect.LEAD))
_FELT = _OF_JOINTS | {Effect.MASS, Effect.INERTIA, Effect.ARMATURE}
_INERTIA = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def with_damper_inertia(model: Model, found: Sequence[Parameter]) -> list[Parameter]:
    """Parameters with their effects on the inertias that dampers see."""
    dofs = np.flatnonzero(model.dof_damper)
    effects = {(effect, i) for p in found for effect, i, _, _ in p.terms if effect in _FELT}
    if not len(dofs) or not effects:
        return list(found)
    joints = {i for effect, i in effects if effect in _OF_JOINTS}
    rates, out = damper_inertia_rates(model, dofs, joints), []
    for p in found:
        change = np.zeros(len(dofs))
        for effect, i, k, weight in p.terms:
            change += weight * rates.get((int(effect), i, k), 0.0)
        terms: tuple[Term, ...] = tuple(
            (Effect.SEEN, int(d), 0, float(w)) for d, w in zip(dofs, change, strict=True) if w
        )
        out.append(p._replace(terms=p.terms + terms))
    return out


def damper_inertia_rates(model: Model, dofs: NDArray[np.int64], joints: Collection[int]) -> Rates:
    """Derivatives of the inertias that the dampers of `dofs` see, by bodies, armatures and the geometry of joints."""
    at = bent(model)
    x = damper_motions(model, at)[1][:, dofs]
    n = len(model.body_mass)
    V, H = np.zeros((2, n, len(dofs), 6))
    out: Rates = {}
    for i in range(n):
        own, p = slice(int(model.body_vadr[i]), int(model.body_vadr[i + 1])), int(model.body_parent[i])
        V[i] = x[own].T @ at.columns[own] + (V[p] if p >= 0 else 0.0)
        H[i] = V[i] @ at.inertia[i]
        out |= _body_rates(at, i, V[i])
        out |= {(int(Effect.ARMATURE), d, 0): x[d] ** 2 for d in range(own.start, own.stop)}
    for i in range(n - 1, -1, -1):
        p = int(model.body_parent[i])
        if p >= 0:
            H[p] += H[i]
        if i in joints:
            out |= _joint_rates(model, at, i, (V[p] if p >= 0 else np.zeros_like(H[i]), V[i], H[i]), x)
    return out


def _body_rates(at: Bent, i: int, V: Floats) -> Rates:
    """By mass and inertia of body i: |v|^2 of its centre, w w^T in its axes."""
    v, w = V[:, :3] + V[:, 3:] @ cross_matrix(at.center[i]), V[:, 3:] @ at.rotation[i]
    out: Rates = {(int(Effect.MASS), i, 0): np.sum(v * v, axis=1)}
    for k, (a, b) in enumerate(_INERTIA):
        out[int(Effect.INERTIA), i, k] = (1.0 if a == b else 2.0) * w[:, a] * w[:, b]
    return out


def _joint_rates(model: Model, at: Bent, i: int, motion: tuple[Floats, Floats, Floats], x: Floats) -> Rates:
    """By the geometry of joint i.   motion: twists before and behind it, momentum of its bodies, (n, 6) each."""
    before, behind, H = motion
    parent = at.rotation[model.body_parent[i]] if model.body_parent[i] >= 0 else np.eye(3)
    lead = BEND * model.joint_lead[i] * at.frame[i] @ model.joint_axis[i]
    ntrans, nrot, first = int(model.joint_ntrans[i]), int(model.joint_nrot[i]), int(model.body_vadr[i])
    velocity = x[first : first + ntrans].T @ at.columns[first : first + ntrans, :3]  # of its translations
    out: Rates = {}
    for k in range(3):
        shift = np.concatenate([parent[:, k], np.zeros(3)])
        out[int(Effect.PARENT_POINT), i, k] = _moved(H, before, shift)
        out[int(Effect.CHILD_POINT), i, k] = _moved(H, behind, np.concatenate([-at.rotation[i][:, k], np.zeros(3)]))
        turn = at.frame[i][:, k]
        twist = np.concatenate([at.joint[i] @ cross_matrix(turn), turn])
        out[int(Effect.ORIENTATION), i, k] = _moved(H, before, twist)
        turned = at.rotation[i][:, k]
        back = np.concatenate([(at.joint[i] + lead) @ cross_matrix(turned), turned])
        whole = _moved(H, before, twist) - _moved(H, behind, back)
        along = 2.0 * np.sum(H[:, :3] * np.cross(turn, velocity), axis=1)
        out[int(Effect.AXIS), i, k] = along if nrot == 3 else whole - along if ntrans == 3 else whole
    if nrot == 1:
        d = first + ntrans
        along = at.frame[i] @ joint_columns(model, i)[-1, 3:]
        moved = _moved(H, before, BEND * np.concatenate([along, np.zeros(3)]))
        out[int(Effect.LEAD), i, 0] = 2.0 * H[:, :3] @ along * x[d] + moved
    return out


def _moved(H: Floats, V: Floats, X: Floats) -> Floats:
    """2 H.(V x X), with the product of twists (v, w) x (v', w') = (w x v' + v x w', w x w')."""
    along, about = cross_matrix(X[:3]), cross_matrix(X[3:])
    linear, angular = V[:, 3:] @ along + V[:, :3] @ about, V[:, 3:] @ about
    return np.asarray(2.0 * np.sum(H[:, :3] * linear + H[:, 3:] * angular, axis=1))
