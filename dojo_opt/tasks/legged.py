"""Any legged robot walks under a velocity command."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt import gaits
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.gait import Gait
from dojo_opt.gaits.legs import Legs
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.mpc.controller import MPC
from dojo_opt.mpc.settings import OPTIONS
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from dojo_opt.tasks.commanded import CommandedGait, SteeredGait
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.simulator.simulator import Simulator
from solvers.types import Vector

__all__ = ["legged_mpc"]

_CALL = "tasks.legged_mpc"
_GAITS = ("trot", "walk", "pace", "bound", "hop")
# of a robot of the size and weight of the A1, as in `quadruped_mpc`: lengths go with the height, times with its root
_KNOT, _KNOTS, _HORIZON = 0.04, 12, 20  # [s], of a period, of a plan
_HOP = 0.4  # [s], a period: in a longer one the base falls so far that knees meet their stops
_SPEED, _LIFT, _KAPPA = 0.2, 0.05, 1e-3  # [m/s], [m], [N s m]
_BASE, _ANGLE, _VELOCITY, _RATE, _EFFORT = 10.0, 1.0, 0.1, 0.01, 1e-4
_CAREFUL = 0.5  # share of the friction that plans assume
# rollouts from a pushed state often fall: where they allow no longer step, all states take one at once; on two feet the
# gaps that this leaves cost the balance (a pushed Bolt falls)
_SHORT = 0.2


@checked_numbers("tasks")
def legged_mpc(  # noqa: PLR0913
    robot: Any,
    gait: str = "trot",
    *,
    velocity: Any = None,
    feet: Sequence[str] | Mapping[str, float] | None = None,
    stance: Any = None,
    period: float | None = None,
    step_height: float | None = None,
    duty: float | None = None,
    damping: float | None = None,
    place: ArrayLike = (0.0, 0.0, 0.0),
    substeps: int = 1,
    **settings: Any,
) -> MPC:
    """A robot with two, four or six legs walks at a commanded velocity: 20 knots, 12 of them a period of its gait.

    Feet and stance are found, see `dojo_opt.gaits.legs.Legs`. Weights are those of `quadruped_mpc` in units of the
    robot's weight and height, times go with the root of the height: 40 ms a knot for one of 0.29 m, 33 ms in a hop.
    Torques stay within the limits of its inputs. The cost tracks the gait with its torques by inverse dynamics; plans
    assume half the friction of the feet, and the height of the ground is estimated from the stance feet. Where a push
    leaves the line search of a tick only short steps, a step of all states at once (multiple shooting) is tried, but on
    two feet. The path of the reference begins at `place`, where `tasks.plant(mpc)` has the robot begin, too: from
    elsewhere the robot is thrown towards it.

    Args:
        robot: the mechanism, on a floating base that looks along x, or its simulator.
        gait: "trot", "walk", "pace", "bound" or "hop". Robots with two legs move them in turn when they trot.
        velocity: (3,) velocity of the base forward and to the left, and rate of its heading [m/s, m/s, rad/s], or a
            function of the time [s] that returns it; it is called once per plan (default None: forward at 0.2 m/s for a
            robot of the A1's height, for others in proportion to the root of the height).
        feet: names of contacts, of bodies that have some, or of links, whose feet are balls about their origins, with
            radii [m] in a dict keyed by name (default None: found).
        stance: coordinates of the stance by joint (default None: found).
        period: duration of a cycle of the gait [s] (default None: 0.48 s, of a hop 0.4 s, for the A1's height).
        step_height: lift of a swinging foot [m] (default None: 0.05 m for the A1's height).
        duty: share of the period that a foot is on the ground (default None: that of the gait).
        damping: least damper of the joints of model and plant [N m s/rad] (default None: see `Legs`).
        place: (3,) where the base begins, x and y [m], and its heading [rad].
        substeps: steps of the model per knot.
        **settings: settings of `dojo.MPC`.

    Returns:
        The controller; `tasks.plant(mpc)` is a plant for it.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, a robot without legs, or a foot that cannot reach its place.
    """
    checks.one_of(f"{_CALL}(gait)", gait, _GAITS)
    legs = Legs(robot, feet, damping=damping, stance=stance)
    knot = _knot(legs, gait, period)
    sim = legs.simulator(knot / whole_number(f"{_CALL}(substeps=...)", substeps), PLANNED)
    lift = _LIFT * legs.size if step_height is None else step_height
    shape: dict[str, Any] = {"period": _KNOTS * knot, "step_height": lift} | ({} if duty is None else {"duty": duty})
    command: Any = (_SPEED * legs.size**0.5, 0.0, 0.0) if velocity is None else velocity
    follow = SteeredGait if callable(command) else CommandedGait
    reference = follow(sim, partial(_period, gait, **shape), command, place)
    problem = _problem(legs, sim, reference, knot, substeps)
    return MPC(problem, reference={0: reference, 1: reference.torques}, **{**_usual(legs, sim), **settings})


def _knot(legs: Legs, gait: str, period: float | None) -> float:
    """Length of a knot, a whole number of milliseconds [s]."""
    usual = _HOP if gait == "hop" else _KNOT * _KNOTS
    cycle = usual * legs.size**0.5 if period is None else checks.number(f"{_CALL}(period=...)", period, above=0.0)
    return 1e-3 * max(1, round(1e3 * cycle / _KNOTS))


def _problem(legs: Legs, sim: Simulator, reference: CommandedGait, knot: float, substeps: int) -> Problem:
    """Tracking of the reference with its torques, from which the guess is."""
    times = knot * np.arange(_HORIZON + 1)
    states, torques = reference(times), reference.torques(times[:-1])
    gains = np.array([part.gain for part in sim.mechanism.inputs or ()])
    return Problem(
        sim,
        states[0],
        _HORIZON,
        cost=[Tracking(states, _weights(legs, sim)), Effort(_EFFORT * gains**2 / legs.torque**2)],
        substeps=substeps,
        controls0=np.clip(torques, *sim.mechanism.input_limits),
        states0=states,
    )


def _usual(legs: Legs, sim: Simulator) -> dict[str, Any]:
    """Settings of `dojo.MPC` that differ from its defaults."""
    grip = min((c.friction for c in sim.mechanism.contacts), default=0.0)
    planner = replace(OPTIONS, multiple_shooting_below=0.0 if legs.biped else _SHORT)
    kappa = _KAPPA * legs.torque * legs.size**0.5
    return {"learn_ground": True, "options": planner, "kappa": kappa, "friction": _CAREFUL * grip}


def _period(name: str, sim: Simulator, command: Vector, **settings: Any) -> Gait:
    """One period of a gait at a command (3,)."""
    speed, lateral, heading_rate = (float(c) for c in command)
    moves = {"speed": speed, "lateral": lateral, "heading_rate": heading_rate}
    made: Gait = getattr(gaits, name)(sim, **moves, cycles=1, **settings)
    return made


def _weights(legs: Legs, sim: Simulator) -> ArrayLike:
    """(ndx,) weights of squares of lengths, angles and their rates, in units of the robot's height and time."""
    joints = sim.nv - 6
    place, turn = _BASE / legs.size**2, _BASE
    pose = [np.full(3, place), np.full(3, turn), np.full(joints, _ANGLE)]
    rates = [np.full(3, _VELOCITY / legs.size), np.full(3, _VELOCITY * legs.size), np.full(joints, _RATE * legs.size)]
    return np.concatenate([*pose, *rates])
