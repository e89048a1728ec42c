"""The same mechanism for Drake: a discrete MultibodyPlant with a SceneGraph, from the flat arrays of a Model.

Drake's body frames are put at our centres of mass with the axes of the joint frame at zero coordinates. Floating bases,
sliders, hinges and rigid joints; contacts become compliant spheres (Drake's defaults) on one half-space. What is left
is refused: other joints, several half-spaces or coefficients of friction.
"""

from __future__ import annotations

import logging
from typing import Any

import numpy as np

from sim.model import Model, Vector

POINT_RADIUS = 1e-4  # [m] of contacts without a radius


class DrakeScene:
    """The diagram, and the way from our states to its states.

    approximation: of discrete contact, a name of pydrake's DiscreteContactApproximation such as "kLagged".
    ValueError: a mechanism that cannot be represented.
    """

    def __init__(self, model: Model, time_step: float, approximation: str = "kLagged") -> None:
        import pydrake.all as drake

        self._drake, self.model = drake, model
        logging.getLogger("drake").setLevel(logging.ERROR)  # a half-space is a warning
        builder = drake.DiagramBuilder()
        self.plant, graph = drake.AddMultibodyPlantSceneGraph(builder, time_step)
        self.plant.SetUseSampledOutputPorts(False)  # the update is then one of the discrete state alone
        self.plant.set_discrete_contact_approximation(getattr(drake.DiscreteContactApproximation, approximation))
        self.plant.mutable_gravity_field().set_gravity_vector(np.array(model.gravity))
        self._bodies: list[Any] = []
        self._joints: list[Any] = []
        for body in range(len(model.body_mass)):
            self._bodies.append(self._body(body))
            self._joints.append(self._joint(body))
        if len(model.contact_body):
            self._contacts()
        self.plant.Finalize()
        everything = drake.GeometrySet([self.plant.GetBodyFrameIdOrThrow(b.index()) for b in self._bodies])
        graph.collision_filter_manager().Apply(drake.CollisionFilterDeclaration().ExcludeWithin(everything))
        self.diagram = builder.Build()

    def state(self, x: Vector) -> Vector:
        """Drake's [q; v] of our state x: quaternion before position, angular velocity (world axes) before linear."""
        model, plant = self.model, self.plant
        nq = int(model.body_qadr[-1])
        q, v = np.zeros(plant.num_positions()), np.zeros(plant.num_velocities())
        for body, joint in enumerate(self._joints):
            own_q, own_v = x[model.body_qadr[body] :], x[nq + model.body_vadr[body] :]
            first, velocity = joint.position_start(), joint.velocity_start()
            if joint.num_positions() == 7:
                q[first : first + 4], q[first + 4 : first + 7] = own_q[3:7], own_q[:3]
                turn = self._drake.RotationMatrix(self._drake.Quaternion(own_q[3:7] / np.linalg.norm(own_q[3:7])))
                v[velocity : velocity + 3], v[velocity + 3 : velocity + 6] = turn.multiply(own_v[3:6]), own_v[:3]
            elif joint.num_positions() == 1:
                q[first], v[velocity] = own_q[0], own_v[0]
        return np.concatenate([q, v])

    def velocity_of(self, dof: int) -> int:
        """Where Drake's v has a degree of freedom that is the only one of its joint; -1: it is not."""
        joint = self._joints[int(self.model.dof_body[dof])]
        return -1 if joint.num_velocities() != 1 else int(joint.velocity_start())

    def _body(self, body: int) -> Any:
        drake = self._drake
        J = self.model.body_inertia[body].reshape(3, 3)
        inertia = drake.RotationalInertia(J[0, 0], J[1, 1], J[2, 2], J[0, 1], J[0, 2], J[1, 2])
        mass = float(self.model.body_mass[body])
        return self.plant.AddRigidBody(
            f"body{body}", drake.SpatialInertia.MakeFromCentralInertia(mass, np.zeros(3), inertia)
        )

    def _joint(self, body: int) -> Any:
        """The joint to the parent."""
        drake, model, first = self._drake, self.model, int(self.model.body_vadr[body])
        kind = int(model.joint_ntrans[body]), int(model.joint_nrot[body])
        parent = int(model.body_parent[body])
        offset = drake.Quaternion(np.array(model.joint_offset[body]))
        place = drake.RigidTransform(offset, np.array(model.joint_parent_point[body]))
        above = self.plant.world_body() if parent < 0 else self._bodies[parent]
        point = drake.RigidTransform(np.array(model.joint_child_point[body]))
        name = f"joint{body}"
        F = self.plant.AddFrame(drake.FixedOffsetFrame(f"{name}_F", above.body_frame(), place))
        M = self.plant.AddFrame(drake.FixedOffsetFrame(f"{name}_M", self._bodies[body].body_frame(), point))
        if kind == (0, 0):
            return self.plant.AddJoint(drake.WeldJoint(name, F, M, drake.RigidTransform()))
        if kind == (3, 3) and np.array_equal(model.joint_trans_axes[body], np.eye(3).ravel()):
            return self.plant.AddJoint(drake.QuaternionFloatingJoint(name, F, M))
        if kind not in ((1, 0), (0, 1)):
            raise ValueError(f"DrakeScene: no joint with {kind[0]} translations and {kind[1]} rotations (body {body})")
        slides = kind == (1, 0)
        axis = np.array(model.joint_trans_axes[body][:3] if slides else model.joint_axis[body])
        low, high = -np.inf, np.inf
        for limit in np.flatnonzero(model.limit_dof == first):
            bound = float(model.limit_bound[limit])
            low, high = (bound, high) if model.limit_sign[limit] > 0 else (low, bound)
        make = drake.PrismaticJoint if slides else drake.RevoluteJoint
        joint = self.plant.AddJoint(make(name, F, M, axis, low, high, float(model.dof_damper[first])))
        if model.dof_spring[first] > 0.0:
            spring = drake.PrismaticSpring if slides else drake.RevoluteSpring
            self.plant.AddForceElement(spring(joint, float(model.dof_rest[first]), float(model.dof_spring[first])))
        return joint

    def _contacts(self) -> None:
        drake, model = self._drake, self.model
        rows = np.column_stack([model.contact_frame[:, :3], model.contact_height, model.contact_friction])
        if np.any(rows != rows[0]):
            raise ValueError("DrakeScene: contacts with several half-spaces or coefficients of friction")
        normal, height, friction = rows[0, :3], float(rows[0, 3]), float(rows[0, 4])
        rub = drake.CoulombFriction(friction, friction)
        plane = drake.HalfSpace.MakePose(normal, height * normal)
        self.plant.RegisterCollisionGeometry(self.plant.world_body(), plane, drake.HalfSpace(), "ground", rub)
        for contact, body in enumerate(model.contact_body):
            ball = drake.Sphere(max(float(model.contact_radius[contact]), POINT_RADIUS))
            at = drake.RigidTransform(np.array(model.contact_point[contact]))
            self.plant.RegisterCollisionGeometry(self._bodies[body], at, ball, f"contact{contact}", rub)
