"""Dampers: weights of the velocities before and after a configuration, by which a damper is of second order.

    impulse = h d nu - lag (nu - v),      lag = 3 h d/(6 + z + z^2),      z = h d/I

v, nu: velocities of the intervals 1-2 and 2-3; I: the inertia that the damper sees, a constant of the mechanism
(mechanism/damper_inertia.py). Where h d is small beside I the lag is h d/2, and the damper acts on the mean of both
velocities: the trapezoidal rule. Where h d is large it acts on nu, as in the implicit method of Euler. A body of the
inertia I, with nothing but the damper, slows down by

    nu/v = (6 - 2 z + z^2)/(6 + 4 z + 2 z^2 + z^3)

in a step: exp(-z) to third order, positive for every z, and zero in the limit.

The lag is at most h d/2. With a = h d/2 - lag >= 0 the impulse is h d (v + nu)/2 + a (nu - v): a damper that takes
h d |v + nu|^2/4, and a rotor of inertia a, which keeps its share. So kinetic energy and a v^2/2 together only fall,
whatever h, d and I are.

In all a damper takes d times the way of a body from it, if the momentum of the body at a node is I v - lag v, with
half the impulse behind it. The velocity of the node is that of this momentum, I v2 = (I - lag) v, written such that the
mass matrix M may be any, also one beside which the lag is large:

    (M + C) v2 = p,    C = 3 h d/(6 - 2 z + z^2)        p: momentum that arrives (energy.py)
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
