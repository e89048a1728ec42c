"""Reference problems of small systems: a hop, a pushed block, swing-ups."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt import models
from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.simulator.simulator import Simulator

__all__ = ["block", "hop", "swingup"]


@checked_numbers("problems")
def hop(target: ArrayLike = (0.5, 0.5), *, substeps: int = 1, height: float = 0.5, **model: Any) -> Problem:
    """Raibert's hopper jumps from rest to rest in one second, 20 knots of 50 ms.

    Knots 0 to 9 track `height` above the ground that the hopper stands on, the others the target itself. Squares of
    position weigh 1, attitude .1, leg 1, velocity and angular velocity .01, leg rate .01, and impulses .01 per (N s)^2.
    At the end the pose is a constraint. The guess is the leg force that balances the weight.   Howell et al. 2022,
    Dojo, hopper example.

    Args:
        target: (2,) displacement along x and y [m].
        substeps: time steps per knot.
        height: height of the first half of the reference above the standing robot [m].
        **model: parameters of `models.raiberthopper`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown parameter of the model.
        ValueError: for an argument of the wrong shape or out of range.
    """
    knot, horizon = 0.05, 20
    place = np.array(checks.vector("problems.hop(target=...)", target, 2))
    height = checks.number("problems.hop(height=...)", height)
    substeps = whole_number("problems.hop(substeps=...)", substeps)
    sim = Simulator(models.raiberthopper(**model), time_step=knot / substeps, kappa=PLANNED)
    start = sim.neutral()
    goal, apex = start.copy(), start.copy()
    goal[:2] += place
    apex[:3] = goal[0], goal[1], goal[2] + height
    weight = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 1.0, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01])
    half = horizon // 2
    mass = float(sim.mechanism.bodies[0].mass)
    return Problem(
        sim,
        start,
        horizon,
        cost=[
            Tracking(np.array([apex] * half + [goal] * (horizon + 1 - half)), weight),
            Effort(0.01 * knot**2),
        ],
        constraints=[Goal(goal, components=np.arange(sim.nv))],
        substeps=substeps,
        controls0=np.array([0.0, 0.0, -mass * np.asarray(sim.mechanism.gravity)[2]]),
    )


@checked_numbers("problems")
def block(goal: str = "right", *, friction: float = 0.5, **model: Any) -> Problem:
    """A half-metre cube of 1 kg moves from rest on the ground to rest one metre to the right, or one metre up.

    Ten knots of 0.1 s, three forces at the centre. The guess is zero: without smoothing, "up" has no gradient there.
    Half of the squares of position, velocity and angular velocity, a quarter of that for the rotation vector, and 1e-2
    per N^2 are the cost. The full state at the end is a constraint.

    Args:
        goal: "right" or "up".
        friction: coefficient of friction of the corners.
        **model: further parameters of `models.block`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown parameter of the model.
        ValueError: for another goal, or a parameter out of range.
    """
    shifts = {"right": (1.0, 0.0, 0.0), "up": (0.0, 0.0, 1.0)}
    checks.one_of("problems.block(goal=...)", goal, shifts)
    sim = Simulator(models.block(friction=friction, **model), time_step=0.1, kappa=PLANNED)
    start = sim.neutral()
    target = start.copy()
    target[:3] += shifts[goal]
    weight = np.array([1.0] * 3 + [0.25] * 3 + [1.0] * 6)
    terms = (Tracking(target, weight, scale=0.5), Effort(1e-2, scale=0.5))
    return Problem(sim, start, 10, cost=terms, constraints=[Goal(target)])


@checked_numbers("problems")
def swingup(name: str = "cartpole") -> Problem:
    """A pendulum, cart-pole or acrobot swings from hanging at rest to upright at rest, which is a constraint.

        pendulum   51 states, 50 ms, |torque| <= 200 N m; squares of the state weigh .1, of the torque .01
        cartpole   26 states, 100 ms; .1 and .001
        acrobot    51 states, 100 ms; .1 on the velocities and .1 on the torque

    Args:
        name: "pendulum", "cartpole" or "acrobot".

    Returns:
        The problem.

    Raises:
        ValueError: for another name.
    """
    weight: ArrayLike
    checks.one_of("problems.swingup(name)", name, ("pendulum", "cartpole", "acrobot"))
    if name == "pendulum":
        sim, horizon, upright = Simulator(models.pendulum(damper=1.0), time_step=0.05), 50, [np.pi]
        weight, effort, limits = 0.1, 0.01, (-200.0, 200.0)
    elif name == "cartpole":
        sim, horizon, upright = Simulator(models.cartpole(), time_step=0.1), 25, [0.0, np.pi]
        weight, effort, limits = 0.1, 1e-3, None
    else:
        sim, horizon, upright = Simulator(models.acrobot(), time_step=0.1), 50, [np.pi, 0.0]
        weight, effort, limits = np.array([0.0, 0.0, 0.1, 0.1]), 0.1, None
    target = np.concatenate([upright, np.zeros(sim.nv)])
    ramp = np.linspace(1.0, 0.0, horizon)[:, None] * 1e-2  # hanging still is a stationary point: leave it
    return Problem(
        sim,
        np.zeros(sim.nx),
        horizon,
        cost=[Tracking(target, weight), Effort(effort)],
        constraints=[Goal(target)],
        control_limits=limits,
        controls0=np.broadcast_to(ramp, (horizon, sim.nu)).copy(),
    )
