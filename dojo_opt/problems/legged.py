"""Problems of any robot with legs: trot, walk, jump, stand up, in units of its height, weight and a pendulum's time."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt import gaits
from dojo_opt.gaits.biped import balanced
from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.gait import Gait, assemble, check_length
from dojo_opt.gaits.legs import Legs
from dojo_opt.gaits.minimum_jerk import minimum_jerk
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from dojo_opt.problems import locomotion
from dojo_opt.problems.locomotion import EFFORT, FOLLOW, PLACE, check_settings, follow
from dojo_opt.problems.whole_knots import whole_knots
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

# of a robot as high as the A1: lengths go with the height, times and speeds with its root
_PERIOD, _SPEED, _LIFT = 0.6, 0.2, 0.04  # of a trot [s], [m/s], [m]
_KNOTS = 20  # of a period
_SUBSTEPS = 2  # of a knot: gaits planned with steps of 50 ms and more fall when they are replayed with shorter ones
_STEP = 0.02  # [s] of jumps and of standing up
_LOWS = (0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95)  # of the height of the stance, where rising begins
_STRIDE = 0.7  # [s] of a walk on two feet
_SINK, _RAISE = 0.4, 0.25  # of the way down that flat feet allow: how much lower the base is in a walk, and their lift
_LOOSE = 0.2  # of the usual damper, which takes much of the torque of ankles that push off
_SHARES = (1.0, 0.85, 0.7, 0.55, 0.4, 0.3, 0.2)  # of the usual distance and height of a jump, from the most
_STRAIN = 1.3  # times the torque limits: largest torques of the reference of a jump, which plans spread over more time
_CROUCH = 0.8  # of the way down that the legs allow, at most, before a jump
# regularisation of the gains of a jump on flat feet, which act for a part of a knot in the air, too: with 100 Talos
# stumbles in four of five landings, and with 10 its ankles turn to their stops before them
_CALM = 1600.0
_LEAST = 1e-3  # [s] time steps are multiples of this


@checked_numbers("problems")
def trot(
    robot: Any = None,
    *,
    feet: Sequence[str] | Mapping[str, float] | None = None,
    stance: Any = None,
    **settings: Any,
) -> Problem:
    """A robot trots: the library's quadruped, or any robot with two, four or six legs.

    Without a robot, the quadruped of the A1's size trots for two periods of one second, 40 knots of 50 ms. The defaults
    are the reference of Dojo's quadruped example, its weights (impulses .01 per (N m s)^2), friction of .8, and less
    damping in the joints (5 N m s/rad there; with .5 here the robot falls over by itself). The pose of the base at the
    end is a constraint. Torques are limited to 33.5 N m.

    Feet and stance of another robot are found, see `dojo_opt.gaits.legs.Legs`; weights, times and lengths follow from
    its weight and height h: two periods of 0.6 s at 0.2 m/s for h = 0.29 m, in proportion to the root of h, with 20
    knots of two time steps each. Torques stay within the limits of its inputs. Six legs move in two sets of three.

    Args:
        robot: the mechanism, on a floating base that looks along x, or its simulator (default None: the quadruped).
        feet: names of contacts, of bodies that have some, or of links, whose feet are balls about their origins, with
            radii [m] in a dict keyed by name (default None: found).
        stance: coordinates of the stance by joint (default None: found).
        **settings: speed [m/s], or distance [m] of all cycles together (speed x period x cycles), step_height [m],
            damping (least damper of the joints [N m s/rad], 0.5 for the quadruped, in proportion for others), further
            arguments of `gaits.trot` (period, duty, cycles, heading_rate, height, footholds, ...) and of `follow`
            (guess, periodic, ...); of the quadruped also time_step, friction and contacts. With periodic=True a plan is
            one period long, unless `cycles` is given.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, a robot without legs, or a foot that cannot reach its place.
    """
    if robot is None:
        return locomotion.trot(**_of_the_quadruped("problems.trot", feet, stance, settings))
    legs = Legs(robot, feet, damping=settings.pop("damping", None), stance=stance)
    return _periodic(legs, "trot", _PERIOD, _SPEED, settings)


@checked_numbers("problems")
def walk(
    robot: Any = None,
    *,
    feet: Sequence[str] | Mapping[str, float] | None = None,
    stance: Any = None,
    **settings: Any,
) -> Problem:
    """A robot walks, one foot after the other: the library's quadruped, or any robot with two or four legs.

    Others walk for two periods of 1 s, 0.7 s on two feet, at 0.1 m/s for a height of 0.29 m, in proportion to the root
    of the height, with 20 knots of two time steps each; all else is as for `trot`.

    Args:
        robot: the mechanism, on a floating base that looks along x, or its simulator (default None: the quadruped).
        feet: names of contacts, of bodies that have some, or of links, whose feet are balls about their origins, with
            radii [m] in a dict keyed by name (default None: found, see `dojo_opt.gaits.legs.Legs`).
        stance: coordinates of the stance by joint (default None: found).
        **settings: as for `trot`.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, a robot without legs, or a foot that cannot reach its place.
    """
    if robot is None:
        return locomotion.walk(**_of_the_quadruped("problems.walk", feet, stance, settings))
    legs = Legs(robot, feet, damping=settings.pop("damping", None), stance=stance)
    return _periodic(legs, "walk", _STRIDE if legs.biped else 1.0, 0.5 * _SPEED, settings)


def _periodic(legs: Legs, name: str, period: float, speed: float, settings: dict[str, Any]) -> Problem:
    """The problem to follow two periods of a gait; period [s] and speed [m/s] of a robot as high as the A1."""
    check_settings(name, getattr(gaits, name), settings, ("damping",))
    slow = legs.size**0.5
    cycle = checks.number(f"problems.{name}(period=...)", settings.pop("period", period * slow), above=0.0)
    step = _rounded(cycle / _KNOTS)
    follows, rest = _shared_out({"substeps": _SUBSTEPS, **settings})
    usual = {"step_height": _LIFT * legs.size, "cycles": 1 if follows.get("periodic") else 2}
    if rest.get("distance") is None:
        usual["speed"] = speed * slow
    substeps = whole_number(f"problems.{name}(substeps=...)", follows["substeps"])
    sim = legs.simulator(step / substeps, PLANNED)
    if Feet(sim).flat:  # legs that are nearly stretched reach neither to the side nor ahead
        bend = _deepest(sim, legs.height)
        usual |= {"height": float(sim.neutral()[2]) - _SINK * bend, "step_height": _RAISE * bend}
    made = getattr(gaits, name)(sim, period=_KNOTS * step, **{**usual, **rest})
    return _scaled(legs, made, follows)


@checked_numbers("problems")
def jump(
    robot: Any = None,
    *,
    feet: Sequence[str] | Mapping[str, float] | None = None,
    stance: Any = None,
    **settings: Any,
) -> Problem:
    """A robot jumps forward, from standing to standing: the library's quadruped, or any robot with legs.

    Replayed with steps of 1 ms, jumps planned with steps of 20 ms land up to 72 mm off; upward and backward jumps are
    the worst. As for `leap`, `ilqr` therefore ends with the refined problem, and jumps land within 4 mm. In the refined
    problem the height at the top is a constraint.

    The quadruped jumps 0.3 m far and 0.2 m high. Others jump as far and high for their height h, that of the quadruped
    being 0.29 m, a third of it on flat feet; times follow the root of h, weights the robot's weight and height. A robot
    whose joints are too weak for that jumps less far and high by default: the torques of the reference, by inverse
    dynamics, exceed no limit by more than 30 %, which plans make up for.

    Args:
        robot: the mechanism, on a floating base that looks along x, or its simulator (default None: the quadruped).
        feet: names of contacts, of bodies that have some, or of links, whose feet are balls about their origins, with
            radii [m] in a dict keyed by name (default None: found, see `dojo_opt.gaits.legs.Legs`).
        stance: coordinates of the stance by joint (default None: found).
        **settings: distance [m], height [m], damping (least damper of the joints [N m s/rad]), refinement (parts of
            every time step in the second half of `ilqr`, 5; 1 for none), further arguments of `gaits.jump` (crouch,
            clearance, before, after) and of `follow`; of the quadruped also time_step, friction and contacts.

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, a robot without legs, or a foot that cannot reach its place.
    """
    if robot is None:
        return locomotion.jump(**_of_the_quadruped("problems.jump", feet, stance, settings))
    legs = Legs(robot, feet, damping=settings.pop("damping", None), stance=stance, share=_LOOSE)
    check_settings("jump", gaits.jump, settings, ("damping", "refinement"))
    slow, size = legs.size**0.5, legs.size
    refinement = settings.pop("refinement", 5)
    follows, rest = _shared_out(settings)
    substeps = whole_number("problems.jump(substeps=...)", follows.get("substeps", 1))
    step = _rounded(_STEP * slow) / substeps
    usual = {"distance": 0.3 * size, "height": 0.2 * size, "crouch": 0.1 * size, "clearance": 0.08 * size}
    usual |= {"before": 0.3 * slow, "after": 0.4 * slow}
    sim = legs.simulator(step, PLANNED)
    if Feet(sim).flat:
        usual |= {"distance": 0.1 * size, "height": 0.07 * size}
    if not {"crouch", "clearance"} <= rest.keys():  # both bend the legs
        bend = _CROUCH * _deepest(sim, legs.height)
        usual |= {name: min(usual[name], bend) for name in ("crouch", "clearance")}
    gait = _strongest(legs, sim, usual, rest)
    odd = -(len(gait.x) - 1) % substeps
    if odd:  # whole knots: the rest at the end takes longer
        gait = _strongest(legs, sim, usual, {**rest, "after": {**usual, **rest}["after"] + odd * step})
    problem = locomotion.with_apex(_scaled(legs, gait, follows), refinement)
    problem.gain_regularization = _CALM if Feet(sim).flat else 0.0
    return problem


def _strongest(legs: Legs, sim: Simulator, usual: dict[str, float], given: dict[str, Any]) -> Gait:
    """The jump of the usual distance and height, or of a share of them that the joints are strong enough for."""
    limits = legs.mechanism.input_limits
    for share in _SHARES:
        smaller = {name: share * usual[name] for name in ("distance", "height")}
        gait = gaits.jump(sim, **{**usual, **smaller, **given})
        if limits is None or "height" in given:
            break
        low, high = (_STRAIN * np.asarray(bound) for bound in limits)
        torques = gait.torques()
        if np.all((low <= torques) & (torques <= high)):
            break
    return gait


def _of_the_quadruped(call: str, feet: Any, stance: Any, settings: dict[str, Any]) -> dict[str, Any]:
    """Settings of the problem of the library's quadruped."""
    if feet is not None or stance is not None:
        raise ValueError(f"{call}(feet=..., stance=...): expected a robot, {call}(robot, ...)")
    return settings


@checked_numbers("problems")
def stand_up(
    robot: Any,
    *,
    feet: Sequence[str] | Mapping[str, float] | None = None,
    low: float | None = None,
    duration: float | None = None,
    damping: float | None = None,
    stance: Any = None,
    **settings: Any,
) -> Problem:
    """A robot with legs stands up from its folded legs, and stands still for a third of the time.

    Args:
        robot: the mechanism, on a floating base that looks along x, or its simulator.
        feet: names of contacts, of bodies that have some, or of links, whose feet are balls about their origins, with
            radii [m] in a dict keyed by name (default None: found, as `dojo_opt.gaits.legs.Legs` says).
        low: height of the base at the beginning over that of the stance, between 0 and 1 (default None: 0.55, or the
            least above it for which flat feet stay on the ground under the centre of mass).
        duration: of the rise and the rest, rounded to whole knots, two at least [s] (default None: 1 s for a robot as
            high as the A1, for others in proportion to the root of the height).
        damping: least damper of the joints, see `Legs` (default None: in proportion to weight and height).
        stance: coordinates of the stance by joint (default None: found).
        **settings: further arguments of `follow` (guess, substeps, control_limits, effort, ...).

    Returns:
        The problem.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range, a robot without legs, or a foot that cannot reach its place.
    """
    legs = Legs(robot, feet, damping=damping, stance=stance)
    if low is not None and not checks.number("problems.stand_up(low=...)", low, above=0.0) < 1.0:
        raise ValueError(f"problems.stand_up(low=...): expected a share of the height below 1, got {low:g}")
    follows, rest = _shared_out(settings)
    checks.keywords("problems.stand_up(...)", rest, (*FOLLOW, "low", "duration", "damping", "stance"))
    slow = legs.size**0.5
    substeps = whole_number("problems.stand_up(substeps=...)", follows.get("substeps", 1))
    step = _rounded(_STEP * slow) / substeps
    sim = legs.simulator(step, PLANNED)
    length = slow if duration is None else duration
    knots = whole_knots("problems.stand_up(duration=...)", length, step * substeps, 2)
    check_length("problems.stand_up(duration=...)", sim, float(substeps) * knots, "stand up in less time")
    count = substeps * knots
    drop = _deepest(sim, legs.height) if low is None else (1.0 - low) * legs.height
    return _scaled(legs, _rise(sim, count, drop), follows)


def _deepest(sim: Simulator, height: float) -> float:
    """How far the base goes down to the usual height, or as far as the legs let it [m].  ValueError: not at all."""
    for low in _LOWS:
        try:
            _lowered(sim, np.array([(1.0 - low) * height]))
        except ValueError:
            if low == _LOWS[-1]:
                raise
        else:
            break
    return float((1.0 - low) * height)


def _lowered(sim: Simulator, by: Floats) -> tuple[Floats, Floats]:
    """Poses (n, 7) of the base, lower by so much, and places (n, k, 3) of the feet, which stand.

    The centre of mass of a robot on flat feet stays over their middle: no leg before or behind keeps it from falling.
    """
    feet, x = Feet(sim), np.tile(sim.neutral(), (len(by), 1))
    places = feet.landed(x[0])
    x[:, 2] -= by
    where = np.tile(places, (len(by), 1, 1))
    if feet.flat:
        return balanced(feet, x, where, places[:, :2].mean(axis=0)), where
    return feet.place(x, where)[:, BaseState.POSE], where


def _rise(sim: Simulator, steps: int, by: float) -> Gait:
    """The base goes up by so much in two thirds of the steps, at rest at both ends; the feet stand."""
    feet = Feet(sim)
    base, where = _lowered(sim, by * (1.0 - minimum_jerk(1.5 * np.arange(-1, steps + 1) / steps)))
    return assemble(sim, "stand up", base, where, np.ones(where.shape[:2], dtype=bool), names=feet.names)


def _shared_out(settings: dict[str, Any]) -> tuple[dict[str, Any], dict[str, Any]]:
    """Arguments of `follow`, and those of the gait."""
    follows = {key: value for key, value in settings.items() if key in FOLLOW}
    return follows, {key: value for key, value in settings.items() if key not in FOLLOW}


def _scaled(legs: Legs, gait: Gait, given: dict[str, Any]) -> Problem:
    """The problem to follow a gait, its weights in units of the robot."""
    place: ArrayLike = np.asarray(PLACE) / legs.size**2
    return follow(gait, **{"place": place, "effort": EFFORT / legs.torque**2, **given})


def _rounded(step: float) -> float:
    """A time step as a whole number of milliseconds."""
    return _LEAST * max(1, round(step / _LEAST))
