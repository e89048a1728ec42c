"""The real cube in Bullet: predictions of tosses with given parameters."""

from __future__ import annotations

import numpy as np

import dojo_opt as dojo
from benchmarks.engines.bullet import quiet
from benchmarks.engines.cube_motion import CubeMotion
from solvers.types import Floats

__all__ = ["BulletCube"]

_SUBSTEPS = 7  # of a frame: about 1 ms
_MASS, _INERTIA, _GRAVITY = 0.37, 8.1e-4, 9.81  # [kg], [kg m^2], [m/s^2]
_PLANE = {"lateralFriction": 1.0, "restitution": 1.0}  # Bullet multiplies those of both bodies
_STILL = {"linearDamping": 0.0, "angularDamping": 0.0, "rollingFriction": 0.0, "spinningFriction": 0.0}


class BulletCube:
    """The cube on the ground, with Bullet's own contacts: 50 solver iterations, friction cones; `sim` subtracts states.

    Args:
        friction: of cube and ground.
        restitution: of an impact; Bullet takes it for 0 at less than 0.2 m/s.
        half: half width [m].
        frame: time between two frames [s].
        sim: the cube.

    Raises:
        ImportError: there is no pybullet.
    """

    def __init__(self, friction: float, restitution: float, half: float, frame: float, sim: dojo.Simulator) -> None:
        with quiet():
            import pybullet
        self._sim, self._bullet = sim, pybullet
        self._client = {"physicsClientId": pybullet.connect(pybullet.DIRECT)}
        pybullet.setGravity(0.0, 0.0, -_GRAVITY, **self._client)
        pybullet.setPhysicsEngineParameter(
            fixedTimeStep=frame / _SUBSTEPS, numSolverIterations=50, numSubSteps=1, enableConeFriction=1, **self._client
        )
        plane = pybullet.createMultiBody(
            0.0, pybullet.createCollisionShape(pybullet.GEOM_PLANE, **self._client), **self._client
        )
        pybullet.changeDynamics(plane, -1, **_PLANE, **self._client)
        box = pybullet.createCollisionShape(pybullet.GEOM_BOX, halfExtents=[half] * 3, **self._client)
        self._cube = pybullet.createMultiBody(_MASS, box, **self._client)
        pybullet.changeDynamics(
            self._cube, -1, lateralFriction=friction, restitution=restitution, localInertiaDiagonal=[_INERTIA] * 3,
            activationState=pybullet.ACTIVATION_STATE_DISABLE_SLEEPING, **_STILL, **self._client,
        )  # fmt: skip

    def rollout(self, x: Floats, us: Floats) -> CubeMotion:
        """As Simulator.rollout."""
        bullet, cube, here = self._bullet, self._cube, self._client
        quaternion = np.roll(x[3:7], -1).tolist()
        bullet.resetBasePositionAndOrientation(cube, x[:3].tolist(), quaternion, **here)
        bullet.resetBaseVelocity(cube, x[7:10].tolist(), (self._turn(quaternion) @ x[10:]).tolist(), **here)
        xs = [x]
        for _ in range(len(us)):
            for _ in range(_SUBSTEPS):
                bullet.stepSimulation(**here)
            position, quaternion = bullet.getBasePositionAndOrientation(cube, **here)
            velocity, spin = bullet.getBaseVelocity(cube, **here)
            xs.append(np.array([*position, *np.roll(quaternion, 1), *velocity, *(self._turn(quaternion).T @ spin)]))
        found = np.array(xs)
        return CubeMotion(found, bool(np.isfinite(found).all()))

    def difference(self, a: Floats, b: Floats) -> Floats:
        """As Simulator.difference."""
        return self._sim.difference(a, b)

    def close(self) -> None:
        """End the world."""
        self._bullet.disconnect(**self._client)

    def _turn(self, quaternion: object) -> Floats:
        """(3, 3) rotation of a quaternion (x, y, z, w)."""
        return np.array(self._bullet.getMatrixFromQuaternion(quaternion)).reshape(3, 3)
