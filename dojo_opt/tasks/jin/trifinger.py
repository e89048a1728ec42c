"""Three fingers around a table move an object and turn it."""

from __future__ import annotations

from dataclasses import replace
from math import cos, pi, sin
from typing import Any

import numpy as np

from dojo_opt.cost import Effort
from dojo_opt.planning.residual import jit
from dojo_opt.tasks.idto.assembly import FileLink, assembled, from_com
from dojo_opt.tasks.jin.grasp import grasp
from dojo_opt.tasks.jin.reposing import HORIZON, Aim, reposing
from dojo_opt.tasks.jin.table import on_table
from dojo_opt.tasks.jin.trial import Trial, draws, pose, turn, within
from dojo_opt.tasks.suite import SuiteTask
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Capsule, Sphere

__all__ = ["trifinger"]

_CALL = "tasks.jin.trifinger"
_FINGERS, _LINK, _RADIUS = 3, 0.16, 0.011  # number, length and radius of links [m]
_BASE = 0.04, 0.29  # [m] from the middle, and above the table
_YAW = (0.0, -2.0 * pi / 3.0, 2.0 * pi / 3.0)  # [rad]
_START = (0.0, -0.7, -1.1)  # [rad]
_RANGES = ((-1.5708, 1.5708), (-1.35263, 4.49422), (-3.00197, 3.00197))  # [rad]
_DAMPER, _TORQUE = 0.05, 0.1  # [N m s/rad], [N m]
_TABLE, _TIP = 0.9, 0.9  # friction
_LONG, _THIN = 0.000353333, 5.33333e-5  # [kg m^2]
_MASS = 0.01  # [kg] of objects
_SHAPES = {"cube": Box(0.06, 0.06, 0.06, friction=0.5)}
_HEIGHT = {"cube": 0.03}  # [m]


def trial_of(item: str, number: int) -> Trial:
    """A trial of the publication: an object on the table, and another place and heading.

    Args:
        item: name of the object.
        number: number of the trial.

    Returns:
        The trial.

    Raises:
        ValueError: there is no such object or trial.
    """
    checks.one_of(f"{_CALL}(item)", item, _SHAPES)
    random, up = draws(_CALL, number), (0.0, 0.0, 1.0)
    xy = within(random, 0.05, 2)
    start = pose(xy, _HEIGHT[item], turn(up, -pi * random.rand() + 0.5 * pi))
    xy = within(random, 0.05, 2)
    return Trial(start, pose(xy, _HEIGHT[item], turn(up, pi * random.rand() - 0.5 * pi)))


def _links(limits: bool) -> list[FileLink]:
    """The links of the fingers, from their bases to their tips."""
    out = []
    ranges = _RANGES if limits else (None, None, None)
    for k, yaw in enumerate(_YAW, 1):
        place = (-_BASE[0] * sin(yaw), _BASE[0] * cos(yaw), _BASE[1])
        upper, middle, lower = (f"{part} {k}" for part in ("upper", "middle", "lower"))
        slender, rod = (_LONG, _LONG, _THIN), (8.36667e-5, 8.36667e-5, 1e-6)
        out += [
            FileLink(
                upper,
                None,
                0.2,
                (0.0, 0.06, 0.0),
                (_LONG, _THIN, _LONG),
                pos=place,
                quat=turn((0.0, 0.0, 1.0), yaw),
                axis=(0.0, 1.0, 0.0),
                limits=ranges[0],
            ),
            FileLink(middle, upper, 0.2, (0.028, 0.0, -0.08), slender, axis=(-1.0, 0.0, 0.0), limits=ranges[1]),
            FileLink(
                lower,
                middle,
                0.03,
                (0.0, 0.0, -0.126667),
                rod,
                pos=(0.0, 0.0, -_LINK),
                axis=(1.0, 0.0, 0.0),
                limits=ranges[2],
            ),
        ]
    return [link._replace(damping=0.0 if limits else _DAMPER) for link in out]


def mechanism(item: str, damped: bool = False) -> Mechanism:
    """An object on a table, and three fingers of three joints, whose drives carry their weight.

    The last link of a finger is a rod; plans know the ball at its end alone.

        q  (16,) pose of the object, three joints of each finger [rad]

    Args:
        item: name of the object.
        damped: whether it is the model of the controller, whose joints have dampers, bounded drives and no stops
            (default False).

    Returns:
        The mechanism.
    """
    links, shape = _links(limits=not damped), _SHAPES[item]
    bodies, joints = assembled(links)
    lowers = [link.name for link in links[2::3]]
    limit = _TORQUE if damped else np.inf
    contacts = on_table(item, shape, _TABLE)
    contacts += [Contact(name, from_com(links, name, (0.0, 0.0, -_LINK)), _RADIUS, friction=_TIP) for name in lowers]
    collisions = []
    for name in lowers:
        end, middle = (from_com(links, name, (0.0, 0.0, part * _LINK)) for part in (-1.0, -0.5))
        rod = Capsule(_RADIUS, _LINK, center=middle, friction=_TIP)
        collisions.append(Collision(item, name, shape, Sphere(_RADIUS, center=end, friction=_TIP) if damped else rod))
    neutral: dict[str, Any] = {link.name: angle for link, angle in zip(links, _START * _FINGERS, strict=True)}
    neutral[item] = (0.0, 0.0, _HEIGHT[item], 1.0, 0.0, 0.0, 0.0)
    return Mechanism(
        [Body(item, _MASS, shape=shape), *(replace(body, gravity_compensation=1.0) for body in bodies)],
        [Joint("floating", None, item), *joints],
        contacts,
        [Input(link.name, limits=(-limit, limit)) for link in links],
        collisions=collisions,
        name=f"trifinger and {item}",
        neutral=neutral,
    )


@jit
def place_of_tip(x: Any, k: int) -> Any:
    """Place of the tip of a finger, and its derivatives by the joints of the finger.

    Args:
        x: (nx,) state.
        k: number of the finger.

    Returns:
        (12,) tuple: place [m], and the derivatives by rows [m/rad].
    """
    a = 7 + 3 * k
    c1, s1 = cos(x[a]), sin(x[a])
    first, second = -x[a + 1], x[a + 2] - x[a + 1]
    y, z = _LINK * (sin(first) + sin(second)), -_LINK * (cos(first) + cos(second))
    y3, z3 = _LINK * cos(second), _LINK * sin(second)  # by the last joint
    c, s = cos(_YAW[k]), sin(_YAW[k])
    across, along = z * s1, _BASE[0] + y  # in the axes of the finger
    return (
        c * across - s * along,
        s * across + c * along,
        _BASE[1] + z * c1,
        c * z * c1,
        -c * y * s1 - s * z,
        c * z3 * s1 - s * y3,
        s * z * c1,
        -s * y * s1 + c * z,
        s * z3 * s1 + c * y3,
        -z * s1,
        -y * c1,
        z3 * c1,
    )


def trifinger(item: str = "cube", trial: int = 0, **settings: Any) -> SuiteTask:
    """Move an object on a table and turn it, with three fingers: 10 knots of 40 ms at 50 Hz.

    Costs are those of the publication: 10 (500 |p - p*|^2 + 5 sin^2(angle / 2)) at the end, half of the squared
    distances of the tips from the object, .05 of the square of the sum of their directions, and .1 of squared torques.
    Angles are weighed by a quarter of their squares here, and velocities of the object a little. The publication moves
    targets of servos by up to .01 rad per tick of 40 ms; these are torques of up to .1 N m on joints with the damper of
    its servos, .05 N m s/rad, here. Plans take no time, and know the ends of the fingers alone.

    A run is a success, and ends, when the object is within 20 mm and 23 degrees of its goal for .8 s; it may take 20 s.
    The last links are capsules of their length, and other links do not touch.

    Args:
        item: "cube".
        trial: number of the trial, 0 to 19 (default 0).
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: there is no such object or trial, or an argument is out of range.
    """
    given, aim = trial_of(item, trial), Aim(near=0.02, turned=0.04, period=0.04, budget=20.0)
    terms = [Effort(0.1), grasp(_FINGERS, 3, place_of_tip, 0.5, 0.05, HORIZON)]
    name = f"jin.trifinger {item} {trial}"
    return reposing(name, given, mechanism(item, damped=True), mechanism(item), terms, aim, settings)
