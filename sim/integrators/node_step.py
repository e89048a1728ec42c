"""Steps of order 2 from node to node: states x = [q; v] with v = M(q)^-1 p of the node, for steps of any length.

    p(q2, v15; h)  = (M(q2) + C) v2 - h/2 f(q2)            p: momentum of a state with its mean velocity v15
    v25            = that of a step (step.py) from (q2, v15)
    (M(q3) + C) v3 = p(q3, v25; h) + h/2 f(q3)            C: of dampers (dynamics/joints/damper.py)

of which closed loops and gears take the part across them, in the metric of M + C (dynamics/loops/loop_velocity.py):
half of their impulse at a node belongs to each of its steps.

f: generalized forces of inputs and external wrenches. The step lets all their impulse h f act at its first node; half
of it belongs to its last, as of the impulse of dampers. So steps of different lengths follow one another at second
order, and without these forces momentum carries over unchanged.

Impulses of contacts are not shared: p(q3, v25; h) is the momentum before the ground acts at the node. The step that
begins there makes up for the gravity of both its halves, whatever their lengths.
"""

from __future__ import annotations

from sim.contact.contact_law import scale_contact
from sim.dynamics.elimination import add_children, dot_six
from sim.dynamics.energy import solve_mass_matrix
from sim.dynamics.external_forces import input_wrench, set_external
from sim.dynamics.loops.loop_velocity import close_velocity
from sim.integrators.mean_velocity import close_interval
from sim.integrators.rollout import begin
from sim.integrators.substeps import AccuracyGoal
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import InputKind, Model
from sim.model.options import Guess, StepOptions
from sim.model.record_columns import Bound, StepReport, StepSetting
from sim.solve.start_velocity import meet_momentum, momentum_error, momentum_of_velocity
from sim.step import step
from solvers.compiler import Table, kernel
from solvers.dense import copy_vector
from solvers.status import Status
from solvers.types import Cube, Vector

_SOLVED = int(Status.SOLVED)
_SINGULAR = int(Status.SINGULAR)


@kernel
def begin_part(data: Data, wrench: Cube) -> None:
    """Forget the step before, but for the external wrenches (1 or 0, nbody, 6)."""
    begin(data)
    set_external(data, wrench, 0)


@kernel
def add_forces(model: Model, data: Data, h: float, u: Vector, out: Vector) -> None:
    """out += h f: generalized forces of inputs and external wrenches at configuration 2 in `data`.   out: (nv,)."""
    F = data.balance
    for i in range(model.body_parent.shape[0]):
        e, o = data.carry.external[i], data.origin
        x, y, z = data.pos2[i, 0] - o[0], data.pos2[i, 1] - o[1], data.pos2[i, 2] - o[2]
        for k in range(6):
            F[i, k] = e[k]
        F[i, 3] += y * e[2] - z * e[1]
        F[i, 4] += z * e[0] - x * e[2]
        F[i, 5] += x * e[1] - y * e[0]
    for j in range(u.shape[0]):
        i = model.input_index[j]
        if model.input_kind[j] == InputKind.JOINT:
            out[i] += h * model.input_wrench[j, 0] * u[j]
            continue
        w = data.wrench[0]
        input_wrench(model, data, j, w)
        for k in range(6):
            F[i, k] += u[j] * w[k]
    add_children(model, F)
    for d in range(out.shape[0]):
        out[d] += h * dot_six(data.S2[d], F[model.dof_body[d]])


@kernel
def mean_of_node(model_at: Table, data_at: Table, h: float, u: Vector, x: Vector, mean: Vector) -> int:
    """mean = (q, v15) of the node x = (q, v), for a step of length h from there; returns the Status.

    data.carry.external: external wrenches.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    nq = data.theta1.shape[0]
    copy_vector(x, mean)
    momentum_error(model, data, h, x, x[nq:], data.residual)  # for the poses
    momentum_of_velocity(model, data, h, x[nq:], data.nu)
    add_forces(model, data, -0.5 * h, u, data.nu)
    status = meet_momentum(model, data, h, mean)
    return close_interval(model, data, h, mean) if status == _SOLVED else status


@kernel
def node_of_mean(model: Model, data: Data, h: float, u: Vector, mean: Vector, x: Vector) -> int:
    """x = (q, v) of the node at the end of a step of length h to mean = (q, v25); returns the Status."""
    nq = data.theta1.shape[0]
    for d in range(data.rhs.shape[0]):
        data.rhs[d] = 0.0
    momentum_error(model, data, h, mean, data.rhs, data.residual)
    add_forces(model, data, 0.5 * h, u, data.residual)
    if not solve_mass_matrix(model, data, h, data.residual, data.dnu):
        return _SINGULAR
    close_velocity(model, data, h, mean[:nq], mean[nq:], data.dnu)
    for k in range(nq):
        x[k] = mean[k]
    for d in range(data.dnu.shape[0]):
        x[nq + d] = data.dnu[d]
    return _SOLVED


@kernel
def hands_on(model: Model) -> bool:
    """Whether steps start near others of the same node: not with loops, gears and pairs of bodies, where the whole step
    and its halves might end in different solutions.
    """
    return model.loop_ntrans.shape[0] + model.gear_dof.shape[0] + model.pair_kind.shape[0] == 0


@kernel
def part_of(goal: Vector, settings: Vector, h: float, parts: int) -> StepOptions:
    """Options of a step of length h: kappa in proportion to it, so that contacts press with the same force.

    parts: into which the same step is also divided: then they have the same gaps, even with the least kappa.

    goal: as in adaptive.py.
    """
    kappa = max(settings[StepSetting.KAPPA] * h / goal[AccuracyGoal.TIME_STEP], parts * goal[AccuracyGoal.LEAST_KAPPA])
    return StepOptions(
        h,
        kappa,
        settings[StepSetting.TOLERANCE],
        int(settings[StepSetting.MAX_ITERATIONS]),
        settings[StepSetting.GAIN],
        settings[StepSetting.LOSS],
        settings[StepSetting.CUTOFF],
        settings[StepSetting.LEFT],
    )


@kernel
def within(options: StepOptions, most: int, share: float) -> StepOptions:
    """The options with at most so many iterations, and a share of the tolerance."""
    iterations, tolerance = min(options.max_iterations, most), share * options.tolerance
    o = options
    return StepOptions(o.h, o.kappa, tolerance, iterations, o.gain, o.loss, o.cutoff, o.left)


@kernel
def step_mean(
    model: Model, data: Data, options: StepOptions, u: Vector, mean: Vector, guess: Guess, out: Vector, report: Vector
) -> int:
    """out = (q, v25) one step after mean = (q, v15); the Status. Iterations are added up, the rest is the largest."""
    iterations = report[StepReport.ITERATIONS]
    residual, violation = report[StepReport.RESIDUAL], report[StepReport.VIOLATION]
    status = step(model, data, options, mean, u, guess, out, report)
    report[StepReport.ITERATIONS] += iterations
    report[StepReport.RESIDUAL] = max(report[StepReport.RESIDUAL], residual)
    report[StepReport.VIOLATION] = max(report[StepReport.VIOLATION], violation)
    return status


@kernel
def followed(data: Data, mean: Vector) -> Guess:
    """Guess of a step after mean = (q, v15): its velocity, with the impulses of the step before where there is one."""
    return Guess(mean[data.theta1.shape[0] :], data.carry.steps[0] > 0)


@kernel
def scale_impulses(model: Model, data: Data, ratio: float) -> None:
    """Impulses of the last step times the ratio of lengths: those of a step in which the same forces act."""
    for c in range(data.cone.shape[0]):
        scale_contact(model, data, c, ratio)
    for k in range(data.bound.shape[0]):
        data.bound[k, Bound.IMPULSE] *= ratio


@kernel
def begin_work(data_at: Table, wrench: Cube) -> None:
    """`begin_part` from a table."""
    begin_part(data_view(data_at), wrench)


@kernel
def node_at(model_at: Table, data_at: Table, h: float, u: Vector, mean: Vector, x: Vector) -> int:
    """`node_of_mean` from tables."""
    return node_of_mean(model_view(model_at), data_view(data_at), h, u, mean, x)
