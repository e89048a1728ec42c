"""The work of the forces of loops in a step: none, to O(h^3), in a motion that time steps can follow."""

from __future__ import annotations

from sim.dynamics.energy import momentum_velocity
from sim.dynamics.loops.closure import loop_rows
from sim.dynamics.loops.constraint_rows import is_loop
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import StepOptions
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.rotation import Vec3, cross
from solvers.types import Vector

_SHARE = 0.03  # of the kinetic energies before and after; loop forces that give more in a step are no motion's


@kernel
def _work_on(data: Data, i: int, f: Vec3, t: Vec3) -> float:
    """Twice the work over the intervals 1-2 and 2-3 of the wrench (f, t) about O on body i at configuration 2."""
    if i < 0:
        return 0.0
    o = data.origin
    x = data.pos2[i]
    m = cross(x[0] - o[0], x[1] - o[1], x[2] - o[2], f[0], f[1], f[2])
    total = 0.0
    for k in range(3):
        total += f[k] * (data.pos3[i, k] - data.pos1[i, k])
        total += (t[k] - m[k]) * 2.0 * (data.turn[i, 1 + k] + data.turn_in[i, 1 + k])
    return total


@kernel
def _loop_work(model: Model, data: Data) -> float:
    """Twice the work of the forces of loops over the intervals 1-2 and 2-3."""
    total = 0.0
    for k in range(model.coupling_body.shape[0]):
        if not is_loop(model, k):
            continue
        f = (0.0, 0.0, 0.0)
        t = (0.0, 0.0, 0.0)
        for row in range(model.coupling_row[k], model.coupling_row[k + 1]):
            g = data.carry.couple_force[row]
            b = data.couple_B[row]
            f = (f[0] + g * b[0], f[1] + g * b[1], f[2] + g * b[2])
            t = (t[0] + g * b[3], t[1] + g * b[4], t[2] + g * b[5])
        total += _work_on(data, model.coupling_body[k, 0], f, t) - _work_on(data, model.coupling_body[k, 1], f, t)
    return total


@kernel
def _closing_work(model: Model, data: Data, tolerance: float) -> float:
    """Twice the work that the forces of loops may do to close the gaps at configurations 1 and 2."""
    for m in range(model.loop_ntrans.shape[0]):
        loop_rows(model, data, m, data.pos1, data.rot1, data.couple_G)
    total = 0.0
    pairs = model.coupling_body.shape[0] - model.loop_ntrans.shape[0]
    for row in range(model.coupling_row[pairs], model.coupling_row[model.coupling_body.shape[0]]):
        total += 2.0 * abs(data.carry.couple_force[row]) * (data.loop_open[row] + abs(data.couple_gap[row]) + tolerance)
    for m in range(model.loop_ntrans.shape[0]):
        loop_rows(model, data, m, data.pos3, data.rot3, data.couple_G)
    return total


@optional(Slot.LOOP_SLACK, default=0.0)
def loop_slack(model: Model, data: Data, options: StepOptions) -> float:
    """Energy that the forces of loops may give to close the gaps at the beginning of the step [J]."""
    return 0.5 * _closing_work(model, data, options.tolerance) / options.h


@optional(Slot.LOOPS_GAINED, default=False)
def loops_gained(model: Model, data: Data, options: StepOptions, v: Vector) -> bool:
    """Whether the forces of loops did work on the way 1-2-3, which those of a motion do to O(h^3) only.

    They do where a loop passes a singular configuration faster than steps can follow: there the equations of a step
    have solutions that lead anywhere, and to any energy. Loops that were open are closed by work. A step that slows the
    bodies down, as an impact does, has given nothing.
    """
    h = options.h
    gain = 0.5 * _loop_work(model, data) / h
    if not gain > 0.0:
        return False
    before = momentum_velocity(model, data, h, data.move_in, data.turn_in, v)
    after = momentum_velocity(model, data, h, data.move, data.turn, data.nu)
    most = _SHARE * 0.5 * (before + after)
    if not (gain > most and after > before):
        return False
    return gain - loop_slack(model, data, options) > most
