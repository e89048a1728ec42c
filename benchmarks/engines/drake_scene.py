"""The same mechanism for Drake: a MultibodyPlant from the flat arrays of a Model.

Body frames are at our centres of mass with our axes. Several translations in one joint become a row of joints with
massless bodies between them. Contacts are spheres that meet the half-space they belong to, and nothing else; springs
are force elements, which Drake integrates explicitly.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from benchmarks.engines.mujoco_scene import POINT_RADIUS, is_free
from sim.model.model import InputKind, Model


@dataclass
class DrakePlant:
    """A diagram with the plant in it, and where the coordinates of our joints are."""

    diagram: Any
    plant: Any
    bodies: list[Any]
    free: list[bool]  # whether the body floats, without a joint of Drake's
    joints: list[list[Any]] = field(default_factory=list)  # for our joint i, translations first
    actuated: list[int] = field(default_factory=list)  # inputs with an actuator


def load(model: Model, time_step: float, approximation: str = "") -> DrakePlant:
    """The plant; without an approximation it is continuous.

    ValueError: a spring of a ball joint, or limits in a continuous plant, which Drake lacks.
    """
    from pydrake.multibody.plant import AddMultibodyPlantSceneGraph, DiscreteContactApproximation
    from pydrake.systems.framework import DiagramBuilder

    logging.getLogger("drake").setLevel(logging.ERROR)  # it warns of every half-space
    if len(model.coupling_body) + len(model.gear_dof):
        raise ValueError("Drake: collisions between bodies and closed loops and gears are not represented")
    if model.contact_terrain.any() or model.contact_restitution.any():
        raise ValueError("Drake: terrain and restitution are not represented")
    if np.any(model.body_weight != 1.0):
        raise ValueError("Drake: gravity compensation is not represented")
    if np.any(model.joint_lead):
        raise ValueError("Drake: joints that turn and slide in one are not represented")
    if not approximation and len(model.limit_dof):
        raise ValueError("Drake: a continuous plant has no limits of joints")
    builder = DiagramBuilder()
    plant, graph = AddMultibodyPlantSceneGraph(builder, time_step if approximation else 0.0)
    if approximation:
        plant.SetUseSampledOutputPorts(False)  # a step is then an update of the discrete state alone
        plant.set_discrete_contact_approximation(getattr(DiscreteContactApproximation, f"k{approximation}"))
    plant.mutable_gravity_field().set_gravity_vector(model.gravity)
    count = len(model.body_mass)
    bodies = [plant.AddRigidBody(f"body{i}", _inertia(model, i)) for i in range(count)]
    scene = DrakePlant(None, plant, bodies, [is_free(model, i) for i in range(count)])
    for i in range(count):
        scene.joints.append([] if scene.free[i] else _joint(model, scene, i))
    _add_forces(model, scene)
    _add_contacts(model, scene, graph)
    plant.Finalize()
    plant.set_penetration_allowance(1e-3)
    plant.set_stiction_tolerance(1e-4)
    scene.diagram = builder.Build()
    return scene


def _inertia(model: Model, body: int) -> Any:
    from pydrake.multibody.tree import SpatialInertia, UnitInertia

    mass = float(model.body_mass[body])
    J = model.body_inertia[body].reshape(3, 3) / mass
    unit = UnitInertia(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
    return SpatialInertia(mass, np.zeros(3), unit, True)


def _joint(model: Model, scene: DrakePlant, i: int) -> list[Any]:
    """Our joint i: translations along the axes of the joint frame, then the rotation."""
    from pydrake.common.eigen_geometry import Quaternion
    from pydrake.math import RigidTransform, RotationMatrix
    from pydrake.multibody.tree import (
        BallRpyJoint,
        FixedOffsetFrame,
        PrismaticJoint,
        RevoluteJoint,
        SpatialInertia,
        WeldJoint,
    )

    plant, parent = scene.plant, int(model.body_parent[i])
    base = plant.world_frame() if parent < 0 else scene.bodies[parent].body_frame()
    turn = RotationMatrix(Quaternion(model.joint_offset[i] / np.linalg.norm(model.joint_offset[i])))
    at_parent = RigidTransform(turn, model.joint_parent_point[i])
    frame = plant.AddFrame(FixedOffsetFrame(f"parent{i}", base, at_parent))
    at_child = RigidTransform(model.joint_child_point[i])
    end = plant.AddFrame(FixedOffsetFrame(f"child{i}", scene.bodies[i].body_frame(), at_child))
    ntrans, nrot, first = int(model.joint_ntrans[i]), int(model.joint_nrot[i]), int(model.body_vadr[i])
    axes, damping = model.joint_trans_axes[i].reshape(3, 3), model.dof_damper
    out = []
    for k in range(ntrans):
        between = k < ntrans - 1 or nrot > 0
        last = plant.AddRigidBody(f"between{i}_{k}", SpatialInertia.Zero()).body_frame() if between else end
        out.append(PrismaticJoint(f"slide{i}_{k}", frame, last, axes[k], damping=float(damping[first + k])))
        frame = last
    if nrot == 1:
        d = first + ntrans
        out.append(RevoluteJoint(f"hinge{i}", frame, end, model.joint_axis[i], damping=float(damping[d])))
    elif nrot == 3:
        out.append(BallRpyJoint(f"ball{i}", frame, end, damping=float(damping[first + ntrans])))
    elif ntrans == 0:
        out.append(WeldJoint(f"weld{i}", frame, end, RigidTransform()))
    return [plant.AddJoint(joint) for joint in out]


def scalar_joints(model: Model, scene: DrakePlant) -> dict[int, Any]:
    """Degree of freedom -> joint of Drake's with that one coordinate."""
    out = {}
    for i, joints in enumerate(scene.joints):
        if scene.free[i]:
            continue
        first, scalars = int(model.body_vadr[i]), int(model.joint_ntrans[i]) + (int(model.joint_nrot[i]) == 1)
        out.update({first + k: joints[k] for k in range(scalars)})
    return out


def _add_forces(model: Model, scene: DrakePlant) -> None:
    """Springs, limits, and an actuator per input of a joint with one coordinate."""
    from pydrake.multibody.tree import PrismaticJoint, PrismaticSpring, RevoluteSpring

    scalars = scalar_joints(model, scene)
    for dof in np.flatnonzero(model.dof_spring):
        if int(dof) not in scalars:
            raise ValueError("Drake: a ball joint has no spring")
        joint = scalars[int(dof)]
        spring = PrismaticSpring if isinstance(joint, PrismaticJoint) else RevoluteSpring
        scene.plant.AddForceElement(spring(joint, float(model.dof_rest[dof]), float(model.dof_spring[dof])))
    for dof in sorted(set(model.limit_dof.tolist())):
        low, high = -np.inf, np.inf
        for limit in np.flatnonzero(model.limit_dof == dof):
            bound = float(model.limit_bound[limit])
            low, high = (bound, high) if model.limit_sign[limit] > 0 else (low, bound)
        scalars[dof].set_position_limits([low], [high])
    for k in np.flatnonzero(model.input_kind == InputKind.JOINT):
        if int(model.input_index[k]) in scalars:
            scene.plant.AddJointActuator(f"input{k}", scalars[int(model.input_index[k])])
            scene.actuated.append(int(k))


def _add_contacts(model: Model, scene: DrakePlant, graph: Any) -> None:
    """Spheres and the half-spaces they belong to, one per place and friction; all other pairs are filtered out."""
    from pydrake.geometry import CollisionFilterDeclaration, GeometrySet, HalfSpace, Sphere
    from pydrake.math import RigidTransform
    from pydrake.multibody.plant import CoulombFriction

    plant = scene.plant
    spheres: dict[tuple[float, ...], list[Any]] = {}
    planes: dict[tuple[float, ...], Any] = {}
    for c in range(len(model.contact_body)):
        normal, height, mu = (
            model.contact_frame[c, :3],
            float(model.contact_height[c]),
            float(model.contact_friction[c]),
        )
        key = (*normal.tolist(), height, mu)
        if key not in planes:
            pose = HalfSpace.MakePose(normal, height * normal)
            planes[key] = plant.RegisterCollisionGeometry(
                plant.world_body(), pose, HalfSpace(), f"plane{len(planes)}", CoulombFriction(mu, mu)
            )
        ball = Sphere(max(float(model.contact_radius[c]), POINT_RADIUS))
        body = scene.bodies[int(model.contact_body[c])]
        place = RigidTransform(model.contact_point[c])
        touch = plant.RegisterCollisionGeometry(body, place, ball, f"contact{c}", CoulombFriction(mu, mu))
        spheres.setdefault(key, []).append(touch)
    everything = [touch for group in spheres.values() for touch in group]
    filters = graph.collision_filter_manager()
    filters.Apply(CollisionFilterDeclaration().ExcludeWithin(GeometrySet(everything)))
    for key, plane in planes.items():
        others = [touch for name, group in spheres.items() if name != key for touch in group]
        if others:
            filters.Apply(CollisionFilterDeclaration().ExcludeBetween(GeometrySet([plane]), GeometrySet(others)))
