"""What a step leaves out of its solver because it is far, and from how far on: far.py and limits.py, for people."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.far import STIFFNESS
from sim.mechanism import Mechanism
from sim.model import Model
from sim.results import SimulationError
from solvers.status import MESSAGES

if TYPE_CHECKING:
    from sim.simulator import Simulator


class LeftOut(NamedTuple):
    """Names of what is far. Its forces act all the same: given by the law of the central path, not solved for."""

    contacts: tuple[str, ...]
    limits: tuple[str, ...]


def left_out(sim: Simulator, x: ArrayLike, u: ArrayLike | None) -> LeftOut:
    """What the step from x under u leaves out.  SimulationError: the step cannot be solved."""
    result = sim.step(x, u)
    if not result.success:
        raise SimulationError(f"Simulator.left_out: {MESSAGES[result.status]}", result.status)
    contacts, limits = sim._calls.far()
    names = limit_names(sim.mechanism, sim.model)
    return LeftOut(
        tuple(name for name, far in zip(sim.mechanism.contact_names, contacts, strict=True) if far),
        tuple(name for name, far in zip(names, limits, strict=True) if far),
    )


def limit_names(mechanism: Mechanism, model: Model) -> list[str]:
    """A name for every bound: its joint, the degree of freedom where there are several, and its side."""
    names = []
    for dof, sign in zip(model.limit_dof, model.limit_sign, strict=True):
        body = int(model.dof_body[dof])
        count = int(model.body_vadr[body + 1] - model.body_vadr[body])
        which = f"[{int(dof - model.body_vadr[body])}]" if count > 1 else ""
        names.append(f"{mechanism.joint_names[body]}{which} {'lower' if sign > 0 else 'upper'}")
    return names


def reach(model: Model, time_step: float, kappa: float, tolerance: float) -> NDArray[np.float64]:
    """Gap from which on each contact of a body at rest is left out, (ncontact,) [m].

    Twice the positive root a of the bound in far.py:

    1000 tolerance a^2 = n kappa ((mu^2 + h (1 + mu)) M + h (1 + mu) T a)
    """
    out = np.zeros(len(model.contact_body))
    for first in np.flatnonzero(model.cluster_end):
        _, _, _, _, _, mobility, mu, turn = model.cluster[first]
        share = len(out) * kappa / (STIFFNESS * tolerance)
        b, c = share * time_step * (1.0 + mu) * turn, share * (mu * mu + time_step * (1.0 + mu)) * mobility
        out[first : model.cluster_end[first]] = b + np.sqrt(b * b + 4.0 * c)
    return out
