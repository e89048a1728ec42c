"""Legs: any legged robot, prepared for its problems: feet, a stance with bent knees, and scales of its costs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from os import PathLike
from typing import Any

import numpy as np

from dojo_opt.gaits.feet import Feet
from sim.mechanism import checks
from sim.mechanism.contact import Contact
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import rotation_matrix
from sim.model.state_columns import BaseState, BodyState
from sim.simulator.inverse_kinematics import ik
from sim.simulator.kinematics import Kinematics
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["Legs"]

_LOW = 0.3  # of the height of the base: contacts no higher than this above the lowest one may be feet
_FLAT = 0.01  # [m] contacts this near to the lowest one of a foot carry together
_ROUND, _OFF_BALL = 0.1, 0.1  # [m] largest radius of a round foot; its error over that
_THIN = 0.05  # height over width of points below which they tell no radius
_STRETCH = 0.8  # length of a standing leg over that of a stretched one
_UPRIGHT = 0.93  # the same on flat feet: bent further, ankles are near their stops, and nothing is left for a crouch
_BEND = 0.9  # [rad] of the knees where the search for a stance begins
_THERE = 1e-4  # [m] error of a stance whose feet are at their places
_MIRRORED = 0.1  # [rad] bends of front and hind knees in the neutral state beyond which they face each other
_PITCH = 0.7  # cosine between the axis of a hinge that bends a leg and y
_TIPPED = 0.7  # cosine between the z axes of the base and the world below which a robot does not stand
_DOWNWARDS = 0.5  # least cosine between gravity and -z of robots that stand
_TRIES = 4  # starts of each search
_A1 = (0.29, 118.0)  # height [m] and weight [N] of the robot whose weights the problems have


class Legs:
    """A robot that stands on the feet at the ends of its legs.

    The feet are found: the bodies at the ends of the tree that reach down to the ground, with their points that are
    farthest from the knee, or lowest where there is an ankle. Points within 1 cm of such a one are one ball, so that a
    foot from a mesh costs as much as a ball: the one on which they lie where the mesh is round, else one in their
    middle. Two feet keep all these points, on which the robot balances. The stance is found, too: hinges about y bend
    the legs to 0.8 of their length, 0.93 on ankles, with the feet below the hips and the knees to the back where the
    joint limits allow it. Mirrored legs, some bent to the back and some to the front in the neutral state, bend further
    to their own side.

    Args:
        robot: the mechanism, on a floating base that looks along x, or its simulator.
        feet: names of contacts, of bodies that have some, or of links, whose feet are balls about their origins, with
            radii [m] in a dict keyed by name (default None: found).
        damping: least damper of the joints, as of a motor's controller [N m s/rad] (default None: 0.5 for a robot of
            the weight and height of the A1, in proportion for others; 0 leaves the joints as they are).
        stance: coordinates by joint (default None: found).
        share: of the usual damper, on flat feet, where none is given.

    Raises:
        ValueError: the robot has no legs, no stance is found, gravity does not point down, or a name is unknown.
    """

    def __init__(
        self,
        robot: Any,
        feet: Sequence[str] | Mapping[str, float] | None = None,
        *,
        damping: float | None = None,
        stance: Any = None,
        share: float = 1.0,
    ) -> None:
        mech: Mechanism = robot.mechanism if isinstance(robot, Simulator) else robot
        if not isinstance(mech, Mechanism):
            hint = "; dojo.load_urdf and dojo.load_mjcf load files" if isinstance(robot, str | PathLike) else ""
            raise TypeError(f"Legs(robot): expected a Mechanism or a Simulator, got {checks.shown(robot)}{hint}")
        if mech.joints[0].kind != "floating" or mech.nv == 6:
            raise ValueError(f"Legs(robot): expected a robot with legs on a floating base, got {mech!r}")
        gravity = np.asarray(mech.gravity, dtype=np.float64)
        if not -gravity[2] > _DOWNWARDS * np.linalg.norm(gravity):
            raise ValueError(
                f"Legs(robot): expected gravity that presses {mech.name!r} onto its feet, got {mech.gravity}"
            )
        if stance is not None:
            try:
                mech = replace(mech, neutral=stance)
            except ValueError as error:  # of the mechanism, which the user has not made
                raise ValueError(f"Legs(stance=...): {str(error).partition('): ')[2]}") from error
        mech = replace(mech, contacts=_feet_of(mech, feet), collisions=())
        sim = Simulator(mech, time_step=0.01)
        if rotation_matrix(sim.neutral()[BaseState.QUATERNION])[2, 2] < _TIPPED:
            raise ValueError(
                f"Legs(robot): the base of {mech.name!r} is not upright in the neutral state, z up, from which the "
                "problems of legs begin; turn it with neutral=..."
            )
        x = Feet(sim).put_down(sim.neutral() if stance is not None else _stance(sim))
        self.mass = sum(body.mass for body in mech.bodies)
        self.height = float(x[2] - Feet(sim).positions(x)[:, 2].min())
        weight = self.mass * float(np.linalg.norm(np.asarray(mech.gravity)))
        self.torque = weight * self.height / (_A1[0] * _A1[1])  # in units of that of the A1
        self.size = self.height / _A1[0]
        usual = 0.5 * self.torque * self.size**0.5 * (share if Feet(sim).flat else 1.0)
        least = usual if damping is None else damping
        checks.number("Legs(damping=...)", least, at_least=0.0)
        joints = [mech.joints[0], *(_damped(joint, least) for joint in mech.joints[1:])]
        self.mechanism = replace(mech, joints=joints, neutral=x[: sim.nq])
        self.feet = tuple(contact.name for contact in mech.contacts)
        self.biped = len({contact.body for contact in mech.contacts}) == 2

    def simulator(self, time_step: float, kappa: float) -> Simulator:
        """The simulator of the robot on its feet.

        Args:
            time_step: time step [s].
            kappa: central-path parameter [N s m].

        Returns:
            The simulator, whose neutral state is the stance.
        """
        return Simulator(self.mechanism, time_step=time_step, kappa=kappa)

    def bends(self) -> Floats:
        """Changes of the stance that bend a leg: its foot rises below the hip, and stays level on an ankle.

        Returns:
            (k, nq) changes of the coordinates, by foot, for a bend of 1 rad at the hip and 2 rad at the knee [rad].
        """
        sim = self.simulator(0.01, 1e-6)
        mech, x = sim.mechanism, sim.neutral()
        kin, joints = Kinematics(sim), {joint.child: joint for joint in mech.joints}
        out = []
        for body in dict.fromkeys(contact.body for contact in mech.contacts):
            hinges = _pitching(kin, joints, body, x[: sim.nq])
            row, turns = np.zeros(sim.nq), kin.jacobian(body, x[: sim.nq])[4]
            hip, knee = (_origin(sim, joints[name], x) for name in hinges[:2])
            forward = 1.0 if knee[0] >= hip[0] else -1.0
            for name, share in zip(hinges, (-1.0, 2.0, -1.0), strict=False):
                joint = joints[name].name
                row[mech.q_slice(joint)] = forward * share * np.sign(turns[mech.v_slice(joint)])
            out.append(row)
        return np.array(out)


def _damped(joint: Joint, least: float) -> Joint:
    """The joint with a damper of at least this, where it has rotations."""
    return replace(joint, damper=max(float(np.max(joint.damper)), least)) if joint.nrot and not joint.ntrans else joint


def _feet_of(mech: Mechanism, given: Any) -> list[Contact]:
    """Contacts of the feet."""
    sim = Simulator(mech, time_step=0.01)
    kin, x = Kinematics(sim), sim.neutral()
    joints = {joint.child: joint for joint in mech.joints}
    if given is not None:
        checks.names("Legs(feet=...)", given)
        return [contact for name in given for contact in _named(mech, kin, name, given)]
    if not mech.contacts:
        raise ValueError(f"Legs(robot): {mech.name!r} has no contact with the ground; name its feet with feet=...")
    ends = set(mech.body_names) - {joint.parent for joint in mech.joints}
    everything = Feet(sim, mech.ground_contact_names).positions(x)
    low: dict[str, float] = {}
    for contact, at in zip(mech.contacts, everything, strict=True):
        if contact.body in ends:
            low[contact.body] = min(low.get(contact.body, np.inf), float(at[2]) - contact.radius)
    if not low:
        raise ValueError(f"Legs(robot): no body at the end of the tree of {mech.name!r} has a contact; give feet=...")
    floor, top = min(low.values()), float(sim.body_states(x[: sim.nq], np.zeros(sim.nv))[0, 2])
    soles = [body for body, height in low.items() if height <= floor + _LOW * max(top - floor, 0.0)]
    out: list[Contact] = []
    for body in soles:
        parts = [(c, at) for c, at in zip(mech.contacts, everything, strict=True) if c.body == body]
        if len(_pitching(kin, joints, body, x[: sim.nq])) > 2:  # a foot on an ankle stands on its lowest points
            far = [c.radius - float(at[2]) for c, at in parts]
        else:  # a shank, on those that are farthest from the knee
            knee = np.asarray(joints[body].child_point, dtype=float)
            far = [float(np.linalg.norm(np.asarray(c.point) - knee)) + c.radius for c, _ in parts]
        carrying = [c for (c, _), reach in zip(parts, far, strict=True) if reach >= max(far) - _FLAT]
        if len(carrying) > 1 and len(soles) > 2:
            middle, radius = _ball(np.array([c.point for c in carrying]), max(c.radius for c in carrying))
            carrying = [replace(carrying[0], point=middle, radius=radius, name=body)]
        out += carrying
    return out


def _ball(points: Floats, radius: float) -> tuple[Floats, float]:
    """The ball on which points (n, 3) lie, as the corners of a round mesh do; else their middle with a given radius.

    |p|^2 = 2 c.p + r^2 - |c|^2 in the mean of squares.
    """
    middle = np.mean(points, axis=0)
    arms = points - middle
    if radius == 0.0 and np.linalg.matrix_rank(arms, tol=_THIN * float(np.abs(arms).max(initial=0.0))) == 3:
        rows = np.concatenate([2.0 * arms, np.ones((len(arms), 1))], axis=1)
        *center, rest = np.linalg.lstsq(rows, (arms**2).sum(axis=1), rcond=None)[0]
        size = float(np.sqrt(max(rest + np.dot(center, center), 0.0)))
        away = np.abs(np.linalg.norm(arms - center, axis=1) - size).max()
        if size <= _ROUND and away <= _OFF_BALL * size:
            return middle + center, size
    return middle, radius


def _named(mech: Mechanism, kin: Kinematics, name: str, given: Any) -> list[Contact]:
    """Contacts of a name: one contact, those of a body, or a ball about the origin of a link."""
    if name in {contact.name for contact in mech.contacts}:
        return [contact for contact in mech.contacts if contact.name == name]
    i, point, _ = kin.place(checks.one_of("Legs(feet=...)", name, [*kin.frames, *mech.contact_names]))
    body = mech.body_names[i]
    own = [contact for contact in mech.contacts if contact.body == body]
    if name in mech.body_names and own:
        return own
    radius = given[name] if isinstance(given, Mapping) else 0.0
    radius = checks.number(f"Legs(feet={{{name!r}: ...}})", radius, at_least=0.0)
    return [Contact(body, point, radius, friction=own[0].friction if own else 0.8, name=name)]


def _stance(sim: Simulator) -> Floats:
    """A state with bent legs, the feet below the hips."""
    mech, x = sim.mechanism, sim.neutral()
    feet = Feet(sim)
    kin, bodies = Kinematics(sim), {joint.child: joint for joint in mech.joints}
    at = feet.positions(x)
    places, knees, own = {}, [], {}
    for k, contact in enumerate(feet.contacts):
        hinges = _pitching(kin, bodies, contact.body, x[: sim.nq])
        if len(hinges) < 2:
            raise ValueError(
                f"Legs(robot): the leg of {contact.name!r} needs two hinges about y to bend; give stance=..."
            )
        hip, knee = (_origin(sim, bodies[name], x) for name in hinges[:2])
        foot = at[k] if len(hinges) == 2 else _origin(sim, bodies[hinges[2]], x)
        length = np.linalg.norm((knee - hip)[[0, 2]]) + np.linalg.norm((foot - knee)[[0, 2]])
        _, point, turn = kin.place(contact.body)
        kin.add(f"foot {k}", contact.body, turn.T @ (np.asarray(contact.point) - point))
        sole = float(foot[2] - at[k, 2])
        middle = hip[0] + (at[k, 0] - foot[0] if len(hinges) > 2 else 0.0)
        stretch = _STRETCH if len(hinges) == 2 else _UPRIGHT
        places[f"foot {k}"] = np.array([middle, at[k, 1], hip[2] - stretch * length - sole])
        knees.append(hinges[1])
        axis = kin.jacobian(contact.body, x[: sim.nq])[4, mech.v_slice(bodies[hinges[1]].name).start]
        own[hinges[1]] = float(np.sign(axis)) * _bend(knee - hip, foot - knee)
    joints, bends = [bodies[name] for name in own], np.array(list(own.values()))
    if bends.min() < -_MIRRORED and bends.max() > _MIRRORED:
        mirrored = _bent(sim, kin, places, joints, x, np.sign(bends))
        if mirrored.error <= _THERE:
            return _with(x, mirrored.q)
    found = [_bent(sim, kin, places, joints, x, np.full(len(joints), sign)) for sign in (1.0, -1.0)]
    good = [r for r in found if r.error <= _THERE]
    if not good:
        raise ValueError(f"Legs(robot): no stance of {mech.name!r} puts the feet below the hips; give stance=...")
    return _with(x, min(good, key=lambda r: _origin_of(sim, bodies, knees, r.q)).q)


def _with(x: Floats, q: Floats) -> Floats:
    """The state (nx,) with other coordinates."""
    return np.concatenate([q, x[len(q) :]])


def _bend(thigh: Floats, shank: Floats) -> float:
    """Angle about y from the thigh (3,) to the shank (3,) [rad]."""
    (a, b), (c, d) = thigh[[0, 2]], shank[[0, 2]]
    return float(np.arctan2(b * c - a * d, a * c + b * d))


def _bent(
    sim: Simulator, kin: Kinematics, places: dict[str, Floats], knees: list[Joint], x: Floats, signs: Floats
) -> Any:
    """The search from knees (k,) that are bent to one side each."""
    start = x[: sim.nq].copy()
    for joint, sign in zip(knees, signs, strict=True):
        q = sim.mechanism.q_slice(joint.name)
        low, high = joint.limits[0] if joint.limits else (-np.inf, np.inf)
        start[q] = np.clip(start[q] + sign * _BEND, low, high)
    parts = {joint.child: joint for joint in sim.mechanism.joints[1:]}
    moving: set[str] = set()
    for contact in sim.mechanism.contacts:
        body = contact.body
        while body in parts:
            moving.add(parts[body].name)
            body = parts[body].parent or ""
    still = [joint.name for joint in sim.mechanism.joints if joint.name not in moving]  # arms stay where they are
    return ik(kin, places, start, fixed=still, tolerance=1e-6, attempts=_TRIES)


def _origin_of(sim: Simulator, bodies: dict[str, Joint], knees: list[str], q: Floats) -> float:
    """Mean place of the knees along x [m]."""
    x = np.concatenate([q, np.zeros(sim.nv)])
    return float(np.mean([_origin(sim, bodies[name], x)[0] for name in knees]))


def _pitching(kin: Kinematics, bodies: dict[str, Joint], body: str, q: Floats) -> list[str]:
    """Joints from the base to a body whose axis is nearly y, by the names of the bodies they carry."""
    mech, out = kin.mechanism, []
    J = kin.jacobian(body, q)[3:]
    while body in bodies and bodies[body].kind != "floating":
        joint = bodies[body]
        if joint.nv == 1 and joint.nrot == 1 and abs(J[1, mech.v_slice(joint.name).start]) > _PITCH:
            out.append(body)
        body = joint.parent or ""
    return out[::-1]


def _origin(sim: Simulator, joint: Joint, x: Floats) -> Floats:
    """Place of the joint point on the child of a joint."""
    i = sim.mechanism.body_names.index(joint.child)
    z = sim.body_states(x[: sim.nq], np.zeros(sim.nv))[i]
    w, v = z[BodyState.SCALAR], z[BodyState.VECTOR]
    point = np.asarray(joint.child_point, dtype=float)
    side = np.cross(v, point)
    return np.asarray(z[BodyState.POSITION] + point + 2.0 * (w * side + np.cross(v, side)))
