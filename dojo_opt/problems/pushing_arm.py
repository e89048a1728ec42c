"""The arm of a push: its hand, the points of the table before it, and its coordinates on the way."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.problems.pushed_object import PushedObject
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.simulator.inverse_kinematics import ik
from sim.simulator.kinematics import Kinematics
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["TIP", "ahead", "pushing_arm", "reached"]

_CALL = "problems.push"
_AHEAD = (0.35, 0.45, 0.55, 0.65)  # of the length of the arm: where the object stands
TIP, _WRIST = "the ball that pushes", "the joint of the ball's link"
_POSTURES = ((-1.0, 0.0), (-1.0, 1.0), (0.0, 1.0))  # directions from the ball to that joint: along the way, and upwards


def pushing_arm(
    arm: Mechanism | Simulator, frame: str | None, offset: ArrayLike, radius: float, time_step: float
) -> Kinematics:
    """Kinematics of the arm without its contacts, with the frames of the ball and of the joint of its link."""
    mech = arm.mechanism if isinstance(arm, Simulator) else arm
    if not isinstance(mech, Mechanism):
        raise TypeError(f"{_CALL}(arm): expected a Mechanism or a Simulator, got {arm!r}")
    frame = _hand(mech) if frame is None else frame
    kin = Kinematics(Simulator(replace(mech, contacts=(), collisions=()), time_step=time_step))
    checks.one_of(f"{_CALL}(frame=...)", frame, kin.frames)
    kin.add(TIP, frame, checks.vector(f"{_CALL}(offset=...)", offset, 3))
    number, origin, turn = kin.place(frame)
    joint = next(joint for joint in mech.joints if joint.child == mech.body_names[number])
    wrist = np.asarray(joint.child_point, dtype=float)
    if np.linalg.norm(wrist - kin.place(TIP)[1]) > radius:  # otherwise its direction from the ball says nothing
        kin.add(_WRIST, frame, turn.T @ (wrist - origin))
    return kin


def _hand(mech: Mechanism) -> str:
    """The body at the end of the longest row of hinges."""
    depth: dict[str, int] = {}
    for joint in mech.joints:
        depth[joint.child] = depth.get(joint.parent or "", 0) + (joint.nrot > 0)
    return max(mech.body_names, key=lambda name: depth[name])


def ahead(kin: Kinematics, thing: PushedObject) -> list[Floats]:
    """Points of the ground before the base, from which an object stays within reach on its way."""
    mech = kin.mechanism
    joint_of = {joint.child: joint for joint in mech.joints}
    number, tip, _ = kin.place(TIP)
    joint, reach = joint_of[mech.body_names[number]], 0.0
    while True:
        reach += float(np.linalg.norm(tip - np.asarray(joint.child_point, dtype=float)))
        tip = np.asarray(joint.parent_point, dtype=float)
        if joint.parent is None or joint.parent not in joint_of:
            break
        joint = joint_of[joint.parent]
    base = np.array([tip[0], tip[1], 0.0])
    return [base + share * reach / thing.far * thing.way for share in _AHEAD if share * reach + thing.far < reach]


def reached(
    kin: Kinematics, q: Floats, tables: list[Floats], thing: PushedObject, radius: float
) -> tuple[Floats, Floats]:
    """The first of some points (3,) of the table from which the hand can push an object, and the coordinates
    (n, nq) of the arm there: such that its links go through neither object nor table, if there are any.
    """
    errors, possible = [], []
    hand = thing.hands(radius)
    for below in tables:
        for posture in (None, *(_POSTURES if _WRIST in kin.frames else ())):
            try:
                hands = _follow(kin, q, below + hand, posture, thing.forward)
            except ValueError as error:
                errors.append(error)
                if posture is None:
                    break  # nor is a hand there that has a posture
                continue
            if thing.is_clear(kin, below, hands):
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
        length = float(np.linalg.norm(kin.place(_WRIST)[1] - kin.place(TIP)[1]))
        wrist = length / float(np.linalg.norm(direction)) * direction
    for place in tips:
        found = ik(kin, {TIP: place} | ({} if posture is None else {_WRIST: place + wrist}), q, attempts=8)
        if not found.success:
            where = "go on with the object to its goal" if out else "begin behind the object"
            raise ValueError(
                f"{_CALL}(goal, at=...): the hand cannot {where}, at {np.round(place, 3)}: {found.message} Give a "
                "nearer goal, at=..., or start=..."
            )
        q = found.q
        out.append(q)
    return np.array(out)
