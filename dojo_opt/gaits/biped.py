"""Steps of a biped: the weight moves onto one foot, the other swings forward, the weight moves between the two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.gait import Gait, assemble, check_length
from dojo_opt.gaits.minimum_jerk import minimum_jerk
from sim.mechanism import checks
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["step"]

_CORRECTIONS = 8  # of the base, for the centre of mass to be where it should
_CLOSE = 1e-6  # [m]
_OFF = 0.05  # [rad] of hinges from their stops, and share of their range


def step(
    sim: Simulator,
    *,
    swinging: str | None = None,
    length: float = 0.2,
    step_height: float = 0.05,
    lower: float = 0.03,
    shift: float = 1.2,
    swing: float = 0.6,
    settle: float = 0.4,
    after: Gait | None = None,
) -> Gait:
    """One step of a biped along x, so slow that the robot is always in balance.

    In `shift` seconds the centre of mass moves over the middle of the other foot, in `swing` seconds the foot moves, in
    `shift` seconds the centre of mass moves between the feet, and for `settle` seconds nothing moves. The base goes
    down during the first shift, and stays there. Joints outside the legs keep their neutral angles.

    Feet are the bodies at the ends of the tree that have contacts: two, with three contacts or more each, or the ankles
    would be free. Three steps of Atlas in a row:

        gait = None
        for foot, length in (("l_foot", 0.2), ("r_foot", 0.4), ("l_foot", 0.2)):
            gait = dojo.gaits.step(sim, swinging=foot, length=length, lower=0.1, after=gait)

    Args:
        sim: simulator of a biped on a floating base.
        swinging: name of the body that swings (default None: the first foot).
        length: displacement of the foot along x [m].
        step_height: lift of the foot [m].
        lower: distance of the base below the neutral state from the first shift on [m].
        shift: duration of each shift of the weight [s].
        swing: duration of the swing [s].
        settle: time at rest at the end [s].
        after: gait at whose end the step begins (default None: the step begins in the neutral state).

    Returns:
        The gait: that of `after`, then the step.

    Raises:
        TypeError: `sim` is not a Simulator, or `after` not a Gait.
        ValueError: for an argument out of range, a robot that has not two feet, a foot that cannot reach its place, or
            an `after` of another robot or time step.
    """
    if not isinstance(sim, Simulator):
        raise TypeError(f"gaits.step(sim): expected a Simulator, got {checks.shown(sim)}")
    for name, value in (("length", length), ("step_height", step_height), ("lower", lower)):
        checks.number(f"gaits.step({name}=...)", value)
    feet = Feet(sim)
    swung = _swung(feet, swinging)
    spans = [checks.number(f"gaits.step({n}=...)", t, above=0.0) for n, t in (("shift", shift), ("swing", swing))]
    total = 2.0 * spans[0] + spans[1] + checks.number("gaits.step(settle=...)", settle, at_least=0.0)
    steps = round(min(total / sim.time_step, 1e300))
    check_length("gaits.step(shift=..., swing=..., settle=...)", sim, steps, "step in less time")
    time = sim.time_step * np.arange(-1.0, steps + 1.0)
    out, over, back = (
        minimum_jerk((time - begin) / span) for begin, span in ((0.0, shift), (shift, swing), (shift + swing, shift))
    )
    start = sim.neutral() if after is None else _end(sim, after)
    path = _swing_path(feet.positions(start), swung, over, length, step_height)
    first = path[0, :, :2].mean(axis=0) if after is None else _center(sim, start[None])[0]
    stance, last = path[0, ~swung, :2].mean(axis=0), path[-1, :, :2].mean(axis=0)
    goal = first + out[:, None] * (stance - first) + back[:, None] * (last - stance)
    x = np.tile(start, (len(time), 1))
    x[:, 2] += out * (sim.neutral()[2] - lower - start[2])
    try:
        base = balanced(feet, x, path, goal)
    except ValueError as error:
        raise ValueError(f"gaits.step(length={length:g}, lower={lower:g}): {error}") from error
    contact = np.ones((len(time), len(swung)), dtype=bool)
    contact[:, swung] = ((over <= 0.0) | (over >= 1.0))[:, None]
    gait = assemble(sim, "step", base, path, contact, names=feet.names)
    return gait if after is None else after.then(gait)


def _swing_path(feet: Floats, swung: NDArray[np.bool_], over: Floats, length: float, height: float) -> Floats:
    """(T, k, 3) places of the contacts, of which those that swing have gone the share `over` (T,) of a step."""
    path = np.tile(feet, (len(over), 1, 1))
    path[:, swung, 0] += length * over[:, None]
    path[:, swung, 2] += height * (4.0 * over * (1.0 - over))[:, None]
    return path


def _swung(feet: Feet, swinging: str | None) -> NDArray[np.bool_]:
    """(k,) which contacts belong to the foot that swings."""
    owner = np.array([contact.body for contact in feet.contacts])
    names = list(dict.fromkeys(owner.tolist()))
    if len(names) != 2:
        raise ValueError(f"gaits.step({feet.sim.mechanism.name}): expected two feet, got {', '.join(names)}")
    moving = names[0] if swinging is None else swinging
    checks.one_of("gaits.step(swinging=...)", moving, names)
    return np.asarray(owner == moving)


def _end(sim: Simulator, after: Gait) -> Floats:
    """The last state of `after`, at rest."""
    if not isinstance(after, Gait):
        raise TypeError(f"gaits.step(after=...): expected a Gait, got {after!r}")
    other = after.simulator
    if (other.mechanism.name, other.nx, other.time_step) != (sim.mechanism.name, sim.nx, sim.time_step):
        raise ValueError(
            f"gaits.step(after=...): expected a gait of {sim.mechanism.name!r} with steps of {sim.time_step:g} s, got "
            f"one of {other.mechanism.name!r} with {other.time_step:g} s"
        )
    state = after.x[-1].copy()
    state[sim.nq :] = 0.0
    return np.asarray(state)


def _center(sim: Simulator, x: Floats) -> Floats:
    """(n, 2) places of the centre of mass of states (n, nx), seen from above [m]."""
    mass = np.array([body.mass for body in sim.mechanism.bodies])
    return np.asarray(np.einsum("b,nbk->nk", mass / mass.sum(), sim.maximal(x)[..., :2]))


def balanced(feet: Feet, x: Floats, path: Floats, goal: Floats) -> Floats:
    """Poses of the base near those of given states for which the centre of mass is where it should be.

    Args:
        feet: the feet.
        x: (n, nx) states.
        path: (n, k, 3) places of the feet [m].
        goal: (n, 2) places of the centre of mass, or (2,) [m].

    Returns:
        (n, 7) poses.

    Raises:
        ValueError: a foot cannot reach its place.
    """
    sim = feet.sim
    x = np.array(x)
    for _ in range(_CORRECTIONS):
        x = feet.place(x, path)
        center = _center(sim, x)
        if np.abs(goal - center).max() < _CLOSE:
            break
        x[:, :2] += goal - center
    return np.asarray(x[:, BaseState.POSE])


def over_its_feet(sim: Simulator) -> Floats:
    """The neutral state with the centre of mass above the middle of the soles, and all hinges off their stops.

    Args:
        sim: simulator of a robot on its feet.

    Returns:
        (nx,) state.

    Raises:
        ValueError: a foot cannot reach its place.
    """
    feet, x = Feet(sim), _inside(sim)[None]
    places = feet.positions(x)
    x[:, BaseState.POSE] = balanced(feet, x, places, places[0, :, :2].mean(axis=0))
    return np.asarray(feet.place(x, places)[0])


def _inside(sim: Simulator) -> Floats:
    """The stance (nx,) with all hinges off their stops, where a smooth stop would push with an infinite torque."""
    x, legs = sim.neutral(), slice(sim.mechanism.joints[0].nq, sim.nq)
    lo, hi = (bound[legs] for bound in sim.mechanism.coordinate_limits)
    off = np.minimum(_OFF, _OFF * (hi - lo))
    x[legs] = np.clip(x[legs], lo + off, hi - off)
    return x
