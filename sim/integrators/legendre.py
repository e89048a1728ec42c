"""Derivatives of the velocity that corresponds to the momentum at the node of a state.

(M(q2) + C) v = p(q2, v15),    C: of dampers (dynamics/joints/damper.py), p: sim/derivatives/momentum_gradient.py
"""

from __future__ import annotations

from sim.derivatives.momentum_gradient import momentum_slopes
from sim.dynamics.energy import node_momentum, node_velocity
from sim.integrators.hamilton import momenta_of_velocity, place
from sim.integrators.hamilton_gradient import Slopes, slopes_at
from sim.model.layout import data_view, model_view
from solvers.compiler import Table, kernel
from solvers.types import Matrix, Vector


@kernel
def legendre_slopes(
    model_at: Table, data_at: Table, h: float, x: Vector, slopes: Slopes, p_q: Matrix, p_v: Matrix
) -> bool:  # fmt: skip
    """p_q, p_v of the state x = (q, v15), and in `slopes` those of M(q) v at its node; False when M is singular.

    The model is one of order 2, no root of which has the momenta of its tree.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    nq = data.theta1.shape[0]
    q, v = x[:nq], x[nq:]
    if not node_velocity(model, data, h, x):
        return False
    for d in range(v.shape[0]):
        data.nu_trial[d] = data.dnu[d]
        data.nu[d] = 0.0
    node_momentum(model, data, h, x, data.wrench)
    momentum_slopes(model, data, h, q, v, p_q, p_v)
    for k in range(nq):
        data.theta1[k] = q[k]
    place(model, data)
    momenta_of_velocity(model, data, data.nu_trial, data.rhs)
    for d in range(v.shape[0]):
        data.nu[d] = data.nu_trial[d]
    for i in range(data.balance.shape[0]):
        for k in range(6):
            data.balance[i, k] = 0.0
    return slopes_at(model, data, x[:0], slopes)
