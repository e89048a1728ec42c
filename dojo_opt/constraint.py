"""Constraints of a plan, met by an augmented Lagrangian with a multiplier and a penalty per entry.

Those in task space, from `CenterOfMass` to `Velocity`, are also costs: it depends on where they are given.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.component_names import chosen_components, chosen_inputs, component_name
from dojo_opt.planning.residual import ResidualKernels, check_residual
from dojo_opt.planning.task_space.body_tasks import CenterOfMass, Frame, Momentum, Point, Velocity
from dojo_opt.planning.task_space.contact_tasks import Clearance, ContactForce, FrictionUse, Slip, TorqueRate
from dojo_opt.planning.task_space.joint_limits import JointLimits
from dojo_opt.planning.term import (
    PeriodicTerm,
    Pick,
    PickTerm,
    ResidualTerm,
    Spec,
    StateTerm,
    Term,
    check_order,
    knot_list,
    numbers,
    state_table,
    table,
)
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from sim.simulator.simulator import Simulator
from solvers.types import Integers, Vector

__all__ = [
    "CenterOfMass",
    "Clearance",
    "ContactForce",
    "ControlBounds",
    "Frame",
    "FrictionUse",
    "Goal",
    "JointLimits",
    "Momentum",
    "Periodic",
    "Point",
    "ResidualConstraint",
    "Slip",
    "SpeedLimits",
    "StateBounds",
    "TorqueRate",
    "Velocity",
]


def __dir__() -> list[str]:
    return list(__all__)


@dataclass(frozen=True)
class Goal(Spec):
    """(x_t (-) target)_i = 0 for chosen tangent components i at chosen knots.

    Attributes:
        target: (nx,) state, or one row per knot.
        components: numbers of components, or names as in `Mechanism.components`: "base", "v knee" (default None: all).
        knots: numbers of the knots; negative ones count from the end (default -1: the last).
    """

    target: ArrayLike
    components: Any = None
    knots: Any = -1

    kind: ClassVar[str] = "constraint"  # alone

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        knots = knot_list("Goal(knots=...)", self.knots, horizon, last=True)
        target = state_table("Goal(target=...)", self.target, knots.size, sim.nx, layout)
        mask = np.zeros((knots.size, sim.ndx))
        mask[:, chosen_components("Goal(components=...)", self.components, sim)] = 1.0
        return StateTerm("Goal", knots, mask, target, layout)


def _bounds(call: str, lower: ArrayLike, upper: ArrayLike, rows: int, chosen: Integers) -> tuple[Any, Integers, Vector]:
    """Reference, repeated components and signs of  lower - z <= 0  and  z - upper <= 0, without infinite bounds."""
    columns = chosen.size
    with_inf = []
    for side, bound in (("lower", lower), ("upper", upper)):
        given = numbers(f"{call}({side}=...)", bound)
        if given.shape not in ((), (columns,), (rows, columns)):
            raise ValueError(f"{call}({side}=...): expected shape () or ({columns},), got {given.shape}")
        with_inf.append(np.broadcast_to(given, (rows, columns)))
    check_order(call, lower, upper, with_inf)
    keep = [np.any(np.isfinite(b), axis=0) for b in with_inf]
    reference = np.concatenate([b[:, k] for b, k in zip(with_inf, keep, strict=True)], axis=1)
    big = np.where(np.isfinite(reference), reference, np.sign(reference) * 1e100)
    sign = np.repeat([-1.0, 1.0], [int(k.sum()) for k in keep])
    return np.ascontiguousarray(big), np.concatenate([chosen[k] for k in keep]), sign


@dataclass(frozen=True)
class StateBounds(Spec):
    """lower <= component <= upper of chosen scalar tangent components at chosen knots.

    A rotation by quaternion has no such bounds.

    Attributes:
        lower: a number, one per component, or one row per knot; infinite where free [m, rad, m/s, rad/s].
        upper: likewise.
        components: numbers of components, or names as in `Mechanism.components`: "base z", "v knee" (default None:
            all).
        knots: numbers of the knots (default None: 1 to T).
    """

    lower: ArrayLike
    upper: ArrayLike
    components: Any = None
    knots: Any = None

    kind: ClassVar[str] = "constraint"  # alone

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        knots = knot_list("StateBounds(knots=...)", self.knots, horizon, last=True)
        knots = knots[knots > 0] if self.knots is None else knots
        chosen = chosen_components("StateBounds(components=...)", self.components, sim)
        reference, columns, sign = _bounds("StateBounds", self.lower, self.upper, knots.size, chosen)
        if np.any(layout[columns] < 0):
            bad = int(columns[layout[columns] < 0][0])
            name = component_name(sim, bad)
            raise ValueError(
                f"StateBounds(components=...): component {bad} ({name}) belongs to a quaternion, which has no bounds"
            )
        pick = Pick(True, layout[columns], columns, sign)
        return PickTerm("StateBounds", knots, np.ones_like(reference), reference, pick, one_sided=True)


@dataclass(frozen=True)
class SpeedLimits(Spec):
    """|v_i| <= share speed_i for the joints whose inputs have a largest speed, as a file gives it.

    Attributes:
        share: allowed share of that speed, above 0 (default 1). Of several inputs of one joint the slowest counts.
        knots: numbers of the knots (default None: 1 to T).
    """

    share: float = 1.0
    knots: Any = None

    kind: ClassVar[str] = "constraint"  # alone

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        mech, share = sim.mechanism, checks.number("SpeedLimits(share=...)", self.share, above=0.0)
        limited = [(i, i.joint) for i in mech.inputs or () if i.joint is not None and np.isfinite(i.speed)]
        if not limited:
            raise ValueError(f"SpeedLimits(): no input of {mech.name!r} has a largest speed; see Input(speed=...)")
        speeds: dict[int, float] = {}
        for i, joint in limited:
            dof = mech.v_slice(joint).start + i.dof
            speeds[dof] = min(speeds.get(dof, np.inf), share * i.speed)
        most = np.array(list(speeds.values()))
        return StateBounds(-most, most, mech.nv + np.array(list(speeds)), self.knots).bind(sim, horizon, layout)


@dataclass(frozen=True)
class ControlBounds(Spec):
    """lower <= u_i <= upper for chosen inputs at chosen knots, as a constraint of the augmented Lagrangian.

    `Problem(control_limits=...)` holds exactly at every iteration and is usually better. Use this one to bound single
    knots.

    Attributes:
        lower: a number, one per input, or one row per knot; infinite where free [N, N m].
        upper: likewise.
        components: numbers or names of inputs (default None: all).
        knots: numbers of the knots (default None: all T).
    """

    lower: ArrayLike
    upper: ArrayLike
    components: Any = None
    knots: Any = None

    kind: ClassVar[str] = "constraint"  # alone

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        del layout
        knots = knot_list("ControlBounds(knots=...)", self.knots, horizon, last=False)
        chosen = chosen_inputs("ControlBounds(components=...)", self.components, sim)
        reference, columns, sign = _bounds("ControlBounds", self.lower, self.upper, knots.size, chosen)
        pick = Pick(False, columns, sim.ndx + columns, sign)
        return PickTerm("ControlBounds", knots, np.ones_like(reference), reference, pick, one_sided=True)


@dataclass(frozen=True)
class ResidualConstraint(Spec):
    """r(x_t, u_t) = 0, or r <= 0, for a function of the user, which is compiled; see `dojo.cost.ResidualCost`.

    Attributes:
        function: the residual, a function of x (nx,), u (nu,) and out (dimension,).
        dimension: number of entries of the residual.
        equality: whether r = 0; with False, r <= 0 (default True).
        jacobian: function of x, u and out (dimension, ndx + nu), the derivative by the tangents (default None: central
            differences on the manifold).
        knots: numbers of the knots (default None: all T + 1).
    """

    function: Callable[..., Any]
    dimension: int
    equality: bool = True
    jacobian: Callable[..., Any] | None = None
    knots: Any = None

    kind: ClassVar[str] = "constraint"  # alone

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        equality = checks.flag("ResidualConstraint(equality=...)", self.equality)
        check_residual("ResidualConstraint", self.function, self.dimension, self.jacobian, sim)
        knots = knot_list("ResidualConstraint(knots=...)", self.knots, horizon, last=True)
        kernels = ResidualKernels(self.function, self.jacobian, sim.nu)
        weight = np.ones((knots.size, self.dimension))
        return ResidualTerm("ResidualConstraint", knots, weight, not equality, kernels, layout)


@dataclass(frozen=True)
class Periodic(Spec):
    """(x_T (-) (x_0 (+) shift))_i = 0 for chosen tangent components i, in problems whose start is free.

    Attributes:
        shift: a number, or (ndx,) displacement over one period, zero in the rotations by quaternion (default 0).
        components: numbers of components, or names as in `Mechanism.components` (default None: all).
    """

    shift: ArrayLike = 0.0
    components: Any = None

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        shift = table("Periodic(shift=...)", self.shift, 1, sim.ndx)[0]
        if np.any(shift[layout < 0]):
            raise ValueError("Periodic(shift=...): expected zeros for rotations by quaternion")
        mask = np.zeros((1, sim.ndx))
        mask[:, chosen_components("Periodic(components=...)", self.components, sim)] = 1.0
        return PeriodicTerm(sim, horizon, mask, shift, layout)
