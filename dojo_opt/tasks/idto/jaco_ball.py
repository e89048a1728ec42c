"""An arm rolls a ball along the ground."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dojo_opt.cost import Clearance
from dojo_opt.mpc.controller import MPC
from dojo_opt.planning.options import Options, Stage
from dojo_opt.planning.problem import Problem
from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.tasks.idto.assembly import FileLink, assembled, from_com
from dojo_opt.tasks.suite import SuiteTask, held, quadratic, servo_effort, timed
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Sphere
from sim.simulator.simulator import Simulator

__all__ = ["jaco_ball"]

_KNOT, _HORIZON, _RATE = 0.05, 20, 100.0  # [s], knots, [Hz]
_JOINTS, _BALL = 7, slice(7, 10)  # of the arm; place of the ball in a state
_NEAR, _HELD = 0.02, 0.5  # [m], [s]
_KAPPA = 2e-5  # [N s m] at 1e-3 friction is viscous and hardly rolls the ball, at 1e-6 the arm does not find it
_KAPPA_GRAD = 5e-5  # [N s m] with derivatives at _KAPPA, plans lose the ball as the arm touches it
_FRICTION = 0.4  # assumed by plans: with all of .5 the arm slips off the ball, and leaves it behind
_SPIN = 0.03  # [1/(rad/s)^2] of the ball, .1 in the publication
_TOUCH = 10.0  # [1/m^2] of the distance of stub and ball
_KP = np.array([500.0, 500.0, 250.0, 500.0, 250.0, 250.0, 250.0])  # [N m/rad]
_KD = 0.1 * _KP  # [N m s/rad]
_ARM = (1.57, 2.0, 0.0, 4.4, 0.0, 2.4, 0.0)  # [rad]
_START, _GOAL = (0.6, 0.27, 0.06), (0.6, 0.0, 0.06)  # [m] of the ball
_HALF = 0.5**0.5
_HEAVY = 1.0  # [kg m^2] of links 4 and 7, as the publication's file has them
_LONG, _THIN = 0.00247074, 0.000380115  # [kg m^2]
_STUB = 0.001 * -0.06 / 0.011  # [m] centre of mass of the last link with its stub
# mass [kg], centre of mass [m] and moments of inertia [kg m^2] of each link; its place and quaternion on the one before
_LINKS = (
    (
        0.7477,
        (0.0, -0.002, -0.0605),
        (0.00152032, 0.00152032, 0.00059816),
        (0.0, 0.27, 0.26675),
        (0.0, -_HALF, _HALF, 0.0),
    ),
    (0.8447, (0.0, -0.103563, 0.0), (_LONG, _THIN, _LONG), (0.0, 0.0016, -0.11875), (0.0, 0.0, -_HALF, _HALF)),
    (0.8447, (0.0, 0.0, -0.102245), (_LONG, _LONG, _THIN), (0.0, -0.205, 0.0), (_HALF, -_HALF, 0.0, 0.0)),
    (0.6763, (0.0, 0.081, -0.0086), (_HEAVY, _HEAVY, _HEAVY), (0.0, 0.0, -0.205), (0.0, 0.0, -_HALF, -_HALF)),
    (
        0.463,
        (0.0, 0.002885, -0.054193),
        (0.000432132, 0.000432132, 9.26e-5),
        (0.0, 0.2073, -0.0114),
        (0.0, 0.0, _HALF, -_HALF),
    ),
    (
        0.463,
        (0.0, 0.049721, -0.002856),
        (0.000432132, 9.26e-5, 0.000432132),
        (0.0, 0.0, -0.10375),
        (0.0, 0.0, -_HALF, -_HALF),
    ),
    (
        0.011,
        (0.0, 0.0, _STUB),
        (_HEAVY + 1.03e-4, _HEAVY + 1.03e-4, _HEAVY + 1e-4),
        (0.0, 0.10375, 0.0),
        (0.0, 0.0, _HALF, -_HALF),
    ),
)
_EFFORT = (40.0, 80.0, 40.0, 40.0, 20.0, 20.0, 20.0)  # [N m]
_SPHERES = (("link_6", (0.0, 0.0, 0.0), 0.048), ("link_7", (0.0, 0.0, 0.0), 0.03275))
_NUB = ("link_7", (0.0, 0.0, -0.055), 0.03275)


def arm() -> list[FileLink]:
    """The links of the arm on its base at (0, .27, .11) m, the stub at its end welded to the last one.

    Returns:
        Seven links.
    """
    return [
        FileLink(f"link_{k}", f"link_{k - 1}" if k > 1 else None, mass, com, inertia, pos=pos, quat=quat)
        for k, (mass, com, inertia, pos, quat) in enumerate(_LINKS, 1)
    ]


def mechanism(friction: float, servos: bool = False) -> Mechanism:
    """The arm, which floats, and the ball on the ground: the three last spheres of the arm touch both.

        q  (14,) joints 1 to 7 of the arm [rad], ball

    Args:
        friction: coefficient of friction.
        servos: whether its joints have the servos of the controller (default False).

    Returns:
        The mechanism.
    """
    links = arm()
    bodies, joints = assembled(links)
    bodies = [replace(body, gravity_compensation=1.0) for body in bodies]
    if servos:
        gains = zip(joints, _KP, _KD, strict=True)
        joints = [replace(joint, spring=float(kp), damper=float(kd)) for joint, kp, kd in gains]
    mass, radius = 0.3, 0.06
    spheres = [(link, from_com(links, link, point), size) for link, point, size in (*_SPHERES, _NUB)]
    collisions = [
        Collision("ball", link, Sphere(radius), Sphere(size, center=point), friction=friction, name=f"{link}:{k}")
        for k, (link, point, size) in enumerate(spheres)
    ]
    contacts = [Contact("ball", radius=radius, friction=friction)]
    contacts += [
        Contact(link, point, size, friction, name=f"{link}:{k} on ground")
        for k, (link, point, size) in enumerate(spheres)
    ]
    neutral: dict[str, Any] = {link.name: angle for link, angle in zip(links, _ARM, strict=True)}
    neutral["ball"] = (*_START, 1.0, 0.0, 0.0, 0.0)
    return Mechanism(
        [*bodies, Body("ball", mass, 0.4 * mass * radius**2 * np.eye(3))],
        [*joints, Joint("floating", None, "ball")],
        contacts,
        [
            Input(link.name, limits=(-np.inf, np.inf) if servos else (-e, e))
            for link, e in zip(links, _EFFORT, strict=True)
        ],
        collisions=collisions,
        name="jaco_ball",
        neutral=neutral,
    )


def jaco_ball(**settings: Any) -> SuiteTask:
    """Roll a ball by .27 m: 20 knots of 50 ms and two iterations per tick, at 100 Hz.

    The arm is carried by its drives. Its servos are those of the publication, which the plan knows here: hard contact
    has no overlap, so an arm that follows the planned angles alone would touch the ball without pressing on it. Three
    things differ from the publication's cost. The horizon is 1 s instead of .5 s, and the spin of the ball weighs .03
    instead of .1: a ball that rolls without slip would take 3 s for two thirds of its way. The squared distance of the
    arm's stub from the ball weighs 10 per m^2; without it, an arm that loses the ball lets it roll away.

    A run of 5 s is a success when the ball stays within 20 mm of its goal for .5 s. Its radius is 60 mm in the plant,
    too, where the publication has 63 mm, against forces that act at a distance.

    Args:
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    sim = Simulator(mechanism(0.5, servos=True), time_step=_KNOT, kappa=_KAPPA)
    own = mechanism(0.5)
    start = sim.neutral()
    goal = start.copy()
    goal[_BALL] = _GOAL
    free, turn = np.zeros(7), 0.25e-4 * np.ones(3)  # of squares of four numbers of a quaternion, a quarter
    rates = np.concatenate([np.full(3, 0.1), np.full(3, _SPIN)])
    running = np.concatenate([free, np.ones(3), turn]), np.concatenate([np.full(7, 0.1), rates])
    end = np.concatenate([free, np.full(3, 10.0), turn]), np.concatenate([np.ones(7), rates])
    touch = own.collisions[-1]  # of the stub
    cost = [
        quadratic(goal, _KNOT, _HORIZON, running, end),
        servo_effort(sim, own, _KNOT * 0.01, _HORIZON),
        Clearance("ball", touch.b, target=0.0, shape_a=touch.shape_a, shape_b=touch.shape_b, weight=_TOUCH),
    ]
    problem = Problem(sim, start, _HORIZON, cost=cost, controls0=_KP * start[:_JOINTS])
    given = timed(_RATE) | {"iterations": 2, "servo": own, "gain_scale": 0.0}
    given |= {"kappa": _KAPPA, "kappa_grad": _KAPPA_GRAD, "friction": _FRICTION}
    given |= {"first": Options(stages=(Stage(_KAPPA, _KAPPA),))}
    mpc = MPC(problem, **{**given, **settings})
    model = Simulator(own, time_step=1e-3, kappa=1e-8)
    spread = np.concatenate([np.full(7, 0.02), [0.01, 0.01, 0.0], np.full(3, 0.1), np.full(7, 0.02), np.zeros(6)])
    return SuiteTask("idto.jaco_ball", mpc, model, start, 5.0, spread, _judge, _RATE, rise=9)


def _judge(loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
    off = np.linalg.norm(loop.x[:, _BALL] - np.asarray(_GOAL), axis=1)
    time = held(loop, off < _NEAR)
    return time >= _HELD, {"at the goal [s]": time, "off at the end [mm]": 1e3 * float(off[-1])}
