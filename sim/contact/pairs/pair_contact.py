"""Contacts between two bodies a and b, or of a with fixed obstacles: geometry at configuration 3, and wrench.

    gap    phi, normal n (from b to a) and contact point p of a pair of shapes: sim/contact/collision; plus the overlap
           that the step may leave, which is 0 but in rescues (engines/dividing_engine.py)
    slip   v_t = T u,   u = u_a - u_b,   u_i = (x_i3 - x_i2)/h + omega_i x (p - x_i3)
    force  f = n gamma + T^T beta on a, -f on b, both at P = p - w_a (x_a3 - x_a2) - w_b (x_b3 - x_b2)

Both wrenches about O are opposite because they act at one point, P: momentum is exact. P is the point p carried back
to configuration 2, where the balance of momenta is taken, mostly by the lighter body (`shares`); of a fixed obstacle, a
alone carries it. Taut strings pull along where they lay at configuration 2: taut_string.py.

Derivatives: pair_jacobian.py.
"""

from __future__ import annotations

from math import cos, sin

from sim.contact.collision.collide import collide_chosen
from sim.contact.pairs.active_features import choose_shapes
from sim.contact.pairs.cylinder_pairs import collide_cylinders, on_cylinder
from sim.contact.pairs.limited_reach import fit_fade
from sim.contact.pairs.pair_pose import place_shapes
from sim.contact.pairs.taut_string import is_taut, pull_from_before, string_arm
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import FeatureChoice
from sim.model.record_columns import Kin, PairFade, PairFrame, RelativePose, Witness
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, rotate, three, transposed_times
from solvers.types import Matrix

POLE = (sin(0.6) * cos(1.1), sin(0.6) * sin(1.1), cos(0.6))  # where `tangents` begin
_TO_POLE = 1.0 / (1.0 + POLE[2])  # x turned the shortest way from z to the pole
_FIRST = (1.0 - _TO_POLE * POLE[0] * POLE[0], -_TO_POLE * POLE[0] * POLE[1], -POLE[0])
_NO_POINT = 1e8  # [m] a gap beyond it says that the shapes have no such point now


@kernel
def tangents(nx: float, ny: float, nz: float) -> tuple[Vec3, Vec3]:
    """t1, t2: the frame of the pole a, turned the shortest way to n: t1 = b - (b.n)/(1 + a.n) (a + n), t2 = n x t1.

    Continuous but at n = -a, so that a pyramid of friction does not jump from one iterate to the next. At n = z it is
    x and y, as of contacts with the ground. An unusual direction of the pole keeps -a away from it.
    """
    a, b = POLE, _FIRST
    p = (b[0] * nx + b[1] * ny + b[2] * nz) / max(1.0 + a[0] * nx + a[1] * ny + a[2] * nz, 1e-12)
    x, y, z = b[0] - p * (a[0] + nx), b[1] - p * (a[1] + ny), b[2] - p * (a[2] + nz)
    s = x * nx + y * ny + z * nz  # rounding: on a floor the frame lies in it exactly
    t1 = (x - s * nx, y - s * ny, z - s * nz)
    return t1, cross(nx, ny, nz, t1[0], t1[1], t1[2])


@kernel
def point_velocity(data: Data, h: float, i: int, x: float, y: float, z: float) -> Vec3:
    """Velocity over the interval of the point (x, y, z), world axes, that moves with body i; 0 for the world."""
    if i < 0:
        return 0.0, 0.0, 0.0
    a = data.pos3[i]
    b = data.pos2[i]
    w = data.turn[i]
    vx, vy, vz = cross(w[1], w[2], w[3], x - a[0], y - a[1], z - a[2])
    return (a[0] - b[0] + 2.0 * vx) / h, (a[1] - b[1] + 2.0 * vy) / h, (a[2] - b[2] + 2.0 * vz) / h


@kernel
def collide_shapes(model: Model, data: Data, first: int) -> None:
    """pair_out of all points of the collision whose first pair this is, at configuration 3."""
    place_shapes(model, data, first, data.pos3, data.rot3)
    kind = model.pair_kind[first]
    sizes = model.pair_sizes[first]
    pose = data.pair_relative[first]
    if data.feature_choice[0] == FeatureChoice.EVERY_POSE:
        choose_shapes(model, data, first)
    elif on_cylinder(kind):
        collide_cylinders(model, data, first)
        return
    end = first
    while end < model.pair_kind.shape[0] and (end == first or model.pair_feature[end] > 0):
        if data.feature_choice[0] != FeatureChoice.EVERY_POSE:
            collide_chosen(model, kind, end - first, data.pair_code[end], sizes, pose[:9], pose[9:], data.pair_out[end])
        end += 1


@kernel
def is_absent(data: Data, j: int) -> bool:
    """Whether the shapes have no such point now (a corner cut off): it has a gap of 1 m then, and no wrench."""
    return data.pair_out[j, Witness.GAP] > _NO_POINT


@kernel
def acts(data: Data, j: int) -> bool:
    """Whether pair j has a wrench: its shapes have that point now, within their reach."""
    return not is_absent(data, j) and data.pair_fade[j, PairFade.PART] > 0.0


@optional(Slot.PAIR_KINEMATICS)
def pair_kinematics(model: Model, data: Data, h: float) -> None:
    """Gap, slip, frame and point of the pairs of active collisions at configuration 3."""
    ground = model.contact_height.shape[0]
    for m in range(data.active_ground_count[0], data.active_count[0]):
        j = data.active[m] - ground
        if model.pair_feature[j] == 0:
            collide_shapes(model, data, j)
        point_kinematics(model, data, h, j)


@kernel
def point_kinematics(model: Model, data: Data, h: float, j: int) -> None:
    """Gap, slip, frame and point of pair j, from pair_out."""
    a = model.coupling_body[model.pair_coupling[j], 0]
    b = model.coupling_body[model.pair_coupling[j], 1]
    g = data.pair_out[j]
    F = data.pair_frame[j]
    s = shape_b(model, j)
    t1, t2 = tangents(*three(g, Witness.NORMAL))
    F[0], F[1], F[2] = rotate(data.shape_rot, s, *three(g, Witness.NORMAL))
    F[3], F[4], F[5] = rotate(data.shape_rot, s, t1[0], t1[1], t1[2])
    F[6], F[7], F[8] = rotate(data.shape_rot, s, t2[0], t2[1], t2[2])
    F[PairFrame.POINT], F[PairFrame.POINT + 1], F[PairFrame.POINT + 2] = rotate(
        data.shape_rot, s, *three(g, Witness.POINT)
    )
    for k in range(3):
        F[PairFrame.POINT + k] += data.shape_pos[s, k]
    ax, ay, az = point_velocity(data, h, a, *three(F, PairFrame.POINT))
    bx, by, bz = point_velocity(data, h, b, *three(F, PairFrame.POINT))
    x, y, z = ax - bx, ay - by, az - bz
    fit_fade(model, data, j)
    kin = data.contact_kin[model.contact_height.shape[0] + j]
    left = data.pair_before[j - model.pair_feature[j], RelativePose.LEFT]
    kin[Kin.GAP] = 1.0 if is_absent(data, j) else g[Witness.GAP] + left
    kin[Kin.SLIP1] = F[3] * x + F[4] * y + F[5] * z
    kin[Kin.SLIP2] = F[6] * x + F[7] * y + F[8] * z
    kin[Kin.ARM] = F[PairFrame.POINT] - data.pos3[a, 0]
    kin[Kin.ARM + 1] = F[PairFrame.POINT + 1] - data.pos3[a, 1]
    kin[Kin.ARM + 2] = F[PairFrame.POINT + 2] - data.pos3[a, 2]
    if is_taut(model, data, j):
        pull_from_before(model, data, j)


@kernel
def shape_b(model: Model, j: int) -> int:
    """Row of shape b of pair j: all points of a collision share their shapes."""
    return 2 * (j - model.pair_feature[j]) + 1


@kernel
def shares(model: Model, j: int) -> tuple[float, float]:
    """Parts of a and b in carrying the contact point of pair j back to configuration 2: m_b/(m_a + m_b) and the rest.

    The point of a ball that rolls moves with the ball; carried by half, it presses ahead of the centre and brakes.
    """
    k = model.pair_coupling[j]
    b = model.coupling_body[k, 1]
    if b < 0:
        return 1.0, 0.0
    m = model.body_mass[model.coupling_body[k, 0]]
    both = m + model.body_mass[b]
    return (1.0 - m / both, m / both) if both > 0.0 else (0.5, 0.5)


@kernel
def pair_arm(model: Model, data: Data, j: int) -> Vec3:
    """P - O."""
    if is_taut(model, data, j):
        return string_arm(model, data, j)
    a = model.coupling_body[model.pair_coupling[j], 0]
    b = model.coupling_body[model.pair_coupling[j], 1]
    wa, wb = shares(model, j)
    F = data.pair_frame[j]
    x = F[PairFrame.POINT] - data.origin[0] - wa * (data.pos3[a, 0] - data.pos2[a, 0])
    y = F[PairFrame.POINT + 1] - data.origin[1] - wa * (data.pos3[a, 1] - data.pos2[a, 1])
    z = F[PairFrame.POINT + 2] - data.origin[2] - wa * (data.pos3[a, 2] - data.pos2[a, 2])
    if b >= 0:
        x -= wb * (data.pos3[b, 0] - data.pos2[b, 0])
        y -= wb * (data.pos3[b, 1] - data.pos2[b, 1])
        z -= wb * (data.pos3[b, 2] - data.pos2[b, 2])
    return x, y, z


@kernel
def gap_normal(model: Model, data: Data, j: int) -> Vec3:
    """Derivative of the gap of pair j by a displacement of a; where a string pulls along is another direction."""
    F = data.pair_frame[j]
    return (F[3], F[4], F[5]) if is_taut(model, data, j) else (F[0], F[1], F[2])


@kernel
def pair_force(data: Data, j: int, fn: float, f1: float, f2: float) -> Vec3:
    """w (n fn + t1 f1 + t2 f2), w the part that acts within the reach of the collision (limited_reach.py)."""
    w = data.pair_fade[j, PairFade.PART]
    return transposed_times(data.pair_frame[j], w * fn, w * f1, w * f2)


@kernel
def add_pair_wrench(model: Model, data: Data, j: int, fn: float, f1: float, f2: float, out: Matrix) -> None:
    """out[a] -= (f, (P - O) x f), out[b] += the same."""
    a = model.coupling_body[model.pair_coupling[j], 0]
    b = model.coupling_body[model.pair_coupling[j], 1]
    f = pair_force(data, j, fn, f1, f2)
    x, y, z = pair_arm(model, data, j)
    m = cross(x, y, z, f[0], f[1], f[2])
    for k in range(3):
        out[a, k] -= f[k]
        out[a, 3 + k] -= m[k]
        if b >= 0:
            out[b, k] += f[k]
            out[b, 3 + k] += m[k]
