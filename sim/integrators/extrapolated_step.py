"""Extrapolation of steps of order 2: a step as a whole, in two parts and in three, to order 6.

    x = x3 + sum_k w_k (x_k - x3),     w = 1/24, -16/15, 81/40      x_k: the node after k parts
    e = |x - x',|                      x' = x2 + (x2 - x1)/3, of order 4

Aitken and Neville's weights for errors in even powers of the length (Hairer, Norsett, Wanner, II.9), which those of the
step are: it is symmetric. Dampers add odd powers; with them the order is 3, and e still nine times the error.
"""

from __future__ import annotations

from sim.dynamics.kinematics import displace
from sim.dynamics.state_manifold import configuration_difference
from sim.integrators.mean_velocity import close_node
from sim.integrators.node_step import begin_part, mean_of_node, node_of_mean, part_of, step_mean
from sim.integrators.substeps import Embedded, SubstepState
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.status import Status
from solvers.types import Matrix, Vector

PARTS = 3
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
        status = step_mean(model, data, part_of(goal, settings, h, 1), line.u, one, other, line.report)
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
    """`combine` from tables, without external wrenches.   ends: (3, nx); scratch: (2, nv)."""
    data = data_view(data_at)
    combine(model_view(model_at), data, (ends[0], ends[1], ends[2]), out, scratch[0], scratch[1])
