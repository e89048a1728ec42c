"""Friction against spinning and rolling of all active contacts: one kernel per operation of the interior point.

Every kernel is optional: scenes without torsional or rolling friction compile none of them.
"""

from __future__ import annotations

from sim.contact.ground_contact import contact_rate
from sim.contact.moments.moment_law import (
    condense_moment,
    has_moment,
    keep_in_bounds,
    moment_change,
    moment_constant,
    moment_of,
    moment_violation,
    start_moment,
)
from sim.contact.moments.moment_rates import (
    add_moment,
    bodies_of,
    earlier_turning,
    faded,
    frame_of,
    frame_turning,
    gap_row,
    is_felt,
    moment_jacobian,
    put_rates,
    rates_by,
    rates_of,
    row_of,
    turned_row,
    world_moment,
)
from sim.contact.pairs.limited_reach import end_of
from sim.contact.pairs.pair_jacobian import pair_rate
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import LawForm
from sim.model.record_columns import Bounce, Cone, ContactRow, Moment
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross, times
from solvers.types import Matrix, Vector

_FIRST, _END = Moment.SPIN, Moment.ROLL + 2


@optional(Slot.MOMENT_RATES)
def moment_rates(model: Model, data: Data, h: float) -> None:
    """Rates of spinning and rolling of the active contacts at configuration 3."""
    for m in range(data.active_count[0]):
        if has_moment(model, data.active[m]):
            put_rates(model, data, h, data.active[m])


@optional(Slot.START_MOMENTS)
def start_moments(model: Model, data: Data, kappa: float) -> None:
    """Moments on the central path of kappa, at the present rates and normal impulses."""
    for m in range(data.active_count[0]):
        start_moment(model, data, data.active[m], kappa)


@optional(Slot.RESUME_MOMENTS)
def resume_moments(model: Model, data: Data, kappa: float, predicted: bool) -> None:
    """Moments on the central path of kappa; predicted: those of pressing contacts stay, within their bounds."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        if predicted and data.cone[c, Cone.IMPULSE] > data.cone[c, Cone.SLACK]:
            keep_in_bounds(model, data, c)
        else:
            start_moment(model, data, c, kappa)


@optional(Slot.KEEP_MOMENTS)
def keep_moments(model: Model, data: Data) -> None:
    """Remember the moments from which the line search starts."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        for k in range(_FIRST, _END):
            data.cone_trial[c, k] = data.cone[c, k]


@optional(Slot.MOVE_MOMENTS)
def move_moments(model: Model, data: Data, alpha: float) -> None:
    """Moments = kept + alpha step, within the bounds of the normal impulses, which have moved."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        for k in range(_FIRST, _END):
            data.cone[c, k] = data.cone_trial[c, k] + alpha * data.carry.cone_step[c, k]
        keep_in_bounds(model, data, c)


@optional(Slot.MOMENT_ERROR, default=0.0)
def moment_error(model: Model, data: Data, kappa: float) -> float:
    """Largest violation of the laws on the central path of kappa, in units of kappa: of contacts that act."""
    e = 0.0
    for m in range(data.active_count[0]):
        e = max(e, moment_violation(model, data, data.active[m], kappa))
    return e


@optional(Slot.APPLY_MOMENTS)
def apply_moments(model: Model, data: Data) -> None:
    """wrench -= moments of all active contacts."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        if has_moment(model, c):
            add_moment(model, data, c, moment_of(data, c), data.wrench)


@optional(Slot.CONDENSE_MOMENTS)
def condense_moments(
    model: Model, data: Data, h: float, kappa: float, indefinite: float, form: int, out: Matrix
) -> None:
    """out += moments of contacts with the ground, coupling_K += those of pairs, both condensed.  (nbody, 36)

    After `condense_contacts` and `condense_pairs`, which see.
    """
    for m in range(data.active_count[0]):
        c = data.active[m]
        if has_moment(model, c) and is_felt(model, data, c):
            moment_jacobian(model, data, h, c)
            condense_moment(model, data, h, c, kappa, indefinite, form)
            ground = c < model.contact_height.shape[0]
            summed = ground and form == LawForm.SOFT and data.bounce[c, Bounce.RESTITUTION] > 0.0
            _add_side(model, data, c, 0, (0.0 if summed else 1.0, indefinite), out)  # see restitution_gradient.py
            if not ground and bodies_of(model, c)[1] >= 0:
                _add_side(model, data, c, 1, (1.0, indefinite), out)


@kernel
def _add_side(model: Model, data: Data, c: int, side: int, parts: tuple[float, float], out: Matrix) -> None:
    """Moment of contact c by the twist of body a (side 0) or b: parts of its law, and of the turning of its frame."""
    law, turning = parts
    ground = model.contact_height.shape[0]
    p = moment_of(data, c)
    f = world_moment(model, data, c, p)
    C = data.moment_Ca[c] if side == 0 else data.moment_Cb[c]
    for k in range(6):
        gap = gap_row(model, data, c, side, k)
        g = world_moment(model, data, c, faded(model, data, c, gap, moment_change(data, c, gap, rates_of(C, k)), p))
        t = frame_turning(model, data, c, side, k)
        x = cross(t[0], t[1], t[2], f[0], f[1], f[2])
        for r in range(3):
            d = law * g[r] + turning * x[r]
            if c < ground:
                out[model.contact_body[c], 18 + 6 * r + k] -= d
            else:
                data.coupling_K[2 * model.pair_coupling[c - ground] + side, 18 + 6 * r + k] += d


@optional(Slot.ADD_MOMENT_LAW)
def add_moment_law(model: Model, data: Data, c: int, out: Matrix) -> None:
    """out += the law of the moment of an impact c on the ground, which `condense_moments` omits."""
    if has_moment(model, c):
        _add_side(model, data, c, 0, (1.0, 0.0), out)


@optional(Slot.MOMENT_BY_GAP, default=(0.0, 0.0, 0.0))
def moment_by_gap(model: Model, data: Data, c: int) -> Vec3:
    """Change of the moment of contact c, world axes, by its law per unit of its gap above the floor of an impact."""
    if not has_moment(model, c) or not is_felt(model, data, c):
        return 0.0, 0.0, 0.0
    return world_moment(model, data, c, moment_change(data, c, 1.0, (0.0, 0.0, 0.0)))


@optional(Slot.ADD_IMPACT_MOMENT)
def add_impact_moment(
    model: Model, data: Data, h: float, c: int, gap: float, s: Vector, t: Vector, out: Vector
) -> None:  # fmt: skip
    """out (6,) += wrench of the moment of an impact on the ground, by its law: of the gap above the floor, and of the
    twists s and t of configurations 2 and 3.
    """
    if not has_moment(model, c):
        return
    x, y, z = rates_by(data.moment_Ca[c], t)
    u, v, w = times(frame_of(model, data, c), *earlier_turning(data, h, model.contact_body[c], s))
    m = world_moment(model, data, c, moment_change(data, c, gap, (x + u, y + v, z + w)))
    for k in range(3):
        out[3 + k] += m[k]


@optional(Slot.MOMENT_WORK, default=0.0)
def moment_work(model: Model, data: Data, h: float, c: int) -> float:
    """1/2 m.(omega + omega') of the moment m of contact c, omega and omega' before and after."""
    if not has_moment(model, c) or not is_felt(model, data, c):
        return 0.0
    a, b = bodies_of(model, c)
    m = world_moment(model, data, c, moment_of(data, c))
    work = 0.0
    for k in range(3):
        work += m[k] * (data.turn_in[a, 1 + k] + data.turn[a, 1 + k]) / h
        if b >= 0:
            work -= m[k] * (data.turn_in[b, 1 + k] + data.turn[b, 1 + k]) / h
    return work


@optional(Slot.MOMENT_CONSTANTS)
def moment_constants(model: Model, data: Data) -> None:
    """wrench -= constant parts of the moments, after those of the impulses."""
    for m in range(data.active_count[0]):
        c = data.active[m]
        if has_moment(model, c) and is_felt(model, data, c):
            add_moment(model, data, c, moment_constant(model, data, c), data.wrench)


@optional(Slot.RECOVER_MOMENTS)
def recover_moments(model: Model, data: Data) -> None:
    """Steps of the moments from the twists of the last solve."""
    ground = model.contact_height.shape[0]
    for m in range(data.active_count[0]):
        c = data.active[m]
        d = data.carry.cone_step[c]
        d[Moment.SPIN] = d[Moment.ROLL] = d[Moment.ROLL + 1] = 0.0
        if not has_moment(model, c) or not is_felt(model, data, c):
            continue
        a, b = bodies_of(model, c)
        x, y, z = rates_by(data.moment_Ca[c], data.twist[a])
        if b >= 0:
            u, v, w = rates_by(data.moment_Cb[c], data.twist[b])
            x, y, z = x + u, y + v, z + w
        gap = contact_rate(model, data, c)[0] if c < ground else pair_rate(model, data, c)[0]
        t, r, s = moment_change(data, c, gap, (x, y, z))
        U, V = data.moment_w[2 * c], data.moment_w[2 * c + 1]
        d[Moment.SPIN], d[Moment.ROLL], d[Moment.ROLL + 1] = t + U[1], r + V[1], s + V[2]


@kernel
def _earlier(model: Model, data: Data, h: float, c: int, side: int, k: int) -> Vec3:
    """Change of the moment of contact c in world axes by the rotation k of body a (side 0) or b at configuration 2."""
    F = frame_of(model, data, c)
    a, b = bodies_of(model, c)
    i, sign = (a, 1.0) if side == 0 else (b, -1.0)
    x = turned_row(data, h, i, row_of(F, 0), -1.0)[k]
    y = turned_row(data, h, i, row_of(F, 1), -1.0)[k]
    z = turned_row(data, h, i, row_of(F, 2), -1.0)[k]
    return world_moment(model, data, c, moment_change(data, c, 0.0, (sign * x, sign * y, sign * z)))


@optional(Slot.ADD_MOMENT_RATES)
def add_moment_rates(model: Model, data: Data, h: float) -> None:
    """A2 -= moments of contacts with the ground: rates depend on pose 2."""
    for m in range(data.active_ground_count[0]):
        c = data.active[m]
        if not has_moment(model, c) or data.bounce[c, Bounce.RESTITUTION] > 0.0:
            continue
        for k in range(3):
            d = _earlier(model, data, h, c, 0, k)
            for r in range(3):
                data.A2[model.contact_body[c], 21 + 6 * r + k] -= d[r]


@optional(Slot.ADD_MOMENT_COUPLINGS)
def add_moment_couplings(model: Model, data: Data, h: float) -> None:
    """coupling_K2 += moments of pairs: rates depend on the poses at configuration 2."""
    ground = model.contact_height.shape[0]
    for m in range(data.active_ground_count[0], data.active_count[0]):
        c = data.active[m]
        if not has_moment(model, c) or not is_felt(model, data, c):
            continue
        for side in range(2):
            if bodies_of(model, c)[side] < 0:
                continue
            K2 = data.coupling_K2[2 * model.pair_coupling[c - ground] + side]
            for k in range(3):
                d = _earlier(model, data, h, c, side, k)
                for r in range(3):
                    K2[21 + 6 * r + k] += d[r]


@optional(Slot.REPORT_MOMENTS)
def report_moments(model: Model, data: Data, out: Matrix) -> None:
    """Moments of contacts in their rows, world axes: active, and inactive ones of clusters and collisions."""
    for m in range(data.active_count[0]):
        _report(model, data, data.active[m], out)
    for m in range(data.inactive_count[0]):
        first = data.inactive_first[m]
        for c in range(first, model.cluster_end[first]):
            if data.contact_out[c] == 1:
                _report(model, data, c, out)
    for m in range(data.near_collision_count[0]):
        first = data.near_collisions[m]
        if data.pair_activation[first] > 0.0:
            for j in range(first, end_of(model, first)):
                _report(model, data, model.contact_height.shape[0] + j, out)


@kernel
def _report(model: Model, data: Data, c: int, out: Matrix) -> None:
    if has_moment(model, c) and is_felt(model, data, c):
        x = world_moment(model, data, c, moment_of(data, c))
        for k in range(3):
            out[c, ContactRow.MOMENT + k] = x[k]
