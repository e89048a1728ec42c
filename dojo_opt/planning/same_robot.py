"""Whether a motion or a plan is one of a simulator's robot, with states that mean the same."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from dojo_opt.planning.plan import Plan
from sim.simulator.simulator import Simulator
from solvers.types import Matrix

__all__ = ["check_same_knots", "check_same_names", "check_same_robot", "check_same_velocities", "check_warm_start"]

_ROUNDING = 1e-9  # [s]
_FEW = 8  # names in a message
_KINDS = ("means over the step before", "those at the nodes")


def check_same_robot(expected: str, sim: Simulator, other: Any, x: Matrix, nu: int | None = None) -> None:
    """Refuse a motion whose coordinates are not those of a simulator.

    Args:
        expected: beginning of the message, as "MPC(plan=...): expected a plan".
        sim: the simulator.
        other: simulator of the motion, None where it is not known.
        x: (N + 1, nx) states of the motion.
        nu: number of its inputs (default None: not compared).

    Raises:
        ValueError: the names of the degrees of freedom, the size of the states or the number of inputs are others.
    """
    own, theirs = sim.mechanism.dof_names, None if other is None else other.mechanism.dof_names
    if x.shape[1] == sim.nx and theirs in (None, own) and nu in (None, sim.nu):
        return
    name = "" if other is None else f" of {other.mechanism.name!r}"
    inputs = ("", "") if nu in (None, sim.nu) else (f" and inputs of {sim.nu}", f" and inputs of {nu}")
    raise ValueError(
        f"{expected}, with the coordinates of {sim.mechanism.name!r} and states of {sim.nx} numbers{inputs[0]}, got "
        f"one{name} with states of {x.shape[1]}{inputs[1]}"
    )


def check_same_names(call: str, own: Sequence[str], theirs: Sequence[str]) -> None:
    """Refuse another robot, of which only the names of its degrees of freedom are known.

    Args:
        call: beginning of the message.
        own: names expected.
        theirs: names of the other robot.

    Raises:
        ValueError: they differ.
    """
    if tuple(own) != tuple(theirs):
        few, others = (", ".join(names[:_FEW]) + (", ..." if len(names) > _FEW else "") for names in (own, theirs))
        raise ValueError(f"{call}: expected a robot with the coordinates {few}, got one with {others}")


def check_same_velocities(call: str, sim: Simulator, other: Any) -> None:
    """Refuse states whose velocities are means where a simulator has those at the nodes, or the other way round.

    Args:
        call: beginning of the message.
        sim: the simulator.
        other: simulator of the states, None where it is not known.

    Raises:
        ValueError: the velocities are of the other kind.
    """
    if other is None or bool(sim.mean_over) == bool(other.mean_over):
        return
    wanted, got = _KINDS if sim.mean_over else reversed(_KINDS)
    raise ValueError(
        f"{call}: expected velocities that are {wanted}, as the simulator has them, got {got}; use a simulator of the "
        "same order"
    )


def check_same_knots(call: str, plan: Any, knot_time: float, owner: str) -> None:
    """Refuse a plan with knots of another length.

    Args:
        call: beginning of the message.
        plan: the plan.
        knot_time: length of a knot [s].
        owner: whose knots these are, as "the problem".

    Raises:
        ValueError: the knots are shorter or longer.
    """
    own = plan.substeps * plan.time_step
    if abs(own - knot_time) > _ROUNDING:
        raise ValueError(f"{call}: expected knots of {knot_time:g} s, as those of {owner}, got {own:g} s")


def check_warm_start(sim: Any, plan: Any) -> None:
    """Refuse a guess of `ilqr` that is no plan, or one of another robot. Its time steps may be others.

    Args:
        sim: simulator of the problem.
        plan: the guess, or None.

    Raises:
        TypeError: it is no Plan.
        ValueError: the robot is another one.
    """
    if plan is not None and not isinstance(plan, Plan):
        raise TypeError(f"ilqr(warm_start=...): expected a Plan, got {plan!r}")
    if plan is not None and isinstance(sim, Simulator):
        check_same_robot("ilqr(warm_start=...): expected a plan", sim, plan.simulator, plan.x, plan.u.shape[1])
