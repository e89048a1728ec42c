"""Three fingertips without a hand grasp, lift and turn an object."""

from __future__ import annotations

from collections.abc import Callable
from itertools import combinations
from typing import Any

import numpy as np

from dojo_opt.cost import Effort
from dojo_opt.tasks.jin.grasp import grasp, place_of_ball
from dojo_opt.tasks.jin.reposing import HORIZON, Aim, reposing
from dojo_opt.tasks.jin.table import on_table
from dojo_opt.tasks.jin.trial import Trial, draws, followed, pose, turn, within
from dojo_opt.tasks.suite import SuiteTask
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Capsule, Sphere
from solvers.types import Vector

__all__ = ["fingertips"]

_CALL = "tasks.jin.fingertips"
_TIPS, _TIP, _TIP_MASS = 3, 0.01, 0.00418879  # number, radius [m], [kg]
_PLACES = ((0.2, 0.0), (0.0, 0.2), (-0.2, 0.0))  # [m]
_DAMPER, _FORCE = 2.0, 0.5  # [N s/m], [N]
_TABLE = 0.5  # friction
_MASS = 0.01  # [kg] of objects
_ALONG_X = (0.5**0.5, 0.0, 0.5**0.5, 0.0)  # turns the axis of a capsule
_SHAPES = {
    "cube": Box(0.06, 0.06, 0.06, friction=0.9),
    "foam brick": Box(0.0466, 0.0753, 0.0516, friction=0.9),
    "stick": Capsule(0.015, 0.1, orientation=_ALONG_X, friction=0.5),
}
_ROUNDED = {"foam brick": 0.012}  # [m] radius of its corners on the table, which are 14 mm inside those of the box
_HEIGHT = {"cube": 0.03, "foam brick": 0.03, "stick": 0.015}  # [m] at the start
_LIFTED = {"cube": 0.05, "foam brick": 0.04}  # [m] lowest goal in the air
_FLIPPED = {"cube": 0.05, "foam brick": 0.03, "stick": 0.015}  # [m] goal of a flip


def _in_air(item: str, random: np.random.RandomState) -> Vector:
    """A goal above the table: turned about an axis between y and z."""
    z = _LIFTED[item] + 0.05 * random.rand()
    xy = within(random, 0.1, 2)
    angle = float(within(random, np.pi)[0])
    return pose(xy, z, turn(np.array([0.0, 1.0, 1.0]) + 0.1 * random.randn(3), angle))


def _rotation(item: str, random: np.random.RandomState) -> Vector:
    """A goal on the table: turned about the vertical."""
    xy = within(random, 0.1, 2)
    return pose(xy, _HEIGHT[item], turn((0.0, 0.0, 1.0), float(within(random, np.pi)[0])))


def _flip(item: str, random: np.random.RandomState) -> Vector:
    """A goal near the table: turned about all axes, a stick not about its transversal one."""
    xy = within(random, 0.1, 2)
    yaw = float(within(random, np.pi)[0])
    pitch = 0.0 if item == "stick" else float(within(random, 0.5 * np.pi)[0])
    roll = float(within(random, 0.5 * np.pi)[0])
    turns = turn((0.0, 0.0, 1.0), yaw), turn((0.0, 1.0, 0.0), pitch), turn((1.0, 0.0, 0.0), roll)
    return pose(xy, _FLIPPED[item], followed(*turns))


_GOALS: dict[str, Callable[[str, np.random.RandomState], Vector]] = {
    "in-air": _in_air,
    "rotation": _rotation,
    "flip": _flip,
}
_MOTIONS = {"cube": tuple(_GOALS), "foam brick": tuple(_GOALS), "stick": ("flip",)}


def trial_of(item: str, motion: str, number: int) -> Trial:
    """A trial of the publication.

    Args:
        item: name of the object.
        motion: "in-air", "rotation" or "flip".
        number: number of the trial.

    Returns:
        The trial.

    Raises:
        ValueError: there is no such object, motion or trial.
    """
    checks.one_of(f"{_CALL}(item)", item, _SHAPES)
    checks.one_of(f"{_CALL}(motion) of {item!r}", motion, _MOTIONS[item])
    random = draws(_CALL, number)
    xy = within(random, 0.025, 2)
    start = pose(xy, _HEIGHT[item], turn((0.0, 0.0, 1.0), float(within(random, np.pi)[0])))
    return Trial(start, _GOALS[motion](item, random))


def mechanism(item: str, damped: bool = False) -> Mechanism:
    """An object on a table and three balls, which float and slide along x, y and z.

        q  (16,) pose of the object, places of the balls [m]

    Args:
        item: name of the object.
        damped: whether it is the model of the controller, whose balls have dampers and bounded drives, and pass through
            one another (default False).

    Returns:
        The mechanism.
    """
    shape, ball = _SHAPES[item], Sphere(_TIP, friction=_TABLE)
    tips = [f"tip {k + 1}" for k in range(_TIPS)]
    bodies = [Body(item, _MASS, shape=shape)]
    bodies += [Body(tip, _TIP_MASS, shape=ball, gravity_compensation=1.0) for tip in tips]
    joints = [Joint("floating", None, item)]
    joints += [Joint("fixed_orientation", None, tip, damper=_DAMPER if damped else 0.0) for tip in tips]
    limit = _FORCE if damped else np.inf
    inputs = [
        Input(tip, dof=k, name=f"{tip} {axis}", limits=(-limit, limit)) for tip in tips for k, axis in enumerate("xyz")
    ]
    contacts = on_table(item, shape, _TABLE, _ROUNDED.get(item, 0.0))
    contacts += [Contact(tip, radius=_TIP, friction=_TABLE) for tip in tips]
    pairs = [(item, tip) for tip in tips]
    if not damped:
        pairs += combinations(tips, 2)
    return Mechanism(
        bodies,
        joints,
        contacts,
        inputs,
        collisions=[Collision(a, b) for a, b in pairs],
        name=f"fingertips and {item}",
        neutral={tip: (*place, _TIP) for tip, place in zip(tips, _PLACES, strict=True)},
    )


def fingertips(item: str = "cube", motion: str = "rotation", trial: int = 0, **settings: Any) -> SuiteTask:
    """Bring an object to a pose with three fingertips: 10 knots of 40 ms at 50 Hz.

    Costs are those of the publication: 10 (500 |p - p*|^2 + 5 sin^2(angle / 2)) at the end, squared distances of the
    tips from the object, .05 of the square of the sum of their directions, and 5e-3 of squared forces. Angles are
    weighed by a quarter of their squares here, and velocities of the object a little. The publication moves targets of
    servos by up to 5 mm per tick; these are forces of up to .5 N on tips with the damper of its servos, 2 N s/m, here.
    Plans take no time, and let the tips pass through one another, as in the publication.

    A run is a success, and ends, when the object is within 20 mm and 14 degrees of its goal for .4 s. It may take 40 s,
    in the air 60 s. The tips start on the table, where those of the publication are half inside it. Foam brick and
    stick are a box and a capsule of their sizes; contacts have no torsional friction.

    Args:
        item: "cube", "foam brick" or "stick".
        motion: "in-air", "rotation" (about the vertical) or "flip" (about all axes); of the stick, only "flip".
        trial: number of the trial, 0 to 19 (default 0).
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: there is no such object, motion or trial, or an argument is out of range.
    """
    given = trial_of(item, motion, trial)
    aim = Aim(near=0.02, turned=0.015, period=0.02, budget=60.0 if motion == "in-air" else 40.0)
    terms = [Effort(5e-3), grasp(_TIPS, 3, place_of_ball, 1.0, 0.05, HORIZON)]
    name = f"jin.fingertips {item} {motion} {trial}"
    return reposing(name, given, mechanism(item, damped=True), mechanism(item), terms, aim, settings)
