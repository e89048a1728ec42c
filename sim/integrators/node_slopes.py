"""Derivatives of the conversions at both ends of a step from node to node (node_step.py).

    (M(q) + C) v = p(q, v'; h) + s h/2 f(q, u)       s = -1 where a step begins, 1 where it ends; C: of dampers

v': mean velocity of the state, f: generalized forces of inputs and external wrenches. Derivatives of p:
sim/derivatives/momentum_gradient.py.
"""

from __future__ import annotations

from sim.dynamics.external_forces import outer_wrenches, set_external
from sim.integrators.hamilton import momenta_of_velocity, place
from sim.integrators.hamilton_gradient import Slopes, slopes_at
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.dense import clear
from solvers.types import Cube, Matrix, Vector


@kernel
def _evaluate(model: Model, data: Data, x: Vector, wrenches: Cube, moving: bool) -> None:
    """Configuration 2 and momenta of the node x = (q, v), or at rest there, and the wrenches (1 or 0, nbody, 6)."""
    nq = data.theta1.shape[0]
    for k in range(nq):
        data.theta1[k] = x[k]
    place(model, data)
    for d in range(data.nu.shape[0]):
        data.nu_trial[d] = data.nu[d] = x[nq + d] if moving else 0.0
    momenta_of_velocity(model, data, data.nu_trial, data.rhs)
    clear(data.balance)
    set_external(data, wrenches, 0)


@kernel
def node_slopes(
    model_at: Table, data_at: Table, u: Vector, wrench: Cube, x: Vector, out: Slopes, f_q: Matrix
) -> bool:  # fmt: skip
    """Of the node x = (q, v): out.p_q, out.p_v of M(q) v; f_q, and out.f_u, of the forces of inputs and wrenches.

    f_q: (nv, nv), those with the forces less those without, both at rest; False where M is singular.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    for k in range(3):
        data.origin[k] = 0.0
    _evaluate(model, data, x, wrench[:0], False)
    outer_wrenches(model, data, u[:0], data.balance)
    if not slopes_at(model, data, u[:0], out):
        return False
    for d in range(f_q.shape[0]):
        for k in range(f_q.shape[1]):
            f_q[d, k] = -out.f_q[d, k]
    _evaluate(model, data, x, wrench, False)
    outer_wrenches(model, data, u, data.balance)
    if not slopes_at(model, data, u, out):
        return False
    for d in range(f_q.shape[0]):
        for k in range(f_q.shape[1]):
            f_q[d, k] += out.f_q[d, k]
    _evaluate(model, data, x, wrench[:0], True)
    return slopes_at(model, data, u, out)
