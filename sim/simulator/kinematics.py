"""Kinematics: frames, Jacobians, centre of mass, mass matrix and inverse dynamics of a simulator's mechanism."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.joint import WORLD
from sim.mechanism.pose import quaternion
from sim.mechanism.shapes import rotation_matrices, rotation_matrix
from sim.model.state_columns import BodyState
from sim.simulator.central_differences import ORDER_8
from sim.simulator.contact_forces import GroundForces, balanced, least_forces
from sim.simulator.ground_balls import GroundBalls
from sim.simulator.simulator import Simulator
from sim.simulator.task_space.compiled_kinematics import CompiledKinematics, KinematicQuantity
from solvers.types import Floats

_TOUCHING = 1e-3  # [m] contacts that are nearer to the ground may carry
_STEP = 4e-3  # of the differences along a motion, in units of the time in which it turns by one radian


class Kinematics:
    """Smooth quantities of a mechanism at coordinates q (nq,) and joint velocities v (nv,).

    A frame has the name of a body, with its origin at the centre of mass, or of a link of a robot from a file, merged
    links included; `frames` lists them, `add` adds one. If a link and a body have the same name, the frame is that of
    the link. Velocities are those of joints, as in `Simulator.state_from_velocity`, not momenta of a step.

    Jacobians, twists and wrenches have linear parts first, world axes: [velocity of the frame's origin; angular].

        M(q) = sum J_i^T diag(m_i I, J_i) J_i,   tau = M dv + b(q, v) + g(q)

    Loops, gears, springs, dampers and contacts are omitted: these are equations of the tree of joints.

    Args:
        sim: the simulator.

    Raises:
        TypeError: `sim` is not a Simulator.
    """

    def __init__(self, sim: Simulator) -> None:
        if not isinstance(sim, Simulator):
            raise TypeError(f"Kinematics(sim): expected a Simulator, got {checks.shown(sim)}")
        self.sim = sim
        mech = self.mechanism = sim.mechanism
        self._bodies = {name: i for i, name in enumerate(mech.body_names)}
        self._frames: dict[str, tuple[int, Floats, Floats]] = {
            name: (i, np.zeros(3), np.eye(3)) for name, i in self._bodies.items()
        }
        report: Any = getattr(mech, "report", None)
        links = getattr(report, "links", None) or getattr(report, "bodies", None) or {}
        for name, link in links.items():
            i = -1 if link.body is None else self._bodies.get(link.body)
            if i is not None:
                self._frames[name] = (i, np.asarray(link.point, dtype=np.float64), rotation_matrix(link.orientation))
        self._mass = np.array([b.mass for b in mech.bodies])
        self._inertia = np.array([b.inertia for b in mech.bodies], dtype=np.float64)

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of the frames."""
        return tuple(self._frames)

    def add(self, name: str, parent: str, point: ArrayLike = (0.0, 0.0, 0.0), orientation: Any = None) -> None:
        """Add a frame.

        Args:
            name: an unused name.
            parent: a frame, or "world".
            point: of its origin in the parent's frame (3,) [m].
            orientation: unit quaternion (w, x, y, z) from its axes to those of the parent; the same axes by default.

        Raises:
            ValueError: the name is taken, or the parent unknown.
        """
        checks.name("Kinematics.add(name)", name)
        if name in self._frames:
            raise ValueError(f"Kinematics.add(name): there is a frame {name!r} already")
        body, origin, turn = self._frame("Kinematics.add(parent)", parent)
        at = origin + turn @ np.asarray(checks.vector("Kinematics.add(point)", point, 3))
        unit = (1.0, 0.0, 0.0, 0.0) if orientation is None else orientation
        own = rotation_matrix(checks.quaternion("Kinematics.add(orientation)", unit))
        self._frames[name] = body, at, turn @ own

    def place(self, frame: str) -> tuple[int, Floats, Floats]:
        """The place of a frame on its body.

        Args:
            frame: name of the frame.

        Returns:
            (number of the body, -1 for the world; the frame's origin from the centre of mass (3,) [m]; rotation (3, 3)
            from the axes of the frame to those of the body).

        Raises:
            ValueError: the frame is unknown.
        """
        return self._frame("Kinematics.place(frame)", frame)

    def pose(self, frame: str, q: ArrayLike) -> tuple[Floats, Floats]:
        """Place and orientation of a frame.

        Args:
            frame: name of the frame.
            q: (..., nq) coordinates.

        Returns:
            (place (..., 3) [m], rotation (..., 3, 3) to world axes).
        """
        body, point, turn = self._frame("Kinematics.pose(frame)", frame)
        q = self._q("Kinematics.pose(q)", q)
        if body < 0:
            return np.broadcast_to(point, (*q.shape[:-1], 3)), np.broadcast_to(turn, (*q.shape[:-1], 3, 3))
        z = self.sim.body_states(q, np.zeros((*q.shape[:-1], self.sim.nv)))[..., body, :]
        R = _rotations(z[..., BodyState.QUATERNION])
        return z[..., BodyState.POSITION] + R @ point, R @ turn

    @np.errstate(over="ignore", invalid="ignore")  # an overflow is refused at the end
    def velocity(self, frame: str, q: ArrayLike, v: ArrayLike) -> Floats:
        """Velocity of a frame.

        Args:
            frame: name of the frame.
            q: (..., nq) coordinates.
            v: (..., nv) joint velocities.

        Returns:
            (..., 6) velocity of the frame's origin [m/s] and angular velocity [rad/s], world axes.
        """
        J = self.jacobian(frame, q)
        v = _rows("Kinematics.velocity(v)", v, self.sim.nv)
        return checks.within_range("Kinematics.velocity", (J @ v[..., None])[..., 0])

    def jacobian(self, frame: str, q: ArrayLike) -> Floats:
        """Jacobian of a frame's velocity by joint velocities.

        Args:
            frame: name of the frame.
            q: (..., nq) coordinates.

        Returns:
            (..., 6, nv) rows of the velocity of the frame's origin, then of the angular velocity, world axes.
        """
        body, point, _ = self._frame("Kinematics.jacobian(frame)", frame)
        q = self._q("Kinematics.jacobian(q)", q)
        if body < 0:
            return np.zeros((*q.shape[:-1], 6, self.sim.nv))
        J, R = self._body_jacobians(q)
        return _shifted(J[..., body, :, :], R[..., body, :, :] @ point)

    def center_of_mass(self, q: ArrayLike) -> Floats:
        """Centre of mass of all bodies.

        Args:
            q: (..., nq) coordinates.

        Returns:
            (..., 3) place [m].
        """
        q = self._q("Kinematics.center_of_mass(q)", q)
        z = self.sim.body_states(q, np.zeros((*q.shape[:-1], self.sim.nv)))
        return np.asarray(self._mass @ z[..., BodyState.POSITION] / self._mass.sum())

    def com_jacobian(self, q: ArrayLike) -> Floats:
        """Jacobian of the velocity of the centre of mass by joint velocities.

        Args:
            q: (..., nq) coordinates.

        Returns:
            (..., 3, nv) Jacobian.
        """
        J, _ = self._body_jacobians(self._q("Kinematics.com_jacobian(q)", q))
        return np.einsum("b,...bkd->...kd", self._mass, J[..., :3, :]) / self._mass.sum()

    @np.errstate(over="ignore", invalid="ignore")  # an overflow is refused at the end
    def centroidal_momentum(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """Momentum of all bodies about their centre of mass.

        Args:
            q: (..., nq) coordinates.
            v: (..., nv) joint velocities.

        Returns:
            (..., 6) linear [kg m/s] and angular momentum [kg m^2/s], world axes.
        """
        q = self._q("Kinematics.centroidal_momentum(q)", q)
        v = _rows("Kinematics.centroidal_momentum(v)", v, self.sim.nv)
        z = self.sim.body_states(q, np.zeros((*q.shape[:-1], self.sim.nv)))
        J, R = self._body_jacobians(q)
        twist = (J @ v[..., None, :, None])[..., 0]
        p = self._mass[:, None] * twist[..., :3]
        spin = (self._world_inertia(R) @ twist[..., 3:, None])[..., 0]
        arm = z[..., BodyState.POSITION] - self.center_of_mass(q)[..., None, :]
        momentum = np.concatenate([p.sum(axis=-2), (spin + np.cross(arm, p)).sum(axis=-2)], axis=-1)
        return checks.within_range("Kinematics.centroidal_momentum", momentum)

    @np.errstate(over="ignore", invalid="ignore")  # an overflow is refused at the end
    def mass_matrix(self, q: ArrayLike) -> Floats:
        """Mass matrix M, armature included.

        Args:
            q: (..., nq) coordinates.

        Returns:
            (..., nv, nv) matrix [kg, kg m, kg m^2].
        """
        J, R = self._body_jacobians(self._q("Kinematics.mass_matrix(q)", q))
        linear, angular = J[..., :3, :], J[..., 3:, :]
        M = np.einsum("b,...bki,...bkj->...ij", self._mass, linear, linear)
        M += np.einsum("...bki,...bkl,...blj->...ij", angular, self._world_inertia(R), angular)
        M = M + np.diag(np.concatenate([np.asarray(j.armature) for j in self.mechanism.joints]))
        return checks.within_range("Kinematics.mass_matrix", M)

    def gravity_torques(self, q: ArrayLike) -> Floats:
        """Forces g(q) of the joints that hold the mechanism at rest against gravity.

        Args:
            q: (..., nq) coordinates.

        Returns:
            (..., nv) forces and torques [N, N m].
        """
        J, _ = self._body_jacobians(self._q("Kinematics.gravity_torques(q)", q))
        share = np.array([1.0 - b.gravity_compensation for b in self.mechanism.bodies])
        weight = np.outer(share * self._mass, np.asarray(self.mechanism.gravity))
        return -np.einsum("bk,...bkd->...d", weight, J[..., :3, :])

    @np.errstate(over="ignore", invalid="ignore")  # an overflow is refused at the end
    def bias_forces(self, q: ArrayLike, v: ArrayLike) -> Floats:
        """Forces b(q, v) of the joints that keep v constant, without gravity.

        b = sum J_i^T [m_i a_i; J_i al_i + w_i x J_i w_i] with the accelerations of the bodies d/dt (J_i(q) v) at
        constant v, by central differences of order 8 along the motion: exact to about 1e-11 of their size.

        Args:
            q: (..., nq) coordinates.
            v: (..., nv) joint velocities.

        Returns:
            (..., nv) forces and torques [N, N m].
        """
        q = self._q("Kinematics.bias_forces(q)", q)
        v = _rows("Kinematics.bias_forces(v)", v, self.sim.nv)
        q, v = _broadcast(q, v)
        J, R = self._body_jacobians(q)
        twist, rate = self._twist_rates(q, v)
        return checks.within_range("Kinematics.bias_forces", self._carried(J, R, twist, rate))

    @np.errstate(over="ignore", invalid="ignore")  # an overflow is refused at the end
    def inverse_dynamics(self, q: ArrayLike, v: ArrayLike, acceleration: ArrayLike) -> Floats:
        """Forces of the joints for an acceleration of the tree, tau = M dv + b + g.

        Args:
            q: (..., nq) coordinates.
            v: (..., nv) joint velocities.
            acceleration: (..., nv) rate of the joint velocities [m/s^2, rad/s^2].

        Returns:
            (..., nv) forces and torques [N, N m].
        """
        q, v = self._q("Kinematics.inverse_dynamics(q)", q), _rows("Kinematics.inverse_dynamics(v)", v, self.sim.nv)
        dv = _rows("Kinematics.inverse_dynamics(acceleration)", acceleration, self.sim.nv)
        q, v, dv = _broadcast(q, v, dv)
        J, R = self._body_jacobians(q)
        return checks.within_range("Kinematics.inverse_dynamics", self._inverse_dynamics(q, v, dv, J, R))

    def contact_forces(
        self,
        q: ArrayLike,
        v: ArrayLike,
        acceleration: ArrayLike,
        joint_forces: ArrayLike | None = None,
        *,
        contacts: Sequence[str] | None = None,
    ) -> GroundForces:
        """Forces of the ground for an acceleration: inverse dynamics of a robot on its contacts.

            M dv + b + g = tau + sum J_i^T f_i,   |tangential f_i| <= friction_i normal f_i

        Without `joint_forces`, degrees of freedom without an input balance alone, and the joints with an input add what
        is missing. Of all forces inside the friction cones, those with the least sum of squares are returned. Where no
        forces balance the load, the result has those that miss it least, and `success` is False.

        Args:
            q: (..., nq) coordinates.
            v: (..., nv) joint velocities.
            acceleration: (..., nv) rate of the joint velocities [m/s^2, rad/s^2].
            joint_forces: (..., nv) known forces of the joints [N, N m] (default None: any, where an input acts).
            contacts: names of contacts with the ground (default None: those within a millimetre of it).

        Returns:
            The forces. Those of contacts that are farther away are zero.

        Raises:
            ValueError: a shape is wrong, or a contact unknown.
        """
        call, mech = "Kinematics.contact_forces", self.mechanism
        q, v = self._q(f"{call}(q)", q), _rows(f"{call}(v)", v, mech.nv)
        dv = _rows(f"{call}(acceleration)", acceleration, mech.nv)
        names = mech.contact_names[: len(mech.contacts)]
        names = names if contacts is None else checks.names(f"{call}(contacts=...)", contacts)
        of_name = dict(zip(mech.contact_names, mech.contacts, strict=False))
        chosen = [of_name[checks.one_of(f"{call}(contacts=...)", name, of_name)] for name in names]
        driven = np.zeros(mech.nv, dtype=bool)
        known = np.zeros(mech.nv)
        if joint_forces is None:
            for part in mech.inputs or ():
                if part.joint is not None:
                    driven[mech.v_slice(part.joint).start + part.dof] = True
        else:
            known = _rows(f"{call}(joint_forces=...)", joint_forces, mech.nv)
        q, v, dv, known = _broadcast(q, v, dv, known)
        J, R = self._body_jacobians(q)
        load = checks.within_range(call, self._inverse_dynamics(q, v, dv, J, R)) - known
        forces, residual = np.zeros((*load.shape[:-1], len(names), 3)), np.zeros(load.shape[:-1])
        success, z = np.zeros(load.shape[:-1], dtype=bool), self.sim.body_states(q, np.zeros(load.shape))
        pushed = np.zeros(load.shape)
        ground = GroundBalls(chosen, [self._bodies[c.body] for c in chosen])
        for row in np.ndindex(load.shape[:-1]):
            centers, gap = ground.places(z[row][:, BodyState.POSITION], R[row])
            near = [i for i in range(len(names)) if contacts is not None or gap[i] < _TOUCHING]
            maps = [ground.force_map(i, centers[i], z[row], J[row]) for i in near]
            A = np.array([push for push, _ in maps]).reshape(len(near), mech.nv, 3).transpose(1, 0, 2)
            f, residual[row] = least_forces(A[~driven], load[row][~driven], ground.friction[near])
            success[row] = balanced(float(residual[row]), load[row])
            pushed[row] = np.einsum("nka,ka->n", A, f)
            for i, (_, frame), force in zip(near, maps, f, strict=True):
                forces[(*row, i)] = frame.T @ force
        rest = load - pushed if joint_forces is None else known
        return GroundForces(tuple(names), forces, np.array(rest), residual, success)

    def _inverse_dynamics(self, q: Floats, v: Floats, dv: Floats, J: Floats, R: Floats) -> Floats:
        """M dv + b + g, with Jacobians and rotations of the bodies at q."""
        mech = self.mechanism
        twist, rate = self._twist_rates(q, v)
        rate += _times(J, dv)
        share = np.array([1.0 - b.gravity_compensation for b in mech.bodies])
        rate[..., :3] -= np.outer(share, np.asarray(mech.gravity))
        armature = np.concatenate([np.asarray(j.armature) for j in mech.joints])
        return self._carried(J, R, twist, rate) + armature * dv

    def _twist_rates(self, q: Floats, v: Floats) -> tuple[Floats, Floats]:
        """Twists J_i v (..., nbody, 6) of the bodies, and their rates d/dt (J_i(q) v) at constant v."""
        step = _STEP / np.maximum(1.0, np.abs(v).max(axis=-1, initial=0.0))[..., None]
        steps = np.array([sign * k for k in range(1, len(ORDER_8) + 1) for sign in (1.0, -1.0)])
        weights = np.repeat(ORDER_8, 2) * np.sign(steps)
        moves = steps.reshape(-1, *(1,) * v.ndim) * (step * v)
        there = self._twists(self.moved(np.broadcast_to(q, (*moves.shape[:-1], q.shape[-1])), moves), v)
        return self._twists(q, v), np.tensordot(weights, there, axes=1) / step[..., None]

    def _twists(self, q: Floats, v: Floats) -> Floats:
        """Velocities and angular velocities (..., nbody, 6) of the bodies, world axes."""
        z = checks.within_range("Kinematics", self.sim.body_states(q, v))
        spin = _rotations(z[..., BodyState.QUATERNION]) @ z[..., BodyState.SPIN, None]
        return np.concatenate([z[..., BodyState.VELOCITY], spin[..., 0]], axis=-1)

    def _carried(self, J: Floats, R: Floats, twist: Floats, rate: Floats) -> Floats:
        """sum J_i^T [m_i a_i; J_i al_i + w_i x J_i w_i] of the bodies' twists and rates (..., nbody, 6)."""
        I, w = self._world_inertia(R), twist[..., 3:]
        force = self._mass[:, None] * rate[..., :3]
        torque = (I @ rate[..., 3:, None])[..., 0] + np.cross(w, (I @ w[..., None])[..., 0])
        return np.einsum("...bkd,...bk->...d", J, np.concatenate([force, torque], axis=-1))

    def compiled(self, quantity: str, frame: str | None = None) -> CompiledKinematics:
        """A function of (x, out) for residuals, observations and rewards of your own, which Numba compiles.

        | quantity | out | |
        |---|---|---|
        | "pose" | (7,) | place of a frame [m], and its unit quaternion (w, x, y, z) to world axes |
        | "jacobian" | (6, nv) | place [m] and orientation by tangent coordinates, as `jacobian` |
        | "velocity" | (6,) | mean velocity of its origin [m/s] and angular velocity [rad/s] over the last time step |
        | "velocity_jacobian" | (6, ndx) | the same by tangent state |
        | "center_of_mass" | (3,) | of all bodies [m] |
        | "com_jacobian" | (3, nv) | by tangent coordinates |

        x is a state (nx,). Mechanism and time step are those of now; later changes of them do not matter. Each function
        takes about a second to compile in a process. It runs in any number of threads.

        Args:
            quantity: name of the result, one of the table.
            frame: name of the frame; None for the centre of mass.

        Returns:
            The function, also for calls from Python.

        Raises:
            ValueError: the quantity or the frame is unknown, there is a frame too many, or a velocity is asked for of a
                simulator of higher order or with an accuracy, whose states have no means.
        """
        call, names = "Kinematics.compiled", {q.name.lower(): q for q in KinematicQuantity}
        found = names[checks.one_of(f"{call}(quantity)", quantity, names)]
        whole = found in (KinematicQuantity.CENTER_OF_MASS, KinematicQuantity.COM_JACOBIAN)
        if whole != (frame is None):
            raise ValueError(f"{call}({quantity!r}, frame): expected {'no' if whole else 'the name of a'} frame")
        moving = found in (KinematicQuantity.VELOCITY, KinematicQuantity.VELOCITY_JACOBIAN)
        if moving and not self.sim.mean_over:
            raise ValueError(
                f"{call}({quantity!r}): expected a Simulator of order 2, whose velocities are means over a time step, "
                f"got {self.sim!r}, whose velocities are those at the node"
            )
        body, point, turn = (-1, np.zeros(3), np.eye(3)) if frame is None else self._frame(f"{call}(frame)", frame)
        place = np.concatenate([point, quaternion(turn)])
        return CompiledKinematics(self.sim, found, body, place)

    def _frame(self, call: str, name: str) -> tuple[int, Floats, Floats]:
        if isinstance(name, str) and name == WORLD and WORLD not in self._frames:
            return -1, np.zeros(3), np.eye(3)
        return self._frames[checks.one_of(call, name, self._frames)]

    def _q(self, call: str, q: ArrayLike) -> Floats:
        return _rows(call, q, self.sim.nq)

    def moved(self, q: ArrayLike, dq: ArrayLike) -> Floats:
        """Coordinates moved by a perturbation, as in `Simulator.integrate`.

        Args:
            q: (..., nq) coordinates.
            dq: (..., nv) perturbation.

        Returns:
            (..., nq) coordinates.

        Raises:
            ValueError: a shape is wrong, or a number not finite.
        """
        q, dq = self._q("Kinematics.moved(q)", q), _rows("Kinematics.moved(dq)", dq, self.sim.nv)
        still = np.zeros((*q.shape[:-1], self.sim.nv))
        x = np.concatenate([q, still], axis=-1)
        return np.asarray(self.sim.integrate(x, np.concatenate([dq, np.zeros_like(dq)], axis=-1)))[..., : self.sim.nq]

    def _world_inertia(self, R: Floats) -> Floats:
        return R @ self._inertia @ np.swapaxes(R, -1, -2)

    def _body_jacobians(self, q: Floats) -> tuple[Floats, Floats]:
        """(..., nbody, 6, nv) at the centres of mass, world axes, and rotations (..., nbody, 3, 3).

        Velocities are linear in those of the joints: the columns are the velocities under one of 1.
        """
        nv = self.sim.nv
        many = np.broadcast_to(q[..., None, :], (*q.shape[:-1], nv, q.shape[-1]))
        z = self.sim.body_states(many, np.broadcast_to(np.eye(nv), (*q.shape[:-1], nv, nv)))
        checks.within_range("Kinematics", z)
        R = _rotations(z[..., 0, :, BodyState.QUATERNION])
        columns = np.moveaxis(z, -3, -1)  # (..., nbody, 13, nv)
        return np.concatenate([columns[..., 3:6, :], R @ columns[..., 10:13, :]], axis=-2), R


def _rows(call: str, value: ArrayLike, length: int) -> Floats:
    """An array (..., length)."""
    out = checks.floats(call, value)
    if out.ndim == 0 or out.shape[-1] != length:
        raise ValueError(f"{call}: expected shape (..., {length}), got {out.shape}")
    return checks.array(call, out, out.shape)


def _broadcast(*arrays: Floats) -> tuple[Floats, ...]:
    """The arrays (..., n_i) with the same leading axes."""
    lead = np.broadcast_shapes(*(a.shape[:-1] for a in arrays))
    return tuple(np.broadcast_to(a, (*lead, a.shape[-1])) for a in arrays)


def _times(J: Floats, v: Floats) -> Floats:
    """(..., nbody, 6) twists of Jacobians (..., nbody, 6, nv) at joint velocities (..., nv)."""
    return np.asarray((J @ v[..., None, :, None])[..., 0])


def _rotations(quats: Floats) -> Floats:
    """(..., 3, 3) of unit quaternions (..., 4)."""
    return rotation_matrices(quats.reshape(-1, 4)).reshape(*quats.shape[:-1], 3, 3)


def _shifted(J: Floats, arm: Floats) -> Floats:
    """A Jacobian (..., 6, nv) of a point that is `arm` (..., 3) away: v + w x arm."""
    moved = J[..., :3, :] + np.cross(J[..., 3:, :], arm[..., None], axis=-2)
    return np.concatenate([moved, J[..., 3:, :]], axis=-2)
