"""Complementarity of all active contacts and all limits: products, their violation, the step to the boundary."""

from __future__ import annotations

from sim.contact.active_contacts import contacts_boundary, contacts_products, contacts_products_ahead
from sim.dynamics.joints.dry_friction import dry_boundary, dry_products, dry_products_ahead
from sim.model.data import Data
from sim.model.model import Model
from sim.model.record_columns import Bound
from solvers.compiler import kernel
from solvers.cones import orthant_step


@kernel
def products(model: Model, data: Data, kappa: float) -> tuple[float, float]:
    """Mean of all complementarity products, kappa where there is none, and their largest distance from kappa."""
    total, count, violation = contacts_products(model, data, kappa)
    for k in range(model.limit_dof.shape[0]):
        t = data.bound[k, Bound.SLACK] * data.bound[k, Bound.IMPULSE]
        total += t
        count += 1.0
        violation = max(violation, abs(t - kappa))
    dry, worst = dry_products(model, data, kappa)
    total, count, violation = total + dry, count + 2.0 * model.dry_dof.shape[0], max(violation, worst)
    return total / count if count > 0.0 else kappa, violation


@kernel
def products_ahead(model: Model, data: Data, alpha: float) -> float:
    """Mean of the complementarity products after a step of length alpha, kappa where there is none."""
    total, count = contacts_products_ahead(model, data, alpha)
    for k in range(model.limit_dof.shape[0]):
        b = data.bound[k]
        d = data.carry.bound_step[k]
        total += (b[Bound.SLACK] + alpha * d[Bound.SLACK]) * (b[Bound.IMPULSE] + alpha * d[Bound.IMPULSE])
        count += 1.0
    total, count = total + dry_products_ahead(model, data, alpha), count + 2.0 * model.dry_dof.shape[0]
    return total / count if count > 0.0 else data.carry.inactive_kappa[0]


@kernel
def boundary_step(model: Model, data: Data) -> float:
    """Largest step that keeps every cone variable in its cone, or 1e30."""
    a = min(contacts_boundary(model, data), dry_boundary(model, data))
    for k in range(model.limit_dof.shape[0]):
        b = data.bound[k]
        d = data.carry.bound_step[k]
        a = min(a, orthant_step(b[Bound.SLACK], d[Bound.SLACK]), orthant_step(b[Bound.IMPULSE], d[Bound.IMPULSE]))
    return a
