"""Servo: proportional and derivative feedback of every driven joint to its planned motion, at the rate of the calls."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.mpc.policy import Policy
from sim.mechanism import checks
from sim.model.model import InputKind
from sim.simulator.simulator import Simulator

Vector = NDArray[np.float64]

__all__ = ["Servo"]


class Servo:
    """u = kp (q_plan - q) + kd (v_plan - v) on the coordinate that each input drives.

    The velocity of a state is the mean one over the interval before it, so that planned for a time is read half a step
    of the model later.

    Args:
        sim: simulator of the model.
        gains: (kp, kd), each a number or (nu,) [N/m, N m/rad; N s/m, N m s/rad].

    Raises:
        ValueError: gains of the wrong shape or below zero, or an input that drives no single coordinate.
    """

    def __init__(self, sim: Simulator, gains: tuple[ArrayLike, ArrayLike]) -> None:
        call = "MPC(servo=...)"
        if not hasattr(gains, "__len__") or len(gains) != 2:
            raise ValueError(f"{call}: expected (kp, kd), got {gains!r}")
        self.kp, self.kd = (_gains(f"{call}: {name}", k, sim.nu) for name, k in zip(("kp", "kd"), gains, strict=True))
        kinds = np.asarray(sim.model.input_kind)
        if np.any(kinds != InputKind.JOINT):
            raise ValueError(f"{call}: every input has to drive a joint; input {int(np.argmax(kinds != InputKind.JOINT))}"
                             " acts on a body")  # fmt: skip
        self._dof = np.asarray(sim.model.input_index)
        self._sim = sim

    def __call__(self, policy: Policy, time: float, x: Vector) -> Vector:
        """The torque of the servos.

        Args:
            policy: the plan.
            time: the time [s].
            x: (nx,) measured state, with the velocity at that time.

        Returns:
            (nu,) input [N, N m].
        """
        sim, at = self._sim, self._dof
        off = sim.difference(policy.state(time), x)[at]
        ahead = policy.state(time + 0.5 * sim.time_step)[sim.nq + at]
        return np.asarray(self.kp * off + self.kd * (ahead - x[sim.nq + at]))


def _gains(call: str, value: Any, size: int) -> Vector:
    """A gain for each input."""
    given = checks.floats(call, value)
    if given.shape not in ((), (size,)) or not np.all(given >= 0.0):
        raise ValueError(f"{call}: expected a number >= 0, or {size} of them, got {value!r}")
    return np.array(np.broadcast_to(given, (size,)))
