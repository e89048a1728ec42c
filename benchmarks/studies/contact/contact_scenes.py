"""Scenes of the contact study: a block that slides, sticks, falls, is pushed and tossed; a ball; a robot that drops.

Blocks touch the ground with their corners, as points; every engine gets the same points.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import cos, radians, sin

import numpy as np
from numpy.typing import ArrayLike

from benchmarks.engines import PhysicsEngine, Run
from dojo_opt.models.block import block
from dojo_opt.models.quadruped import quadruped
from dojo_opt.models.sphere import sphere
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator

G = 9.81  # [m/s^2]
SPEED, FRICTION = 3.0, 0.3  # of the sliding block
STOP = SPEED**2 / (2.0 * FRICTION * G)  # [m] where it stops
SLOPE, GRIP = radians(20.0), 0.5  # of the block that must not creep
TILTED = (0.8, 0.36, 0.48, 0.0)  # a unit quaternion with no axis along an edge


@dataclass(frozen=True)
class Scene:
    """A mechanism, its start and its duration; every step is a sample unless a number of samples is given."""

    mechanism: Mechanism
    q: ArrayLike
    v: ArrayLike
    duration: float  # [s]
    inputs: ArrayLike | None = None
    samples: int | None = None

    def run(self, engine: PhysicsEngine, time_step: float) -> Run:
        """Motion of the scene in one engine."""
        return engine.simulate(
            self.mechanism,
            time_step=time_step,
            q=self.q,
            v=self.v,
            duration=self.duration,
            samples=self.samples or round(self.duration / time_step),
            inputs=self.inputs,
        )


def standing() -> Scene:
    """A cube of half a metre that finds its rest: soft contacts sink in a little."""
    return Scene(block(friction=FRICTION), (0, 0, 0.25, 1, 0, 0, 0), np.zeros(6), 0.5)


def sliding(angle: float, q: ArrayLike) -> Scene:
    """The cube at 3 m/s on friction 0.3, along the direction `angle` [rad], from where it stands."""
    velocity = (SPEED * cos(angle), SPEED * sin(angle), 0.0, 0.0, 0.0, 0.0)
    return Scene(block(friction=FRICTION), q, velocity, 1.3)


def on_slope(duration: float) -> Scene:
    """The cube on a slope of 20 degrees with friction 0.5: it must stay, as tan 20 = 0.364."""
    gravity = (G * sin(SLOPE), 0.0, -G * cos(SLOPE))
    return Scene(block(friction=GRIP, gravity=gravity), (0, 0, 0.25, 1, 0, 0, 0), np.zeros(6), duration)


def ball_drop() -> Scene:
    """A ball of 0.1 m dropped from 1 m."""
    return Scene(sphere(radius=0.1, friction=0.5), (0, 0, 1.1, 1, 0, 0, 0), np.zeros(6), 1.5)


def box_drop() -> Scene:
    """The cube dropped from 1 m on a corner."""
    return Scene(block(friction=0.5), (0, 0, 1.5, *TILTED), np.zeros(6), 3.0)


def ball_impact(time_step: float) -> Scene:
    """The ball at 100 m/s, first touching a third into a time step."""
    q = (0.0, 0.0, 0.1 + 100.0 * time_step * 3.33, 1, 0, 0, 0)
    return Scene(sphere(radius=0.1, friction=0.5), q, (0, 0, -100.0, 0, 0, 0), 60 * time_step)


def box_impact(time_step: float) -> Scene:
    """The cube at 100 m/s down and 30 m/s along, spinning, a corner first."""
    q = (0.0, 0.0, 0.5 + 100.0 * time_step * 3.33, *TILTED)
    return Scene(block(friction=0.5), q, (30.0, 0, -100.0, 5.0, -5.0, 5.0), 60 * time_step)


def ramp(time_step: float) -> Scene:
    """A cube of 0.2 m and 1 kg on friction 0.4, pushed along x by a force that grows to 20 N within a second."""
    mechanism = block(edge=0.2, mass=1.0, friction=0.4)
    push = 20.0 * time_step * np.arange(round(1.0 / time_step))  # sampled at the start of each step, and held
    inputs = np.column_stack([push, 0.0 * push, 0.0 * push])
    return Scene(mechanism, (0, 0, 0.1, 1, 0, 0, 0), np.zeros(6), 1.0, inputs, samples=100)


def ramp_displacement() -> float:
    """Position of the pushed cube after one second [m]: it starts when 20 t = mu m g, then a = 20 t - mu g."""
    begin = 0.4 * G / 20.0
    return 20.0 * (1.0 - begin) ** 3 / 6.0


def toss() -> Scene:
    """The same cube thrown onto the ground with spin: a tumbling that amplifies every error."""
    q, v = (0, 0, 0.25, *TILTED), (1.0, 0.4, 0.0, 2.0, -3.0, 1.0)
    return Scene(block(edge=0.2, mass=1.0, friction=0.4), q, v, 1.0, samples=100)


def robot_drop() -> Scene:
    """A quadruped of A1's size with spring legs, dropped from 0.1 m."""
    mechanism = quadruped(spring=60.0, damper=2.0, limits=False)
    neutral = Simulator(mechanism).neutral()
    q = neutral[: mechanism.nq].copy()
    q[2] += 0.1
    return Scene(mechanism, q, np.zeros(mechanism.nv), 1.0, samples=20)
