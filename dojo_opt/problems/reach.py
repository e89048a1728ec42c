"""Problems of arms: a frame reaches a place, or a pose, and stays there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.constraint import Frame, Goal, SpeedLimits
from dojo_opt.cost import Tracking
from dojo_opt.gaits.minimum_jerk import minimum_jerk
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.planning.problem import Problem
from dojo_opt.problems.holding import effort, holding_inputs
from dojo_opt.problems.whole_knots import whole_knots
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import check_room
from sim.simulator.inverse_kinematics import ik
from sim.simulator.kinematics import Kinematics
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["reach"]

_CALL = "problems.reach"
_TIP = "the point that reaches the target"


@checked_numbers("problems")
def reach(
    arm: Mechanism | Simulator,
    frame: str,
    target: Any,
    *,
    start: ArrayLike | None = None,
    duration: float = 1.5,
    time_step: float = 0.02,
    substeps: int = 1,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    constraints: Any = (),
) -> Problem:
    """An arm moves a frame to a target, and is at rest there.

    The guess is a smooth motion of the joints to the nearest coordinates at the target, with the torques that hold the
    arm on the way. The costs are joint rates, and differences of the torques from those of the guess. The pose of the
    frame and the rest at the end are constraints, as are the largest speeds of the joints, if the arm has any. Torques
    stay within the limits of the inputs.

    Args:
        arm: the mechanism, or its simulator, whose time step is then `time_step`. Its base may be fixed or not.
        frame: name of a link, merged ones too, or of a body, as in `dojo.Kinematics`.
        target: (3,) place of the frame [m], or (place, unit quaternion (w, x, y, z)).
        start: (nq,) coordinates, or (nx,) state (default None: the neutral state).
        duration: duration of the motion, rounded to whole knots, two at least [s].
        time_step: time step of the simulator [s].
        substeps: time steps per knot.
        offset: (3,) of the point that reaches the place from the origin of the frame, in its axes [m] (default zero).
        constraints: further constraints, such as `constraint.Clearance` from an obstacle (default none).

    Returns:
        The problem.

    Raises:
        TypeError: `arm` is neither a mechanism nor a simulator.
        ValueError: the frame is unknown, no coordinates within the joint limits reach the target, or an argument is out
            of range.
    """
    sim = _simulator(arm, time_step)
    point = np.asarray(checks.vector(f"{_CALL}(offset=...)", offset, 3))
    place, turn = _target(target)
    first = _start(sim, start)
    last = _reached(sim, frame, point, place if turn is None else (place, turn), first)
    substeps = whole_number(f"{_CALL}(substeps=...)", substeps)
    knot = time_step * substeps
    horizon = whole_knots(f"{_CALL}(duration=...)", duration, knot, 2)
    check_room(f"{_CALL}(duration=...)", horizon, 8.0 * sim.nx, "reach in less time, or with longer steps", "knots")
    states = _path(sim, first, last, horizon, substeps)
    held = holding_inputs(sim, states[:-1, : sim.nq])
    return Problem(
        sim,
        first,
        horizon,
        cost=[Tracking(states, {"v": knot}), effort(sim, held, knot)],
        constraints=[
            Frame(frame, place, turn, knots=-1, offset=point),
            *_rest(sim, last),
            *(constraints if isinstance(constraints, list | tuple) else (constraints,)),
        ],
        substeps=substeps,
        controls0=held,
        states0=states,
        advice="Try a longer duration, or a nearer target.",
    )


def _simulator(arm: Any, time_step: float) -> Simulator:
    if isinstance(arm, Simulator):
        return arm.replace(time_step=time_step)
    if not isinstance(arm, Mechanism):
        raise TypeError(f"{_CALL}(arm): expected a Mechanism or a Simulator, got {arm!r}")
    return Simulator(arm, time_step=time_step)


def _target(target: Any) -> tuple[Floats, Floats | None]:
    """Place and quaternion."""
    pair = isinstance(target, tuple | list) and len(target) == 2
    place, turn = target if pair else (target, None)
    at = checks.array(f"{_CALL}(target)", place, (3,))
    return at, None if turn is None else np.asarray(checks.quaternion(f"{_CALL}(target)", turn))


def _start(sim: Simulator, given: ArrayLike | None) -> Floats:
    """The first state."""
    if given is None:
        return sim.neutral()
    array = np.asarray(checks.floats(f"{_CALL}(start=...)", given))
    if array.shape == (sim.nq,):
        array = np.concatenate([array, np.zeros(sim.nv)])
    x = np.array(checks.array(f"{_CALL}(start=...)", array, (sim.nx,)))
    for joint in sim.mechanism.joints:
        q = x[sim.mechanism.q_slice(joint.name)]
        for value, (low, high) in zip(q, joint.limits or (), strict=False):
            if not low <= value <= high:
                at = f"{value:.4g} is beyond its limits [{low:g}, {high:g}]"
                raise ValueError(f"{_CALL}(start=...): joint {joint.name!r} at {at}")
    return x


def _reached(sim: Simulator, frame: Any, point: Floats, target: Any, first: Floats) -> Floats:
    """(nq,) coordinates near the first state (nx,) with a point of a frame (3,) at its target."""
    kin = Kinematics(sim)
    checks.one_of(f"{_CALL}(frame)", frame, kin.frames)
    kin.add(_TIP, frame, point)
    found = ik(kin, {_TIP: target}, first[: sim.nq])
    if not found.success:
        raise ValueError(f"{_CALL}({frame!r}, target): {found.message}")
    return found.q


def _rest(sim: Simulator, q: Floats) -> list[Goal | SpeedLimits]:
    """Rest at coordinates (nq,) at the end, and the speed limits of the inputs on the way, if there are any."""
    rest = Goal(np.concatenate([q, np.zeros(sim.nv)]), components="v")
    limited = any(i.joint is not None and np.isfinite(i.speed) for i in sim.mechanism.inputs or ())
    return [rest, SpeedLimits()] if limited else [rest]


def _path(sim: Simulator, first: Floats, q: Floats, horizon: int, substeps: int) -> Floats:
    """(T + 1, nx) states on the smoothest way from the start to coordinates q, at rest at both ends."""
    last = np.concatenate([q, np.zeros(sim.nv)])
    way = sim.difference(last, first)[: sim.nv]
    step = 1.0 / (horizon * substeps)
    share = np.arange(horizon + 1) / horizon
    moved = np.zeros((horizon + 1, sim.ndx))
    moved[:, : sim.nv] = minimum_jerk(share)[:, None] * way
    if sim.mean_over:
        rates = (minimum_jerk(share) - minimum_jerk(share - step)) / sim.time_step
    else:
        rates = 30.0 * (share * (1.0 - share)) ** 2 * step / sim.time_step
    states = sim.integrate(np.concatenate([first[: sim.nq], np.zeros(sim.nv)]), moved)
    states[:, sim.nq :] = rates[:, None] * way
    states[0] = first
    return np.asarray(states)
