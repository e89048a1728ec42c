"""One step of a biped: the weight goes onto one foot, the other swings forward, the weight goes between the two."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from dojo_opt.feet import Feet
from dojo_opt.gaits.gait import Gait, assemble
from sim import checks
from sim.simulator import Simulator

Array = NDArray[np.float64]

__all__ = ["step"]

_CORRECTIONS = 8  # of the base, for the centre of mass to be where it should
_CLOSE = 1e-6  # [m]


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
) -> Gait:
    """Reference of one step of the body `swinging` (by default the first foot) by `length` [m] along x.

    So slow that the robot is in balance all the way: in `shift` seconds the centre of mass moves over the middle of the
    other foot, in `swing` seconds the foot moves, rising by `step_height` [m], in `shift` seconds the centre of mass
    moves between the feet, and for `settle` seconds nothing does. The base goes `lower` [m] down during the first shift
    and stays there. Joints that lead to no foot keep their neutral angles.

    Feet are the bodies at the ends of the tree that have contacts: two, with three contacts or more each, or the
    ankles would be free. ValueError: they are not two, or a foot cannot reach its place.
    """
    for name, value in (("length", length), ("step_height", step_height), ("lower", lower)):
        checks.number(f"gaits.step({name}=...)", value)
    feet = Feet(sim)
    owner = np.array([contact.body for contact in feet.contacts])
    names = list(dict.fromkeys(owner.tolist()))
    if len(names) != 2:
        raise ValueError(f"gaits.step({sim.mechanism.name}): expected two feet, got {', '.join(names)}")
    moving = names[0] if swinging is None else swinging
    checks.one_of("gaits.step(swinging=...)", moving, names)
    spans = [checks.number(f"gaits.step({n}=...)", t, above=0.0) for n, t in (("shift", shift), ("swing", swing))]
    total = 2.0 * spans[0] + spans[1] + checks.number("gaits.step(settle=...)", settle, at_least=0.0)
    time = sim.time_step * np.arange(-1.0, round(total / sim.time_step) + 1.0)
    out, over, back = (
        _smooth((time - begin) / span) for begin, span in ((0.0, shift), (shift, swing), (shift + swing, shift))
    )
    places = feet.positions(sim.neutral())
    path = np.tile(places, (len(time), 1, 1))
    swung = owner == moving
    path[:, swung, 0] += length * over[:, None]
    path[:, swung, 2] += step_height * (4.0 * over * (1.0 - over))[:, None]
    stance = places[~swung].mean(axis=0)
    first = places.mean(axis=0)
    last = first + (0.5 * length, 0.0, 0.0)
    goal = first + out[:, None] * (stance - first) + back[:, None] * (last - stance)
    base = _balanced(sim, feet, path, goal[:, :2], lower * out)
    contact = np.ones((len(time), len(owner)), dtype=bool)
    contact[:, swung] = ((over <= 0.0) | (over >= 1.0))[:, None]
    return assemble(sim, "step", base, path, contact, names=feet.names)


def _smooth(t: Array) -> Array:
    """0 before 0, 1 after 1, with two derivatives zero at both: 10 t^3 - 15 t^4 + 6 t^5."""
    t = np.clip(t, 0.0, 1.0)
    return np.asarray(t**3 * (10.0 - 15.0 * t + 6.0 * t**2))


def _balanced(sim: Simulator, feet: Feet, path: Array, goal: Array, lower: Array) -> Array:
    """Poses (n, 7) of the base, upright, for which the centre of mass is above `goal` (n, 2)."""
    mass = np.array([body.mass for body in sim.mechanism.bodies])
    x = np.tile(sim.neutral(), (len(path), 1))
    x[:, 2] -= lower
    for _ in range(_CORRECTIONS):
        x = feet.place(x, path)
        centre = np.einsum("b,nbk->nk", mass / mass.sum(), sim.maximal(x)[..., :2])
        if np.abs(goal - centre).max() < _CLOSE:
            break
        x[:, :2] += goal - centre
    return x[:, :7]
