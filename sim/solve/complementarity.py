"""Complementarity of all active contacts and all limits: products, their violation, the step to the boundary."""

from __future__ import annotations

from sim.contact.contact_law import (
    contact_boundary,
    contact_products,
    contact_products_ahead,
    slip_violation,
)
from sim.model.columns import Bound
from sim.model.data import Data
from sim.model.model import Model
from solvers.compiler import kernel
from solvers.cones import orthant_step


@kernel
def products(model: Model, data: Data, kappa: float) -> tuple[float, float]:
    """Mean of all complementarity products, kappa where there is none, and their largest distance from kappa."""
    total = 0.0
    count = 0.0
    violation = 0.0
    for m in range(data.active_count[0]):
        c = data.active[m]
        t, n, low, high = contact_products(model, data, c)
        total += t
        count += n
        violation = max(violation, high - kappa, kappa - low)
    for k in range(model.limit_dof.shape[0]):
        t = data.bound[k, Bound.SLACK] * data.bound[k, Bound.IMPULSE]
        total += t
        count += 1.0
        violation = max(violation, abs(t - kappa))
    return total / count if count > 0.0 else kappa, violation


@kernel
def slip_error(model: Model, data: Data, kappa: float) -> float:
    """Largest violation of the friction law of the central path of kappa, in units of kappa."""
    e = 0.0
    for m in range(data.active_count[0]):
        c = data.active[m]
        e = max(e, slip_violation(model, data, c, kappa))
    return e


@kernel
def products_ahead(model: Model, data: Data, alpha: float) -> float:
    """Mean of the complementarity products after a step of length alpha, kappa where there is none."""
    total = 0.0
    count = 0.0
    for m in range(data.active_count[0]):
        c = data.active[m]
        t, n = contact_products_ahead(model, data, c, alpha)
        total += t
        count += n
    for k in range(model.limit_dof.shape[0]):
        b = data.bound[k]
        d = data.bound_step[k]
        total += (b[Bound.SLACK] + alpha * d[Bound.SLACK]) * (b[Bound.IMPULSE] + alpha * d[Bound.IMPULSE])
        count += 1.0
    return total / count if count > 0.0 else data.inactive_kappa[0]


@kernel
def boundary_step(model: Model, data: Data) -> float:
    """Largest step that keeps every cone variable in its cone, or 1e30."""
    a = 1e30
    for m in range(data.active_count[0]):
        c = data.active[m]
        a = min(a, contact_boundary(model, data, c))
    for k in range(model.limit_dof.shape[0]):
        b = data.bound[k]
        d = data.bound_step[k]
        a = min(a, orthant_step(b[Bound.SLACK], d[Bound.SLACK]), orthant_step(b[Bound.IMPULSE], d[Bound.IMPULSE]))
    return a
