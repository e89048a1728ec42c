"""Costs of a plan. All are weighted squares of residuals, so Gauss-Newton is exact for linear ones.

Weights multiply squares without a factor 1/2: a cost is `scale * sum w r^2`. Use `scale=0.5` for the other convention.

Those in task space, from `CenterOfMass` to `Velocity`, are also constraints: it depends on where they are given.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.planning.component_names import input_weight, state_weight
from dojo_opt.planning.residual import ResidualKernels, check_residual
from dojo_opt.planning.task_space.body_tasks import CenterOfMass, Frame, Momentum, Point, Velocity
from dojo_opt.planning.task_space.contact_tasks import Clearance, ContactForce, FrictionUse, Slip, TorqueRate
from dojo_opt.planning.task_space.joint_limits import JointLimits
from dojo_opt.planning.term import Pick, PickTerm, ResidualTerm, Spec, StateTerm, Term, knot_list, state_table, table
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from sim.simulator.simulator import Simulator
from solvers.types import Integers

__all__ = [
    "CenterOfMass",
    "Clearance",
    "ContactForce",
    "Effort",
    "Frame",
    "FrictionUse",
    "JointLimits",
    "Momentum",
    "Point",
    "ResidualCost",
    "Slip",
    "Spec",
    "TorqueRate",
    "Tracking",
    "Velocity",
]


def __dir__() -> list[str]:
    return list(__all__)


def _checked_weight(call: str, value: ArrayLike, rows: int, columns: int, scale: float) -> NDArray[np.float64]:
    """scale * value as a table (rows, columns) of numbers >= 0."""
    weight = table(f"{call}(weight=...)", value, rows, columns)
    if np.any(weight < 0.0):
        raise ValueError(f"{call}(weight=...): expected no negative weight, got {weight.min():g}")
    return checks.number(f"{call}(scale=...)", scale, at_least=0.0) * weight


@dataclass(frozen=True)
class Tracking(Spec):
    """Track states: scale * sum_t sum_i weight_ti (x_t (-) reference_t)_i^2, tangent to the manifold.

    Rotations by quaternion enter as rotation vectors.

    Attributes:
        reference: (nx,) state, or one row per knot.
        weight: a number, (ndx,), or one row per knot [1 / square of the component's unit]; or a dict keyed by names as
            in `Mechanism.components`, such as {"base": 10.0, "v": 0.1}. Components without a name in it weigh zero, and
            later names override earlier ones.
        knots: numbers of the knots (default None: all T + 1).
        scale: factor of the whole cost (default 1).
    """

    reference: ArrayLike
    weight: ArrayLike | Mapping[str, ArrayLike]
    knots: Any = None
    scale: float = 1.0

    kind: ClassVar[str] = "cost"  # alone

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        knots = knot_list("Tracking(knots=...)", self.knots, horizon, last=True)
        reference = state_table("Tracking(reference=...)", self.reference, knots.size, sim.nx, layout)
        named = state_weight("Tracking(weight=...)", self.weight, sim)
        weight = _checked_weight("Tracking", named, knots.size, sim.ndx, self.scale)
        return StateTerm("Tracking", knots, weight, reference, layout)


@dataclass(frozen=True)
class Effort(Spec):
    """Cost of inputs: scale * sum_t sum_i weight_ti (u_t - reference_t)_i^2.

    Attributes:
        weight: a number, (nu,), (T, nu), or a dict keyed by names of inputs [1/N^2, 1/(N m)^2].
        reference: (nu,) or (T, nu) inputs [N, N m] (default 0).
        scale: factor of the whole cost (default 1).
    """

    weight: ArrayLike | Mapping[str, float]
    reference: ArrayLike = 0.0
    scale: float = 1.0

    kind: ClassVar[str] = "cost"  # alone

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        del layout
        knots = np.arange(horizon)
        reference = table("Effort(reference=...)", self.reference, horizon, sim.nu)
        named = input_weight("Effort(weight=...)", self.weight, sim)
        weight = _checked_weight("Effort", named, horizon, sim.nu, self.scale)
        pick = Pick(False, np.arange(sim.nu), sim.ndx + np.arange(sim.nu), np.ones(sim.nu))
        return PickTerm("Effort", knots, weight, reference, pick)


@dataclass(frozen=True)
class ResidualCost(Spec):
    """scale * sum_t sum_i weight_ti r_i(x_t, u_t)^2 for a function of the user, which is compiled (see `dojo.jit`).

        def residual(x, u, out): ...                          # writes all of out, (dimension,)

    The loop over the knots is compiled once (about a second) and kept on disk, see `dojo.jit`. At the final knot u is
    zero. x and u are read-only.

    Attributes:
        function: the residual, a function of x (nx,), u (nu,) and out (dimension,).
        dimension: number of entries of the residual.
        weight: a number, (dimension,), or one row per knot (default 1).
        jacobian: function of x, u and out (dimension, ndx + nu), the derivative by the tangents (default None: central
            differences on the manifold).
        knots: numbers of the knots (default None: all T + 1).
        scale: factor of the whole cost (default 1).
    """

    function: Callable[..., Any]
    dimension: int
    weight: ArrayLike = 1.0
    jacobian: Callable[..., Any] | None = None
    knots: Any = None
    scale: float = 1.0

    kind: ClassVar[str] = "cost"  # alone

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        check_residual("ResidualCost", self.function, self.dimension, self.jacobian, sim)
        knots = knot_list("ResidualCost(knots=...)", self.knots, horizon, last=True)
        weight = _checked_weight("ResidualCost", self.weight, knots.size, self.dimension, self.scale)
        kernels = ResidualKernels(self.function, self.jacobian, sim.nu)
        return ResidualTerm("ResidualCost", knots, weight, False, kernels, layout)
