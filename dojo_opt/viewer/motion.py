"""Motion: a trajectory or a plan in world coordinates, for plots and the viewer."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from dojo_opt.constraint import Frame, Goal, Point
from dojo_opt.planning.component_names import chosen_components
from dojo_opt.viewer.drawing import Piece, extent, pieces
from sim.mechanism import checks
from sim.mechanism.forward_kinematics import body_poses
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import rotation_matrix
from sim.mechanism.short_repr import short_repr
from sim.model.state_columns import BodyState
from sim.simulator.inverse_kinematics import ik
from sim.simulator.kinematics import Kinematics
from sim.simulator.results import Trajectory
from sim.simulator.simulator import Simulator
from solvers.types import Floats

_TARGET = "the point with a target"


@dataclass(frozen=True)
class Motion:
    """Poses of the bodies and forces of the contacts over time.

    Attributes:
        mechanism: the mechanism.
        time: (T + 1,) times of the states [s].
        x: (T + 1, nx) states.
        u: (T, nu) inputs [N, N m].
        position: (T + 1, nbody, 3) centres of mass [m].
        quaternion: (T + 1, nbody, 4) orientations.
        contact_time: (N,) end of each simulation step [s].
        normal_force: (N, ncontact) mean normal force over the step [N].
        friction_force: (N, ncontact) size of the mean friction force over the step [N].
        force: (N, ncontact, 3) mean force of each contact on its body, world axes [N].
        point: (N, ncontact, 3) its point of action [m].
        goal: (nbody, 7) places and quaternions of the bodies at the goal of a plan; None where there is none.
    """

    mechanism: Mechanism
    time: Floats
    x: Floats
    u: Floats
    position: Floats
    quaternion: Floats
    contact_time: Floats
    normal_force: Floats
    friction_force: Floats
    force: Floats
    point: Floats
    goal: Floats | None = None

    @cached_property
    def pieces(self) -> dict[str, list[Piece]]:
        """The drawing of every body."""
        return pieces(self.mechanism)

    @cached_property
    def bounds(self) -> tuple[Floats, Floats]:
        """Lowest and highest coordinates (3,) of the drawing of the first pose [m]."""
        turn = [rotation_matrix(q) for q in self.quaternion[0]]
        names = self.mechanism.body_names
        points = [extent(self.pieces[name]) @ turn[k].T + self.position[0, k] for k, name in enumerate(names)]
        every = np.concatenate(points)
        return every.min(axis=0), every.max(axis=0)

    @property
    def radius(self) -> float:
        """Half of the longest side of the first pose [m]."""
        low, high = self.bounds
        return max(0.1, 0.5 * float((high - low).max()))

    __repr__ = short_repr

    def points(self, body: int, point: Any) -> Floats:
        """Path of a point of a body.

        Args:
            body: number of the body.
            point: (3,) place from the centre of mass, body axes [m].

        Returns:
            (T + 1, 3) places, world axes [m].
        """
        R = np.array([rotation_matrix(q) for q in self.quaternion[:, body]])
        return np.asarray(self.position[:, body] + R @ np.asarray(point, dtype=np.float64))


def motion(result: Any, simulator: Simulator | None = None) -> Motion:
    """Motion of a result. The contact forces of a plan, or a FeedbackRollout, come from its steps, solved again.

    Args:
        result: Trajectory, Plan, FeedbackRollout or ClosedLoop; or a Mechanism, at rest in its neutral state.
        simulator: simulator of the result, for one that was read from a file (default None: that of the result).

    Returns:
        The motion.

    Raises:
        TypeError: the result is none of these.
        ValueError: the result does not know its simulator.
        SimulationError: a step of a plan cannot be solved again, for its forces.
    """
    if isinstance(result, Mechanism):
        return _standing(result)
    if not hasattr(result, "x") or not hasattr(result, "u"):
        raise TypeError(f"expected a Trajectory, a Plan or a ClosedLoop to show, got a {type(result).__name__}")
    sim = simulator or getattr(result, "simulator", None) or getattr(getattr(result, "problem", None), "sim", None)
    if not (sim is None or isinstance(sim, Simulator)):
        raise TypeError(f"expected a Simulator to show a {type(result).__name__} with, got {checks.shown(sim)}")
    if sim is None:
        raise ValueError(f"this {type(result).__name__} does not know its simulator; give simulator=...")
    x, u = np.asarray(result.x, dtype=np.float64), np.asarray(result.u, dtype=np.float64)
    known = getattr(result, "contacts", None)  # a plan has none
    substeps = 1 if isinstance(result, Trajectory) else getattr(result, "substeps", 1)  # per knot
    wrenches = getattr(result, "wrenches", None)
    forces = _contact_forces(sim, x, u, substeps, wrenches) if known is None else _of(known)
    normal, friction, force, point = forces
    z = sim.maximal(x)
    end = _goal(result, sim)
    return Motion(
        mechanism=sim.mechanism,
        time=sim.time_step * substeps * np.arange(len(x), dtype=np.float64),
        x=x,
        u=u,
        position=z[:, :, BodyState.POSITION],
        quaternion=z[:, :, BodyState.QUATERNION],
        contact_time=sim.time_step * np.arange(1, len(normal) + 1, dtype=np.float64),
        normal_force=normal,
        friction_force=friction,
        force=force,
        point=point,
        goal=None if end is None else sim.maximal(end)[:, [0, 1, 2, 6, 7, 8, 9]],
    )


def _goal(result: Any, sim: Simulator) -> Floats | None:
    """(nx,) state at the goal of a plan: where a `Goal`, a `Frame` or a `Point` of its last knot puts the robot, each
    from the state that the ones before give. Coordinates that they leave free are as planned.
    """
    problem: Any = getattr(result, "problem", None)
    if problem is None:
        return None
    last = np.asarray(result.x[-1], dtype=np.float64)
    reached, free = last, True
    for spec in problem.specs[1]:
        if isinstance(spec, Goal | Frame | Point) and np.isin([-1, problem.horizon], np.atleast_1d(spec.knots)).any():
            there = _at_goal(spec, sim, reached) if isinstance(spec, Goal) else _at_frame(spec, sim, reached)
            reached, free = (reached, free) if there is None else (there, False)
    return None if free else reached


def _at_goal(spec: Goal, sim: Simulator, x: Floats) -> Floats | None:
    """The state at a goal; None if it has no coordinates."""
    target = np.array(np.atleast_2d(np.asarray(spec.target, dtype=np.float64))[-1])
    if target.shape != (sim.nx,):
        return None
    mask = np.zeros(sim.ndx)
    mask[chosen_components("Goal(components=...)", spec.components, sim)] = 1.0
    return np.asarray(sim.integrate(x, mask * sim.difference(target, x))) if mask[: sim.nv].any() else None


def _at_frame(spec: Frame | Point, sim: Simulator, x: Floats) -> Floats | None:
    """The state with a frame at its target; None with bounds or chosen entries, or if no coordinates nearby do that."""
    if spec.lower is not None or spec.upper is not None or spec.periodic or not isinstance(spec.weight, int | float):
        return None
    place, turn = (spec.target, None) if isinstance(spec, Point) else (spec.place, spec.orientation)
    if place is not None:
        place = np.broadcast_to(np.atleast_2d(np.asarray(place, dtype=np.float64))[-1], (3,))
    if turn is not None:
        turn = np.atleast_2d(np.asarray(turn, dtype=np.float64))[-1]
    kin = Kinematics(sim)
    kin.add(_TARGET, spec.frame, spec.offset)
    found = ik(kin, {_TARGET: place if turn is None else (place, turn)}, x[: sim.nq], attempts=1)
    return np.concatenate([found.q, x[sim.nq :]]) if found.success else None


def _standing(mech: Mechanism) -> Motion:
    """One knot: the neutral state."""
    q = np.asarray(mech.neutral, dtype=np.float64)
    found = body_poses(mech.joints, q)
    at = [found[name] for name in mech.body_names]
    none = np.zeros((0, len(mech.contact_names)))
    return Motion(
        mechanism=mech,
        time=np.zeros(1),
        x=np.concatenate([q, np.zeros(mech.nv)])[None],
        u=np.zeros((0, len(mech.input_names))),
        position=np.array([[pose.point for pose in at]]),
        quaternion=np.array([[pose.quaternion for pose in at]]),
        contact_time=np.zeros(0),
        normal_force=none,
        friction_force=none,
        force=np.zeros((*none.shape, 3)),
        point=np.zeros((*none.shape, 3)),
    )


def _contact_forces(sim: Simulator, x: Floats, u: Floats, substeps: int, wrenches: Floats | None) -> tuple[Floats, ...]:
    """Forces of every simulation step, as `_of`; a knot spans `substeps` of them, under its external wrenches."""
    knots: list[tuple[Floats, ...]] = [tuple(np.zeros((0, sim.ncontact, *more)) for more in ((), (), (3,), (3,)))]
    for t in range(len(u)):
        held = None if wrenches is None else np.tile(wrenches[t], (substeps, 1, 1))
        path = sim.rollout(x[t], np.tile(u[t], (substeps, 1)), wrenches=held, throw=True)
        knots.append(_of(path.contacts))
    return tuple(np.concatenate(parts) for parts in zip(*knots, strict=True))


def _of(contacts: Any) -> tuple[Floats, ...]:
    """Normal and friction force (N, k), the force and its point of action (N, k, 3)."""
    return contacts.normal_force, contacts.friction_force, contacts.force, contacts.point
