"""JointLimits: the limits of the joints of a mechanism as a cost or a constraint of a plan."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from dojo_opt.planning.term import Pick, PickTerm, Spec, Term, knot_list
from sim.mechanism import checks
from sim.mechanism.short_repr import short_repr
from sim.simulator.simulator import Simulator
from solvers.types import Integers


@dataclass(frozen=True)
class JointLimits(Spec):
    """lower + margin <= q_i <= upper - margin for the joints that have limits.

    The simulator enforces the limits of a mechanism anyway, by impulses of its joints. This term keeps the plan away
    from them; in costs, the square of the excess counts.

    Attributes:
        margin: distance from the limits [m, rad] (default 0).
        joints: names of joints (default None: all that have limits).
        weight: of squares of the excess [1/m^2, 1/rad^2] (default 1).
        knots: numbers of the knots (default None: 1 to T).
    """

    margin: float = 0.0
    joints: Any = None
    weight: float = 1.0
    knots: Any = None

    __repr__ = short_repr

    def bind(self, sim: Simulator, horizon: int, layout: Integers) -> Term:
        knots = knot_list("JointLimits(knots=...)", self.knots, horizon, last=True)
        knots = knots[knots > 0] if self.knots is None else knots
        margin = checks.number("JointLimits(margin=...)", self.margin)
        weight = checks.number("JointLimits(weight=...)", self.weight, at_least=0.0)
        mech = sim.mechanism
        limited = {j.name: j for j in mech.joints if j.limits and np.isfinite(j.limits).any()}
        wanted = (self.joints,) if isinstance(self.joints, str) else self.joints
        words = limited if wanted is None else checks.names("JointLimits(joints=...)", wanted)
        names = [checks.one_of("JointLimits(joints=...)", name, limited) for name in words]
        if not names:
            raise ValueError(f"JointLimits(): no joint of {mech.name!r} has limits")
        columns, signs, bounds = [], [], []
        for name in names:
            first = mech.v_slice(name).start
            for k, pair in enumerate(np.asarray(limited[name].limits, dtype=float)):
                if pair[0] + margin > pair[1] - margin:
                    raise ValueError(f"JointLimits(margin=...): {margin:g} exceeds half the range of {name!r}")
                for sign, bound in zip((-1.0, 1.0), pair, strict=True):
                    if np.isfinite(bound):
                        columns.append(first + k)
                        signs.append(sign)
                        bounds.append(bound - sign * margin)
        chosen = np.array(columns)
        reference = np.tile(bounds, (knots.size, 1))
        pick = Pick(True, layout[chosen], chosen, np.array(signs))
        return PickTerm("JointLimits", knots, np.full(reference.shape, weight), reference, pick, one_sided=True)
