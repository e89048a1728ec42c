"""The Allegro hand turns an object on its palm."""

from __future__ import annotations

from dataclasses import replace
from math import pi
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.cost import Effort
from dojo_opt.tasks.jin.grasp import grasp
from dojo_opt.tasks.jin.palm_objects import OBJECTS
from dojo_opt.tasks.jin.palm_up import FINGERS, JOINTS, NAMES, mechanism, place_of_tip
from dojo_opt.tasks.jin.reposing import HORIZON, Aim, reposing
from dojo_opt.tasks.jin.trial import Trial, draws, pose, turn
from dojo_opt.tasks.suite import SuiteTask
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.overlaps import overlaps
from sim.mechanism.shapes import rotation_matrix
from sim.model.state_columns import BaseState
from solvers.types import Vector

__all__ = ["allegro"]

_CALL = "tasks.jin.allegro"
_SPREAD = 0.005  # [m] standard deviation of places
_QUARTER = 0.5 * pi
# until nothing overlaps at the start: lift [m], share of the bends of fingers that is kept, largest number of steps
_BENDS = {"first": 3, "middle": 3, "ring": 3, "thumb": 2}  # last joints of fingers
_LIFT, _UNBENT, _STEPS = 1e-3, 0.98, 100
# [N s m] of plans: the gap of a contact is kappa over its impulse; at 1e-4 objects float by centimetres, near their
# goals, and hands do not lift them
_KAPPA = 1e-5
# [m, rad] of the cube: a step of a plan that moves it by less is taken without a search, which takes most of a tick.
# The other objects have a tenth of its mass: bowl and camera are thrown then, and the foam brick stays farther off
_STEP_LIMIT = np.array([0.01] * 3 + [0.15] * 3 + [np.inf] * (FINGERS * JOINTS))


def trial_of(item: str, number: int) -> Trial:
    """A trial of the publication: an object above the palm, and a quarter turn about the vertical from there.

    Args:
        item: name of the object.
        number: number of the trial.

    Returns:
        The trial.

    Raises:
        ValueError: there is no such object or trial.
    """
    thing = OBJECTS[checks.one_of(f"{_CALL}(item)", item, OBJECTS)]
    random, up = draws(_CALL, number), (0.0, 0.0, 1.0)
    xy = np.asarray(thing.center) + _SPREAD * random.randn(2)
    yaw = 0.25 * pi + _QUARTER * random.rand() if item == "stick" else pi * random.rand() - _QUARTER
    sides = (-_QUARTER, _QUARTER) if thing.right_first else (_QUARTER, -_QUARTER)
    start = pose(xy, thing.height, turn(up, yaw))
    return Trial(start, pose(thing.goal[:2], thing.goal[2], turn(up, yaw + random.choice(sides))))


def _of_mass_center(place: Vector, com: ArrayLike) -> Vector:
    """The pose (7,) of a body by its centre of mass, from that of its frame, in which this is at com."""
    out = place.copy()
    out[:3] += rotation_matrix(place[3:]) @ np.asarray(com)
    return out


def _apart(start: Vector, hand: Mechanism) -> Vector:
    """Coordinates (23,) of the start, parted: hard contact would throw objects that overlap off the hand.

    Fingers that overlap the object are unbent step by step; an object that overlaps the palm or a base link is lifted,
    and so is one that overlaps fingers that are nearly straight.
    """
    q = np.array(hand.neutral)
    q[BaseState.POSE] = start
    for step in range(_STEPS):
        found = overlaps(hand, q)
        if not found:
            break
        stiff = {name for name in found if name.startswith("palm") or name.endswith(":0")}
        q[2] += _LIFT if stiff or step >= _STEPS // 2 else 0.0  # a wide object lies on fingers that are straight
        bent = {name.partition(":")[0] for name in found if name not in stiff}
        for k, finger in enumerate(NAMES):
            end = BaseState.JOINTS + JOINTS * (k + 1)
            q[end - _BENDS[finger] : end] *= _UNBENT if finger in bent else 1.0
    return q


def allegro(item: str = "cube", trial: int = 0, hull: ArrayLike | None = None, **settings: Any) -> SuiteTask:
    """Turn an object on the palm of the Allegro hand by a quarter turn: 10 knots of 40 ms at 50 Hz.

    Costs are those of the publication: 50 sin^2(angle / 2) at the end, squared distances of the tips from the object,
    and .1 of squared torques; the place of the object weighs 5000 at the end, five times as much as there. Angles are
    weighed by a quarter of their squares, and velocities of the object a little. The publication moves targets of
    servos of 1 N m/rad by up to .2 rad per tick of 100 ms; these are torques of up to .2 N m, held for 20 ms, on joints
    with the damper of the hand, .1 N m s/rad. Plans take no time.

    A run is a success, and ends, when the object is within 23 degrees of its goal for 2 s, wherever it is; it may take
    50 s. Links are balls, and capsules at their tips, where those of the publication are boxes with the same tips; they
    meet the object alone, and the palm is its box. Can, foam brick and stick are a cylinder, a box and a capsule of
    their sizes, and the torus, of which MuJoCo sees the convex hull, is a polytope of 60 corners. The others have mass,
    centre of mass, inertia and size of the publication's meshes, and are boxes or cylinders, unless the corners of
    their convex hulls are given. Plans see torus and others as ellipsoids, those of hulls the nearest ones, and tips as
    three balls each where they see a box or a cylinder; on the palm they see bowl and binoculars with a hull as that
    of 12 of its corners. Contacts have no torsional friction. At the start, fingers that
    overlap the object are unbent, or it is lifted.

    Args:
        item: "cube", "can", "foam brick", "stick", "torus", "bowl", "airplane", "binoculars", "cup", "mug",
            "piggy bank", "rubber duck", "teapot", "water bottle", "elephant" or "camera".
        trial: number of the trial, 0 to 19 (default 0).
        hull: (n, 3) points whose convex hull is the object in the plant, in the frame of its mesh [m] (default None:
            the shape of its size).
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: there is no such object or trial, or an argument is out of range.
    """
    given, aim = trial_of(item, trial), Aim(near=np.inf, turned=0.04, period=0.1, budget=50.0)
    terms = [Effort(0.1), grasp(FINGERS, JOINTS, place_of_tip, 1.0, 0.0, HORIZON)]
    thing = OBJECTS[item] if hull is None else OBJECTS[item].hulled(hull)
    given = Trial(*(_of_mass_center(place, thing.com) for place in given))
    name, hand = f"jin.allegro {item} {trial}", mechanism(item, thing)
    start = _apart(given.start, hand)
    given = given._replace(start=start[BaseState.POSE])
    hand, planned = (replace(mech, neutral=start) for mech in (hand, mechanism(item, thing, planned=True)))
    usual: dict[str, Any] = {"servo": None, "iterations": 1, "kappa": _KAPPA}
    if item == "cube":
        usual["step_limit"] = _STEP_LIMIT
    return reposing(name, given, planned, hand, terms, aim, {**usual, **settings})
