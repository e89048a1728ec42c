"""A quadruped walks without a given gait."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from dojo_opt.plant.closed_loop import ClosedLoop
from dojo_opt.tasks.free_gait import GaitWeights, free_gait_mpc
from dojo_opt.tasks.idto.assembly import FileLink, assembled, from_com
from dojo_opt.tasks.suite import SuiteTask
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Cylinder, Sphere
from sim.mechanism.terrain import Terrain
from sim.model.state_columns import BaseState
from sim.simulator.simulator import Simulator

__all__ = ["mini_cheetah", "mini_cheetah_hills"]

_RATE = 60.0  # [Hz]
_WAY, _LOW, _TILT = 3.2, 0.15, 0.5  # [m] in 10 s, [m] and [rad] of the trunk
_STANCE = (0.0, -0.8, 1.6)  # [rad] abduction, hip, knee
_EFFORT = (18.0, 18.0, 26.0)  # [N m]
_FRICTION = 0.4  # assumed by plans, against slip on the .67 of the plant
_KNOT = 0.02  # [s]
_WEIGHTS = GaitWeights(pose=10.0, effort=1e-4, slip=10.0, near=0.01, alike=0.05)
_SERVO = 50.0, 1.0  # [N m/rad], [N m s/rad]
_HILL, _FIRST, _APART, _ROUND = 0.05, 2.0, 1.0, 1.0  # [m] height, place, distance and radius of hills
_GRID = 0.01  # [m]
_LONG = 25.0  # [m] of the cylinders
_LEGS = {"fl": (1.0, 1.0), "fr": (1.0, -1.0), "hl": (-1.0, 1.0), "hr": (-1.0, -1.0)}


def _links() -> list[FileLink]:
    """The trunk and the three links of each leg."""
    links = [FileLink("trunk", None, 3.3, (0.0, 0.0, 0.0), (0.012677, 0.017298, 0.024475), "floating")]
    for leg, (front, left) in _LEGS.items():
        turn = front * left  # of both diagonals
        abduction = (0.00024813, 0.00054315, 0.00045809, -turn * 7.3074e-5, 0.0, 0.0)
        thigh = (0.0019421, 0.0017224, 0.00066017, 0.0, 0.0, left * 8.4495e-5)
        shank = (0.00034489, 0.00034717, 5.7021e-6, 0.0, 0.0, -1.1541e-6)
        across, limits = (0.0, -1.0, 0.0), (-2.6, 2.6)
        links += [
            FileLink(
                f"{leg}_abduction",
                "trunk",
                0.54,
                (-front * 0.020141, left * 0.0031566, 0.0),
                abduction,
                pos=(front * 0.19, left * 0.049, 0.0),
                axis=(1.0, 0.0, 0.0),
                limits=(-1.6, 1.6),
            ),
            FileLink(
                f"{leg}_thigh",
                f"{leg}_abduction",
                0.634,
                (0.0, left * 0.00010106, -0.015538),
                thigh,
                pos=(0.0, left * 0.062, 0.0),
                axis=across,
                limits=limits,
            ),
            FileLink(
                f"{leg}_shank",
                f"{leg}_thigh",
                0.064,
                (0.00019682, 0.00087559, -0.089454),
                shank,
                pos=(0.0, 0.0, -0.209),
                axis=across,
                limits=limits,
            ),
        ]
    return links


def mechanism(friction: float, terrain: Terrain | None = None) -> Mechanism:
    """The robot of 8.25 kg with feet of 17.5 mm: masses of the publication's Python variant, which are mirrored.

    Args:
        friction: coefficient of friction of the feet.
        terrain: the ground (default None: level).

    Returns:
        The mechanism, which stands.
    """
    links = _links()
    bodies, joints = assembled(links)
    feet = [
        Contact(
            f"{leg}_shank",
            from_com(links, f"{leg}_shank", (0.0, 0.0, -0.19)),
            0.0175,
            friction=friction,
            name=f"{leg}_foot",
            terrain=terrain,
        )
        for leg in _LEGS
    ]
    parts = ("abduction", "thigh", "shank")
    neutral: dict[str, Any] = {"trunk": (0.0, 0.0, 0.29, 1.0, 0.0, 0.0, 0.0)}
    neutral |= {f"{leg}_{part}": angle for leg in _LEGS for part, angle in zip(parts, _STANCE, strict=True)}
    inputs = [
        Input(f"{leg}_{part}", limits=(-effort, effort))
        for leg in _LEGS
        for part, effort in zip(parts, _EFFORT, strict=True)
    ]
    return Mechanism(bodies, joints, feet, inputs, name="mini_cheetah", neutral=neutral)


def mini_cheetah(*, speed: float = 0.4, terrain: Terrain | None = None, **settings: Any) -> SuiteTask:
    """Walk along x at .4 m/s: 20 knots of 20 ms at 60 Hz, without a contact schedule.

    A run of 10 s is a success if the trunk advances 3.2 m (in proportion at other speeds) and stays above .15 m, with
    roll and pitch below .5 rad. The trunk has no contacts, because a robot that lies has failed before. The feet start
    on the ground; in the publication they start 5.5 mm inside it.

    With hard contact the publication's cost is least for a robot that leans forward and stands. The cost is therefore
    that of `tasks.free_gait_mpc`, with ten times the weights of the trunk, half that of torques, and 10 for slip. Plans
    make two iterations per tick, assume a friction of .4, and act at once, without the publication's delay of one tick.
    They take the ground for a plane whose slope is estimated from the stance feet. Dampers of servos have 1 N m s/rad
    instead of 2, with which the joints chatter when torques are held for 1 ms.

    Args:
        speed: speed of the nominal motion [m/s].
        terrain: the ground of the plant, which plans do not know (default None: level).
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    given: dict[str, Any] = {"period": 1.0 / _RATE, "iterations": 2, "servo": _SERVO, "friction": _FRICTION}
    mpc = free_gait_mpc(
        (speed, 0.0, 0.0),
        robot=mechanism(2.0 / 3.0),
        knot=_KNOT,
        weights=_WEIGHTS,
        **{**given, **settings},
    )
    model = Simulator(mechanism(2.0 / 3.0, terrain), time_step=1e-3, kappa=1e-8)
    spread = np.array([0.05, 0.05, 0.01, 0.05, 0.05, 0.05] + [0.1] * 12 + [0.1] * 18)
    judge = _Walked(_WAY * speed / 0.4)
    return SuiteTask("idto.mini_cheetah", mpc, model, mpc.start, 10.0, spread, judge, _RATE, rise=2)


def hills(count: int) -> Terrain:
    """Cylinders of 1 m radius that lie across the way, 50 mm above the ground, .62 m wide there, 1 m apart.

    Args:
        count: number of hills.

    Returns:
        The ground.
    """
    end = _FIRST + _APART * count
    lines = np.linspace(0.0, end, round(end / _GRID) + 1)

    def height(x: Any, y: Any) -> Any:
        del y
        off = np.abs(x[..., None] - _FIRST - _APART * np.arange(count)).min(axis=-1)
        return np.sqrt(np.maximum(_ROUND**2 - off**2, (_ROUND - _HILL) ** 2)) - (_ROUND - _HILL)

    return Terrain.from_function(height, lines, [0.0])


def with_cylinders(robot: Mechanism, count: int = 5) -> Mechanism:
    """The robot with the hills as cylinders on level ground, for engines in whose height fields feet sink.

    Args:
        robot: the robot, on any ground.
        count: number of hills (default 5).

    Returns:
        The mechanism: each foot touches the ground and every hill.
    """
    turn = (0.5**0.5, 0.5**0.5, 0.0, 0.0)  # the axis along y
    collisions = [
        Collision(
            foot.body,
            None,
            Sphere(foot.radius, center=foot.point),
            Cylinder(_ROUND, _LONG, center=(_FIRST + _APART * k, 0.0, _HILL - _ROUND), orientation=turn),
            friction=foot.friction,
            name=f"{foot.name} on hill {k}",
        )
        for k in range(count)
        for foot in robot.contacts
    ]
    level = [replace(foot, terrain=None) for foot in robot.contacts]
    return replace(robot, contacts=level, collisions=collisions)


def mini_cheetah_hills(*, count: int = 5, speed: float = 0.4, **settings: Any) -> SuiteTask:
    """Walk over five hills of 50 mm, 1 m apart, at .4 m/s: `mini_cheetah` on that ground, which plans take for a plane.

    A run of 20 s is a success if the trunk passes the last hill, at x = 6.5 m (in proportion at other speeds), and
    stays above .15 m, with roll and pitch below .5 rad. The robot feels the hills with its feet only; plans of the
    publication know them.

    Args:
        count: number of hills.
        speed: speed of the nominal motion [m/s].
        **settings: settings of `dojo.MPC`, instead of the ones of the task.

    Returns:
        The task.

    Raises:
        TypeError: for an unknown setting.
        ValueError: for an argument out of range.
    """
    count = whole_number("idto.mini_cheetah_hills(count=...)", count)
    checks.number("idto.mini_cheetah_hills(speed=...)", speed, above=0.0)
    way = _FIRST + _APART * count - 0.5
    task = mini_cheetah(speed=speed, terrain=hills(count), **settings)
    judge, duration = _Walked(way), 8.0 / speed * way / 6.5
    return replace(task, name="idto.mini_cheetah_hills", duration=duration, judge=judge)


class _Walked:
    """Whether the robot gets `far` [m] on its feet, backward where that is negative."""

    def __init__(self, far: float) -> None:
        self._far = far

    def __call__(self, loop: ClosedLoop) -> tuple[bool, dict[str, float]]:
        w, x, y, z = loop.x[:, BaseState.QUATERNION].T
        roll = np.arctan2(2.0 * (w * x + y * z), 1.0 - 2.0 * (x**2 + y**2))
        pitch = np.arcsin(np.clip(2.0 * (w * y - z * x), -1.0, 1.0))
        way, low = float(loop.x[-1, 0] - loop.x[0, 0]), float(loop.x[:, 2].min())
        tilt = float(max(np.abs(roll).max(), np.abs(pitch).max()))
        done = way * np.sign(self._far) >= abs(self._far) and low > _LOW and tilt < _TILT
        return done, {"way [m]": way, "lowest [m]": low, "tilt [rad]": tilt}
