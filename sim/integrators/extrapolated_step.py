"""Extrapolation of steps of order 2: a step as a whole and in two parts, to order 4; also in three, to order 6.

    x = x2 + (x2 - x1)/3                           of trees of joints, with contacts and limits, too

    x = x3 + sum_k w_k (x_k - x3),     w = 1/24, -16/15, 81/40      x_k: the node after k parts
    e = |x - x',|                      x' = x2 + (x2 - x1)/3, of order 4

Aitken and Neville's weights for errors in even powers of the length (Hairer, Norsett, Wanner, II.9), which those of the
step are: it is symmetric. Dampers add odd powers; with them the order is 3, and e still nine times the error.
"""

from __future__ import annotations

from sim.dynamics.kinematics import displace
from sim.dynamics.state_manifold import configuration_difference
from sim.integrators.mean_velocity import close_node
from sim.integrators.node_step import begin_part, followed, mean_of_node, node_of_mean, part_of, step_mean
from sim.integrators.slip_stop import friction_turn
from sim.integrators.substeps import Clock, Embedded, SubstepState
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.record_columns import ContactRow
from solvers.compiler import Table, kernel
from solvers.status import Status
from solvers.types import Matrix, Vector

PARTS = 3
# [m, rad] invisible error: the gap of a contact on the central path is no more exact, nor that of a loop
NOISE, CLOSED = 1e-10, 1e-12
_STRAIGHT = 3e-4  # [m, rad] the gap of a circle of 1 m differs by the square of a third of it
WEIGHTS = (1.0 / 24.0, -16.0 / 15.0, 81.0 / 40.0)

_SOLVED = int(Status.SOLVED)
_W1, _W2 = WEIGHTS[0], WEIGHTS[1]
_E1, _E2 = _W1 + 1.0 / 3.0, _W2 - 4.0 / 3.0  # of the difference of orders 6 and 4


@kernel
def combine(
    model: Model, data: Data, ends: tuple[Vector, Vector, Vector], out: Vector, one: Vector, two: Vector
) -> float:
    """out = x of the nodes (x1, x2, x3), closed along loops and gears; returns e of the coordinates, 1e300
    where these are singular.

    one, two: (nv,) scratch.
    """
    x1, x2, x3 = ends
    nq = data.theta1.shape[0]
    configuration_difference(model, x3[:nq], x1[:nq], one)
    configuration_difference(model, x3[:nq], x2[:nq], two)
    error = 0.0
    for d in range(one.shape[0]):
        error = max(error, abs(_E1 * one[d] + _E2 * two[d]))
        one[d] = _W1 * one[d] + _W2 * two[d]
        out[nq + d] = x3[nq + d] + _W1 * (x1[nq + d] - x3[nq + d]) + _W2 * (x2[nq + d] - x3[nq + d])
    displace(model, x3[:nq], one, 1.0, out[:nq])
    return error if close_node(model, data, out) else 1e300


@kernel
def combine_pair(model: Model, data: Data, x1: Vector, x2: Vector, out: Vector, scratch: Vector) -> None:
    """out = x2 + (x2 - x1)/3, of order 4, of nodes after one and two parts of a tree of joints.   scratch: (nv,)."""
    nq = data.theta1.shape[0]
    configuration_difference(model, x2[:nq], x1[:nq], scratch)
    for d in range(scratch.shape[0]):
        out[nq + d] = x2[nq + d] + (x2[nq + d] - x1[nq + d]) / 3.0
    displace(model, x2[:nq], scratch, -1.0 / 3.0, out[:nq])


@kernel
def raise_order(model: Model, data: Data, line: SubstepState, embedded: Embedded, accuracy: float) -> float:
    """The step of order 4 in line.trial, of the node line.node after it as a whole and line.trial after two halves;
    returns the error e = |q2 - q1|/2 of that of order 2 [m, rad].

    1e300 where it stays of order 2: with loops or gears, where friction turns, and where q1 and q2 are so far apart
    that gaps between them are no straight line.
    """
    if model.loop_ntrans.shape[0] + model.gear_dof.shape[0] > 0:
        return 1e300
    apart = 0.0
    for d in range(embedded.distance.shape[0]):
        apart = max(apart, abs(embedded.distance[d]))
    rough = max(friction_turn(line.parts, accuracy), (apart / _STRAIGHT) ** (1.0 / 3.0))
    line.clock[Clock.ROUGH] = rough
    if rough > 1.0:
        return 1e300
    combine_pair(model, data, line.node, line.trial, line.trial, embedded.rate)
    one, other, whole = line.parts[0], line.parts[1], line.parts[2]
    for c in range(line.slips.shape[0]):
        for k in range(ContactRow.POINT):
            other[c, k] += (one[c, k] + other[c, k] - whole[c, k]) / 3.0
        for k in range(ContactRow.MOMENT, other.shape[1]):
            other[c, k] += (one[c, k] + other[c, k] - whole[c, k]) / 3.0
    noise = NOISE if model.contact_body.shape[0] + model.limit_dof.shape[0] > 0 else CLOSED
    return max(0.5 * apart - noise, 0.0)


@kernel
def take_parts(model_at: Table, data_at: Table, h: float, line: SubstepState, options: tuple[Vector, Vector]) -> int:
    """line.ahead = the node after three steps of length h from line.x; the Status.   options: (goal, settings)."""
    model, data = model_view(model_at), data_view(data_at)
    goal, settings = options
    begin_part(data, line.wrench)
    status = mean_of_node(model_at, data_at, h, line.u, line.x, line.mean)
    begin_part(data, line.wrench)
    one, other = line.mean, line.half
    for _ in range(PARTS):
        if status != _SOLVED:
            return status
        guess = followed(data, one)
        status = step_mean(model, data, part_of(goal, settings, h, 1), line.u, one, guess, other, line.report)
        one, other = other, one
    return node_of_mean(model, data, h, line.u, one, line.ahead) if status == _SOLVED else status


@kernel
def extrapolate(
    model_at: Table,
    data_at: Table,
    settings: Vector,
    goal: Vector,
    line: SubstepState,
    embedded: Embedded,
    h: float,
) -> float:
    """line.ahead = the extrapolated node, of line.node, line.trial and three parts; e [m, rad], 1e300 if it fails."""
    if take_parts(model_at, data_at, h / PARTS, line, (goal, settings)) != _SOLVED:
        return 1e300
    model, data = model_view(model_at), data_view(data_at)
    ends = line.node, line.trial, line.ahead
    return combine(model, data, ends, line.ahead, embedded.distance, embedded.rate)


@kernel
def combined_at(model_at: Table, data_at: Table, ends: Matrix, out: Vector, scratch: Matrix) -> None:
    """`combine` of three nodes, `combine_pair` of two, from tables.   ends: (3 or 2, nx); scratch: (2, nv)."""
    data = data_view(data_at)
    if ends.shape[0] == 2:
        combine_pair(model_view(model_at), data, ends[0], ends[1], out, scratch[0])
        return
    combine(model_view(model_at), data, (ends[0], ends[1], ends[2]), out, scratch[0], scratch[1])
