"""Dampers: weights of the velocities before and after a configuration, by which a damper is of second order.

    impulse = h d nu - lag (nu - v),      lag = 3 h d/(6 + z + z^2),      z = h d/I
    (M + C) v2 = p,                       C = 3 h d/(6 - 2 z + z^2)

v, nu: velocities of the intervals 1-2 and 2-3; v2: velocity of the node, p: momentum that arrives there (energy.py);
I: the inertia that the damper sees, a constant of the mechanism (mechanism/damper_inertia.py).
Derivation: docs/theory/dampers.md.
"""

from __future__ import annotations

from sim.model.layout import model_view
from sim.model.model import Model
from solvers.compiler import Table, kernel
from solvers.types import Vector


@kernel
def damper_lag(model: Model, h: float, d: int) -> float:
    """Weight of v in the impulse of the damper of a degree of freedom, less in that of nu [kg, kg m^2]."""
    y = h * model.dof_damper[d]
    if y == 0.0:
        return 0.0
    z = y / model.dof_seen[d]
    return 3.0 * y / (6.0 + z * (1.0 + z))


@kernel
def damper_impulse(model: Model, h: float, d: int, nu: float, v: float) -> float:
    """h d nu - lag (nu - v) [N s, N m s]."""
    return h * model.dof_damper[d] * nu - damper_lag(model, h, d) * (nu - v)


@kernel
def node_damping(model: Model, h: float, d: int) -> float:
    """C of a degree of freedom, about half of h d [kg, kg m^2]; h: length of the interval that ends at the node."""
    y = h * model.dof_damper[d]
    if y == 0.0:
        return 0.0
    z = y / model.dof_seen[d]
    return 3.0 * y / (6.0 + z * (z - 2.0))


@kernel
def node_dampings(model_at: Table, h: float, out: Vector) -> None:
    """out = C of all degrees of freedom.   out: (nv,)."""
    model = model_view(model_at)
    for d in range(out.shape[0]):
        out[d] = node_damping(model, h, d)


@kernel
def lag_rates(model: Model, h: float, d: int) -> tuple[float, float]:
    """Derivatives of the lag: by h d, and by I times -1.

    With the lag h d g(z), g = 3/(6 + z + z^2) and g' = -3 (1 + 2 z)/(6 + z + z^2)^2, these are g + z g' and z^2 g'.
    """
    z = h * model.dof_damper[d] / model.dof_seen[d]
    below = 6.0 + z * (1.0 + z)
    slope = -3.0 * (1.0 + 2.0 * z) / below / below
    return 3.0 / below + z * slope, z * z * slope
