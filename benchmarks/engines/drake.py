"""Drake as an engine: discrete plants with their contact approximations, and the continuous plant by Runge-Kutta."""

from __future__ import annotations

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from benchmarks.engines import drake_scene
from benchmarks.engines.drake_scene import DrakePlant
from benchmarks.engines.failed_runs import ended
from benchmarks.engines.separate_process import apart
from dojo_opt.report.engine import Run, clocked, held, nodes, observe
from sim.mechanism.mechanism import Mechanism
from sim.model.model import InputKind, Model
from sim.simulator.simulator import Simulator
from solvers.types import Floats

APPROXIMATIONS = ("Lagged", "Sap", "Tamsi")
PATIENCE = 20.0  # [s] of processor time for a motion of a given accuracy
_LOST = 1e8  # [m/s, rad/s] faster than this, the simulation has blown up


@dataclass(frozen=True)
class Drake:
    """One contact approximation of the discrete plant, or "" for the continuous plant by RK3 with fixed steps.

    Point contact, 1 mm penetration allowance, 1e-4 m/s stiction tolerance.
    """

    approximation: str
    rounds: int = 1  # times that a run shorter than a second is clocked

    @property
    def name(self) -> str:
        """Name in tables."""
        return f"Drake {self.approximation.lower() or 'RK3'}"

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
        """As Engine.simulate; an exception of Drake's ends the run with its first sentence."""
        marks = nodes(time_step, duration, samples)
        u = held(mechanism, inputs, int(marks[-1]))
        sim = Simulator(mechanism, time_step=time_step)
        scene = drake_scene.load(sim.model, time_step, self.approximation)
        silent = [k for k in np.flatnonzero(sim.model.input_kind == InputKind.JOINT) if k not in scene.actuated]
        if np.any(u[:, silent]):
            raise ValueError("Drake: inputs of joints with several coordinates are not represented")
        start = np.concatenate([np.asarray(q, dtype=np.float64), np.asarray(v, dtype=np.float64)])
        travel = _Travel(sim, scene, time_step, not self.approximation)
        (xs, steps, message), seconds = clocked(lambda: travel.run(start, u, marks), self.rounds)
        times = time_step * marks[: len(xs)].astype(np.float64)
        return observe(sim, times, xs[:, : sim.nq], xs[:, sim.nq :], seconds, steps, message)


def engines() -> list[Drake]:
    """All approximations and the continuous plant."""
    return [*(Drake(approximation) for approximation in APPROXIMATIONS), Drake("")]


@dataclass(frozen=True)
class _Travel:
    """A plant, and the function that steps it."""

    sim: Simulator
    scene: DrakePlant
    time_step: float
    continuous: bool

    def run(self, start: Floats, u: Floats, marks: NDArray[np.int64]) -> tuple[Floats, int, str]:
        """([q; v] at the marks, number of steps taken, why it stopped)."""
        simulator, context = self._prepared(start)
        xs = [start]
        done = 0
        try:
            simulator.Initialize()
            self._push(context, u[0])
            single = len(u) > 1 or self._follows()
            for mark in marks[1:]:
                while done < mark:
                    if single:
                        self._push(context, u[min(done, len(u) - 1)])
                    done = done + 1 if single else int(mark)
                    simulator.AdvanceTo(done * self.time_step)
                x = read(self.sim.model, self.scene, context)
                if not np.abs(x).max() < _LOST:
                    return np.array(xs), done, f"lost before {done * self.time_step:g} s"
                xs.append(x)
        except (RuntimeError, ValueError, SystemError, SystemExit) as error:
            return np.array(xs), done, str(error).split(". ")[0][:200]
        return np.array(xs), done, ""

    def _prepared(self, start: Floats) -> tuple[Any, Any]:
        """Simulator at the start; and the context of its plant."""
        from pydrake.systems.analysis import ResetIntegratorFromFlags
        from pydrake.systems.analysis import Simulator as DrakeSimulator

        simulator = DrakeSimulator(self.scene.diagram)
        if self.continuous:
            ResetIntegratorFromFlags(simulator, "runge_kutta3", self.time_step)
            simulator.get_mutable_integrator().set_fixed_step_mode(True)
        context = self.scene.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
        write(self.sim.model, self.scene, context, start)
        return simulator, context

    def _follows(self) -> bool:
        """Whether a wrench turns with its body, so that it has to be written at every step."""
        return bool(np.any(self.sim.model.input_kind == InputKind.BODY))

    def _push(self, context: Any, u: Floats) -> None:
        """Inputs: forces of joints by actuators, wrenches on bodies at their centres of mass."""
        from pydrake.multibody.math import SpatialForce
        from pydrake.multibody.plant import ExternallyAppliedSpatialForce

        model, plant = self.sim.model, self.scene.plant
        if self.scene.actuated:
            plant.get_actuation_input_port().FixValue(context, u[self.scene.actuated])
        forces = []
        for k in np.flatnonzero(model.input_kind != InputKind.JOINT):
            body = self.scene.bodies[int(model.input_index[k])]
            wrench = float(u[k]) * model.input_wrench[k]
            if model.input_kind[k] == InputKind.BODY:
                R = plant.EvalBodyPoseInWorld(context, body).rotation().matrix()
                wrench = np.r_[R @ wrench[:3], R @ wrench[3:]]
            force = ExternallyAppliedSpatialForce()
            force.body_index, force.p_BoBq_B = body.index(), np.zeros(3)
            force.F_Bq_W = SpatialForce(tau=wrench[3:], f=wrench[:3])
            forces.append(force)
        if forces:
            plant.get_applied_spatial_force_input_port().FixValue(context, forces)


def controlled(
    mechanism: Mechanism, start: Floats, seconds: float, accuracy: float, scheme: str
) -> tuple[Floats | None, float]:
    """The continuous plant by an integrator with error control, as "runge_kutta3" or "cenic".

    Args:
        mechanism: a tree.
        start: (nq + nv,) [q; v], v at the node.
        seconds: length of the motion [s].
        accuracy: the target accuracy of Drake's integrator.
        scheme: a name of Drake's `GetIntegrationSchemes`.

    Returns:
        q in the end, None where the motion failed or took more than PATIENCE, and the processor time [s].

    Raises:
        ValueError: for a mechanism that Drake cannot represent.
    """
    from pydrake.systems.analysis import ResetIntegratorFromFlags
    from pydrake.systems.analysis import Simulator as DrakeSimulator
    from pydrake.systems.framework import EventStatus

    model = Simulator(mechanism).model
    scene = drake_scene.load(model, 0.0)
    simulator = DrakeSimulator(scene.diagram)
    ResetIntegratorFromFlags(simulator, scheme, seconds)
    simulator.get_mutable_integrator().set_target_accuracy(accuracy)
    context = scene.plant.GetMyMutableContextFromRoot(simulator.get_mutable_context())
    write(model, scene, context, start)
    if scene.actuated:
        scene.plant.get_actuation_input_port().FixValue(context, np.zeros(len(scene.actuated)))
    begin = time.process_time()

    def late(_: Any) -> Any:
        """The end of a motion that takes too long."""
        over = time.process_time() - begin > PATIENCE
        return EventStatus.ReachedTermination(None, "too slow") if over else EventStatus.DidNothing()

    try:
        simulator.Initialize()
        simulator.set_monitor(late)
        begin = time.process_time()
        simulator.AdvanceTo(seconds)
        cost = time.process_time() - begin
    except (RuntimeError, ValueError, SystemError, SystemExit):
        return None, np.inf
    if context.get_time() < seconds:
        return None, np.inf
    return read(model, scene, context)[: len(start) - len(model.dof_body)], cost


def write(model: Model, scene: DrakePlant, context: Any, x: Floats) -> None:
    """Our state [q; v], v at the node, into a context."""
    from pydrake.common.eigen_geometry import Quaternion
    from pydrake.math import RigidTransform, RollPitchYaw, RotationMatrix
    from pydrake.multibody.math import SpatialVelocity

    plant, nq = scene.plant, len(x) - len(model.dof_body)
    positions, rates = np.array(plant.GetPositions(context)), np.array(plant.GetVelocities(context))
    for dof, joint in drake_scene.scalar_joints(model, scene).items():
        positions[joint.position_start()] = x[model.dof_qadr[dof]]
        rates[joint.velocity_start()] = x[nq + dof]
    plant.SetPositions(context, positions)
    plant.SetVelocities(context, rates)
    for i in np.flatnonzero(model.joint_nrot == 3):
        end = int(model.body_qadr[i + 1])
        w = x[nq + model.body_vadr[i + 1] - 3 : nq + model.body_vadr[i + 1]]
        turn = RotationMatrix(Quaternion(x[end - 4 : end] / np.linalg.norm(x[end - 4 : end])))
        if scene.free[i]:
            plant.SetFreeBodyPose(context, scene.bodies[i], RigidTransform(turn, x[end - 7 : end - 4]))
            first = nq + int(model.body_vadr[i])
            velocity = SpatialVelocity(w=turn.matrix() @ w, v=x[first : first + 3])
            plant.SetFreeBodySpatialVelocity(context, scene.bodies[i], velocity)
        else:
            scene.joints[i][-1].set_angles(context, RollPitchYaw(turn).vector())
            scene.joints[i][-1].set_angular_velocity(context, turn.matrix() @ w)


def read(model: Model, scene: DrakePlant, context: Any) -> Floats:
    """Our state [q; v], v at the node, from a context."""
    from pydrake.math import RollPitchYaw

    positions, rates = scene.plant.GetPositions(context), scene.plant.GetVelocities(context)
    q: list[float] = []
    v: list[float] = []
    for i, joints in enumerate(scene.joints):
        if scene.free[i]:
            pose = scene.plant.EvalBodyPoseInWorld(context, scene.bodies[i])
            velocity = scene.plant.EvalBodySpatialVelocityInWorld(context, scene.bodies[i])
            turn = pose.rotation()
            q += [*pose.translation(), *turn.ToQuaternion().wxyz()]
            v += [*velocity.translational(), *(turn.matrix().T @ velocity.rotational())]
            continue
        scalars = int(model.joint_ntrans[i]) + (int(model.joint_nrot[i]) == 1)
        q += [float(positions[joint.position_start()]) for joint in joints[:scalars]]
        v += [float(rates[joint.velocity_start()]) for joint in joints[:scalars]]
        if model.joint_nrot[i] == 3:
            turn = RollPitchYaw(joints[-1].get_angles(context)).ToRotationMatrix()
            q += [*turn.ToQuaternion().wxyz()]
            v += [*(turn.matrix().T @ joints[-1].get_angular_velocity(context))]
    return np.array([*q, *v], dtype=np.float64)
