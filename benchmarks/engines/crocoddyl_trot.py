"""A gait planned by crocoddyl (FDDP, C++), as a yardstick for an easier problem: it is told when each foot stands.

The robot is built from the arrays of the same mechanism, and gets the knots, the cost, the reference and the guess of
a problem of `dojo.problems.follow`. The differences all make the problem easier: the standing feet and their positions
are given in every knot, as constraints on the acceleration; a knot is one explicit Euler step; joints have no torque
limits, stops or damping (crocoddyl has none); friction and the final pose are penalties, so one solve is enough.
Nothing keeps a foot in the air out of the ground: in the trot of `dojo.problems` feet dip into it by 7 mm.

Mastalli et al. 2020, "Crocoddyl: An Efficient and Versatile Framework for Multi-Contact Optimal Control".
"""

from __future__ import annotations

from typing import Any

import numpy as np

from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.feet import Feet
from dojo_opt.planning.problem import Problem
from sim.model.model import Model
from solvers.types import Matrix

TOUCH = 1e-6  # [m] a foot this near to the ground at both ends of a knot stands in it
BAUMGARTE = np.array([0.25, 1.0])  # of a standing foot: position per squared, velocity per knot time; none overshoots
FRICTION = 1e-4  # weight of a force outside of its cone [1/N^2 per second]
GOAL = 10.0  # weight of the pose at the end [1/m^2, 1/rad^2]


class CrocoddylTrot:
    """The shooting problem, and its guess."""

    def __init__(self, problem: Problem) -> None:
        import crocoddyl
        import pinocchio

        self._croc, self._pin = crocoddyl, pinocchio
        sim, self._knot = problem.sim, problem.knot_time
        (tracking,) = (s for s in problem.specs[0] if isinstance(s, Tracking))
        (effort,) = (s for s in problem.specs[0] if isinstance(s, Effort))
        reference = np.asarray(tracking.reference)
        self._weight = 2.0 * tracking.scale * np.asarray(tracking.weight)  # crocoddyl halves squares
        self._effort = 2.0 * effort.scale * float(np.asarray(effort.weight))
        feet = Feet(sim)
        self._friction = [float(contact.friction) for contact in feet.contacts]
        model, frames = pinocchio_model(sim.model)
        self._frames = [frames[sim.mechanism.contact_names.index(name)] for name in feet.names]
        self._state = crocoddyl.StateMultibody(model)
        self._actuation = crocoddyl.ActuationModelFloatingBase(self._state)
        down = feet.gaps(reference) < TOUCH
        places = feet.positions(reference)
        self.xs = [pinocchio_state(x) for x in reference]
        self.us = list(problem.controls0)
        running = [
            crocoddyl.IntegratedActionModelEuler(
                self._dynamics(self.xs[t], places[t + 1], down[t] & down[t + 1]), self._knot
            )
            for t in range(problem.horizon)
        ]
        last = crocoddyl.IntegratedActionModelEuler(self._dynamics(self.xs[-1], places[-1], down[-1], last=True), 0.0)
        self._problem = crocoddyl.ShootingProblem(self.xs[0], running, last)
        self._problem.nthreads = 1
        self.solver = crocoddyl.SolverFDDP(self._problem)

    def solve(self, max_iterations: int = 100) -> int:
        """Plan from the reference, and return the number of iterations."""
        us = [u[: model.nu] for u, model in zip(self.us, self._problem.runningModels, strict=True)]
        self.solver.solve(self.xs, us, max_iterations, False)
        return min(int(self.solver.iter) + 1, max_iterations)

    def _dynamics(self, x: Any, places: Matrix, stands: Any, *, last: bool = False) -> Any:
        """Forward dynamics with the given feet as contacts, and the cost of a knot around the state x."""
        croc, nu = self._croc, self._actuation.nu
        per_second = 1.0 if last else 1.0 / self._knot  # the Euler step multiplies by the knot time
        contacts, costs = croc.ContactModelMultiple(self._state, nu), croc.CostModelSum(self._state, nu)
        gains = BAUMGARTE / np.array([self._knot**2, self._knot])
        for k in np.flatnonzero(stands):
            frame = self._frames[k]
            axes = self._pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
            contacts.addContact(f"foot{k}", croc.ContactModel3D(self._state, frame, places[k], axes, nu, gains))
            cone = croc.FrictionCone(np.eye(3), self._friction[k], 4, False)
            residual = croc.ResidualModelContactFrictionCone(self._state, frame, cone, nu, not last)
            barrier = croc.ActivationModelQuadraticBarrier(croc.ActivationBounds(cone.lb, cone.ub))
            if not last:
                costs.addCost(f"cone{k}", croc.CostModelResidual(self._state, barrier, residual), FRICTION)
        activation = croc.ActivationModelWeightedQuad(per_second * self._weight)
        deviation = croc.ResidualModelState(self._state, x, nu)
        costs.addCost("tracking", croc.CostModelResidual(self._state, activation, deviation), 1.0)
        if last:
            pose = croc.ActivationModelWeightedQuad(np.repeat([GOAL, 0.0], [6, self._state.ndx - 6]))
            costs.addCost("goal", croc.CostModelResidual(self._state, pose, deviation), 1.0)
        else:
            torque = croc.CostModelResidual(self._state, croc.ResidualModelControl(self._state, nu))
            costs.addCost("effort", torque, per_second * self._effort)
        return croc.DifferentialActionModelContactFwdDynamics(self._state, self._actuation, contacts, costs, 0.0, True)


def pinocchio_model(model: Model) -> tuple[Any, list[int]]:
    """`pinocchio.Model` of a floating base with hinges, and the frame of each contact.

    Its joint frames have the axes of our bodies and lie in the joints.
    """
    import pinocchio as pin

    others = np.any(model.joint_nrot[1:] != 1) or np.any(model.joint_lead)
    if model.joint_nrot[0] != 3 or model.joint_ntrans[0] != 3 or others:
        raise ValueError("pinocchio_model(model): expected a floating base, and hinges")
    robot = pin.Model()
    robot.gravity.linear = np.array(model.gravity)
    joints: list[int] = []
    for body, parent in enumerate(model.body_parent):
        place = pin.SE3.Identity()
        kind: Any = pin.JointModelFreeFlyer()
        if parent >= 0:
            w, x, y, z = model.joint_offset[body]
            point = model.joint_parent_point[body] - model.joint_child_point[parent]
            place = pin.SE3(pin.Quaternion(w, x, y, z).toRotationMatrix(), point)
            axis = np.asarray(model.joint_axis[body])
            aligned = (pin.JointModelRX, pin.JointModelRY, pin.JointModelRZ)  # these are cheaper
            kind = aligned[int(axis.argmax())]() if axis.max() == 1.0 else pin.JointModelRevoluteUnaligned(axis)
        name = f"joint{body}" if parent >= 0 else "root_joint"  # crocoddyl takes the joint of this name as unactuated
        joints.append(robot.addJoint(joints[parent] if parent >= 0 else 0, kind, place, name))
        inertia = np.asarray(model.body_inertia[body]).reshape(3, 3)
        lever = -np.asarray(model.joint_child_point[body])
        robot.appendBodyToJoint(
            joints[body], pin.Inertia(float(model.body_mass[body]), lever, inertia), pin.SE3.Identity()
        )
    frames = []
    for contact, body in enumerate(model.contact_body):
        place = pin.SE3(np.eye(3), model.contact_point[contact] - model.joint_child_point[body])
        frame = pin.Frame(f"contact{contact}", joints[body], 0, place, pin.FrameType.OP_FRAME)
        frames.append(int(robot.addFrame(frame)))
    return robot, frames


def pinocchio_state(x: Matrix) -> Matrix:
    """State x of a floating base with hinges for pinocchio: quaternion scalar last, linear velocity in body axes."""
    nv = (len(x) - 1) // 2
    out = np.array(x)
    out[3:7] = x[[4, 5, 6, 3]]
    w, u, v = x[3], -x[4:7], x[nv + 1 : nv + 4]
    out[nv + 1 : nv + 4] = v + 2.0 * (w * np.cross(u, v) + np.cross(u, np.cross(u, v)))
    return out
