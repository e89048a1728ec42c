"""Results of Simulator: frozen dataclasses of arrays, each a Result with `success`, `status` and `message`.

No method raises for an unsolved step unless throw=True: the result has its status. Derivatives of
an unsolved step are zero; taking them out of their result, by unpacking or by name, raises SimulationError.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from sim.integrators.feedback import Path
from sim.mechanism.brief import brief_repr
from sim.mechanism.mechanism import Mechanism
from solvers.status import MESSAGES, Status
from solvers.types import Integers

Floats = NDArray[np.float64]


STATUSES = tuple(Status)  # by number: twice as fast as Status(number)


class SimulationError(RuntimeError):
    """A time step that did not reach its tolerance; `status` is the reason."""

    def __init__(self, message: str, status: Status) -> None:
        super().__init__(message)
        self.status = status


class Interrupted(KeyboardInterrupt):
    """Ctrl-C during a long call, which ends within a fifth of a second; `result` is the partial result.

    result    the return value of the call so far: the Trajectory, Shot or Batch of a rollout with the
              steps that were solved, the Plan of `ilqr` with the trajectory of its last iteration, the ClosedLoop of
              `closed_loop`; None where nothing was done yet. Calls that only differentiate raise KeyboardInterrupt
    """

    def __init__(self, result: Any = None) -> None:
        super().__init__()
        self.result = result

    def __str__(self) -> str:
        return "" if self.result is None else f"so far: {self.result!r}"


class Result:
    """How a call ended. `status` is one Status, or an array with that of each knot or rollout."""

    status: Any
    detail: str = ""  # the sentence about an unsolved step, with its numbers

    @property
    def success(self) -> bool:
        """Whether all steps reached their tolerance."""
        return self._end() == Status.SOLVED

    @property
    def message(self) -> str:
        """The first status that is not SOLVED, or SOLVED, as a sentence."""
        return self.detail or MESSAGES[self._end()]

    def check(self) -> None:
        """SimulationError unless all steps were solved."""
        if not self.success:
            raise SimulationError(self.message, self._end())

    def _end(self) -> Status:
        """The first status that is not SOLVED, or SOLVED."""
        if isinstance(self.status, Status):
            return self.status
        unsolved = self.status[self.status != Status.SOLVED]
        return Status(int(unsolved[0])) if len(unsolved) else Status.SOLVED


Ended = TypeVar("Ended", bound=Result)


def ended(result: Ended, throw: bool) -> Ended:
    """The result; with `throw`, SimulationError instead of one that was not a success."""
    if throw:
        result.check()
    return result


@dataclass(frozen=True, repr=False)
class Contacts:
    """Contacts over one step, (ncontact, ...), or over the steps of a trajectory, (T, ncontact, ...). World axes."""

    names: tuple[str, ...]
    normals: Floats  # (..., ncontact, 3) into the body; of a collision, from its second body to its first
    time_step: float  # [s]
    impulse: Floats  # (..., ncontact, 3) impulse on the body [N s]
    point: Floats  # (..., ncontact, 3) where it acts, at the end of the step [m]
    gap: Floats  # (..., ncontact) distance from the ground at the end of the step [m]
    slip: Floats  # (..., ncontact) sliding speed [m/s]

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
    """One time step. When it was not solved, x is the state before it."""

    x: Floats  # (nx,)
    status: Status
    iterations: int  # of Newton's method; of all solves, if loops solve the step again
    residual: float  # largest error of a balance or gap equation [N s, m]
    violation: float  # largest |product - kappa| of the complementary pairs
    scene: tuple[Mechanism, float, Floats] = field(repr=False)  # mechanism, time step, rows of the contacts
    substeps: int = 1  # that it was divided into
    share: float = 1.0  # of the momentum of bodies against each other that a divided step handed on
    detail: str = ""

    @cached_property
    def contacts(self) -> Contacts:
        """Its contacts, (ncontact, ...)."""
        return contacts_of(*self.scene)

    __repr__ = brief_repr


@dataclass(frozen=True, repr=False)
class Trajectory(Result):
    """A rollout. It ends at the first step that was not solved: then x has knot + 1 rows, u and the rest knot rows."""

    simulator: Any  # the Simulator that made it
    x: Floats  # (T + 1, nx)
    u: Floats  # (T, nu) [N, N m]
    time: Floats  # (T + 1,) [s]
    status: Status
    knot: int  # number of solved steps
    residual: float  # of the last step that was tried
    iterations: Integers  # (T,)
    contacts: Contacts
    substeps: Integers  # (T,) that each step was divided into
    shares: Floats  # (T,) of the momentum of bodies against each other that each step handed on: 1, but in whips
    detail: str = ""
    wrenches: Floats | None = None  # (T, nbody, 6) external ones, if there were any [N, N m]

    def __repr__(self) -> str:
        sim, shapes = self.simulator, f"x {self.x.shape}, u {self.u.shape}"
        steps = f"{self.knot} steps of {sim.time_step:g} s"
        return f"Trajectory({sim.mechanism.name}, {steps}, {self.status.name}, {shapes})"


@dataclass(frozen=True)
class Shot(Result):
    """A closed-loop rollout; x and u end at the first knot that was not solved."""

    x: Floats  # (T + 1, nx)
    u: Floats  # (T, nu) [N, N m]
    status: Status
    knot: int  # number of solved knots
    residual: float  # of the last step that was tried
    detail: str = ""

    __repr__ = brief_repr

    @classmethod
    def of(cls, found: tuple[int, Path]) -> Shot:
        """From (number of solved knots, all of them)."""
        knot, path = found
        return cls(path.xs[: knot + 1], path.us[:knot], Status(int(path.report[0])), knot, float(path.report[2]))


@dataclass(frozen=True)
class Jacobian(Result):
    """Derivatives of one step: `A, B = jacobian`; with names (wrt=...), a table of blocks by these names.

    Taking out A, B or a block raises SimulationError where the step was not solved.
    """

    blocks: Mapping[str, Floats]  # "state" (ndx, ndx), "input" (ndx, nu), parameters (ndx, n)
    x_next: Floats  # (nx,)
    status: Status
    accuracy: float = 0.0  # estimate of the error, relative to the largest entry
    detail: str = ""
    by_name: bool = False  # requested by names

    __repr__ = brief_repr

    @property
    def A(self) -> Floats:
        """(ndx, ndx) d(next state)/d(state)."""
        return self["state"]

    @property
    def B(self) -> Floats:
        """(ndx, nu) d(next state)/d(input)."""
        return self["input"]

    def __iter__(self) -> Iterator[Any]:
        self.check()
        return iter(self.blocks) if self.by_name else iter((self.A, self.B))

    def __len__(self) -> int:
        return len(self.blocks)

    def __contains__(self, name: object) -> bool:
        return name in self.blocks

    def __getitem__(self, name: str | int) -> Floats:
        self.check()
        return self.blocks[("state", "input")[name] if isinstance(name, int) else name]

    def keys(self) -> Iterable[str]:
        """Names of the blocks, in the order of wrt=...; `dict(jacobian)` is a table of them."""
        self.check()
        return self.blocks.keys()

    def values(self) -> Iterable[Floats]:
        """The blocks."""
        self.check()
        return self.blocks.values()

    def items(self) -> Iterable[tuple[str, Floats]]:
        """Names and blocks."""
        self.check()
        return self.blocks.items()


@dataclass(frozen=True)
class Linearization(Result):
    """Derivatives of every knot at its state and input, in tangent coordinates."""

    A: Floats  # (T, ndx, ndx)
    B: Floats  # (T, ndx, nu)
    x_next: Floats  # (T, nx)
    status: Integers  # (T,) Status of each knot; the derivatives of an unsolved knot are zero
    parameters: Mapping[str, Floats] = field(default_factory=dict)  # by name (T, ndx, n); the requested ones
    # (T,) estimate of the error of A and B, relative to their largest entry: hard contacts on light parts cost digits
    accuracy: Floats = field(default_factory=lambda: np.zeros(0))
    detail: str = ""

    __repr__ = brief_repr


@dataclass(frozen=True)
class Gradient(Result, Mapping[str, Floats]):
    """Gradient of a scalar of a rollout, by the names of wrt=...; SimulationError where a step was not solved."""

    blocks: Mapping[str, Floats]
    status: Status
    detail: str = ""

    __repr__ = brief_repr

    def __iter__(self) -> Iterator[str]:
        return iter(self.blocks)

    def __len__(self) -> int:
        return len(self.blocks)

    def __getitem__(self, name: str) -> Floats:
        self.check()
        return self.blocks[name]


@dataclass(frozen=True)
class Batch(Result):
    """Rollouts from many states. Rows after the first unsolved step of a rollout repeat its last state."""

    x: Floats  # (n, T + 1, nx)
    status: Integers  # (n,) Status of each rollout
    knot: Integers  # (n,) number of solved steps
    detail: str = ""

    __repr__ = brief_repr

    @classmethod
    def of(cls, rows: tuple[Floats, Integers, Integers]) -> Batch:
        """From (states, status, number of solved steps), the rows after the last solved step still to be filled in."""
        xs, _, knots = rows
        for x, knot in zip(xs, knots, strict=True):
            x[knot + 1 :] = x[knot]
        return cls(*rows)


def carried(call: Callable[[], Any], made: Callable[[Any], Any]) -> Any:
    """The converted result of a call; the result that Interrupted carries is converted likewise."""
    try:
        result = call()
    except Interrupted as stop:
        raise Interrupted(None if stop.result is None else made(stop.result)) from None
    return made(result)


def contacts_of(mech: Mechanism, time_step: float, rows: Floats) -> Contacts:
    """Contacts from the rows (..., ncontact, 11) of a kernel."""
    parts = (rows[..., 8:11], time_step, rows[..., :3], rows[..., 3:6], rows[..., 6], rows[..., 7])
    return Contacts(mech.contact_names, *parts)


def path_of(call: str, trajectory: Any) -> tuple[Any, Any]:
    """(states, inputs) of a trajectory, or of such a pair."""
    if isinstance(trajectory, Trajectory):
        return trajectory.x, trajectory.u
    if isinstance(trajectory, tuple | list) and len(trajectory) == 2:
        return trajectory[0], trajectory[1]
    raise TypeError(f"{call}: expected a Trajectory or (states, inputs), got {trajectory!r}")


def sentence(
    mech: Mechanism, where: str, report: Floats, tolerance: float, loop: tuple[float, str] | None = None
) -> str:
    """The sentence of a status, with the numbers of the report of a kernel.

    loop: by how much the one that is furthest open is, and which it is.
    """
    status, iterations, residual, violation, contact = report[:5]
    reason = Status(int(status))
    text = f"{where}: {MESSAGES[reason]}"
    if reason == Status.CONTACT_SUNK:
        text += f" It is {mech.contact_names[int(contact)]!r}."
    if reason in (Status.MAX_ITERATIONS, Status.NO_PROGRESS):
        text += f" Residual {residual:.1e} after {int(iterations)} iterations (tolerance {tolerance:g})"
        text += f", off the central path by {violation:.1e}." if violation > 0.0 else "."
        if contact >= 0:
            text += f" Contact {mech.contact_names[int(contact)]!r} is worst."
        if loop is not None and not loop[0] < tolerance:
            text += f" {loop[1]} is open by {loop[0]:.1e}."
    return text


def fastest(mech: Mechanism, z: Floats) -> str:
    """The body that turns fastest in a maximal state (nbody, 13), as a sentence; for short steps, else turns wrap."""
    spin = np.linalg.norm(z[:, 10:], axis=1)
    return f"The fastest is {mech.body_names[int(spin.argmax())]!r}, with {spin.max():.3g} rad/s before the step."
