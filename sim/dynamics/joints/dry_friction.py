"""Dry friction of joints on the central path: the impulse lambda, at most F = h f, that takes the most power.

    f - b = h nu,    f (F + lambda) = kappa,    b (F - lambda) = kappa,    all four factors positive

f and b are the motion forward and backward in the step. As kappa -> 0 a joint that moves is held back by F, and one
that rests by any impulse below it: a cone of one dimension whose radius is given. Power is never gained, lambda nu < 0.
The variables of a joint are f, F + lambda, b and F - lambda (columns Dry); lambda and b, f are eliminated for nu:

    d lambda = w - (h/c) d nu,    c = f/(F + lambda) + b/(F - lambda) + e

A servo whose force has limits is the same element, with a spring in series: T = M + lambda, between h times its limits
M - F and M + F, and f - b = h nu - r + e T with the compliance e and rest r of joints/limited_servo.py; dry friction
has M = e = r = 0.
"""

from __future__ import annotations

from sim.dynamics.joints.limited_servo import begin_drive, drive_by_time_step
from sim.model.data import Data
from sim.model.model import Model
from sim.model.options import NewtonTarget
from sim.model.record_columns import Drive, Dry, DryConstant, DryMove
from sim.model.slots import Slot
from solvers.compiler import kernel, optional
from solvers.cones import orthant_step
from solvers.types import Vector

_LEFT = 1e-3  # a variable that fell below this share of its former value has left its cone
_HELD = 0.01  # least share of its bound by which an impulse that is kept stays within it


@kernel
def dry_impulse(data: Data, k: int) -> float:
    """lambda of element k, or T of a servo."""
    return data.dry_drive[k, Drive.MEAN] + 0.5 * (data.dry[k, Dry.LEFT_FORWARD] - data.dry[k, Dry.LEFT_BACKWARD])


@kernel
def dry_compliance(data: Data, k: int) -> float:
    """c of element k, -d(h nu)/d(lambda)."""
    z = data.dry[k]
    own = data.dry_drive[k, Drive.COMPLIANCE]
    return z[Dry.FORWARD] / z[Dry.LEFT_FORWARD] + z[Dry.BACKWARD] / z[Dry.LEFT_BACKWARD] + own


@kernel
def onto_dry_path(z: Vector, x: float, bound: float, kappa: float) -> None:
    """z = the point of the central path at the motion x, for an impulse of at most `bound`.

    The remainder F - |lambda| = F kappa (1 + kappa/(s + y))/(kappa + s),  y = F |x|,  s^2 = kappa^2 + y^2.
    """
    y = bound * abs(x)
    s = (kappa * kappa + y * y) ** 0.5
    least = bound * kappa * (1.0 + kappa / (s + y)) / (kappa + s)
    most = 2.0 * bound - least
    z[Dry.LEFT_FORWARD] = least if x > 0.0 else most
    z[Dry.LEFT_BACKWARD] = most if x > 0.0 else least
    z[Dry.FORWARD] = kappa / z[Dry.LEFT_FORWARD]
    z[Dry.BACKWARD] = kappa / z[Dry.LEFT_BACKWARD]


@kernel
def onto_servo_path(z: Vector, x: float, e: float, bound: float, kappa: float) -> None:
    """z = the point of the central path of a servo at f - b = x + e lambda, lambda between -bound and bound.

    The difference of both sides falls with lambda, from infinity to minus infinity: Newton's method, or the middle.
    """
    low, high = -bound, bound
    y = min(max(-x / e, -0.999 * bound), 0.999 * bound)
    for _ in range(100):
        p, r = bound + y, bound - y
        g = kappa / p - kappa / r - x - e * y
        if g > 0.0:
            low = y
        else:
            high = y
        step = g / (kappa / (p * p) + kappa / (r * r) + e)
        y = y + step if low < y + step < high else 0.5 * (low + high)
        if abs(step) <= 1e-14 * min(p, r):
            break
    p, r = max(bound + y, 1e-15 * bound), max(bound - y, 1e-15 * bound)
    z[Dry.LEFT_FORWARD], z[Dry.LEFT_BACKWARD] = p, r
    z[Dry.FORWARD], z[Dry.BACKWARD] = kappa / p, kappa / r


@kernel
def _onto_path(data: Data, k: int, kappa: float) -> None:
    """Element k on the central path of kappa, at the present motion."""
    x, bound, own = data.dry_move[k, DryMove.MOTION], data.dry_move[k, DryMove.BOUND], data.dry_drive[k]
    if own[Drive.COMPLIANCE] > 0.0:
        x += own[Drive.COMPLIANCE] * own[Drive.MEAN]
        onto_servo_path(data.dry[k], x, own[Drive.COMPLIANCE], bound, kappa)
    else:
        onto_dry_path(data.dry[k], x, bound, kappa)


@optional(Slot.DRY_KINEMATICS)
def dry_kinematics(model: Model, data: Data, h: float) -> None:
    """The motion h nu and the bound h f of every element."""
    for k in range(model.dry_dof.shape[0]):
        data.dry_move[k, DryMove.MOTION] = h * data.nu[model.dry_dof[k]] - data.dry_drive[k, Drive.REST]
        data.dry_move[k, DryMove.BOUND] = h * model.dry_force[k]


@optional(Slot.FIT_DRY)
def fit_dry(model: Model, data: Data, h: float, q: Vector, v: Vector, u: Vector) -> None:
    """The variables of the last step, which may have had another length, with the sum 2 F, and the same products; and
    the drives of servos in this step.
    """
    for k in range(model.dry_dof.shape[0]):
        begin_drive(model, data, h, k, q, v, u)
        z = data.dry[k]
        total = z[Dry.LEFT_FORWARD] + z[Dry.LEFT_BACKWARD]
        if total > 0.0:
            g = 2.0 * h * model.dry_force[k] / total
            z[Dry.LEFT_FORWARD] *= g
            z[Dry.LEFT_BACKWARD] *= g
            z[Dry.FORWARD] /= g
            z[Dry.BACKWARD] /= g


@optional(Slot.START_DRY)
def start_dry(model: Model, data: Data, kappa: float) -> None:
    """All elements on the central path of kappa, at the present motion."""
    for k in range(model.dry_dof.shape[0]):
        _onto_path(data, k, kappa)


@optional(Slot.RESUME_DRY)
def resume_dry(model: Model, data: Data, kappa: float, predicted: bool) -> None:
    """All elements on the central path of kappa: at the motion of those that move, near the impulse of the others.

    predicted: the impulses that they have now, otherwise those kept in dry_trial.
    """
    for k in range(model.dry_dof.shape[0]):
        x, bound = data.dry_move[k, DryMove.MOTION], data.dry_move[k, DryMove.BOUND]
        z = data.dry[k]
        left = z[Dry.LEFT_FORWARD] if predicted else data.dry_trial[k, Dry.LEFT_FORWARD]
        if bound * abs(x) > kappa or not left > 0.0 or data.dry_drive[k, Drive.COMPLIANCE] > 0.0:
            _onto_path(data, k, kappa)
            continue
        left = min(max(left, _HELD * bound), (2.0 - _HELD) * bound)
        z[Dry.LEFT_FORWARD], z[Dry.LEFT_BACKWARD] = left, 2.0 * bound - left
        z[Dry.FORWARD], z[Dry.BACKWARD] = kappa / left, kappa / (2.0 * bound - left)


@optional(Slot.RETURN_DRY)
def return_dry(model: Model, data: Data, kappa: float) -> None:
    """The elements that left their cones put back onto the central path of kappa."""
    for k in range(model.dry_dof.shape[0]):
        left = False
        for j in range(4):
            left = left or data.dry[k, j] <= _LEFT * data.dry_trial[k, j]
        if left:
            _onto_path(data, k, kappa)


@optional(Slot.DRY_ERROR, default=0.0)
def dry_error(model: Model, data: Data) -> float:
    """Largest |f - b - h nu|, of a servo |f - b - h nu + r - e T|."""
    r = 0.0
    for k in range(model.dry_dof.shape[0]):
        r = max(r, abs(_gap(data, k)))
    return r


@kernel
def _gap(data: Data, k: int) -> float:
    """f - b - h nu + r - e T of element k."""
    z = data.dry[k]
    own = data.dry_drive[k, Drive.COMPLIANCE] * dry_impulse(data, k)
    return z[Dry.FORWARD] - z[Dry.BACKWARD] - data.dry_move[k, DryMove.MOTION] - own


@optional(Slot.DRY_LOAD, default=0.0)
def dry_load(model: Model, data: Data) -> float:
    """Sum of |lambda|."""
    total = 0.0
    for k in range(model.dry_dof.shape[0]):
        total += abs(dry_impulse(data, k))
    return total


@optional(Slot.APPLY_DRY)
def apply_dry(model: Model, data: Data, out: Vector) -> None:
    """out -= lambda.   out: (nv,)."""
    for k in range(model.dry_dof.shape[0]):
        out[model.dry_dof[k]] -= dry_impulse(data, k)


@optional(Slot.ADD_DRY_BLOCKS)
def add_dry_blocks(model: Model, data: Data, h: float) -> None:
    """joint_block += h/c on the diagonal."""
    for k in range(model.dry_dof.shape[0]):
        d = model.dry_dof[k]
        i = model.dof_body[d]
        n = model.body_vadr[i + 1] - model.body_vadr[i]
        a = d - model.body_vadr[i]
        data.joint_block[i, a * n + a] += h / dry_compliance(data, k)


@optional(Slot.DRY_CONSTANTS)
def dry_constants(model: Model, data: Data, target: NewtonTarget) -> None:
    """dnu += w, with d lambda = w - (h/c) d nu; w and the constant parts of df and db kept in dry_w."""
    for k in range(model.dry_dof.shape[0]):
        z, step = data.dry[k], data.carry.dry_step[k]
        parts = data.dry_w[k]
        for side in range(2):
            a, p = z[2 * side], z[2 * side + 1]
            r = target.kappa - a * p - target.corrected * step[2 * side] * step[2 * side + 1]
            parts[DryConstant.FORWARD + side] = r / p
        w = parts[DryConstant.FORWARD] - parts[DryConstant.BACKWARD] + target.gap_fraction * _gap(data, k)
        parts[DryConstant.IMPULSE] = w / dry_compliance(data, k)
        data.dnu[model.dry_dof[k]] += parts[DryConstant.IMPULSE]


@optional(Slot.RECOVER_DRY)
def recover_dry(model: Model, data: Data, h: float) -> None:
    """dry_step from dnu."""
    for k in range(model.dry_dof.shape[0]):
        z, step, w = data.dry[k], data.carry.dry_step[k], data.dry_w[k]
        change = w[DryConstant.IMPULSE] - h / dry_compliance(data, k) * data.dnu[model.dry_dof[k]]
        step[Dry.LEFT_FORWARD], step[Dry.LEFT_BACKWARD] = change, -change
        step[Dry.FORWARD] = w[DryConstant.FORWARD] - z[Dry.FORWARD] / z[Dry.LEFT_FORWARD] * change
        step[Dry.BACKWARD] = w[DryConstant.BACKWARD] + z[Dry.BACKWARD] / z[Dry.LEFT_BACKWARD] * change


@optional(Slot.KEEP_DRY)
def keep_dry(model: Model, data: Data) -> None:
    """Remember the variables from which the line search starts."""
    for k in range(model.dry_dof.shape[0]):
        for j in range(4):
            data.dry_trial[k, j] = data.dry[k, j]


@optional(Slot.MOVE_DRY)
def move_dry(model: Model, data: Data, alpha: float) -> None:
    """dry = kept + alpha step."""
    for k in range(model.dry_dof.shape[0]):
        for j in range(4):
            data.dry[k, j] = data.dry_trial[k, j] + alpha * data.carry.dry_step[k, j]


@optional(Slot.DRY_PRODUCTS, default=(0.0, 0.0))
def dry_products(model: Model, data: Data, kappa: float) -> tuple[float, float]:
    """Sum of the products, and their largest distance from kappa."""
    total, violation = 0.0, 0.0
    for k in range(model.dry_dof.shape[0]):
        for side in range(2):
            t = data.dry[k, 2 * side] * data.dry[k, 2 * side + 1]
            total += t
            violation = max(violation, abs(t - kappa))
    return total, violation


@optional(Slot.DRY_PRODUCTS_AHEAD, default=0.0)
def dry_products_ahead(model: Model, data: Data, alpha: float) -> float:
    """Sum of the products after a step of length alpha."""
    total = 0.0
    for k in range(model.dry_dof.shape[0]):
        z, d = data.dry[k], data.carry.dry_step[k]
        for j in range(0, 4, 2):
            total += (z[j] + alpha * d[j]) * (z[j + 1] + alpha * d[j + 1])
    return total


@optional(Slot.DRY_BOUNDARY, default=1e30)
def dry_boundary(model: Model, data: Data) -> float:
    """Largest step that keeps every variable positive, or 1e30."""
    a = 1e30
    for k in range(model.dry_dof.shape[0]):
        for j in range(4):
            a = min(a, orthant_step(data.dry[k, j], data.carry.dry_step[k, j]))
    return a


@optional(Slot.ADD_DRY_TIME_STEP)
def add_dry_time_step(model: Model, data: Data, h: float, w: float, col: int) -> None:
    """columns += w d lambda/dh where h nu and h v stay, F and M in proportion to h:

    c d lambda = b/(F - lambda) d(M + F) + f/(F + lambda) d(M - F) + the change of the drive
    """
    for k in range(model.dry_dof.shape[0]):
        z = data.dry[k]
        force, middle = model.dry_force[k], model.dry_middle[k]
        change = z[Dry.BACKWARD] / z[Dry.LEFT_BACKWARD] * (middle + force)
        change += z[Dry.FORWARD] / z[Dry.LEFT_FORWARD] * (middle - force)
        change += drive_by_time_step(model, data, h, k, dry_impulse(data, k))
        data.columns[model.dry_dof[k], col] += w * change / dry_compliance(data, k)


@optional(Slot.APPLY_FRICTION)
def apply_friction(model: Model, data: Data, out: Vector) -> None:
    """out -= lambda of dry friction, without servos, whose work is that of drives.   out: (nv,)."""
    for k in range(model.dry_dof.shape[0]):
        if model.dry_input[k] < 0:
            out[model.dry_dof[k]] -= dry_impulse(data, k)
