"""Problems of arms: the hand pushes an object along a table."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.equilibrium import potential_gradient
from dojo_opt.gaits.static_motions import input_map
from dojo_opt.models.checked_numbers import checked_numbers
from dojo_opt.planning.options import PLANNED
from dojo_opt.planning.problem import Problem
from dojo_opt.problems.whole_knots import whole_knots
from sim.mechanism import checks
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import check_room
from sim.mechanism.shape_contacts import shape_contacts
from sim.mechanism.shapes import Solid, Sphere, rotation_matrices
from sim.simulator.inverse_kinematics import ik
from sim.simulator.kinematics import Kinematics
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["push"]

_CALL = "problems.push"
_AHEAD = (0.35, 0.45, 0.55, 0.65)  # of the length of the arm: where the object stands
_GAP = 0.01  # [m] between the hand and the object at the beginning
_REST = 0.2  # of the duration, at the end
# weights of squares per second: place of the object over its way, its heading, angles of the arm, and their rates
_PLACE, _TURN, _ANGLE, _RATE = 1.0, 1.0, 0.1, 0.01
_EFFORT = 0.01  # of squares of a torque, in units of the largest that holds the arm
_ROUGH = 0.5  # friction of an object whose shapes have none
_TIP, _WRIST = "the ball that pushes", "the joint of the ball's link"
_POSTURES = ((-1.0, 0.0), (-1.0, 1.0), (0.0, 1.0))  # directions from the ball to that joint: along the way, and upwards


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
    1 cm behind the object, at the height of its centre of mass. In the guess the hand moves straight ahead with the
    object in front of it, under the torques that hold the arm, without contact. The links of the arm have no contacts
    with the object and the table. In the guess their joints and centres of mass stay outside of both where the arm can;
    a warning tells where it cannot. Nothing keeps their shapes outside: a hand that is wider than the object is high
    reaches into the table, unless `offset` and `at` have it stand off. Place and heading of the object at the end are
    constraints, and both are at rest there. Each shape of the object has its own friction, 0.5 where it has none, at
    the table and at the ball.

    Args:
        arm: the mechanism, or its simulator, whose time step is then `time_step`; its own contacts are omitted.
        object: a body with a shape that stands on the table: a Box, Sphere, Capsule or Polytope.
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
        ValueError: the frame is unknown, the hand cannot reach the object or its goal, or an argument is out of range.
    """
    checks.number(f"{_CALL}(radius=...)", radius, above=0.0)
    kin = _arm(arm, frame, offset, radius, time_step)
    alone = kin.sim
    if not isinstance(object, Body):
        raise TypeError(f"{_CALL}(object): expected a Body, got {object!r}")
    way = np.append(checks.array(f"{_CALL}(goal)", goal, (2,)), 0.0)
    far = float(np.linalg.norm(way))
    if far == 0.0:
        raise ValueError(f"{_CALL}(goal): expected a displacement along the table, got zero")
    horizon = whole_knots(f"{_CALL}(duration=...)", duration, time_step, 5)
    q = alone.neutral()[: alone.nq]
    q = q if start is None else np.array(checks.array(f"{_CALL}(start=...)", start, (alone.nq,)))
    below = np.append(kin.pose(_TIP, q)[0][:2], 0.0) if at is None else checks.array(f"{_CALL}(at=...)", at, (3,))
    up = (0.0, 0.0, _half(object, np.array([0.0, 0.0, -1.0])))
    forward = way / far
    check_room(f"{_CALL}(duration=...)", horizon, 8.0 * alone.nx, "push in less time, or with longer steps", "knots")
    share = np.clip(np.arange(-1.0, horizon + 1.0) / ((1.0 - _REST) * horizon), 0.0, 1.0)
    moved = -_GAP + (far + _GAP) * _smooth(share)
    hand = up - (_half(object, np.array([-1.0, 0.0, 0.0])) + radius) * forward + moved[:, None] * forward
    tables = [below, *(_ahead(kin, way) if start is None and at is None else ())]
    below, hands = _reached(kin, q, tables, hand, _Course(object, np.array(up), forward, np.maximum(moved, 0.0)))
    place = below + up
    pose = np.array([*place, *_heading(forward)])
    sim = _scene(kin, object, pose, radius, float(below[2]))
    states = _states(sim, hands, place + np.maximum(moved, 0.0)[:, None] * forward)
    held = _holding(alone, hands[1:-1])
    unit = max(float(np.abs(held).max(initial=0.0)), 1e-3)
    return Problem(
        sim,
        states[0],
        horizon,
        cost=[
            Tracking(states, time_step * _weights(alone.nv, far)),
            Effort(time_step * _EFFORT / unit**2, reference=held),
        ],
        constraints=[Goal(states[-1], components=_ends(alone.nv))],
        controls0=held,
        states0=states,
        advice="Try a longer duration, a nearer goal, or an object that is lighter or has less friction.",
    )


def _arm(
    arm: Mechanism | Simulator, frame: str | None, offset: ArrayLike, radius: float, time_step: float
) -> Kinematics:
    """Kinematics of the arm without its contacts, with the frames of the ball and of the joint of its link."""
    mech = arm.mechanism if isinstance(arm, Simulator) else arm
    if not isinstance(mech, Mechanism):
        raise TypeError(f"{_CALL}(arm): expected a Mechanism or a Simulator, got {arm!r}")
    frame = _hand(mech) if frame is None else frame
    kin = Kinematics(Simulator(replace(mech, contacts=(), collisions=()), time_step=time_step))
    checks.one_of(f"{_CALL}(frame=...)", frame, kin.frames)
    kin.add(_TIP, frame, checks.vector(f"{_CALL}(offset=...)", offset, 3))
    number, origin, turn = kin.place(frame)
    joint = next(joint for joint in mech.joints if joint.child == mech.body_names[number])
    wrist = np.asarray(joint.child_point, dtype=float)
    if np.linalg.norm(wrist - kin.place(_TIP)[1]) > radius:  # otherwise its direction from the ball says nothing
        kin.add(_WRIST, frame, turn.T @ (wrist - origin))
    return kin


def _holding(arm: Simulator, q: Floats) -> Floats:
    """(n, nu) inputs within their limits that hold the arm against gravity at coordinates (n, nq) [N m]."""
    resting = np.concatenate([q, np.zeros((len(q), arm.nv))], axis=1)
    held = np.linalg.lstsq(input_map(arm), potential_gradient(arm, resting).T, rcond=None)[0].T
    return np.asarray(np.clip(held, *(np.asarray(bound, dtype=float) for bound in arm.mechanism.input_limits)))


def _hand(mech: Mechanism) -> str:
    """The body at the end of the longest row of hinges."""
    depth: dict[str, int] = {}
    for joint in mech.joints:
        depth[joint.child] = depth.get(joint.parent or "", 0) + (joint.nrot > 0)
    return max(mech.body_names, key=lambda name: depth[name])


def _heading(forward: Floats) -> list[float]:
    """The quaternion that turns x to a level direction (3,)."""
    half = 0.5 * float(np.arctan2(forward[1], forward[0]))
    return [np.cos(half), 0.0, 0.0, np.sin(half)]


def _half(body: Body, direction: Floats) -> float:
    """How far the shapes of a body reach in a direction (3,) from its centre of mass [m]."""
    if not body.shapes:
        raise ValueError(f"{_CALL}(object): body {body.name!r} has no shape")
    return max(_reach(shape, direction) for shape in body.shapes)


def _reach(shape: Solid, direction: Floats) -> float:
    """How far a shape on its body reaches in a direction (3,) [m]."""
    stance = shape.stance()
    if stance is None:
        raise ValueError(f"{_CALL}(object): expected a Box, Sphere, Capsule or Polytope, got {shape!r}")
    return float((shape.place(stance.points) @ direction).max()) + stance.radius


def _ahead(kin: Kinematics, way: Floats) -> list[Floats]:
    """Points of the ground before the base, from which an object that moves by `way` (3,) stays within reach."""
    mech = kin.mechanism
    joint_of = {joint.child: joint for joint in mech.joints}
    number, tip, _ = kin.place(_TIP)
    joint, reach = joint_of[mech.body_names[number]], 0.0
    while True:
        reach += float(np.linalg.norm(tip - np.asarray(joint.child_point, dtype=float)))
        tip = np.asarray(joint.parent_point, dtype=float)
        if joint.parent is None or joint.parent not in joint_of:
            break
        joint = joint_of[joint.parent]
    base, far = np.array([tip[0], tip[1], 0.0]), float(np.linalg.norm(way))
    return [base + share * reach / far * way for share in _AHEAD if share * reach + far < reach]


@dataclass(frozen=True)
class _Course:
    """Where the object is while it is pushed."""

    object: Body
    up: Floats  # (3,) from the table to its centre of mass [m]
    forward: Floats  # (3,) direction of the way
    moved: Floats  # (n,) distances along it [m]

    def is_clear(self, kin: Kinematics, below: Floats, hands: Floats) -> bool:
        """Whether joints and centres of mass of the arm stay above the table and outside the object.

        Args:
            kin: of the arm.
            below: (3,) point of the table below the object at the beginning [m].
            hands: (n, nq) coordinates of the arm.
        """
        mech = kin.mechanism
        bodies = kin.sim.maximal(np.concatenate([hands, np.zeros((len(hands), kin.sim.nv))], axis=1))
        number = {name: k for k, name in enumerate(mech.body_names)}
        points = [bodies[:, k, :3] for k in range(len(number))]
        for joint in mech.joints:
            if joint.parent in number:  # that of the base may be on the table
                body = bodies[:, number[joint.child]]
                points.append(
                    body[:, :3] + rotation_matrices(body[:, 6:10]) @ np.asarray(joint.child_point, dtype=float)
                )
        arm = np.array(points)
        axes = np.array([self.forward, np.cross([0.0, 0.0, 1.0], self.forward), [0.0, 0.0, 1.0]])
        relative = (arm - (below + self.up + self.moved[:, None] * self.forward)) @ axes.T
        low = [-_half(self.object, -axis) for axis in np.eye(3)]
        high = [_half(self.object, axis) for axis in np.eye(3)]
        inside = np.all((relative > low) & (relative < high), axis=-1)
        return not np.any(inside) and bool(np.all(arm[..., 2] > below[2]))


def _reached(kin: Kinematics, q: Floats, tables: list[Floats], hand: Floats, course: _Course) -> tuple[Floats, Floats]:
    """The first of some points (3,) of the table from which the hand (n, 3) can go its way, and the coordinates (n, nq)
    of the arm there: such that its links go through neither object nor table, if there are any.
    """
    errors, possible = [], []
    for below in tables:
        for posture in (None, *(_POSTURES if _WRIST in kin.frames else ())):
            try:
                hands = _follow(kin, q, below + hand, posture, course.forward)
            except ValueError as error:
                errors.append(error)
                if posture is None:
                    break  # nor is a hand there that has a posture
                continue
            if course.is_clear(kin, below, hands):
                return below, hands
            possible.append((below, hands))
    if not possible:
        raise errors[0]
    warnings.warn(
        f"{_CALL}: links of the arm go through the object or the table, whose contacts with them are omitted; give "
        "offset=... to the end of the hand, at=..., or start=...",
        stacklevel=4,
    )
    return possible[0]


def _follow(kin: Kinematics, q: Floats, tips: Floats, posture: tuple[float, float] | None, forward: Floats) -> Floats:
    """(n, nq) coordinates of the arm with its ball at the places (n, 3), each from those before.

    posture: direction from the ball to the joint of its link, along `forward` and upwards (None: any).
    """
    out: list[Floats] = []
    wrist = np.zeros(3)
    if posture is not None:
        direction = posture[0] * forward + [0.0, 0.0, posture[1]]
        length = float(np.linalg.norm(kin.place(_WRIST)[1] - kin.place(_TIP)[1]))
        wrist = length / float(np.linalg.norm(direction)) * direction
    for place in tips:
        found = ik(kin, {_TIP: place} | ({} if posture is None else {_WRIST: place + wrist}), q, attempts=8)
        if not found.success:
            where = "go on with the object to its goal" if out else "begin behind the object"
            raise ValueError(
                f"{_CALL}(goal, at=...): the hand cannot {where}, at {np.round(place, 3)}: {found.message} Give a "
                "nearer goal, at=..., or start=..."
            )
        q = found.q
        out.append(q)
    return np.array(out)


def _scene(kin: Kinematics, thing: Body, pose: Floats, radius: float, table: float) -> Simulator:
    """The arm, the object on the table, and the ball between them."""
    mech = kin.mechanism
    rough = [_ROUGH if shape.friction is None else shape.friction for shape in thing.shapes]
    thing = replace(thing, shape=[replace(shape, friction=mu) for shape, mu in zip(thing.shapes, rough, strict=True)])
    contacts = shape_contacts(_CALL, thing, height=table)
    joint = Joint("floating", None, thing.name)
    alone = Mechanism([thing], [joint], contacts, inputs=(), neutral=pose)
    number, point, _ = kin.place(_TIP)
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


def _smooth(t: Floats) -> Floats:
    """0 at 0, 1 at 1, with two derivatives zero at both: 10 t^3 - 15 t^4 + 6 t^5."""
    return np.asarray(t**3 * (10.0 - 15.0 * t + 6.0 * t**2))
