"""Gait: a reference motion of a legged robot, with its contact schedule and the torques of inverse dynamics."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from dojo_opt.gaits.equilibrium import at_rest_on_ground, least_pushes
from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.static_motions import input_map
from sim.mechanism import checks
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.memory_limit import check_room
from sim.mechanism.servos import passive
from sim.mechanism.short_repr import short_repr
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Flags, Floats

__all__ = ["Gait"]

_ALOFT = 100.0  # [m] where no foot feels the ground
_FAR = 1e3  # [rad, m] where no joint feels its stops
_LONGEST = 100_000  # time steps: half an hour at 20 ms, whose inverse kinematics take seconds
_SAME = 1e-9  # share of a time step by which equal ones may differ
_STILL = 1e-9  # [m/s, rad/s] velocities of states at rest
_JOINED = 1e-3  # [m, rad] between the ends of two motions that follow one another
_EVEN = 1e-4  # weight of small foot forces against the balance of the base


@dataclass(frozen=True)
class Gait:
    """A motion along the time steps of a simulator. It is a reference: feet and base are consistent, but forces may not
    be.

    The velocity of row t is that of the interval from t - 1 to t, as in every state of order 2. x[0] has that of the
    interval before the motion, which for a periodic gait is the last one of a period. For a simulator whose states have
    the velocity at the node, it is the mean of those of the intervals before and after the row. With orders 4 to 8,
    `stand` has the velocity before the ground acts, as states at rest on the ground have: see Simulator.

    Attributes:
        name: name of the gait.
        simulator: simulator of the robot.
        time: (T + 1,) times of the rows [s].
        x: (T + 1, nx) states.
        feet: (T + 1, k, 3) centres of the feet, world axes [m].
        contact: (T + 1, k) whether each foot is on the ground.
        foot_names: names of the k contacts.
    """

    name: str
    simulator: Simulator
    time: Floats
    x: Floats
    feet: Floats
    contact: Flags
    foot_names: tuple[str, ...]

    __repr__ = short_repr

    def then(self, other: Gait) -> Gait:
        """This motion, followed by another one that begins where this one ends.

        Args:
            other: the motion that follows, of the same robot and time step. Its first row is the last one of this
                motion, up to velocities.

        Returns:
            A gait of both motions; its name and simulator are those of this one.

        Raises:
            TypeError: the other one is no Gait.
            ValueError: another robot, other feet, another time step or kind of velocities, or another beginning.
        """
        call = f"Gait.then({self.name} -> {getattr(other, 'name', other)})"
        if not isinstance(other, Gait):
            raise TypeError(f"Gait.then: expected a Gait, got {checks.shown(other)}")
        mine, its = self.simulator, other.simulator
        if mine.mechanism.joint_names != its.mechanism.joint_names or mine.nx != its.nx:
            raise ValueError(f"{call}: expected a motion of {mine.mechanism.name!r}, got {its.mechanism.name!r}")
        if self.foot_names != other.foot_names:
            raise ValueError(f"{call}: expected the feet {self.foot_names}, got {other.foot_names}")
        if abs(mine.time_step - its.time_step) > _SAME * mine.time_step or bool(mine.mean_over) != bool(its.mean_over):
            raise ValueError(f"{call}: expected time steps of {mine.time_step:g} s, got {its.time_step:g} s")
        off = np.abs(mine.difference(other.x[0], self.x[-1])[: mine.nv])
        if off.max() > _JOINED:
            name = mine.mechanism.dof_names[int(off.argmax())]
            raise ValueError(f"{call}: it begins {off.max():.3g} m or rad from where this motion ends, in {name!r}")
        x, feet, contact = (np.concatenate([getattr(self, f), getattr(other, f)[1:]]) for f in ("x", "feet", "contact"))
        time = np.concatenate([self.time, self.time[-1] + other.time[1:]])
        return replace(self, time=time, x=x, feet=feet, contact=contact)

    def torques(self, *, iterations: int = 3) -> Floats:
        """Inputs by inverse dynamics: they move the joints along the reference while the feet carry the robot.

        The generalised forces of the motion come from steps of the same mechanism in the air with an input on every
        degree of freedom. Those of the base are balanced, as far as possible, by small forces inside the friction
        pyramids of the feet that are on the ground.

        Args:
            iterations: number of Newton iterations for the generalised forces.

        Returns:
            (T, nu) inputs [N, N m].

        Raises:
            ValueError: the reference cannot be followed at a step.
        """
        sim = self.simulator
        tau = self._generalized_forces(iterations)
        feet, B = Feet(sim, self.foot_names), input_map(sim)
        J = feet.jacobian(self.x[1:])  # the forces of a step act at its end
        base = ~B.any(axis=1)
        us = np.empty((len(tau), sim.nu))
        edges = _pyramid(feet)
        for t in range(len(tau)):
            carrying = self.contact[t + 1]
            push = np.einsum("kec,kcv->kev", edges[carrying], J[t, carrying]).reshape(-1, sim.nv)
            left = tau[t]
            if len(push):
                left = left - push.T @ least_pushes(push[:, base], left[base], _EVEN)
            us[t] = np.linalg.lstsq(B, left, rcond=None)[0]
        return us

    def _generalized_forces(self, iterations: int) -> Floats:
        """(T, nv) forces that lead from each state to the velocity of the next, without the ground."""
        mech = passive(self.simulator.mechanism)
        joints = [_with_far_stops(j) for j in mech.joints]
        driven = replace(mech, joints=joints, inputs=[Input(j.name, dof=d) for j in mech.joints for d in range(j.nv)])
        sim = self.simulator.replace(mechanism=driven)
        x = self.x.copy()
        if sim.mean_over == 0.0 and not sim.second_order_reason:  # in the air, what rests has no velocity
            still = np.isclose(x, at_rest_on_ground(sim, x), rtol=0.0, atol=_STILL).all(axis=1)
            x[still, sim.nq :] = 0.0
        x[:, 2] += _ALOFT
        tau = np.zeros((len(x) - 1, sim.nv))
        for _ in range(iterations):
            linear = sim.linearize_trajectory(x[:-1], tau)
            missing = x[1:, sim.nq :] - linear.x_next[:, sim.nq :]
            if np.any(linear.status):
                t = int(np.flatnonzero(linear.status)[0])
                raise ValueError(f"Gait.torques({self.name}): the reference cannot be followed at step {t}")
            tau += np.linalg.solve(linear.B[:, sim.nv :], missing[..., None])[..., 0]
        return tau


def _with_far_stops(joint: Joint) -> Joint:
    """The joint with its stops out of reach and without dry friction: a first guess of the forces meets both."""
    far = [(-_FAR if np.isfinite(lo) else lo, _FAR if np.isfinite(hi) else hi) for lo, hi in joint.limits or ()]
    return replace(joint, limits=far, friction=0.0)


def _pyramid(feet: Feet) -> Floats:
    """(k, 4, 3) edges of a pyramid inside the friction cone of every foot, unit normal force."""
    out = np.empty((len(feet.names), 4, 3))
    for k, contact in enumerate(feet.contacts):
        n = feet.normal[k]
        first = np.cross(n, [0.0, 1.0, 0.0] if abs(n[1]) < 0.9 else [1.0, 0.0, 0.0])
        first /= np.linalg.norm(first)
        second = np.cross(n, first)
        friction = contact.friction if contact.law != "impact" else 0.0
        out[k] = n + friction * np.array([first, -first, second, -second])
    return out


def check_length(call: str, sim: Simulator, steps: float, remedy: str) -> None:
    """Refuse gaits that are too long, or larger than the memory, before any array of theirs is made.

    Args:
        call: the call and the argument that an error names.
        sim: simulator of the robot.
        steps: number of time steps.
        remedy: end of the message.

    Raises:
        ValueError: there are more than 100,000, or their derivatives, which torques and plans need, do not fit.
    """
    if not steps <= _LONGEST:
        raise ValueError(f"{call}: expected at most {_LONGEST:,} time steps, got {steps:.6g}: {remedy}")
    check_room(call, int(steps), 8.0 * (sim.nx + sim.ndx * (sim.ndx + sim.nu)), remedy, "time steps")


def _at_nodes(means: Floats) -> Floats:
    """(n, nv) velocities at the ends of intervals with the mean velocities `means`; the last is extrapolated."""
    return np.concatenate([0.5 * (means[:-1] + means[1:]), 1.5 * means[-1:] - 0.5 * means[-2:-1]])


def assemble(sim: Simulator, name: str, base: Floats, feet: Floats, contact: Flags, *, names: tuple[str, ...]) -> Gait:
    """Gait from the pose of the base (T + 2, 7) and the feet (T + 2, k, 3) at times -h, 0, ..., T h."""
    x = np.tile(sim.neutral(), (len(base), 1))
    x[:, BaseState.POSE] = base
    try:
        x = Feet(sim, names).place(x, feet)
    except ValueError as error:
        raise ValueError(f"{error}; move less far or fast, lift the feet less, or change the height") from error
    means = sim.difference(x[1:], x[:-1])[:, : sim.nv] / sim.time_step
    x = x[1:]
    x[:, sim.nq :] = means if sim.mean_over else _at_nodes(means)
    time = sim.time_step * np.arange(len(x), dtype=np.float64)
    return Gait(name, sim, time, x, feet[1:], contact[1:], names)
