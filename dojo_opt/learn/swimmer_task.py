"""A robot like Gymnasium's swimmer: three links that wind forwards, on wheels instead of in a fluid."""

from __future__ import annotations

import numpy as np

from dojo_opt.learn.task import Task
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Capsule, Sphere
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator
from solvers.types import Floats

__all__ = ["swimmer"]

_TURN, _JOINTS = BaseState.QUATERNION.start, BaseState.JOINTS  # columns of a state, for kernels
_LENGTH, _RADIUS, _DENSITY = 1.0, 0.1, 1000.0  # of a link [m], [kg/m^3]
_BEND = float(np.deg2rad(100.0))  # largest angle between links
_GEAR = 150.0  # [N m]
_WHEEL, _TRACK = 0.15, 0.3  # radius, and half the distance of the wheels of a link [m]
_FRICTION = 1.5


def _mechanism() -> Mechanism:
    """Front, middle and rear link, each with two free wheels."""
    capsule = Capsule(_RADIUS, _LENGTH, orientation=(0.5**0.5, 0.0, 0.5**0.5, 0.0))
    ball, mass = Sphere(_WHEEL), _DENSITY * np.pi * _RADIUS**2 * (_LENGTH + 4.0 / 3.0 * _RADIUS)
    bodies, joints, contacts = [], [], []
    for k, name in enumerate(("front", "middle", "rear")):
        bodies.append(Body(name, mass, shape=capsule))
        if k == 0:
            joints.append(Joint("floating", None, name, name="base"))
        else:
            before = ("front", "middle")[k - 1]
            joints.append(
                Joint(
                    "revolute",
                    before,
                    name,
                    parent_point=(-0.5 * _LENGTH, 0.0, 0.0),
                    child_point=(0.5 * _LENGTH, 0.0, 0.0),
                    limits=(-_BEND, _BEND),
                    armature=0.1,
                    name=f"bend_{k}",
                )
            )
    for name in ("front", "middle", "rear"):
        for side, y in (("left", _TRACK), ("right", -_TRACK)):
            wheel = f"{name}_{side}"
            bodies.append(Body(wheel, 0.5, shape=ball))
            joints.append(Joint("revolute", name, wheel, parent_point=(0.0, y, 0.0), axis=(0.0, 1.0, 0.0), name=wheel))
            contacts.append(Contact(wheel, (0.0, 0.0, 0.0), _WHEEL, friction=_FRICTION, name=wheel))
    neutral = {"base": (0.0, 0.0, _WHEEL, 1.0, 0.0, 0.0, 0.0)}
    inputs = [Input("bend_1"), Input("bend_2")]
    return Mechanism(bodies, joints, contacts, inputs, name="swimmer", neutral=neutral)


def swimmer() -> Task:
    """Swimmer-v5's links, actions, observations and reward, on wheels: 8 observations, 2 actions, 0.04 s each.

    The simulator has no fluid. Two free wheels under the middle of each link take its place: like the drag of a slender
    body they hold a link across its axis and let it move along, by friction instead of viscosity, so that it glides
    on without loss when the torques end. Links of 1 m and 1000 kg/m^3, hinges with 150 N m, an armature of 0.1 kg m^2
    and stops at 100 degrees are Gymnasium's; returns are not.

        observation   heading, two angles [rad]; velocity of the front link's centre, their rates [m/s, rad/s]
        reward        velocity along x, minus 1e-4 |a|^2

    Returns:
        The task.
    """
    mech = _mechanism()
    nq = mech.nq

    def observation(x, out):  # type: ignore[no-untyped-def]
        q = x[_TURN:_JOINTS]
        out[0] = np.arctan2(2.0 * (q[0] * q[3] + q[1] * q[2]), 1.0 - 2.0 * (q[2] ** 2 + q[3] ** 2))
        out[1], out[2] = x[_JOINTS], x[_JOINTS + 1]
        out[3], out[4], out[5] = x[nq], x[nq + 1], x[nq + 5]
        out[6], out[7] = x[nq + 6], x[nq + 7]

    def reward(x, a, after):  # type: ignore[no-untyped-def]
        return (after[0] - x[0]) / 0.04 - 1e-4 * (a[0] ** 2 + a[1] ** 2)

    def start(rng: np.random.Generator) -> Floats:
        q = np.array(mech.neutral, dtype=np.float64)
        angle = rng.uniform(-0.1, 0.1)
        q[:2] += rng.uniform(-0.1, 0.1, 2)
        q[3:7] = np.cos(0.5 * angle), 0.0, 0.0, np.sin(0.5 * angle)
        q[7:9] = rng.uniform(-0.1, 0.1, 2)
        v = np.zeros(mech.nv)
        v[6:8] = rng.uniform(-0.1, 0.1, 2)
        return np.concatenate([q, v])

    most = np.full(2, _GEAR)
    return Task(
        Simulator(mech, time_step=0.02, kappa=1e-3), 2, observation, 8, reward, -most, most, start, name="Swimmer",
        settings={"environments": 32, "episode": 256, "evaluations": 4, "episodes": 4, "epochs": 300},
    )  # fmt: skip
