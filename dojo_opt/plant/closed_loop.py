"""`closed_loop`: a controller and a plant over time, and the record of their motion."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.planning.component_names import chosen_components
from dojo_opt.planning.same_robot import check_same_names
from dojo_opt.plant.ground_plane import GroundPlane
from dojo_opt.plant.plant import Plant
from dojo_opt.plant.tick import Tick
from sim import drawn
from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import check_room
from sim.mechanism.short_repr import short_table
from sim.model.record_columns import ContactRow
from sim.simulator.results import Contacts, Interrupted, contacts_of
from sim.simulator.simulator import Simulator
from solvers.status import MESSAGES, Status
from solvers.types import Floats, Integers, Matrix, Vector

Controller = Callable[[float, Vector], ArrayLike]

__all__ = ["ClosedLoop", "closed_loop", "coordinate_numbers", "steps_of"]

_LEVEL, _SOLVED = GroundPlane(), Status.SOLVED
_RECORD = 500.0  # bytes of the objects that keep a step


@dataclass(frozen=True, repr=False)
class ClosedLoop:
    """The record of a run, up to the end, its aim, a fall, or the first step of the plant that could not be solved.

    Attributes:
        simulator: simulator of the plant, perturbation included.
        time: (N + 1,) times of the states [s].
        x: (N + 1, nx) true states.
        u: (N, nu of the plant) inputs that acted, pushes included [N, N m].
        status: (N,) or (N + 1,) Status of every step that was tried.
        contacts: contacts of every step, world axes.
        survived: whether the run reached its end or its aim.
        message: the end of the run as a sentence.
        softened: number of steps of the plant that needed softer contact than its own, see `Plant`.
        log: every tick of the controller; empty for a controller without ticks.
        reference: states over time to be tracked, a function of times (n,) [s]; None without a reference.
        tracked: numbers of the tracked coordinates, of an MPC those with a weight; None for all.
    """

    simulator: Simulator
    time: Vector
    x: Matrix
    u: Matrix
    status: Integers
    contacts: Contacts
    survived: bool
    message: str
    softened: int = 0
    log: Sequence[Tick] = field(default=(), repr=False)
    reference: Any = field(default=None, repr=False)
    tracked: Integers | None = None

    def __repr__(self) -> str:
        return (
            f"ClosedLoop({self.duration:g} s, {self.message} x {self.x.shape}, u {self.u.shape}, {len(self.log)} ticks)"
        )

    def _repr_html_(self) -> str:
        rows = [] if self.reference is None else list(self.by_coordinate().items())
        return drawn(self) + short_table(repr(self), ("coordinate", "rms error [m or rad]"), rows)

    @property
    def duration(self) -> float:
        """Length of the run [s]."""
        return float(self.time[-1])

    def error(self) -> Matrix:
        """True (-) reference coordinates over time.

        Returns:
            (N + 1, nv) errors [m, rad].

        Raises:
            ValueError: the run has no reference, or one that returns no states.
        """
        if self.reference is None:
            raise ValueError("ClosedLoop.error: no reference was given; use closed_loop(reference=...)")
        states = _checked_states(self.reference, self.time, self.simulator)
        return self.simulator.difference(self.x, states)[:, : self.simulator.nv]

    def rms(self, components: Any = None) -> float:
        """Root mean square of the distance from the reference.

        For several coordinates, squares of lengths [m] and of angles [rad] are added up. `by_coordinate` has each of
        them by itself.

        Args:
            components: numbers below nv, or names as in `Mechanism.components` (default None: all `tracked` ones).

        Returns:
            The root mean square [m, rad].

        Raises:
            ValueError: the run has no reference, a name is unknown, or a component is a velocity.
        """
        error = self.error()
        chosen = np.arange(error.shape[1]) if self.tracked is None else self.tracked
        if components is not None:
            chosen = coordinate_numbers("ClosedLoop.rms(components)", components, self.simulator)
        return float(np.sqrt(np.mean(np.sum(error[:, chosen] ** 2, axis=1))))

    def by_coordinate(self) -> dict[str, float]:
        """Root mean square of the distance from the reference, by coordinate.

        Returns:
            {name of each tracked coordinate: its root mean square [m or rad]}.

        Raises:
            ValueError: the run has no reference.
        """
        each, names = np.sqrt(np.mean(self.error() ** 2, axis=0)), self.simulator.mechanism.dof_names
        return {names[i]: float(each[i]) for i in (range(len(each)) if self.tracked is None else self.tracked)}


def closed_loop(
    controller: Controller,
    plant: Plant,
    duration: float,
    *,
    control_step: float | None = None,
    reference: Any = None,
    fallen: Callable[[Vector], bool] | None = None,
    finished: Callable[[float, Vector], bool] | None = None,
) -> ClosedLoop:
    """Run u = controller(time, measured state) on the plant, from the start of both.

    Args:
        controller: an `MPC`, which is reset, or any function of (time [s], state (nx,)) that returns an input (nu,)
            [N, N m]. One with a method `feel` is told of every step (simulator of the plant, state (nx,), contacts
            (ncontact, 11) as rows of `ContactRow`).
        plant: the plant, which is reset.
        duration: length of the run [s].
        control_step: time between calls of the controller, whose answer is held in between [s]; a multiple of the time
            step of the plant (default None: that of the task of a learned policy, else every time step).
        reference: function of times (n,) [s] that returns the states (n, nx) of the error (default None: that of the
            controller, raised by the height of the ground that the controller has learnt by then).
        fallen: function of a state that returns whether the robot has fallen, which ends the run (default None:
            `plant.fallen`).
        finished: function of (time [s], state) after every step that returns whether the aim is achieved, which ends
            the run before its duration (default None: never).

    Returns:
        The motion, up to the end, the aim, a fall, or the first step of the plant that could not be solved.

    Raises:
        TypeError: for an argument of the wrong kind.
        ValueError: for a number out of range, a plant of another robot than that of the controller, if it has a
            simulator `sim`, or an answer of the controller of the wrong shape.
        Interrupted: after Ctrl-C, a KeyboardInterrupt; its `result` is the ClosedLoop until then.
    """
    if not isinstance(plant, Plant):
        raise TypeError(f"closed_loop(plant): expected a Plant, such as Plant(simulator), got {plant!r}")
    if isinstance(getattr(type(controller), "controller", None), property):
        name = type(controller).__name__
        raise TypeError(f"closed_loop(controller): expected the controller of a {name}, such as policy.controller")
    if not callable(controller):
        raise TypeError(f"closed_loop(controller): expected an MPC or a function of (time, x), got {controller!r}")
    model = getattr(controller, "sim", None)
    if isinstance(model, Simulator):
        names = (sim.mechanism.dof_names for sim in (model, plant.nominal))
        check_same_names("closed_loop(plant)", *names)
    h, steps = plant.nominal.time_step, steps_of("closed_loop(duration)", plant, duration)
    control_step = getattr(controller, "control_step", None) if control_step is None else control_step
    every = 1 if control_step is None else round(checks.number("closed_loop(control_step=...)", control_step) / h)
    if every < 1 or (control_step is not None and abs(every * h - control_step) > 1e-9):
        raise ValueError(
            f"closed_loop(control_step=...): expected a multiple of the plant's step {h:g} s, got {control_step}"
        )
    if reference is not None:
        _checked_states(reference, np.zeros(2), plant.nominal)
    plant.reset()
    if hasattr(controller, "reset"):
        controller.reset()
    for name, function in (("fallen", fallen), ("finished", finished)):
        if function is not None and not callable(function):
            raise TypeError(f"closed_loop({name}=...): expected a function, got {checks.shown(function)}")
    run = _LoopRecord([plant.x])
    try:
        _drive(run, controller, plant, steps, every, plant.fall_check if fallen is None else _test(fallen), finished)
    except KeyboardInterrupt:
        run.survived, run.message = False, MESSAGES[Status.INTERRUPTED]
        raise Interrupted(_closed_loop(run, controller, plant, reference)) from None
    return _closed_loop(run, controller, plant, reference)


def coordinate_numbers(call: str, components: Any, sim: Simulator) -> Integers:
    """Numbers below nv, from numbers or names."""
    chosen = chosen_components(call, components, sim)
    if np.any(chosen >= sim.nv):
        raise ValueError(f"{call}: expected coordinates, got velocities among {checks.shown(components)}")
    return chosen


def _checked_states(reference: Any, times: Vector, sim: Simulator) -> Floats:
    """The states (n, nx), or one (nx,), that a function returns for times (n,) [s]."""
    call = "closed_loop(reference=...)"
    if not callable(reference):
        raise TypeError(f"{call}: expected a function of the times (n,), got {checks.shown(reference)}")
    states = checks.floats(call, reference(times))
    if states.shape not in ((sim.nx,), (times.size, sim.nx)):
        raise ValueError(f"{call}: expected states of shape ({times.size}, {sim.nx}), got {states.shape}")
    return checks.array(call, states, states.shape)


def steps_of(call: str, plant: Plant, duration: float) -> int:
    """Steps of the plant in a duration [s], whose record fits the memory."""
    steps = round(checks.number(call, duration, above=0.0) / plant.nominal.time_step)
    if not steps:
        raise ValueError(
            f"{call}: expected a step of the plant, {plant.nominal.time_step:g} s, or more, got {duration}"
        )
    numbers = plant.nominal.nx + plant.nominal.nu + 11 * plant.nominal.ncontact
    check_room(call, steps, _RECORD + 8.0 * numbers, "run it in parts")
    return steps


def _closed_loop(run: _LoopRecord, controller: Controller, plant: Plant, reference: Any) -> ClosedLoop:
    """The record of the steps, as arrays."""
    h, count = plant.nominal.time_step, len(run.u)
    own, tracked = getattr(controller, "references", None), None
    if reference is None and own is not None and own.state is not None:
        times = h * np.arange(float(len(run.planes)))
        reference, tracked = OnPlanes(own.state, times, run.planes, plant.nominal.mechanism), own.tracked
    return ClosedLoop(
        simulator=plant.simulator,
        time=h * np.arange(count + 1.0),
        x=np.array(run.x[: count + 1]),
        u=np.array(run.u).reshape(count, plant.simulator.nu),
        status=np.array(run.status, dtype=np.int64),
        contacts=contacts_of(
            plant.simulator.mechanism,
            plant.simulator.time_step,
            np.array(run.contacts[:count])
            if count
            else np.zeros((0, plant.simulator.ncontact, int(ContactRow.MOMENT))),
        ),
        survived=run.survived,
        message=" ".join([run.message, *_first(run.reservations)]),
        softened=plant.softened,
        log=tuple(run.log),
        reference=reference,
        tracked=tracked,
    )


def _first(reservations: list[str]) -> list[str]:
    """Their number, and the first one."""
    return [f"Steps with a reservation: {len(reservations)}.", reservations[0]] if reservations else []


class OnPlanes:
    """States over time, carried onto the ground that was learnt until then."""

    def __init__(self, level: Any, time: Vector, planes: Sequence[GroundPlane], mechanism: Mechanism) -> None:
        self._level, self._time, self._planes, self._mechanism = level, time, planes, mechanism

    def __call__(self, times: ArrayLike) -> Matrix:
        """(n, nx) at the times (n,) [s]."""
        x = np.array(self._level(times))
        at = np.maximum(np.searchsorted(self._time, np.asarray(times) + 1e-9) - 1, 0)
        planes = [self._planes[k] for k in at]
        for plane in set(planes) - {GroundPlane()}:
            rows = np.array([other == plane for other in planes])
            x[rows] = plane.carry(x[rows], self._mechanism)
        return x


@dataclass
class _LoopRecord:
    """The record of the steps so far."""

    x: list[Vector]
    u: list[Vector] = field(default_factory=list)
    contacts: list[Matrix] = field(default_factory=list)  # (ncontact, 11) of each step
    status: list[int] = field(default_factory=list)
    log: list[Tick] = field(default_factory=list)
    planes: list[GroundPlane] = field(default_factory=list)  # that the reference was carried onto
    survived: bool = True
    message: str = "Ran to the end."
    reservations: list[str] = field(default_factory=list)  # about solved steps


def _drive(
    run: _LoopRecord,
    controller: Controller,
    plant: Plant,
    steps: int,
    every: int,
    has_fallen: Callable[[Vector], bool],
    finished: Callable[[float, Vector], bool] | None,
) -> None:
    """Call the controller at regular steps of the plant, until the end, the aim, a fall, or an unsolved step."""
    command = np.zeros(plant.nominal.nu)
    own, log = getattr(controller, "references", None), getattr(controller, "log", [])
    feel = getattr(controller, "feel", None)
    for k in range(steps):
        if k % every == 0:
            answer = controller(plant.time, plant.measure().copy())  # a controller may write into its argument
            command = checks.array("closed_loop: controller's u", answer, (plant.nominal.nu,))
            run.log += [tick for tick in log[-1:] if not run.log or tick is not run.log[-1]]
        run.planes.append(_LEVEL if own is None else own.plane)
        u, result = plant.step(command)
        run.status.append(int(result.status))
        if result.status != _SOLVED:
            run.message, run.survived = f"Plant, step {k}: {MESSAGES[result.status]}", False
            break
        if result.detail:
            run.reservations.append(f"Plant, step {k}: {result.detail}")
        run.contacts.append(result.scene[2])
        run.x.append(plant.x)
        if feel is not None:
            feel(plant.simulator, plant.x, result.scene[2])
        run.u.append(u)  # last: Ctrl-C may come between two of them, and counts the steps by this one
        if has_fallen(plant.x):
            run.message, run.survived = f"Fell at {plant.time:.3f} s.", False
            break
        if finished is not None and _yes("closed_loop: the answer of finished", finished(plant.time, plant.x.copy())):
            run.message = f"Achieved its aim at {plant.time:.3f} s."
            break


def _test(fallen: Callable[[Vector], bool]) -> Callable[[Vector], bool]:
    """A user's function of a state, which it may write into."""
    return lambda x: _yes("closed_loop: the answer of fallen", fallen(x.copy()))


def _yes(call: str, answer: Any) -> bool:
    """The answer of a user's function, which is not an array."""
    try:
        return bool(answer)
    except ValueError:
        raise ValueError(f"{call}: expected True or False, got {checks.shown(answer)}") from None
