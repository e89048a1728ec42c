"""Results of Simulator: frozen dataclasses of arrays, each a Result with `success`, `status` and `message`.

No method raises for an unsolved step unless throw=True: the result has its status. Results of
derivatives are in derivative_results.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from html import escape
from os import PathLike
from typing import Any, TypeVar

import numpy as np

from sim import drawn
from sim.contact.collision.witness import ABSENT
from sim.contact.pairs.limited_reach import BEYOND
from sim.integrators.feedback import Path
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.renamed import renamed
from sim.mechanism.short_repr import short_repr
from sim.model.record_columns import ContactRow, StepReport
from sim.model.state_columns import BodyState
from sim.simulator.motion_file import archived, contact_rows, export, opened, restored, with_new_names
from sim.simulator.npz_file import reading, write_npz
from solvers.status import MESSAGES, Status
from solvers.types import Floats, Integers

STATUSES = tuple(Status(number) for number in range(len(Status)))  # by number: twice as fast as Status(number)
# columns of a contact; NumPy takes three times as long with the members of an enum
IMPULSE, POINT, NORMAL, MOMENT = (
    slice(int(k), k + 3) for k in (ContactRow.IMPULSE, ContactRow.POINT, ContactRow.NORMAL, ContactRow.MOMENT)
)
_GAP, _SLIP = int(ContactRow.GAP), int(ContactRow.SLIP)
_LOST, _ERROR = int(StepReport.LOST), int(StepReport.ERROR)
_OVERLAP = 1e-3  # [m] from which a message names it


class SimulationError(RuntimeError):
    """A time step that did not reach its tolerance; `status` is the reason.

    Attributes:
        status: Status of the step.
    """

    def __init__(self, message: str, status: Status) -> None:
        super().__init__(message)
        self.status = status


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a long call, which ends within a fifth of a second.

    Attributes:
        result: return value of the call so far: the Trajectory, FeedbackRollout or RolloutBatch of a rollout with the
            solved steps, the Plan of `ilqr` and the Identified of `identify` as of their last iterations, the
            ClosedLoop of `dojo.closed_loop`; None if nothing was done yet. Calls that compute derivatives only raise
            KeyboardInterrupt.
    """

    def __init__(self, result: Any = None) -> None:
        super().__init__()
        self.result = result

    def __str__(self) -> str:
        return "" if self.result is None else f"so far: {self.result!r}"


class Result:
    """How a call ended.

    Attributes:
        status: one Status, or an array with that of each knot or rollout.
        detail: sentence about an unsolved step, with its numbers.
    """

    status: Any
    detail: str = ""

    @property
    def success(self) -> bool:
        """Whether all steps reached their tolerance."""
        return self._end() == Status.SOLVED

    @property
    def message(self) -> str:
        """The first status that is not SOLVED, or SOLVED, as a sentence."""
        return self.detail or MESSAGES[self._end()]

    def check(self) -> None:
        """Raise an error unless all steps were solved.

        Raises:
            SimulationError: a step was not solved.
        """
        if not self.success:
            raise SimulationError(self.message, self._end())

    def _end(self) -> Status:
        """The first status that is not SOLVED, or SOLVED."""
        if isinstance(self.status, Status):
            return self.status
        unsolved = self.status[self.status != Status.SOLVED]
        return Status(int(unsolved[0])) if len(unsolved) else Status.SOLVED


Ended = TypeVar("Ended", bound=Result)


def checked(result: Ended, throw: bool) -> Ended:
    """The result; with `throw`, SimulationError instead of one that was not a success."""
    if checks.flag("throw=...", throw):
        result.check()
    return result


@dataclass(frozen=True, repr=False)
class Contacts:
    """Contacts over one step, (ncontact, ...), or over the steps of a trajectory, (T, ncontact, ...). World axes.

    Attributes:
        names: names of the contacts.
        normals: (..., ncontact, 3) normals into the body; of a collision, from its second body to its first.
        time_step: time step [s].
        impulse: (..., ncontact, 3) impulse on the body [N s].
        point: (..., ncontact, 3) its point of action at the end of the step [m].
        gap: (..., ncontact) distance from the ground at the end of the step [m]; infinite beyond the reach of a contact
            (see Collision), or one that does not exist in this configuration.
        slip: (..., ncontact) sliding speed [m/s].
        moment_impulse: (..., ncontact, 3) moment of torsional and rolling friction on the body, over the step [N m s];
            None where no contact has them.
    """

    names: tuple[str, ...]
    normals: Floats
    time_step: float
    impulse: Floats
    point: Floats
    gap: Floats
    slip: Floats
    moment_impulse: Floats | None = None

    def __getattr__(self, name: str) -> Floats:
        """`gap`, evaluated on demand (`contacts_of`): where a step has a report, a collision without a
        normal is beyond its reach.
        """
        if name != "gap" or "rows" not in vars(self):
            raise AttributeError(f"{type(self).__name__!r} object has no attribute {name!r}")
        ground, gap = vars(self)["rows"]
        seen = np.asarray(self.normals.any(axis=-1))
        told = seen[..., ground, None] | (gap[..., ground, None] == BEYOND)
        object.__setattr__(self, "gap", np.where((told & ~seen) | (gap >= ABSENT), np.inf, gap))
        return self.gap

    def __repr__(self) -> str:
        if self.impulse.ndim > 2:
            return f"Contacts({'x'.join(map(str, self.impulse.shape[:-2]))} steps of {', '.join(self.names)})"
        forces = zip(self.names, self.normal_force, strict=True)
        return f"Contacts({', '.join(f'{name} {force:.3g} N' for name, force in forces)})"

    @property
    def force(self) -> Floats:
        """(..., ncontact, 3) mean force on the body over the step [N]."""
        return self.impulse / self.time_step

    @property
    def moment(self) -> Floats:
        """(..., ncontact, 3) mean moment of torsional and rolling friction on the body, beside that of its force at
        `point` [N m]; zero where there is none.
        """
        return np.zeros_like(self.impulse) if self.moment_impulse is None else self.moment_impulse / self.time_step

    @property
    def normal_force(self) -> Floats:
        """(..., ncontact) mean normal force [N]."""
        return np.einsum("...cj,...cj->...c", self.force, self.normals)

    @property
    def friction_force(self) -> Floats:
        """(..., ncontact) size of the mean friction force [N]."""
        along = self.normal_force[..., None] * self.normals
        return np.asarray(np.linalg.norm(self.force - along, axis=-1))


@dataclass(frozen=True)
class StepResult(Result):
    """One time step. If it was not solved, x is the state before it.

    Attributes:
        x: (nx,) state.
        status: Status of the step.
        iterations: iterations of Newton's method; of all solves, if loops solve the step again.
        residual: largest error of a balance or gap equation [N s, m].
        violation: largest |product - kappa| of the complementary pairs [N s m].
        scene: mechanism, time step, and rows of the contacts, for `contacts`.
        parts: number of steps that it was divided into.
        momentum_fraction: fraction of the relative momentum of bodies that a divided step conserved.
        error: ratio of the estimated error to the one that the accuracy allows; 0 without an accuracy.
        detail: sentence about an unsolved step, with its numbers.
    """

    x: Floats
    status: Status
    iterations: int
    residual: float
    violation: float
    scene: tuple[Mechanism, float, Floats] = field(repr=False)
    parts: int = 1
    momentum_fraction: float = 1.0
    error: float = 0.0
    detail: str = ""
    substeps = renamed("parts")
    share = renamed("momentum_fraction")

    @cached_property
    def contacts(self) -> Contacts:
        """Contacts of the step, (ncontact, ...)."""
        return contacts_of(*self.scene)

    __repr__ = short_repr


@dataclass(frozen=True, repr=False)
class Trajectory(Result):
    """A rollout. It ends at the first step that was not solved: u has one row per solved step, and x one more.

    Attributes:
        simulator: the Simulator that made it.
        x: (T + 1, nx) states.
        u: (T, nu) inputs [N, N m].
        time: (T + 1,) times of the states [s].
        status: Status of the rollout.
        solved_steps: number of solved steps.
        residual: largest error of an equation in the last step that was tried [N s, m].
        iterations: (T,) iterations of each step.
        contacts: contacts of each step, (T, ncontact, ...).
        parts: (T,) number of steps that each step was divided into; with an accuracy, of sub-steps.
        momentum_fractions: (T,) fraction of the relative momentum of bodies that each step conserved: 1, except in
            whip-like motions.
        errors: (T,) ratio of the estimated to the allowed error of each step: above 1 if contacts prevented a shorter
            step; 0 without an accuracy.
        detail: sentence about an unsolved step, with its numbers.
        wrenches: (T, nbody, 6) external wrenches [N, N m]; None without any.
    """

    simulator: Any
    x: Floats
    u: Floats
    time: Floats
    status: Status
    solved_steps: int
    residual: float
    iterations: Integers
    contacts: Contacts
    parts: Integers
    momentum_fractions: Floats
    errors: Floats
    detail: str = ""
    wrenches: Floats | None = None
    knot = renamed("solved_steps")
    substeps = renamed("parts")
    shares = renamed("momentum_fractions")

    def __repr__(self) -> str:
        sim, shapes = self.simulator, f"x {self.x.shape}, u {self.u.shape}"
        steps = f"{self.solved_steps} steps of {sim.time_step:g} s"
        return f"Trajectory({sim.mechanism.name}, {steps}, {self.status.name}, {shapes})"

    def _repr_html_(self) -> str:
        return drawn(self) + f"<p>{escape(repr(self))}</p>"

    def save(self, path: str | PathLike[str]) -> None:
        """Write the trajectory and its simulator to a file, in a format of dojo-opt without pickles.

        Args:
            path: path of the file; NumPy appends .npz to a name without it.

        Raises:
            OSError: the file cannot be written.
        """
        head, arrays = archived(self.simulator, "trajectory")
        plain = {name: getattr(self, name) for name in ("solved_steps", "residual", "detail")}
        plain["status"] = int(self.status)
        names = ("x", "u", "time", "iterations", "parts", "momentum_fractions", "errors")
        arrays |= {name: getattr(self, name) for name in names}
        rows = {name: getattr(self.contacts, name) for name in ("impulse", "point", "gap", "slip", "normals")}
        if self.contacts.moment_impulse is not None:
            rows["moment_impulse"] = self.contacts.moment_impulse
        arrays |= {f"contact_{name}": array for name, array in rows.items()}
        arrays |= {} if self.wrenches is None else {"wrenches": self.wrenches}
        write_npz("Trajectory.save(path)", path, head | plain, arrays)

    @classmethod
    def load(cls, path: str | PathLike[str]) -> Trajectory:
        """Read a file that `save` wrote.

        Args:
            path: path of the file.

        Returns:
            The trajectory, with its simulator.

        Raises:
            OSError: the file cannot be read.
            ValueError: it is another file, or of a later version.
        """
        call = "Trajectory.load"
        head, arrays = opened(call, path, "trajectory")
        with reading(call, path, "trajectory"):
            sim, head, arrays = restored(head, arrays), with_new_names(head), with_new_names(arrays)
            rows = contact_rows(sim, head, arrays)
            contacts = Contacts(sim.mechanism.contact_names, time_step=sim.time_step, **rows)
            return cls(simulator=sim, status=Status(head.pop("status")), contacts=contacts, **head, **arrays)

    def export(self, path: str | PathLike[str]) -> None:
        """Write the motion for other tools.

        Args:
            path: path of the file. With the suffix .csv a table with named columns, of times, coordinates, velocities
                and inputs; .npz these as arrays; .json the motion of the hinges and slides by their names, as in
                trajectory_msgs/JointTrajectory of ROS.

        Raises:
            OSError: the file cannot be written.
            ValueError: for another suffix.
        """
        export("Trajectory.export(path)", path, self.simulator, self.time, self.x, self.u)

    def at(self, times: Any) -> Floats:
        """States at any times of a motion of a simulator with an accuracy, as exact as the motion is.

        Args:
            times: (n,) since its beginning [s].

        Returns:
            States (n, nx).

        Raises:
            ValueError: the simulator has no accuracy, or a time lies outside.
        """
        if self.simulator.accuracy is None:
            raise ValueError("Trajectory.at: fixed time steps have states at their ends only; use accuracy=...")
        asked = checks.array("Trajectory.at(times)", times, ("n",))
        if np.any(asked < 0.0) or np.any(asked > self.time[-1] * (1.0 + 1e-12)):
            raise ValueError(f"Trajectory.at(times): expected times from 0 to {self.time[-1]:g} s, got {times!r}")
        return np.asarray(self.simulator.nodes_at((self.x, self.u, self.wrenches), asked))


@dataclass(frozen=True)
class FeedbackRollout(Result):
    """A rollout under a feedback law; x and u end at the first knot that was not solved.

    Attributes:
        x: (T + 1, nx) states.
        u: (T, nu) inputs [N, N m].
        status: Status of the rollout.
        solved_knots: number of solved knots.
        residual: largest error of an equation in the last step that was tried [N s, m].
        detail: sentence about an unsolved step, with its numbers.
        made_by: the Simulator that made it.
        kappa: central-path parameter of the call [N s m]; None for that of `made_by`.
        substeps: number of its time steps per knot.
        wrenches: (T, nbody, 6) external wrenches [N, N m]; None without any.
    """

    x: Floats
    u: Floats
    status: Status
    solved_knots: int
    residual: float
    detail: str = ""
    made_by: Any = field(default=None, repr=False)
    kappa: float | None = None
    substeps: int = 1
    wrenches: Floats | None = None
    knot = renamed("solved_knots")

    __repr__ = short_repr

    @cached_property
    def simulator(self) -> Any:
        """The Simulator that made it, with the kappa of the call; made when asked for, which takes milliseconds."""
        return self.made_by if self.kappa is None else self.made_by.replace(kappa=self.kappa)

    @property
    def time(self) -> Floats:
        """(T + 1,) times of the knots [s]."""
        return self.made_by.time_step * self.substeps * np.arange(float(len(self.x)))

    @classmethod
    def of(cls, found: tuple[int, Path], **made_with: Any) -> FeedbackRollout:
        """The result of a rollout.

        Args:
            found: (number of solved knots, all of them).
            **made_with: made_by, kappa, substeps, wrenches.

        Returns:
            The result.
        """
        knot, path = found
        status, residual = Status(int(path.report[StepReport.STATUS])), float(path.report[StepReport.RESIDUAL])
        detail = reservation(path.report[None], "") if status == Status.SOLVED else ""
        return cls(path.xs[: knot + 1], path.us[:knot], status, knot, residual, detail, **made_with)


@dataclass(frozen=True)
class RolloutBatch(Result):
    """Rollouts from many states. Rows after the first unsolved step of a rollout repeat its last state.

    Attributes:
        x: (n, T + 1, nx) states.
        status: (n,) Status of each rollout.
        solved_steps: (n,) number of solved steps.
        detail: sentence about an unsolved step, with its numbers.
    """

    x: Floats
    status: Integers
    solved_steps: Integers
    detail: str = ""
    knot = renamed("solved_steps")

    __repr__ = short_repr

    @classmethod
    def of(cls, rows: tuple[Floats, Floats, Integers]) -> RolloutBatch:
        """The result of a batch.

        Args:
            rows: (states, report, number of solved steps), the rows after the last solved step still to be filled in.

        Returns:
            The result.
        """
        xs, reports, knots = rows
        for x, knot in zip(xs, knots, strict=True):
            x[knot + 1 :] = x[knot]
        status = reports[:, StepReport.STATUS].astype(np.int64)
        return cls(xs, status, knots, "" if status.any() else reservation(reports, "rollout"))


def converted(call: Callable[[], Any], made: Callable[[Any], Any]) -> Any:
    """The converted result of a call; the result that Interrupted carries is converted likewise."""
    try:
        result = call()
    except Interrupted as stop:
        raise Interrupted(None if stop.result is None else made(stop.result)) from None
    return made(result)


def contacts_of(mech: Mechanism, time_step: float, rows: Floats) -> Contacts:
    """Contacts from the rows (..., ncontact, 11) of a kernel."""
    parts = rows[..., NORMAL], time_step, rows[..., IMPULSE], rows[..., POINT], rows[..., _GAP], rows[..., _SLIP]
    moments = rows[..., MOMENT] if rows.shape[-1] > ContactRow.MOMENT else None
    contacts = Contacts(mech.contact_names, *parts, moments)
    if any([c.reach is not None for c in mech.collisions]):  # to look through thousands takes longer than a step
        vars(contacts)["rows"] = len(mech.contacts), vars(contacts).pop("gap")
    return contacts


def states_and_inputs(call: str, trajectory: Any) -> tuple[Any, Any]:
    """(states, inputs) of a trajectory, or of such a pair."""
    if isinstance(trajectory, Trajectory):
        return trajectory.x, trajectory.u
    if isinstance(trajectory, tuple | list) and len(trajectory) == 2:
        return trajectory[0], trajectory[1]
    raise TypeError(
        f"{call}: expected a Trajectory or (states, inputs), one time step apart, got {checks.shown(trajectory)}"
    )


def status_message(
    mech: Mechanism, where: str, report: Floats, tolerance: float, loop: tuple[float, str] | None = None
) -> str:
    """The sentence of a status, with the numbers of a StepReport; loop: (gap, name) of the one with the largest gap."""
    status, iterations, residual, violation, contact = report[:5]
    reason = Status(int(status))
    text = f"{where}: {MESSAGES[reason]}"
    if reason == Status.CONTACT_SUNK and contact >= 0:
        text += f" It is {mech.contact_names[int(contact)]!r}."
    if reason in (Status.MAX_ITERATIONS, Status.NO_PROGRESS):
        text += f" Residual {residual:.1e} after {int(iterations)} iterations (tolerance {tolerance:g})"
        met = " but" if residual <= tolerance else ""
        text += f",{met} off the central path by {violation:.1e}." if violation > 0.0 else "."
        if contact >= 0:
            text += f" Contact {mech.contact_names[int(contact)]!r} is worst."
        if loop is not None and not loop[0] < tolerance:
            text += f" {loop[1]} is open by {loop[0]:.1e}."
    return text


def reservation(reports: Floats, noun: str = "step") -> str:
    """A sentence about solved steps that lost momentum, or whose estimated error is beyond the accuracy; or empty.

    reports: (n, 9) of StepReport.   noun: of what each of them is the report; empty for a motion.
    """
    lost, errors = reports[:, _LOST], reports[:, _ERROR]
    if lost.dot(lost) > 0.0:  # the product takes a fifth of the time of a maximum
        lossy = np.flatnonzero(lost)
        first, kept = lossy[0], 1.0 - lost[lossy]
        where = f" in {len(lossy)} {noun}(s): {noun} {first}" if noun else ": a divided step"
        return (
            f"Solved, but momentum of bodies relative to one another was lost{where} conserved {kept[0]:.2g} of it, "
            f"the worst {kept.min():.2g}. Shorten the time step, or give an accuracy."
        )
    if errors.dot(errors) <= 1.0 or errors.max(initial=0.0) <= 1.0:
        return ""
    worst = int(np.argmax(errors))
    where = f"{noun} {worst}" if noun else "a step"
    return (
        f"Solved, but the estimated error of {where} is {errors[worst]:.2g} times the one that the accuracy allows: "
        "sub-steps in contact have a shortest length. Give a larger accuracy=..., or compare the motions of two."
    )


def overlap(mech: Mechanism, parts: Integers, rows: Floats) -> str:
    """A sentence about the deepest overlap of shapes that divided steps left, or empty.

    parts: (T,) of each step.   rows: (T, ncontact, 11) of contacts.
    """
    first = len(mech.contacts)
    if rows.shape[1] == first:
        return ""
    divided = np.flatnonzero(parts > 1)
    if not len(divided):
        return ""
    gaps = rows[divided, first:, _GAP]
    k, c = divmod(int(np.argmin(gaps)), gaps.shape[1])
    if not gaps[k, c] < -_OVERLAP:
        return ""
    return (
        f"Solved, but shapes overlap by up to {-gaps[k, c]:.2g} m at {mech.contact_names[first + c]!r} after step "
        f"{divided[k]}: no solution was found that takes them apart at once. Begin without overlap."
    )


def fastest_body(mech: Mechanism, z: Floats) -> str:
    """A sentence that names the fastest-turning body of a maximal state (nbody, 13), empty where that is not finite.

    Its step is short, otherwise turns wrap.
    """
    w = np.linalg.norm(z[:, BodyState.SPIN], axis=1)
    if not np.isfinite(w).all():
        return ""
    return f" The fastest is {mech.body_names[int(w.argmax())]!r}, with {w.max():.3g} rad/s before the step."
