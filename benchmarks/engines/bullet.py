"""PyBullet as an engine: Featherstone multibodies, stepped one by one from Python.

Springs are explicit torques of the step, as Bullet has none of its own.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.engines import bullet_scene
from benchmarks.engines.bullet_scene import World
from benchmarks.engines.failed_runs import ended
from benchmarks.engines.mujoco_scene import is_free
from benchmarks.engines.separate_process import apart
from dojo_opt.report.engine import Run, clocked, held, nodes, observe
from sim.mechanism.mechanism import Mechanism
from sim.model.model import InputKind, Model
from sim.simulator.simulator import Simulator
from solvers.types import Floats

_LOST = 1e8  # [m/s, rad/s] faster than this, the simulation has blown up


@dataclass(frozen=True)
class Bullet:
    """50 solver iterations, friction cones, no damping but the mechanism's own."""

    iterations: int = 50
    rounds: int = 1  # times that a run shorter than a second is clocked
    name: str = "PyBullet"

    @ended
    @apart
    def simulate(
        self,
        mechanism: Mechanism,
        *,
        time_step: float,
        q: ArrayLike,
        v: ArrayLike,
        duration: float,
        samples: int,
        inputs: ArrayLike | None = None,
    ) -> Run:
        """As Engine.simulate."""
        with quiet():
            import pybullet

        marks = nodes(time_step, duration, samples)
        u = held(mechanism, inputs, int(marks[-1]))
        sim = Simulator(mechanism, time_step=time_step)
        bullet_scene.check(sim.model)
        if bullet_scene.unused(sim.model, u):
            raise ValueError("PyBullet: inputs of joints with several coordinates are not represented")
        start = np.concatenate([np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)])

        def travel() -> tuple[Floats, int, str]:
            with quiet():
                world = bullet_scene.load(pybullet, sim.model, time_step, self.iterations)
            try:
                return _travel(world, sim.model, start, u, marks)
            finally:
                world.close()

        (xs, steps, message), seconds = clocked(travel, self.rounds)
        times = time_step * marks[: len(xs)].astype(np.float64)
        return observe(sim, times, xs[:, : sim.nq], xs[:, sim.nq :], seconds, steps, message)


@contextmanager
def quiet() -> Iterator[None]:
    """Discard standard output meanwhile: Bullet prints to it from compiled code, and a report in JSON goes there."""
    sys.stdout.flush()
    kept = os.dup(1)
    try:
        with open(os.devnull, "wb") as nothing:
            os.dup2(nothing.fileno(), 1)
        yield
    finally:
        ctypes.CDLL("ucrtbase" if sys.platform == "win32" else None).fflush(None)
        os.dup2(kept, 1)
        os.close(kept)


def engines() -> list[Bullet]:
    """The single variant of PyBullet."""
    return [Bullet()]


def _travel(world: World, model: Model, start: Floats, u: Floats, marks: NDArray[np.int64]) -> tuple[Floats, int, str]:
    """([q; v] at the marks, number of steps taken, why it stopped)."""
    write(world, model, start)
    springs = np.flatnonzero(model.dof_spring)
    forced = len(springs) > 0 or bool(np.any(u))
    xs = [start]
    done = 0
    for mark in marks[1:]:
        while done < mark:
            if forced:
                _push(world, model, u[min(done, len(u) - 1)], springs)
            world.bullet.stepSimulation(physicsClientId=world.client)
            done += 1
        x = read(world, model)
        if not np.abs(x).max() < _LOST:
            return np.array(xs), done, f"lost before step {done}"
        xs.append(x)
    return np.array(xs), done, ""


def _push(world: World, model: Model, u: Floats, springs: NDArray[np.int64]) -> None:
    """Springs, inputs of joints, and wrenches at centres of mass, for the next step."""
    bullet, here = world.bullet, {"physicsClientId": world.client}
    torques = dict.fromkeys(springs.tolist(), 0.0)
    for dof in springs:
        state = bullet.getJointState(*world.links[int(model.dof_body[dof])], **here)
        torques[int(dof)] -= float(model.dof_spring[dof] * (state[0] - model.dof_rest[dof]))
    for k, value in enumerate(u):
        index = int(model.input_index[k])
        if model.input_kind[k] == InputKind.JOINT:
            if value:
                torques[index] = torques.get(index, 0.0) + float(value)
            continue
        multibody, link = world.links[index]
        wrench = value * model.input_wrench[k]
        position, quaternion = _frame(world, index)
        if model.input_kind[k] == InputKind.BODY:
            R = _matrix(world, quaternion)
            wrench = np.r_[R @ wrench[:3], R @ wrench[3:]]
        where = bullet.WORLD_FRAME
        bullet.applyExternalForce(multibody, link, wrench[:3].tolist(), position, where, **here)
        bullet.applyExternalTorque(multibody, link, wrench[3:].tolist(), where, **here)
    for dof, torque in torques.items():
        multibody, link = world.links[int(model.dof_body[dof])]
        bullet.setJointMotorControl2(multibody, link, bullet.TORQUE_CONTROL, force=torque, **here)


def _frame(world: World, body: int) -> tuple[Any, Any]:
    """Centre of mass and orientation (x, y, z, w) of the body's own axes."""
    multibody, link = world.links[body]
    here = {"physicsClientId": world.client}
    if link >= 0:
        state = world.bullet.getLinkState(multibody, link, computeForwardKinematics=1, **here)
        return state[0], state[5]
    position, inertial = world.bullet.getBasePositionAndOrientation(multibody, **here)
    local = world.bullet.getDynamicsInfo(multibody, -1, **here)[4]
    back = world.bullet.invertTransform((0, 0, 0), local)[1]
    return position, world.bullet.multiplyTransforms((0, 0, 0), inertial, (0, 0, 0), back)[1]


def _matrix(world: World, quaternion: Any) -> Floats:
    return np.array(world.bullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)


def write(world: World, model: Model, x: Floats) -> None:
    """Our state [q; v], v at the node."""
    bullet, here = world.bullet, {"physicsClientId": world.client}
    nq = len(x) - len(model.dof_body)
    for body, (multibody, link) in enumerate(world.links):
        q = x[model.body_qadr[body] : model.body_qadr[body + 1]]
        v = x[nq + model.body_vadr[body] : nq + model.body_vadr[body + 1]]
        if is_free(model, body):
            turn = np.roll(q[3:], -1)
            local = bullet.getDynamicsInfo(multibody, -1, **here)[4]
            inertial = bullet.multiplyTransforms((0, 0, 0), turn.tolist(), (0, 0, 0), local)[1]
            bullet.resetBasePositionAndOrientation(multibody, q[:3].tolist(), inertial, **here)
            omega = _matrix(world, turn.tolist()) @ v[3:]
            bullet.resetBaseVelocity(multibody, v[:3].tolist(), omega.tolist(), **here)
        elif model.joint_nrot[body] == 3:
            turn = np.roll(q, -1).tolist()
            bullet.resetJointStateMultiDof(multibody, link, turn, v.tolist(), **here)
        elif len(q):
            bullet.resetJointState(multibody, link, float(q[0]), float(v[0]), **here)


def read(world: World, model: Model) -> Floats:
    """Our state [q; v], v at the node."""
    bullet, here = world.bullet, {"physicsClientId": world.client}
    q: list[float] = []
    v: list[float] = []
    for body, (multibody, link) in enumerate(world.links):
        if is_free(model, body):
            position, turn = _frame(world, body)
            linear, angular = bullet.getBaseVelocity(multibody, **here)
            q += [*position, turn[3], *turn[:3]]
            v += [*linear, *(_matrix(world, turn).T @ np.array(angular))]
        elif model.joint_nrot[body] == 3:
            state = bullet.getJointStateMultiDof(multibody, link, **here)
            q += [state[0][3], *state[0][:3]]
            v += [*state[1]]
        elif model.body_qadr[body + 1] > model.body_qadr[body]:
            state = bullet.getJointState(multibody, link, **here)
            q.append(state[0])
            v.append(state[1])
    return np.array([*q, *v], dtype=np.float64)
