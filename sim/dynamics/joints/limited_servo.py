"""The drive of a servo with force limits: its unlimited force, in the form of dry friction.

    P = h (g u - kp (q + h (nu - v)/4) - kd nu) = P0 - h k nu,    k = h kp/4 + kd

is the impulse of the servo without limits: its spring is that of a joint (joint_forces.py), its damper acts on the
unknown velocity. With limits it is T = P between h lo and h hi, and one of the two otherwise: (T - P)/k = f - b,

    f - b = h nu - r + e T,    f (T - h lo) = kappa,    b (h hi - T) = kappa,    r = P0/k,  e = 1/k

a plastic element behind a spring. P falls with nu, so T does, and no step has two solutions for it: the implicit spring
that it is within its limits is stable for every gain, and beyond them its force is constant.
"""

from __future__ import annotations

from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Drive, Gain
from solvers.compiler import kernel
from solvers.types import Vector


@kernel
def begin_drive(model: Model, data: Data, h: float, k: int, q: Vector, v: Vector, u: Vector) -> None:
    """dry_drive of element k in a step from (q, v) under u; zero of dry friction."""
    own = data.dry_drive[k]
    own[Drive.REST], own[Drive.COMPLIANCE], own[Drive.MEAN] = 0.0, 0.0, h * model.dry_middle[k]
    if model.dry_input[k] < 0:
        return
    d = model.dry_dof[k]
    kp, kd = model.dry_gain[k, Gain.STIFFNESS], model.dry_gain[k, Gain.DAMPING]
    force = model.dry_gain[k, Gain.INPUT] * u[model.dry_input[k]] - kp * (q[model.dof_qadr[d]] - 0.25 * h * v[d])
    own[Drive.COMPLIANCE] = 1.0 / (0.25 * h * kp + kd)
    own[Drive.REST] = h * force * own[Drive.COMPLIANCE]


@kernel
def drive_by_time_step(model: Model, data: Data, h: float, k: int, impulse: float) -> float:
    """e dP/dh + (P - T) de/dh of element k with the impulse T, where h nu and h v stay; 0 of dry friction.

    P + kd h nu is in proportion to h.
    """
    if model.dry_input[k] < 0:
        return 0.0
    d = model.dry_dof[k]
    e = data.dry_drive[k, Drive.COMPLIANCE]
    kp, kd = model.dry_gain[k, Gain.STIFFNESS], model.dry_gain[k, Gain.DAMPING]
    P = (data.dry_drive[k, Drive.REST] - h * data.nu[d]) / e
    return e * (P / h + kd * data.nu[d]) - (P - impulse) * e * e * 0.25 * kp
