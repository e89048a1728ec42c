"""Parameters of the ground where a contact is: F, F_x and F_y of its height field, and the radius, which F is made for.

Columns[:, col] -= w dR.   dphi = -(dF - phi n.(dF_x, dF_y, 0)) n_z,   the frame turns as it does from place to place.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.height_field import field_values, height_field
from sim.contact.terrain_contact import center, frame_turn
from sim.derivatives.parameters.contact_columns import add_impulse, add_turn, floor_change, impulse_change, is_active
from sim.derivatives.parameters.moment_columns import add_moment_change
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bounce, Kin
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.types import Matrix


@kernel
def is_on_terrain(model: Model, data: Data, c: int) -> bool:
    """Whether a height field has a part in the contact, and the contact in the step."""
    return model.contact_terrain[c] > 0 and is_active(data, c)


@kernel
def add_ground_place(model: Model, data: Data, h: float, c: int, k: int, col: int) -> None:
    """columns[:, col] -= dR/d(F, F_x or F_y), k = 0, 1, 2, where contact c is."""
    if not is_on_terrain(model, data, c):
        return
    n = data.contact_frame[c]
    if k == 0:
        add_impulse(model, data, c, impulse_change(data, c, -n[2], 0.0, 0.0), 1.0, col)
        add_moment_change(model, data, h, c, (-n[2], -n[2]), (0.0, 0.0, 0.0), 1.0, col)
        return
    phi = (
        data.contact_kin[c, Kin.GAP] + data.bounce[c, Bounce.FLOOR]
    )  # contact_kin has the gap above the floor of an impact
    turn = frame_turn(n, -1.0 if k == 1 else 0.0, -1.0 if k == 2 else 0.0)
    add_turn(model, data, h, c, turn, phi * n[2] * n[k - 1], 1.0, col)


@kernel
def earlier_rate(model: Model, c: int, phi: float, pos: Matrix, rot: Matrix) -> float:
    """d(phi)/d(radius) at an earlier configuration, by its poses."""
    k = model.contact_terrain[c] - 1
    x, y, _ = center(model, c, pos, rot)
    _, Fx, Fy, _, _, _ = height_field(model, k, x, y)
    G, Gx, Gy, _, _, _ = field_values(model, model.terrain_rates, k, x, y)
    i = 1.0 / sqrt(1.0 + Fx * Fx + Fy * Fy)
    return -i * (G + phi * i * (Fx * Gx + Fy * Gy))


@optional(Slot.ADD_SURFACE_RADIUS)
def add_surface_radius(model: Model, data: Data, h: float, c: int, w: float, col: int) -> None:
    """The surface on which the centre of contact c is, made for a larger radius."""
    if not is_on_terrain(model, data, c):
        return
    x, y, _ = center(model, c, data.pos3, data.rot3)
    G, Gx, Gy, _, _, _ = field_values(model, model.terrain_rates, model.contact_terrain[c] - 1, x, y)
    n = data.contact_frame[c]
    b = data.bounce[c]
    gap = -n[2] * (G - (data.contact_kin[c, Kin.GAP] + b[Bounce.FLOOR]) * (n[0] * Gx + n[1] * Gy))
    if b[Bounce.RESTITUTION] > 0.0:
        d1 = earlier_rate(model, c, b[Bounce.GAP1], data.pos1, data.rot1)
        gap -= floor_change(data, c, d1, earlier_rate(model, c, b[Bounce.GAP2], data.pos2, data.rot2))
    add_turn(model, data, h, c, frame_turn(n, -Gx, -Gy), gap, w, col)
