"""Randomization: models that a policy learns on, drawn around that of a task."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.learn.task import Task
from sim.mechanism import checks
from sim.mechanism.memory_limit import room_for
from sim.mechanism.short_repr import short_repr
from sim.simulator.contact_groups import ContactGroups
from sim.simulator.row_impulses import RowImpulses
from sim.simulator.simulator import Simulator
from sim.simulator.step_batch import StepBatch
from solvers.types import Floats, Integers

__all__ = ["Models", "Randomization", "check_pushes", "draw_pushes"]


@dataclass(frozen=True)
class Randomization:
    """Ranges of uniformly drawn models; without any, all rows have the model of the task.

    Attributes:
        values: {parameter: (low, high)}; one value for all its components, of names as in `Simulator.parameters`.
        factors: {parameter: (low, high)}; one factor on all its components.
        substeps: time steps per action; one is chosen for all rows of an epoch (default (): those of the task).
        kappa: (low, high) of the smoothing [N s m], drawn by row and epoch, logarithmically (default None).
        noise: of observations, in their standard deviations (default 0).
        models: number of models per choice of substeps (default 16).
        pushes: mean time between pushes [s], and the standard deviations of the changes that one makes to the first
            velocities, such as the six of a floating base [m/s, rad/s] (default None: none).
        delays: control steps from the decision of an action to its application; one is chosen for all rows of an epoch
            (default (): none).
        by_row: whether every row of an epoch has a model and a kappa of its own; otherwise all have one, drawn anew for
            the next epoch (default True).
    """

    values: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    factors: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    substeps: tuple[int, ...] = ()
    kappa: tuple[float, float] | None = None
    noise: float = 0.0
    models: int = 16
    by_row: bool = True
    pushes: tuple[float, ArrayLike] | None = None
    delays: tuple[int, ...] = ()

    __repr__ = short_repr

    def __post_init__(self) -> None:
        for field_ in ("values", "factors"):
            for name, pair in checks.mapping(f"Randomization({field_}=...)", getattr(self, field_)).items():
                low, high = checks.vector(f"Randomization({field_}=...): {name!r}", pair, 2)
                if not low <= high:
                    raise ValueError(f"Randomization: {name!r}: expected low <= high, got {low} and {high}")
        if set(self.values) & set(self.factors):
            raise ValueError("Randomization(values=..., factors=...): a parameter is in both")
        for field_, least in (("substeps", 1), ("delays", 0)):
            counts = getattr(self, field_)
            if isinstance(counts, str) or not isinstance(counts, Sequence):
                raise TypeError(f"Randomization({field_}=...): expected whole numbers, got {checks.shown(counts)}")
            for count in counts:
                checks.whole_number(f"Randomization({field_}=...)", count, least)
        if self.kappa is not None:
            low, high = checks.vector("Randomization(kappa=...)", self.kappa, 2)
            if not 0.0 < low <= high:
                raise ValueError(f"Randomization(kappa=...): expected 0 < low <= high, got {self.kappa}")
        checks.number("Randomization(noise=...)", self.noise, at_least=0.0)
        room_for(
            "Randomization(models=...)", self.models, 8.0 * (1 + len(self.values) + len(self.factors)), noun="models"
        )
        check_pushes("Randomization", self.pushes)


def check_pushes(call: str, pushes: Any, velocities: int | None = None) -> None:
    """Refuse pushes that are no mean time [s] and deviations, or that have more of these than there are velocities."""
    if pushes is None:
        return
    if not isinstance(pushes, tuple | list) or len(pushes) != 2:
        raise TypeError(f"{call}(pushes=...): expected (time, deviations), got {pushes!r}")
    checks.number(f"{call}(pushes=...)", pushes[0], above=0.0)
    count = np.size(checks.floats(f"{call}(pushes=...)", pushes[1]))
    if velocities is not None and count > velocities:
        raise ValueError(f"{call}(pushes=...): expected at most {velocities} deviations, as velocities, got {count}")


def draw_pushes(
    rng: np.random.Generator, task: Task, shape: tuple[int, ...], pushes: tuple[float, ArrayLike]
) -> Floats:
    """(*shape, nv) changes of the velocities after actions: none, or normal ones, on average once in the given time."""
    mean_time, spread = pushes
    pushed = rng.uniform(size=(*shape, 1)) < task.knot_time / mean_time
    size = np.zeros(task.sim.nv)
    size[: np.size(spread)] = spread
    return pushed * size * rng.standard_normal((*shape, task.sim.nv))


class Models:
    """The models of a randomisation, and those of the rows of an epoch."""

    def __init__(
        self, task: Task, randomization: Randomization, rng: np.random.Generator, cutoff: float | None = None
    ) -> None:
        """cutoff: of the simulators; None: that of the task."""
        self._task, self.randomization = task, randomization
        self._choices = randomization.substeps or (task.substeps,)
        sim, count = task.sim if cutoff is None else task.sim.replace(cutoff=cutoff), randomization.models
        check_pushes("Randomization", randomization.pushes, sim.nv)
        self._sims: dict[int, Simulator] = {}
        self._tables: dict[int, dict[str, Floats]] = {}
        for substeps in dict.fromkeys(self._choices):
            self._sims[substeps] = sim.replace(time_step=task.knot_time / substeps, kappa=sim.kappa)
            table = {}
            for name, (low, high) in randomization.values.items():
                size = len(sim.parameters((name,)).values)
                table[name] = np.repeat(rng.uniform(low, high, (count, 1)), size, axis=1)
            for name, (low, high) in randomization.factors.items():
                table[name] = rng.uniform(low, high, (count, 1)) * sim.parameters((name,)).values
            self._tables[substeps] = table

    def draw(self, rng: np.random.Generator, rows: int) -> Drawn:
        """The models of an epoch."""
        substeps = int(rng.choice(self._choices))
        count = rows if self.randomization.by_row else 1
        chosen = rng.integers(self.randomization.models, size=count)
        kappa = None
        if self.randomization.kappa is not None:
            low, high = np.log(self.randomization.kappa)
            kappa = np.broadcast_to(np.exp(rng.uniform(low, high, count)), rows)
        parameters = {name: table[chosen] for name, table in self._tables[substeps].items()}
        delay = int(rng.choice(self.randomization.delays)) if self.randomization.delays else 0
        return self.drawn(substeps, kappa, parameters, delay)

    def drawn(self, substeps: int, kappa: Floats | None, parameters: Mapping[str, Floats], delay: int) -> Drawn:
        """Models of these values, of rows."""
        touch = self._task.touch_groups
        return Drawn(self._sims[substeps], substeps, kappa, parameters, delay, touch)


@dataclass(frozen=True)
class Drawn:
    """The models of the rows of a batch."""

    sim: Simulator
    substeps: int
    kappa: Floats | None  # (n,)
    parameters: Mapping[str, Floats]  # each (n, components), or (1, components) of all rows
    delay: int = 0  # of actions [control steps]
    touch: ContactGroups | None = None  # whose forces end the states

    __repr__ = short_repr

    def step(
        self,
        xs: Floats,
        inputs: Floats,
        derivatives: bool = False,
        kappa: float | None = None,
        impulses: RowImpulses | None = None,
    ) -> StepBatch:
        """One action of every row, from states of the task to states of the task; a kappa instead of that of rows, and
        the impulses of the actions before, as for `Simulator.step_batch`.

        Forces at the end of states have no derivatives: beside these, they are those of a second call.
        """
        nx, level = self.sim.nx, self.kappa if kappa is None else kappa
        asked, given = (xs[:, :nx], inputs, self.substeps), (level, self.parameters)
        touched = self.touch is not None and not derivatives
        found = self.sim.step_batch(*asked, derivatives, *given, contacts=touched, impulses=impulses)
        if xs.shape[1] == nx:
            return found
        x = np.concatenate([found.x, xs[:, nx:]], axis=1)
        if self.touch is not None:
            felt = self.sim.step_batch(*asked, False, *given, contacts=True) if derivatives else found
            assert felt.contacts is not None
            numbers = 6 * self.touch.count
            x[:, -numbers:] = self.touch.wrenches(felt.x, felt.contacts).reshape(len(x), numbers)
        return replace(found, x=x)

    def motion(self, impulses: RowImpulses) -> RowMotion:
        """The rows of these impulses, for many actions."""
        return RowMotion(self, impulses)

    def rows(self, chosen: NDArray[np.int64]) -> Drawn:
        """Models of some rows."""
        kappa = None if self.kappa is None else self.kappa[chosen]
        own = {name: t if len(t) == 1 else t[chosen] for name, t in self.parameters.items()}
        return replace(self, kappa=kappa, parameters=own)

    @classmethod
    def of(cls, task: Task) -> Drawn:
        """The model of the task, for all rows."""
        return cls(task.sim, task.substeps, None, {}, touch=task.touch_groups)


class RowMotion:
    """Rows of a batch that act again and again.

    Args:
        drawn: models of the rows.
        impulses: of the rows, of their simulator.
    """

    def __init__(self, drawn: Drawn, impulses: RowImpulses) -> None:
        self._drawn, self.impulses = drawn, impulses
        plain = drawn.touch is None
        self._stepper = impulses.stepper(drawn.substeps, drawn.kappa, drawn.parameters) if plain else None

    def step(self, xs: Floats, inputs: Floats, room: tuple[Floats, Floats] | None) -> tuple[Floats, Integers]:
        """(states (n, nx) after an action of every row, Status (n,) of each).

        Args:
            xs: (n, nx) states of the task.
            inputs: (n, nu) [N, N m].
            room: for derivatives, A (n, ndx, ndx) and B (n, ndx, nu), or None.
        """
        nx = self._drawn.sim.nx
        if self._stepper is None:
            found = self._drawn.step(xs, inputs, room is not None, impulses=self.impulses)
            if room is not None:
                room[0][:], room[1][:] = found.A, found.B
            return found.x, found.status
        found = self._stepper.step(xs[:, :nx], inputs, room)
        return found.x if xs.shape[1] == nx else np.concatenate([found.x, xs[:, nx:]], axis=1), found.status
