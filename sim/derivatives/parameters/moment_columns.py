"""Parameters of contacts with torsional or rolling friction: what their moments add to columns[:, col] -= w dR.

The moment m = n tau + T^T rho follows its laws, of the gap and of the rates of the relative angular velocity omega, and
its frame: dm = F^T d(tau, rho) + turn x m, with rates that change by (turn x e).omega as the frame turns. Scenes
without these frictions compile none of this.
"""

from __future__ import annotations

from sim.contact.moments.moment_law import friction_change, has_moment, moment_change, moment_of
from sim.contact.moments.moment_rates import (
    bodies_of,
    faded,
    frame_of,
    is_felt,
    relative_turning,
    world_moment,
)
from sim.derivatives.parameters.body_columns import add_wrench
from sim.model.data import Data
from sim.model.model import Model
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, times


@kernel
def add_moment_column(model: Model, data: Data, c: int, m: Vec3, w: float, col: int) -> None:
    """The change m, in world axes, of the moment of contact c on its first body, and its opposite on the second."""
    a, b = bodies_of(model, c)
    none = (0.0, 0.0, 0.0)
    add_wrench(model, data, a, none, m, -w, col)
    add_wrench(model, data, b, none, m, w, col)


@optional(Slot.ADD_MOMENT_CHANGE)
def add_moment_change(
    model: Model, data: Data, h: float, c: int, gaps: tuple[float, float], turn: Vec3, w: float, col: int
) -> None:  # fmt: skip
    """The gap of contact c grows by gaps[0], that above the floor of an impact by gaps[1]; its frame turns by `turn`,
    world axes.
    """
    if not has_moment(model, c) or not is_felt(model, data, c):
        return
    u, p = relative_turning(model, data, h, c), moment_of(data, c)
    x = cross(u[0], u[1], u[2], turn[0], turn[1], turn[2])  # (turn x e).u = e.(u x turn)
    rates = times(frame_of(model, data, c), x[0], x[1], x[2])
    d = world_moment(model, data, c, faded(model, data, c, gaps[0], moment_change(data, c, gaps[1], rates), p))
    f = world_moment(model, data, c, p)
    y = cross(turn[0], turn[1], turn[2], f[0], f[1], f[2])
    add_moment_column(model, data, c, (d[0] + y[0], d[1] + y[1], d[2] + y[2]), w, col)


@optional(Slot.ADD_MOMENT_FRICTION)
def add_moment_friction(model: Model, data: Data, c: int, e: int, w: float, col: int) -> None:
    """Torsional (e = 0) or rolling friction of contact c."""
    if has_moment(model, c) and is_felt(model, data, c):
        add_moment_column(model, data, c, world_moment(model, data, c, friction_change(data, c, e)), w, col)


@optional(Slot.ADD_MOMENT_TIME_STEP)
def add_moment_time_step(model: Model, data: Data, h: float, w: float, col: int) -> None:
    """The rates of all contacts, which are turns over h: -rate/h."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        if has_moment(model, c) and is_felt(model, data, c):
            x, y, z = times(frame_of(model, data, c), *relative_turning(model, data, h, c))
            d = world_moment(model, data, c, moment_change(data, c, 0.0, (-x / h, -y / h, -z / h)))
            add_moment_column(model, data, c, d, w, col)
