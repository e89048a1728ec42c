"""Parameters of the ground where a contact is: F, F_x and F_y of its height field, and the radius, which F is made for.

Columns[:, col] -= w dR.   dphi = -(dF - phi n.(dF_x, dF_y, 0)) n_z,   the frame turns as it does from place to place.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.height_field import field_values, height_field
from sim.contact.terrain_contact import centre, frame_turn
from sim.derivatives.parameters.contact_columns import add_impulse, add_turn, floor_change, impulse_change, is_active
from sim.model.columns import Bounce, Kin
from sim.model.data import Work
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.types import Matrix


@kernel
def is_on_terrain(model: Model, work: Work, c: int) -> bool:
    """Whether a height field has a part in the contact, and the contact in the step."""
    return model.contact_terrain[c] > 0 and is_active(work, c)


@kernel
def add_ground_place(model: Model, work: Work, h: float, c: int, k: int, col: int) -> None:
    """columns[:, col] -= dR/d(F, F_x or F_y), k = 0, 1, 2, where contact c is."""
    if not is_on_terrain(model, work, c):
        return
    n = work.contact_frame[c]
    if k == 0:
        add_impulse(model, work, c, impulse_change(work, c, -n[2], 0.0, 0.0), 1.0, col)
        return
    phi = (
        work.contact_kin[c, Kin.GAP] + work.bounce[c, Bounce.FLOOR]
    )  # contact_kin has the gap above the floor of an impact
    turn = frame_turn(n, -1.0 if k == 1 else 0.0, -1.0 if k == 2 else 0.0)
    add_turn(model, work, h, c, turn, phi * n[2] * n[k - 1], 1.0, col)


@kernel
def earlier_rate(model: Model, c: int, phi: float, pos: Matrix, rot: Matrix) -> float:
    """d(phi)/d(radius) at an earlier configuration, by its poses."""
    k = model.contact_terrain[c] - 1
    x, y, _ = centre(model, c, pos, rot)
    _, Fx, Fy, _, _, _ = height_field(model, k, x, y)
    G, Gx, Gy, _, _, _ = field_values(model, model.terrain_rates, k, x, y)
    i = 1.0 / sqrt(1.0 + Fx * Fx + Fy * Fy)
    return -i * (G + phi * i * (Fx * Gx + Fy * Gy))


@optional(Slot.ADD_SURFACE_RADIUS)
def add_surface_radius(model: Model, work: Work, h: float, c: int, w: float, col: int) -> None:
    """The surface on which the centre of contact c is, made for a larger radius."""
    if not is_on_terrain(model, work, c):
        return
    x, y, _ = centre(model, c, work.pos3, work.rot3)
    G, Gx, Gy, _, _, _ = field_values(model, model.terrain_rates, model.contact_terrain[c] - 1, x, y)
    n = work.contact_frame[c]
    b = work.bounce[c]
    gap = -n[2] * (G - (work.contact_kin[c, Kin.GAP] + b[Bounce.FLOOR]) * (n[0] * Gx + n[1] * Gy))
    if b[Bounce.RESTITUTION] > 0.0:
        d1 = earlier_rate(model, c, b[Bounce.GAP1], work.pos1, work.rot1)
        gap -= floor_change(work, c, d1, earlier_rate(model, c, b[Bounce.GAP2], work.pos2, work.rot2))
    add_turn(model, work, h, c, frame_turn(n, -Gx, -Gy), gap, w, col)
