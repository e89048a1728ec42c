"""The same mechanism for PyBullet: URDF text from the flat arrays of a Model, one file per tree.

Link frames are at the joint points with our axes, inertial frames at the centres of mass along the principal axes.
Bullet's own damping and its cap on joint speeds are switched off. A contact has the friction of its body; Bullet
multiplies it by the friction of the plane, which is 1.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from benchmarks.engines.mujoco_scene import POINT_RADIUS, is_free
from sim.model.model import InputKind, Model
from solvers.types import Floats


@dataclass
class World:
    """A client with the mechanism in it: (multibody, link) of every body, link -1 being the base."""

    bullet: Any
    client: int
    links: list[tuple[int, int]] = field(default_factory=list)

    def close(self) -> None:
        """Release the client."""
        self.bullet.disconnect(self.client)


def check(model: Model) -> None:
    """ValueError: the model has a feature that this engine does not represent."""
    if len(model.coupling_body) + len(model.gear_dof):
        raise ValueError("PyBullet: collisions between bodies and closed loops and gears are not represented")
    if model.contact_terrain.any() or model.contact_restitution.any():
        raise ValueError("PyBullet: terrain and restitution are not represented")
    if np.any(model.body_weight != 1.0):
        raise ValueError("PyBullet: gravity compensation is not represented")
    if np.any(model.joint_lead):
        raise ValueError("PyBullet: joints that turn and slide in one are not represented")
    several = (model.joint_ntrans > 0) & (model.joint_ntrans + model.joint_nrot > 1)
    if np.any(several & ~np.array([is_free(model, i) for i in range(len(several))])):
        raise ValueError("PyBullet: joints with several translations are not represented")
    balls = np.flatnonzero(model.joint_nrot == 3)
    dofs = [int(model.body_vadr[i + 1]) - 1 for i in balls]
    if np.any(model.dof_spring[dofs]) or np.any(model.dof_damper[dofs]):
        raise ValueError("PyBullet: springs and dampers of ball joints are not represented")
    if len(np.unique(_planes(model), axis=0)) > 1:
        raise ValueError("PyBullet: more than one half-space is not represented")
    for body in range(len(model.body_mass)):
        if len(np.unique(model.contact_friction[model.contact_body == body])) > 1:
            raise ValueError("PyBullet: contacts of one body have one friction")


def _planes(model: Model) -> Floats:
    return np.column_stack([model.contact_frame[:, :3], model.contact_height])


def load(bullet: Any, model: Model, time_step: float, iterations: int) -> World:
    """The world at zero coordinates."""
    world = World(bullet, bullet.connect(bullet.DIRECT), [(-1, -1)] * len(model.body_mass))
    here = {"physicsClientId": world.client}
    bullet.setGravity(*model.gravity, **here)
    bullet.setPhysicsEngineParameter(
        fixedTimeStep=time_step, numSubSteps=0, numSolverIterations=iterations, enableConeFriction=1, **here
    )
    if len(model.contact_body):
        normal, height = model.contact_frame[0, :3], float(model.contact_height[0])
        shape = bullet.createCollisionShape(bullet.GEOM_PLANE, planeNormal=normal.tolist(), **here)
        plane = bullet.createMultiBody(0.0, shape, basePosition=(height * normal).tolist(), **here)
        bullet.changeDynamics(plane, -1, lateralFriction=1.0, restitution=0.0, **here)
    for root in np.flatnonzero(model.body_parent < 0):
        _tree(world, model, int(root))
    for body, (multibody, link) in enumerate(world.links):
        mu = model.contact_friction[model.contact_body == body]
        bullet.changeDynamics(
            multibody,
            link,
            lateralFriction=float(mu[0]) if len(mu) else 0.0,
            linearDamping=0.0,
            angularDamping=0.0,
            maxJointVelocity=1e9,
            restitution=0.0,
            activationState=bullet.ACTIVATION_STATE_DISABLE_SLEEPING,
            **here,
        )
    _unlock(world, model)
    return world


def _tree(world: World, model: Model, root: int) -> None:
    """One multibody: the tree that hangs on `root`."""
    members = [root]
    for body in range(root + 1, len(model.body_mass)):
        if model.body_parent[body] in members:
            members.append(body)
    bullet, free = world.bullet, is_free(model, root)
    flags = bullet.URDF_USE_INERTIA_FROM_FILE
    here = {"physicsClientId": world.client}
    with TemporaryDirectory() as folder:
        file = Path(folder) / "tree.urdf"
        file.write_text(_urdf(model, members, free), encoding="utf-8")
        multibody = bullet.loadURDF(str(file), useFixedBase=not free, flags=flags, **here)
    for link in range(bullet.getNumJoints(multibody, **here)):
        name = bullet.getJointInfo(multibody, link, **here)[12].decode()
        world.links[int(name.removeprefix("body"))] = multibody, link
    if free:
        world.links[root] = multibody, -1


def _urdf(model: Model, members: list[int], free: bool) -> str:
    lines = ['<robot name="tree">'] + ([] if free else ['<link name="world"/>'])
    for body in members:
        if not (free and body == members[0]):
            lines.append(_joint(model, body, free and int(model.body_parent[body]) == members[0]))
        lines.append(_link(model, body))
    return "\n".join([*lines, "</robot>"])


def _bounds(model: Model, dof: int) -> tuple[float, float]:
    """Limits of a coordinate; without limits, lower above upper, which Bullet takes as unlimited."""
    mine = np.flatnonzero(model.limit_dof == dof)
    if not len(mine):
        return 1.0, -1.0
    low = [float(model.limit_bound[k]) for k in mine if model.limit_sign[k] > 0]
    high = [float(model.limit_bound[k]) for k in mine if model.limit_sign[k] < 0]
    return low[0] if low else -1e6, high[0] if high else 1e6


def _angles(turn: Rotation) -> Floats:
    """Roll, pitch, yaw of URDF; at a pitch of 90 degrees one of many solutions."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", UserWarning)
        return np.asarray(turn.as_euler("xyz"))


def _text(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)


def _link(model: Model, body: int) -> str:
    """<link> with its inertia along the principal axes and a ball per contact; its frame is at its joint."""
    at = np.zeros(3) if is_free(model, body) else model.joint_child_point[body]
    moments, axes = np.linalg.eigh(model.body_inertia[body].reshape(3, 3))
    if np.linalg.det(axes) < 0.0:
        axes[:, 0] = -axes[:, 0]
    rpy = _angles(Rotation.from_matrix(axes))
    ixx, iyy, izz = (repr(float(moment)) for moment in moments)
    lines = [
        f'<link name="body{body}"><inertial><origin xyz="{_text(-at)}" rpy="{_text(rpy)}"/>',
        f'<mass value="{float(model.body_mass[body])!r}"/>',
        f'<inertia ixx="{ixx}" iyy="{iyy}" izz="{izz}" ixy="0" ixz="0" iyz="0"/></inertial>',
    ]
    for c in np.flatnonzero(model.contact_body == body):
        radius = max(float(model.contact_radius[c]), POINT_RADIUS)
        place = _text(model.contact_point[c] - at)
        ball = f'<geometry><sphere radius="{radius!r}"/></geometry>'
        lines.append(f'<collision><origin xyz="{place}" rpy="0 0 0"/>{ball}</collision>')
    return "".join([*lines, "</link>"])


def _joint(model: Model, body: int, on_free_base: bool) -> str:
    """<joint> of a body, in the link frame of its parent."""
    parent = int(model.body_parent[body])
    at = np.zeros(3) if parent < 0 or on_free_base else model.joint_child_point[parent]
    rpy = _angles(Rotation.from_quat(np.roll(model.joint_offset[body], -1)))
    free = int(model.joint_ntrans[body]), int(model.joint_nrot[body])
    kind = {(0, 0): "fixed", (1, 0): "prismatic", (0, 1): "continuous", (0, 3): "spherical"}[free]
    bounds = _bounds(model, int(model.body_vadr[body]))
    if kind == "continuous" and bounds[0] <= bounds[1]:
        kind = "revolute"
    axis = model.joint_trans_axes[body, :3] if free[0] else model.joint_axis[body]
    damping = float(model.dof_damper[model.body_vadr[body]]) if kind != "fixed" else 0.0
    lines = [
        f'<joint name="joint{body}" type="{kind}"><child link="body{body}"/>',
        f'<parent link="{"world" if parent < 0 else f"body{parent}"}"/>',
        f'<origin xyz="{_text(model.joint_parent_point[body] - at)}" rpy="{_text(rpy)}"/><axis xyz="{_text(axis)}"/>',
        f'<dynamics damping="{damping!r}" friction="0"/>',
    ]
    if kind in ("prismatic", "revolute"):
        low, high = bounds
        lines.append(f'<limit lower="{low!r}" upper="{high!r}" effort="1e12" velocity="1e12"/>')
    return "".join([*lines, "</joint>"])


def _unlock(world: World, model: Model) -> None:
    """Switch off the motors that brake every new joint."""
    bullet, here = world.bullet, {"physicsClientId": world.client}
    for body, (multibody, link) in enumerate(world.links):
        if link < 0:
            continue
        if model.joint_nrot[body] == 3:
            still = {"targetPosition": [0, 0, 0, 1], "targetVelocity": [0, 0, 0], "force": [0, 0, 0]}
            bullet.setJointMotorControlMultiDof(
                multibody, link, bullet.POSITION_CONTROL, positionGain=0, velocityGain=0, **still, **here
            )
        elif model.joint_ntrans[body] + model.joint_nrot[body] == 1:
            bullet.setJointMotorControl2(multibody, link, bullet.VELOCITY_CONTROL, force=0.0, **here)


def unused(model: Model, u: Floats) -> bool:
    """Whether inputs that are not zero act on joints with several coordinates."""
    joints = np.flatnonzero(model.input_kind == InputKind.JOINT)
    bodies = model.dof_body[model.input_index[joints]]
    several = (model.joint_ntrans + model.joint_nrot)[bodies] > 1
    return bool(np.any(u[:, joints[several]]))
