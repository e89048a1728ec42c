"""Problems of arms: a frame reaches a place, or a pose, and stays there."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.constraint import Frame, Goal, SpeedLimits
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.equilibrium import potential_gradient
from dojo_opt.gaits.static_motions import input_map
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.planning.problem import Problem
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

_EFFORT = 0.01  # weight of squares of a torque, in units of the largest that holds the arm, beside rates in rad/s


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
    kin = Kinematics(sim)
    checks.one_of("problems.reach(frame)", frame, kin.frames)
    point = np.asarray(checks.vector("problems.reach(offset=...)", offset, 3))
    kin.add(_TIP, frame, point)
    place, turn = _target(target)
    first = _start(sim, start)
    found = ik(kin, {_TIP: place if turn is None else (place, turn)}, first[: sim.nq])
    if not found.success:
        raise ValueError(f"problems.reach({frame!r}, target): {found.message}")
    substeps = whole_number("problems.reach(substeps=...)", substeps)
    horizon = whole_knots("problems.reach(duration=...)", duration, time_step * substeps, 2)
    check_room(
        "problems.reach(duration=...)", horizon, 8.0 * sim.nx, "reach in less time, or with longer steps", "knots"
    )
    states = _path(sim, first, found.q, horizon, substeps)
    B = input_map(sim)
    held = np.linalg.lstsq(B, potential_gradient(sim, states[:-1]).T, rcond=None)[0].T
    low, high = sim.mechanism.input_limits
    unit = np.maximum(np.abs(np.clip(held, low, high)).max(initial=0.0), 1e-3)
    knot = time_step * substeps
    more = tuple(constraints) if isinstance(constraints, list | tuple) else (constraints,)
    limited = any(i.joint is not None and np.isfinite(i.speed) for i in sim.mechanism.inputs or ())
    return Problem(
        sim,
        first,
        horizon,
        cost=[
            Tracking(states, {"v": knot}),
            Effort(knot * _EFFORT / unit**2, reference=np.clip(held, low, high)),
        ],
        constraints=[
            Frame(frame, place, turn, knots=-1, offset=point),
            Goal(np.concatenate([found.q, np.zeros(sim.nv)]), components="v"),
            *((SpeedLimits(),) if limited else ()),
            *more,
        ],
        substeps=substeps,
        controls0=held,
        states0=states,
        advice="Try a longer duration, or a nearer target.",
    )


_TIP = "the point that reaches the target"


def _simulator(arm: Any, time_step: float) -> Simulator:
    if isinstance(arm, Simulator):
        return arm.replace(time_step=time_step)
    if not isinstance(arm, Mechanism):
        raise TypeError(f"problems.reach(arm): expected a Mechanism or a Simulator, got {arm!r}")
    return Simulator(arm, time_step=time_step)


def _target(target: Any) -> tuple[Floats, Floats | None]:
    """Place and quaternion."""
    pair = isinstance(target, tuple | list) and len(target) == 2
    place, turn = target if pair else (target, None)
    at = checks.array("problems.reach(target)", place, (3,))
    return at, None if turn is None else np.asarray(checks.quaternion("problems.reach(target)", turn))


def _start(sim: Simulator, given: ArrayLike | None) -> Floats:
    """The first state."""
    if given is None:
        return sim.neutral()
    array = np.asarray(checks.floats("problems.reach(start=...)", given))
    if array.shape == (sim.nq,):
        array = np.concatenate([array, np.zeros(sim.nv)])
    x = np.array(checks.array("problems.reach(start=...)", array, (sim.nx,)))
    for joint in sim.mechanism.joints:
        q = x[sim.mechanism.q_slice(joint.name)]
        for value, (low, high) in zip(q, joint.limits or (), strict=False):
            if not low <= value <= high:
                at = f"{value:.4g} is beyond its limits [{low:g}, {high:g}]"
                raise ValueError(f"problems.reach(start=...): joint {joint.name!r} at {at}")
    return x


def _path(sim: Simulator, first: Floats, q: Floats, horizon: int, substeps: int) -> Floats:
    """(T + 1, nx) states on the smoothest way from the start to coordinates q, at rest at both ends."""
    last = np.concatenate([q, np.zeros(sim.nv)])
    way = sim.difference(last, first)[: sim.nv]
    step = 1.0 / (horizon * substeps)

    def along(share: Floats) -> Floats:
        return share**3 * (10.0 - 15.0 * share + 6.0 * share**2)

    share = np.arange(horizon + 1) / horizon
    moved = np.zeros((horizon + 1, sim.ndx))
    moved[:, : sim.nv] = along(share)[:, None] * way
    if sim.mean_over:
        rates = (along(share) - along(np.maximum(share - step, 0.0))) / sim.time_step
    else:
        rates = 30.0 * (share * (1.0 - share)) ** 2 * step / sim.time_step
    states = sim.integrate(np.concatenate([first[: sim.nq], np.zeros(sim.nv)]), moved)
    states[:, sim.nq :] = rates[:, None] * way
    states[0] = first
    return np.asarray(states)
