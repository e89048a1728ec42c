"""Problems of arms: the hand pushes an object along a table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.constraint import Goal
from dojo_opt.cost import Tracking
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from dojo_opt.problems.holding import effort, holding_inputs
from dojo_opt.problems.pushed_object import PushedObject
from dojo_opt.problems.pushing_arm import TIP, ahead, pushing_arm, reached
from dojo_opt.problems.whole_knots import whole_knots
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import check_room
from sim.mechanism.shape_contacts import shape_contacts
from sim.mechanism.shapes import Sphere
from sim.simulator.kinematics import Kinematics
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["push"]

_CALL = "problems.push"
# weights of squares per second: place of the object over its way, its heading, angles of the arm, and their rates
_PLACE, _TURN, _ANGLE, _RATE = 1.0, 1.0, 0.1, 0.01
_CALM = 30.0  # regularisation of the gains: with less, some objects turn away from the hand in shorter steps


@checked_numbers("problems")
def push(
    arm: Mechanism | Simulator,
    object: Body,
    goal: ArrayLike,
    *,
    frame: str | None = None,
    offset: ArrayLike = (0.0, 0.0, 0.0),
    radius: float = 0.03,
    start: ArrayLike | None = None,
    at: ArrayLike | None = None,
    duration: float = 2.0,
    time_step: float = 0.02,
) -> Problem:
    """An arm pushes an object along a table to a place, where both come to rest.

    The object stands with its x axis in the direction of the push. The hand is a ball at a frame of the arm; it begins
    1 cm behind the object, at the height of its centre of mass, or lower where the object would tip over. In the guess
    the hand moves straight ahead with the object in front of it, under the torques that hold the arm, without contact.
    The links of the arm have no contacts with the object and the table. In the guess their joints and centres of mass
    stay outside of both where the arm can; a warning tells where it cannot. Nothing keeps their shapes outside: a hand
    that is wider than the object is high reaches into the table, unless `offset` and `at` have it stand off. Place and
    heading of the object at the end are constraints, and both are at rest there. Each shape of the object has its own
    friction, 0.5 where it has none, at the table and at the ball. Gains are low (`Problem.gain_regularization`), so
    that plans hold with shorter steps.

    Args:
        arm: the mechanism, or its simulator, whose time step is then `time_step`; its own contacts are omitted.
        object: a body with a shape that stands on the table: a Box, Capsule or Polytope, or a Sphere among others.
        goal: (2,) displacement of the object along x and y [m].
        frame: name of the link that has the ball (default None: the body at the end of the longest row of hinges).
        offset: (3,) of the ball from the origin of the frame, in its axes [m].
        radius: radius of the ball [m].
        start: (nq,) coordinates from which the search for the starting pose begins (default None: the neutral ones).
        at: (3,) point of the table below the object at the beginning [m] (default None: on the ground, below the ball
            of the coordinates `start`; without these, and if it cannot push from there, further away from the base).
        duration: duration of the motion, a fifth of which is rest at the end; rounded to whole knots, five at least
            [s].
        time_step: time step of the simulator [s].

    Returns:
        The problem; the joint of the object has the object's name.

    Raises:
        TypeError: `arm` is neither a mechanism nor a simulator, or `object` no body.
        ValueError: the frame is unknown, the hand cannot reach the object or its goal, the object rolls along its way,
            or an argument is out of range.
    """
    checks.number(f"{_CALL}(radius=...)", radius, above=0.0)
    kin = pushing_arm(arm, frame, offset, radius, time_step)
    thing = PushedObject.of(object, _way(goal), _knots(kin, duration))
    q, tables = _tables(kin, thing, start, at)
    below, hands = reached(kin, q, tables, thing, radius)
    return _problem(kin, _scene(kin, thing, below, radius), thing, below, hands)


def _knots(kin: Kinematics, duration: float) -> int:
    """The number of knots, one per time step."""
    call = f"{_CALL}(duration=...)"
    knots = whole_knots(call, duration, kin.sim.time_step, 5)
    check_room(call, knots, 8.0 * kin.sim.nx, "push in less time, or with longer steps", "knots")
    return knots


def _tables(
    kin: Kinematics, thing: PushedObject, start: ArrayLike | None, at: ArrayLike | None
) -> tuple[Floats, list[Floats]]:
    """Coordinates (nq,) where the search begins, and points (3,) of the table for the object, in order."""
    q = kin.sim.neutral()[: kin.sim.nq]
    q = q if start is None else np.array(checks.array(f"{_CALL}(start=...)", start, (kin.sim.nq,)))
    below = np.append(kin.pose(TIP, q)[0][:2], 0.0) if at is None else checks.array(f"{_CALL}(at=...)", at, (3,))
    return q, [below, *(ahead(kin, thing) if start is None and at is None else ())]


def _problem(kin: Kinematics, sim: Simulator, thing: PushedObject, below: Floats, hands: Floats) -> Problem:
    """The problem from the coordinates of the arm (n, nq), with the object over a point of the table (3,)."""
    states, held = _states(sim, hands, thing.places(below)), holding_inputs(kin.sim, hands[1:-1])
    weights = sim.time_step * _weights(kin.sim.nv, thing.far)
    return Problem(
        sim,
        states[0],
        len(held),
        cost=[Tracking(states, weights), effort(kin.sim, held, sim.time_step)],
        constraints=[Goal(states[-1], components=_ends(kin.sim.nv))],
        controls0=held,
        states0=states,
        gain_regularization=_CALM,
        advice="Try a longer duration, a nearer goal, or an object that is lighter or has less friction.",
    )


def _way(goal: ArrayLike) -> Floats:
    """(3,) displacement of the object [m]."""
    way = np.append(checks.array(f"{_CALL}(goal)", goal, (2,)), 0.0)
    if float(np.linalg.norm(way)) == 0.0:
        raise ValueError(f"{_CALL}(goal): expected a displacement along the table, got zero")
    return way


def _scene(kin: Kinematics, pushed: PushedObject, below: Floats, radius: float) -> Simulator:
    """The arm, the object over a point of the table (3,), and the ball between them."""
    mech, thing = kin.mechanism, pushed.body
    rough = pushed.friction
    thing = replace(thing, shape=[replace(shape, friction=mu) for shape, mu in zip(thing.shapes, rough, strict=True)])
    contacts = shape_contacts(_CALL, thing, height=float(below[2]))
    joint = Joint("floating", None, thing.name)
    pose = np.array([*(below + pushed.up), *pushed.heading])
    alone = Mechanism([thing], [joint], contacts, inputs=(), neutral=pose)
    number, point, _ = kin.place(TIP)
    if thing.name in (*mech.body_names, *mech.joint_names):
        raise ValueError(f"{_CALL}(object): the arm {mech.name!r} has a part called {thing.name!r}, too")
    ball = Sphere(radius, center=point)
    pairs = [
        Collision(mech.body_names[number], thing.name, ball, shape, friction=rough[k], name=f"hand-{thing.name}.{k}")
        for k, shape in enumerate(thing.shapes)
    ]
    return Simulator(mech.add(alone).with_collisions(*pairs), time_step=kin.sim.time_step, kappa=PLANNED)


def _states(sim: Simulator, hands: Floats, places: Floats) -> Floats:
    """States (n - 1, nx) along coordinates of the arm (n, nq) and places of the object (n, 3)."""
    x = np.tile(sim.neutral(), (len(hands), 1))
    x[:, : hands.shape[1]] = hands
    x[:, hands.shape[1] : hands.shape[1] + 3] = places
    steps = sim.difference(x[1:], x[:-1])[:, : sim.nv]
    x = x[1:]
    x[:, sim.nq :] = steps / sim.time_step
    return x


def _weights(arm: int, far: float) -> Floats:
    """(ndx,) weights of squares of a scene with a given number of degrees of freedom of the arm."""
    place = [*[_PLACE / far**2] * 3, *[_TURN] * 3]
    return np.array([_ANGLE] * arm + place + [_RATE] * arm + [_RATE * w for w in place])


def _ends(arm: int) -> NDArray[np.int64]:
    """Components that the goal holds: place along the table and heading of the object, and all velocities."""
    return np.concatenate([arm + np.array([0, 1, 5]), np.arange(arm + 6, 2 * (arm + 6))])
