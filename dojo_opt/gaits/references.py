"""Reference gaits of legged robots: stand, walk, trot, pace, bound, hop, turn, jump.

Every function takes a simulator and gives a `Gait` along its time steps: base, feet, joint angles by inverse
kinematics, and velocities that belong to them. The robot's first joint is its floating base, its feet are the contacts
of the bodies at the ends of the tree. The base looks along x.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.gaits.biped import balanced
from dojo_opt.gaits.equilibrium import at_rest_on_ground
from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.footfall import Footfall
from dojo_opt.gaits.gait import Gait, assemble, check_length
from sim.mechanism import checks
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["Gait", "bound", "hop", "jump", "pace", "stand", "trot", "turn", "walk"]

# share of the period at which a foot comes down, by (in front, on the left)
_TROT = {(True, False): 0.0, (False, True): 0.0, (True, True): 0.5, (False, False): 0.5}
_PACE = {(True, False): 0.0, (False, False): 0.0, (True, True): 0.5, (False, True): 0.5}
_BOUND = {(False, False): 0.0, (False, True): 0.0, (True, False): 0.5, (True, True): 0.5}
_WALK = {(False, True): 0.0, (True, True): 0.25, (False, False): 0.5, (True, False): 0.75}
_HOP = dict.fromkeys(_TROT, 0.0)
_STRONGEST = 1000.0  # largest push of a jump, over the weight
_KEYWORDS = "speed distance period duty lateral heading_rate cycles step_height height footholds tilt".split()


def trot(sim: Simulator, *, speed: float | None = None, period: float = 1.0, duty: float = 0.5, **gait: Any) -> Gait:
    """A trot: diagonal feet together.

    Args:
        sim: simulator of a robot with legs on a floating base.
        speed: forward speed of the base [m/s] (default None: 0.2, or that of `distance`).
        period: length of a cycle, a whole number of time steps [s].
        duty: share of the period that a foot is on the ground, between 0 and 1.
        **gait: keywords that all periodic gaits have:

            distance       displacement of the base over all cycles, without turning, instead of a speed: speed x period
                           x cycles [m] (default None)
            lateral        speed of the base to the left [m/s] (default 0)
            heading_rate   rate of turning, positive to the left [rad/s] (default 0)
            cycles         number of periods (default 2)
            step_height    lift of a swinging foot [m] (default 0.05)
            height         height of the base, on average [m] (default None: that of the neutral state)
            footholds      (k, 2) places of the feet from the base in the middle of a stance, forward and to the left
                           [m] (default None: those of the neutral state)
            tilt           largest roll and pitch of the base due to the change of its feet [rad] (default 0.2)

    Returns:
        The gait: states and contact schedule, one row per time step.

    Raises:
        TypeError: `sim` is not a Simulator, or a keyword is unknown.
        ValueError: for an argument out of range, a robot without legs, a foot that cannot reach its place, or a joint
            that would exceed its limits.
    """
    return _periodic(sim, "trot", _TROT, usual=0.2, speed=speed, period=period, duty=duty, **gait)


def pace(sim: Simulator, *, speed: float | None = None, period: float = 0.4, duty: float = 0.5, **gait: Any) -> Gait:
    """A pace: feet of the same side together.

    Args:
        sim: simulator of a robot with legs on a floating base.
        speed: forward speed of the base [m/s] (default None: 0.2, or that of `distance`).
        period: length of a cycle, a whole number of time steps [s].
        duty: share of the period that a foot is on the ground, between 0 and 1.
        **gait: keywords of all periodic gaits, see `trot`.

    Returns:
        The gait: states and contact schedule, one row per time step.

    Raises:
        TypeError: `sim` is not a Simulator, or a keyword is unknown.
        ValueError: as for `trot`.
    """
    return _periodic(sim, "pace", _PACE, usual=0.2, speed=speed, period=period, duty=duty, **gait)


def bound(
    sim: Simulator,
    *,
    speed: float | None = None,
    period: float = 0.36,
    duty: float = 1 / 3,
    tilt: float = 0.4,
    **gait: Any,
) -> Gait:
    """A bound: hind feet, flight (for duty < 0.5), front feet, flight.

    Args:
        sim: simulator of a robot with legs on a floating base.
        speed: forward speed of the base [m/s] (default None: 0.5, or that of `distance`).
        period: length of a cycle, a whole number of time steps [s].
        duty: share of the period that a foot is on the ground, between 0 and 1.
        tilt: largest roll and pitch of the base due to the change of its feet [rad].
        **gait: keywords of all periodic gaits, see `trot`.

    Returns:
        The gait: states and contact schedule, one row per time step.

    Raises:
        TypeError: `sim` is not a Simulator, or a keyword is unknown.
        ValueError: as for `trot`.
    """
    return _periodic(sim, "bound", _BOUND, usual=0.5, speed=speed, period=period, duty=duty, tilt=tilt, **gait)


def walk(sim: Simulator, *, speed: float | None = None, period: float = 1.0, duty: float = 0.75, **gait: Any) -> Gait:
    """A walk: left hind, left front, right hind, right front foot.

    Args:
        sim: simulator of a robot with legs on a floating base.
        speed: forward speed of the base [m/s] (default None: 0.1, or that of `distance`).
        period: length of a cycle, a whole number of time steps [s].
        duty: share of the period that a foot is on the ground, between 0 and 1.
        **gait: keywords of all periodic gaits, see `trot`.

    Returns:
        The gait: states and contact schedule, one row per time step.

    Raises:
        TypeError: `sim` is not a Simulator, or a keyword is unknown.
        ValueError: as for `trot`.
    """
    return _periodic(sim, "walk", _WALK, usual=0.1, speed=speed, period=period, duty=duty, **gait)


def hop(sim: Simulator, *, speed: float | None = None, period: float = 0.5, duty: float = 0.5, **gait: Any) -> Gait:
    """A hop: all feet together.

    Args:
        sim: simulator of a robot with legs on a floating base.
        speed: forward speed of the base [m/s] (default None: 0, or that of `distance`).
        period: length of a cycle, a whole number of time steps [s].
        duty: share of the period that a foot is on the ground, between 0 and 1.
        **gait: keywords of all periodic gaits, see `trot`.

    Returns:
        The gait: states and contact schedule, one row per time step.

    Raises:
        TypeError: `sim` is not a Simulator, or a keyword is unknown.
        ValueError: as for `trot`.
    """
    return _periodic(sim, "hop", _HOP, usual=0.0, speed=speed, period=period, duty=duty, **gait)


def turn(sim: Simulator, *, heading_rate: float = 0.5, period: float = 0.5, **gait: Any) -> Gait:
    """A trot that turns, by default on the spot.

    Args:
        sim: simulator of a robot with legs on a floating base.
        heading_rate: rate of turning, positive to the left [rad/s].
        period: length of a cycle, a whole number of time steps [s].
        **gait: `speed` (default 0), `duty`, and keywords of all periodic gaits, see `trot`.

    Returns:
        The gait: states and contact schedule, one row per time step.

    Raises:
        TypeError: `sim` is not a Simulator, or a keyword is unknown.
        ValueError: as for `trot`.
    """
    usual = {} if "distance" in gait else {"speed": 0.0}
    return trot(sim, **{**usual, **gait}, heading_rate=heading_rate, period=period)


def stand(sim: Simulator, *, duration: float = 1.0, height: float | None = None) -> Gait:
    """A robot that stands still, its feet below those of the neutral state.

    Args:
        sim: simulator of a robot with legs on a floating base.
        duration: length of the motion, a whole number of time steps [s].
        height: height of the base [m] (default None: that of the neutral state).

    Returns:
        The gait: states and contact schedule, one row per time step.

    Raises:
        TypeError: `sim` is not a Simulator.
        ValueError: for an argument out of range, a robot without legs, a foot that cannot reach its place, or a joint
            that would exceed its limits.
    """
    _check_legs("gaits.stand", sim)
    steps = _whole("gaits.stand(duration=...)", duration, sim.time_step)
    check_length("gaits.stand(duration=...)", sim, steps, "stand for less time")
    feet, ground = Feet(sim), _ground(sim)
    base = np.tile(sim.neutral()[BaseState.POSE], (steps + 2, 1))
    if height is not None:
        base[:, 2] = checks.number("gaits.stand(height=...)", height)
    places = np.tile(ground, (steps + 2, 1, 1))
    made = assemble(sim, "stand", base, places, np.ones(places.shape[:2], dtype=bool), names=feet.names)
    return replace(made, x=at_rest_on_ground(sim, made.x))


def jump(
    sim: Simulator,
    *,
    distance: float = 0.3,
    height: float = 0.2,
    crouch: float = 0.1,
    clearance: float = 0.08,
    before: float = 0.3,
    after: float = 0.4,
) -> Gait:
    """A jump from standing to standing.

    The base sinks within `before`, is pushed at constant acceleration back to where it stood, flies with its feet drawn
    in, and comes to rest in the same way, within `after`.

    Args:
        sim: simulator of a robot with legs on a floating base.
        distance: displacement along x [m].
        height: rise of the base over its first height [m], above 0, at most 1,000 times the crouch.
        crouch: drop of the base before the push [m], above 0.
        clearance: distance by which the feet are drawn in during the flight [m].
        before: time in which the base sinks [s], above 0. It, `after`, the push and the flight are rounded to whole
            time steps, one at least.
        after: time in which the base comes to rest [s], above 0.

    Returns:
        The gait: states and contact schedule, one row per time step.

    Raises:
        TypeError: `sim` is not a Simulator.
        ValueError: for an argument out of range, a robot without legs, a foot that cannot reach its place, a joint that
            would exceed its limits, or a scene without gravity.
    """
    call = "gaits.jump"
    _check_legs(call, sim)
    h = sim.time_step
    for name, value in (("distance", distance), ("clearance", clearance)):
        checks.number(f"{call}({name}=...)", value)
    for name, value in (("height", height), ("crouch", crouch), ("before", before), ("after", after)):
        checks.number(f"{call}({name}=...)", value, above=0.0)
    if height > _STRONGEST * crouch:  # the work of the push is that of the rise
        raise ValueError(
            f"{call}(height=..., crouch=...): expected a rise of at most {_STRONGEST:,.0f} times the crouch, whose "
            f"push takes as many times the weight; got {height:g} m from {crouch:g} m"
        )
    gravity = _gravity(sim)
    if gravity == 0.0:
        raise ValueError(f"{call}(sim): {sim.mechanism.name!r} has no gravity, so it never comes down")
    speed = float(np.sqrt(2.0 * gravity * height))
    durations = before, 2.0 * crouch / speed, 2.0 * speed / gravity, after
    sink, push, fly, rest = (max(1, round(min(d / h, 1e300))) for d in durations)
    check_length(f"{call}(...)", sim, sink + 2 * push + fly + rest, "jump in less time")
    ends = np.cumsum([0, sink, push, fly, push, rest]) * h
    t = h * np.arange(-1, round(ends[-1] / h) + 1)
    forward, up = _jump_path(np.clip(t, 0.0, None), ends, distance, crouch, height)
    base = np.tile(sim.neutral()[BaseState.POSE], (len(t), 1))
    base[:, 0] += forward
    base[:, 2] += up
    share = np.clip((t - ends[2]) / (ends[3] - ends[2]), 0.0, 1.0)
    feet = np.tile(_ground(sim), (len(t), 1, 1))
    feet[..., 0] += distance * (0.5 * (1.0 - np.cos(np.pi * share)))[:, None]
    feet[..., 2] += (np.maximum(up, 0.0) + clearance * np.sin(np.pi * share) ** 2)[:, None]
    contact = np.repeat(((t <= ends[2] + 1e-9) | (t >= ends[3] - 1e-9))[:, None], feet.shape[1], axis=1)
    soles = Feet(sim)
    if soles.flat:  # nothing but the feet keeps the robot from falling forward
        x = np.tile(sim.neutral(), (len(t), 1))
        x[:, BaseState.POSE] = base
        middle = feet[0, :, :2].mean(axis=0)
        base = balanced(soles, x, feet, middle + np.stack([forward, np.zeros_like(forward)], axis=1))
    return assemble(sim, "jump", base, feet, contact, names=soles.names)


def _jump_path(t: Floats, ends: Floats, distance: float, crouch: float, height: float) -> tuple[Floats, Floats]:
    """Base forward and up [m] over time: cosine, constant acceleration, parabola, and the same backwards."""
    rise = np.zeros_like(t)
    half = 0.5 * (ends[2] + ends[3])
    backwards = np.interp(t, [half, *ends[3:]], [half, *ends[2::-1]])
    mirrored = np.where(t <= half, t, backwards)
    sinking = mirrored <= ends[1]
    rise[sinking] = -0.5 * crouch * (1.0 - np.cos(np.pi * mirrored[sinking] / ends[1]))
    pushed = (mirrored > ends[1]) & (mirrored <= ends[2])
    rise[pushed] = -crouch + crouch * ((mirrored[pushed] - ends[1]) / (ends[2] - ends[1])) ** 2
    flown = mirrored > ends[2]
    rise[flown] = height * (1.0 - ((half - mirrored[flown]) / (half - ends[2])) ** 2)
    # forward at constant acceleration while pushed, constant speed in the air
    push, fly = ends[2] - ends[1], ends[3] - ends[2]
    speed = distance / (fly + push)
    into = np.clip(t - ends[1], 0.0, push)
    out = np.clip(t - ends[3], 0.0, push)
    forward = speed * (0.5 * into**2 / push + np.clip(t - ends[2], 0.0, fly) + out - 0.5 * out**2 / push)
    return forward, rise


def _gravity(sim: Simulator) -> float:
    """Acceleration of free fall [m/s^2]."""
    return float(np.linalg.norm(sim.mechanism.gravity))


def _check_legs(call: str, sim: Simulator) -> None:
    """Refuse robots without a floating base that has joints."""
    if not isinstance(sim, Simulator):
        raise TypeError(f"{call}(sim): expected a Simulator, got {sim!r}")
    joints = sim.mechanism.joints
    if joints[0].kind != "floating" or sim.nv == 6:
        raise ValueError(f"{call}(sim): expected a robot with legs on a floating base, got {sim.mechanism!r}")


def _ground(sim: Simulator) -> Floats:
    """(k, 3) feet of the neutral state, put onto the ground."""
    return Feet(sim).landed(sim.neutral())


def _whole(call: str, duration: float, step: float) -> int:
    """Number of time steps of a duration."""
    count = round(checks.number(call, duration, above=0.0) / step)
    if count < 1 or abs(count * step - duration) > 1e-6 * duration:
        raise ValueError(f"{call}: expected a whole number of time steps of {step:g} s, got {duration:g} s")
    return count


def settings_of(gait: Any) -> list[str]:
    """The keywords of a function of this file."""
    names = [name for name in signature(gait).parameters if name not in ("sim", "gait")]
    return names if gait is jump else list(dict.fromkeys([*names, *_KEYWORDS]))


def _periodic(
    sim: Simulator,
    name: str,
    offsets: dict[tuple[bool, bool], float],
    *,
    usual: float,
    speed: float | None,
    period: float,
    duty: float,
    distance: float | None = None,
    lateral: float = 0.0,
    heading_rate: float = 0.0,
    cycles: int = 2,
    step_height: float = 0.05,
    height: float | None = None,
    footholds: ArrayLike | None = None,
    tilt: float = 0.2,
    **unknown: Any,
) -> Gait:
    """A periodic gait; see `trot`."""
    call = f"gaits.{name}"
    checks.keywords(f"{call}(...)", unknown, _KEYWORDS)
    _check_legs(call, sim)
    for keyword, value in (("lateral", lateral), ("heading_rate", heading_rate)):
        checks.number(f"{call}({keyword}=...)", value)
    if not 0.0 < checks.number(f"{call}(duty=...)", duty) < 1.0:
        raise ValueError(f"{call}(duty=...): expected a share of the period between 0 and 1, got {duty}")
    for keyword, value in (("step_height", step_height), ("tilt", tilt)):
        checks.number(f"{call}({keyword}=...)", value, at_least=0.0)
    if height is not None:
        checks.number(f"{call}(height=...)", height)
    once = _whole(f"{call}(period=...)", period, sim.time_step)
    steps = once * checks.whole_number(f"{call}(cycles=...)", cycles)
    check_length(f"{call}(cycles=..., period=...)", sim, steps, "repeat a plan: Plan.repeated")
    forward = _forward(call, usual, speed, distance, steps * sim.time_step)
    feet, ground, neutral = Feet(sim), _ground(sim), sim.neutral()
    places = ground[:, :2] - neutral[:2]
    if footholds is not None:
        places = checks.array(f"{call}(footholds=...)", footholds, places.shape)
    offset = _offsets(offsets, places, [contact.body for contact in feet.contacts])
    velocity, steps_from = complex(forward, lateral), places[:, 0] + 1j * places[:, 1]
    pattern = Footfall(offset, duty, period, step_height, velocity, heading_rate, steps_from, _gravity(sim))
    t = sim.time_step * np.arange(-1, steps + 1)
    spot, heading = pattern.base(t)
    sway = pattern.sway(t, _inertia(sim), tilt)
    if len({contact.body for contact in feet.contacts}) == 2:  # two feet: the weight goes from one to the other
        spot = spot + 1j * np.exp(1j * heading) * pattern.shift(t, float(neutral[2] - ground[:, 2].mean()))
        sway[:, 1] = 0.0
    base = np.empty((len(t), 7))
    base[:, :3] = np.stack([spot.real, spot.imag, sway[:, 0] + (neutral[2] if height is None else height)], axis=1)
    base[:, :2] += neutral[:2]
    base[:, 3:] = _attitude(heading, sway[:, 2], sway[:, 1])
    where, lift = pattern.feet(t)
    targets = np.stack([where.real + neutral[0], where.imag + neutral[1], lift + ground[:, 2]], axis=2)
    return assemble(sim, name, base, targets, pattern.contact(t), names=feet.names)


def _forward(call: str, usual: float, speed: float | None, distance: float | None, duration: float) -> float:
    """Forward speed [m/s], from the speed or the distance that is given."""
    if speed is not None and distance is not None:
        raise ValueError(f"{call}(speed=..., distance=...): expected one of them, got {speed} m/s and {distance} m")
    if distance is not None:
        return checks.number(f"{call}(distance=...)", distance) / duration
    return usual if speed is None else checks.number(f"{call}(speed=...)", speed)


def _offsets(offsets: dict[tuple[bool, bool], float], places: Floats, bodies: Sequence[str]) -> Floats:
    """(k,) when each contact comes down, with those of its body, which is a foot: by left of two feet, by front and
    left of four, in turn along each side of more.
    """
    names = list(dict.fromkeys(bodies))
    owner = np.array([names.index(body) for body in bodies])
    centers = np.array([places[owner == k].mean(axis=0) for k in range(len(names))])
    middle = centers.mean(axis=0)
    left = centers[:, 1] > middle[1]
    front = (centers[:, 0] > middle[0]) & (len(centers) != 2)
    if len(centers) > 4:
        for side in (True, False):
            order = np.argsort(-centers[left == side, 0]).argsort()
            front[left == side] = order % 2 == 0
    return np.array([offsets[bool(x), bool(y)] for x, y in zip(front, left, strict=True)])[owner]


def _attitude(yaw: Floats, pitch: Floats, roll: Floats) -> Floats:
    """Quaternions (n, 4) of a turn about z, then y, then x, each in the axes of the one before."""
    (a, b, c), (d, e, f) = (np.cos([yaw / 2, pitch / 2, roll / 2]), np.sin([yaw / 2, pitch / 2, roll / 2]))
    return np.stack(
        [a * b * c + d * e * f, a * b * f - d * e * c, a * e * c + d * b * f, d * b * c - a * e * f], axis=1
    )


def _inertia(sim: Simulator) -> tuple[float, float, float]:
    """Mass [kg], and moments of inertia about x and y at the base [kg m^2], in the neutral configuration."""
    x = sim.neutral()
    mass = sum(body.mass for body in sim.mechanism.bodies)
    moments = []
    for axis in (0, 1):
        spun = x.copy()
        spun[:3] = 0.0
        spun[sim.nq + 3 + axis] = 1e-3
        still = x.copy()
        still[:3] = 0.0
        moments.append((sim.momentum(spun)[1][axis] - sim.momentum(still)[1][axis]) / 1e-3)
    return float(mass), float(moments[0]), float(moments[1])
