"""Take-off: the height to which the inputs of a robot can throw its base, at most."""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.static_motions import input_map
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["highest_rise"]

_STEP = 0.04  # of the height of the base over its feet: from one posture of the stroke to the next


def highest_rise(sim: Simulator, limits: Any) -> float:
    """How far the base rises over the neutral state in a jump on the spot, at most, with massless legs.

    The base moves straight up over its standing feet, from the posture in which the legs are folded as far as their
    stops allow to the one in which they are stretched. In each the feet press down as hard as the limits of the inputs
    and friction allow, whatever that does to the attitude of the base. Over a part of the stroke dz they do the work
    F dz, at most that of the inputs at their limits. With the weight m g the whole stroke s leads to the height
    sum(F dz) / (m g) - s over the stretched posture.

    Args:
        sim: simulator of a robot on a floating base, whose neutral state stands on its feet.
        limits: (lower, upper), numbers or (nu,): limits of the inputs [N, N m].

    Returns:
        The rise [m]; infinite where an input has no limit, a joint has a spring, or there is no gravity.
    """
    mech = sim.mechanism
    low, high = (np.broadcast_to(np.asarray(bound, dtype=float), sim.nu) for bound in limits)
    weight = float(sum(body.mass for body in mech.bodies) * np.linalg.norm(mech.gravity))
    sprung = any(np.any(joint.spring) for joint in mech.joints)
    if weight == 0.0 or sprung or not np.all(np.isfinite(low) & np.isfinite(high)):
        return np.inf
    feet = Feet(sim)
    places = feet.landed(sim.neutral())
    dz = _STEP * float(sim.neutral()[2] - places[:, 2].min())
    down, up = (_stroke(feet, places, step) for step in (-dz, dz))
    states = np.array([*down[::-1], sim.neutral(), *up])
    force = np.array([_press(feet, x, low, high) for x in states])
    turned = np.abs(sim.difference(states[1:], states[:-1])[:, 6 : sim.nv])
    strength = np.abs(input_map(sim)[6:]) @ np.maximum(np.abs(low), np.abs(high))
    work = np.minimum(0.5 * dz * (force[1:] + force[:-1]), turned @ strength)
    ends = work[0] + work[-1] if len(work) else 0.0  # the stops are within a step beyond the last postures
    stroke = dz * (len(work) + 2)
    return dz * (len(up) + 1) + float(work.sum() + ends) / weight - stroke


def _stroke(feet: Feet, places: Floats, dz: float) -> list[Floats]:
    """States (nx,) whose base is higher by dz from one to the next, the feet at their places, until the legs end."""
    out: list[Floats] = []
    x = feet.sim.neutral()
    while True:
        x = x.copy()
        height = BaseState.POSITION.stop - 1
        x[height] += dz
        if x[height] <= places[:, 2].min():
            return out
        try:
            x = feet.place(x, places[None])[0]
        except ValueError:
            return out
        out.append(x)


def _press(feet: Feet, x: Floats, low: Floats, high: Floats) -> float:
    """Largest vertical force of all feet on the ground in a state, with inputs within their limits [N]."""
    from scipy.optimize import linprog  # .3 s, which only jumps beyond the usual need

    sim, k = feet.sim, len(feet.names)
    J = feet.touching(x).jacobian(x)[..., 6:].reshape(3 * k, -1)
    B = input_map(sim)[6:]
    driven = B.any(axis=1)
    balance = np.concatenate([J.T, B], axis=1)[driven]
    cone = np.zeros((4 * k, 3 * k + sim.nu))
    for i, contact in enumerate(feet.contacts):
        for side in range(4):
            cone[4 * i + side, 3 * i + side // 2] = (1.0, -1.0)[side % 2]
            cone[4 * i + side, 3 * i + 2] = -contact.friction if contact.law != "impact" else 0.0
    gain = np.zeros(3 * k + sim.nu)
    gain[2 : 3 * k : 3] = -1.0
    bounds = [*[(None, None), (None, None), (0.0, None)] * k, *zip(low, high, strict=True)]
    found = linprog(gain, A_ub=cone, b_ub=np.zeros(4 * k), A_eq=balance, b_eq=np.zeros(len(balance)), bounds=bounds)
    return -float(found.fun) if found.status == 0 else np.inf
