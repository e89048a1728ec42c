"""Servos: proportional and derivative feedback of every driven joint, at the rate of the calls."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.mpc.policy import Policy
from dojo_opt.planning.manifold import tangent_layout
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.model.model import InputKind
from sim.simulator.simulator import Simulator
from solvers.types import Integers, Vector

__all__ = ["ModelServo", "Servo"]

_CALL = "MPC(servo=...)"


class Servo:
    """Servos that follow the plan, which does not know them: kp (q_plan - q) + kd (v_plan - v), added to the inputs.

    The velocity of a state is the mean one over the interval before it, so that planned for a time is read half this
    interval later.

    Args:
        sim: simulator of the model.
        gains: (kp, kd), each a number or (nu,) [N/m, N m/rad; N s/m, N m s/rad].

    Raises:
        ValueError: gains of the wrong shape or below zero, or an input that drives no single coordinate.
    """

    def __init__(self, sim: Simulator, gains: tuple[ArrayLike, ArrayLike]) -> None:
        if not hasattr(gains, "__len__") or isinstance(gains, str) or len(gains) != 2:
            raise ValueError(f"{_CALL}: expected (kp, kd) or a Mechanism, got {gains!r}")
        self.kp, self.kd = (_gains(f"{_CALL}: {name}", k, sim.nu) for name, k in zip(("kp", "kd"), gains, strict=True))
        self._dof = driven(sim)
        self._sim = sim

    def __call__(self, policy: Policy, time: float, x: Vector) -> Vector:
        """The forces of the servos.

        Args:
            policy: the plan.
            time: the time [s].
            x: (nx,) measured state, with the velocity at that time.

        Returns:
            (nu,) forces [N, N m].
        """
        sim, at = self._sim, self._dof
        off = sim.difference(policy.state(time), x)[at]
        ahead = policy.state(time + 0.5 * sim.mean_over)[sim.nq + at]
        return np.asarray(self.kp * off + self.kd * (ahead - x[sim.nq + at]))


class ModelServo:
    """Servos that the plan knows: springs and dampers that the model has at its driven joints, and the robot has not.

        tau = u - kp (q - rest) - kd v

    An input u = kp (target - rest) + feedforward moves the target. The robot's actuators make the force tau, and their
    limits hold for all of it.

    Args:
        sim: simulator of the model.
        own: mechanism of the robot, with the same joints.

    Attributes:
        kp: (nu,) spring constants [N/m, N m/rad].
        kd: (nu,) dampers [N s/m, N m s/rad].
        rest: (nu,) coordinates at rest [m, rad].
        dof: (nu,) numbers of the driven degrees of freedom.
        place: (nu,) addresses of their coordinates in x.
        velocity: (nu,) addresses of their velocities in x.

    Raises:
        ValueError: the joints differ, the model has no spring and no damper more, or an input drives no single
            coordinate.
    """

    def __init__(self, sim: Simulator, own: Mechanism) -> None:
        mine = sim.mechanism
        if mine.joint_names != own.joint_names or [j.kind for j in mine.joints] != [j.kind for j in own.joints]:
            raise ValueError(f"{_CALL}: expected a mechanism with the joints of the model, got {own!r}")
        self.dof = driven(sim)
        self.kp, self.kd, self.rest = (_by_dof(mine, field)[self.dof] for field in ("spring", "damper", "rest"))
        self.kp -= _by_dof(own, "spring")[self.dof]
        self.kd -= _by_dof(own, "damper")[self.dof]
        if not (self.kp.any() or self.kd.any()):
            raise ValueError(f"{_CALL}: the model has no springs and dampers that this mechanism has not")
        self.place = _coordinates(sim, self.dof)
        self.velocity = sim.nq + self.dof

    def __call__(self, u: Vector, x: Vector) -> Vector:
        """The forces of the actuators.

        Args:
            u: (nu,) input of the model [N, N m].
            x: (nx,) measured state, with the velocity at that time.

        Returns:
            (nu,) forces [N, N m].
        """
        return np.asarray(u - self.kp * (x[self.place] - self.rest) - self.kd * x[self.velocity])


def driven(sim: Simulator, call: str = _CALL) -> Integers:
    """Numbers of the degrees of freedom that the inputs drive.

    Args:
        sim: the simulator.
        call: of which the message tells.

    Returns:
        (nu,) numbers below nv.

    Raises:
        ValueError: an input acts on a body.
    """
    on_body = np.flatnonzero(np.asarray(sim.model.input_kind) != InputKind.JOINT)
    if on_body.size:
        raise ValueError(f"{call}: every input has to drive a joint; input {on_body[0]} acts on a body")
    return np.asarray(sim.model.input_index)


def _coordinates(sim: Simulator, dofs: Integers) -> Integers:
    """Addresses in x of the coordinates of degrees of freedom, none of them a rotation by quaternion."""
    layout = tangent_layout(sim, sim.neutral())
    at = np.asarray(layout)[dofs]
    if np.any(at < 0):
        raise ValueError(f"{_CALL}: an input drives a rotation of a quaternion joint, which has no single coordinate")
    return at


def _by_dof(mechanism: Mechanism, field: str) -> Vector:
    """(nv,) spring constants, dampers or rests."""
    return np.concatenate([np.broadcast_to(getattr(joint, field), (joint.nv,)) for joint in mechanism.joints])


def _gains(call: str, value: Any, size: int) -> Vector:
    """A gain for each input."""
    given = checks.floats(call, value)
    if given.shape not in ((), (size,)) or not np.all(given >= 0.0):
        raise ValueError(f"{call}: expected a number >= 0, or {size} of them, got {value!r}")
    return np.array(np.broadcast_to(given, (size,)))
