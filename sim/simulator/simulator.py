"""Simulator: one mechanism with a time step; its steps, rollouts and derivatives."""

from __future__ import annotations

from dataclasses import replace as changed
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.mechanism import checks
from sim.mechanism.mechanism import Mechanism
from sim.simulator import wrenches as pushed
from sim.simulator.border import whole
from sim.simulator.calls import REPORT
from sim.simulator.contact_settings import with_contacts
from sim.simulator.derivatives import Derivatives
from sim.simulator.describe import describe
from sim.simulator.horizon import Horizon
from sim.simulator.omitted_contacts import left_out
from sim.simulator.policies import Feedback, Rolled, roll
from sim.simulator.reactions import Reactions
from sim.simulator.results import (
    Batch,
    Shot,
    SimulationError,
    StepResult,
    Trajectory,
    carried,
    contacts_of,
    error_of,
    fastest,
)
from sim.simulator.settings import Settings, default_kappa
from sim.simulator.wrenches import Wrenches
from solvers.status import MESSAGES, Status

Floats = NDArray[np.float64]

_SETTINGS = ("time_step", "kappa", "tolerance", "max_iterations", "order")
_ORDERS = (2, 4, 6, 8)


class Simulator(Derivatives):
    """A mechanism, a time step [s], and how exactly a step is solved.

    kappa           central-path parameter [N s m]: contacts press with kappa / gap, a resting body floats by kappa over
                    its impulse. By default 1e-9 m/s * m |g| h, m the lightest part that no joint holds to another,
                    |g| 9.81 m/s^2 without gravity, within 1e-13 and 1e-6; with collisions m is that of all parts
    tolerance       of the equations of a step [N s, N m s, m], relative to 1 + the largest momentum
    max_iterations  of the interior point
    order           of a step; 4, 6, 8 explicit, for trees: 4, 7, 12 evaluations of the equations of motion. Momentum
                    is exact with all; order 2 bounds the energy for ever, the others keep a much smaller error that
                    grows. Steps that might leave out impulses kappa / gap beyond the tolerance are of order 2

    A state is x = [q; v] (nx,), an input u (nu,) in N and N m, a perturbation dx (ndx,) = [dq; dv]; see `describe()`.
    With order 2, v is the mean velocity over the interval that led to q; with higher orders that of the node, M(q)^-1 p
    before what the ground does in the step to come: standing still, g h/2.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        time_step: float = 0.02,
        kappa: float | None = None,
        tolerance: float = 1e-8,
        max_iterations: int = 500,
        order: int = 2,
    ) -> None:
        if not isinstance(mechanism, Mechanism):
            raise TypeError(f"Simulator(mechanism): expected a Mechanism, got {mechanism!r}")
        if not isinstance(max_iterations, int | np.integer) or max_iterations < 1:
            raise ValueError(f"Simulator(max_iterations=...): expected a whole number >= 1, got {max_iterations!r}")
        if order not in _ORDERS:
            raise ValueError(f"Simulator(order=...): expected one of {_ORDERS}, got {order!r}")
        h = checks.number("Simulator(time_step=...)", time_step, above=0.0)
        self._kappa = None if kappa is None else checks.number("Simulator(kappa=...)", kappa, above=0.0)
        level = default_kappa(mechanism, h) if self._kappa is None else self._kappa
        accuracy = checks.number("Simulator(tolerance=...)", tolerance, above=0.0)
        super().__init__(mechanism, Settings(h, level, accuracy, int(max_iterations), int(order)))

    def __reduce__(self) -> Any:
        return Simulator, (self.mechanism, *self._given().values())

    def _given(self) -> dict[str, Any]:
        """The settings as they were given: kappa None where it is the default."""
        return {**self._calls.settings._asdict(), "kappa": self._kappa}

    def __repr__(self) -> str:
        numbers = ", ".join(f"{name}={value:g}" for name, value in self._calls.settings._asdict().items())
        return f"Simulator({self.mechanism.name}, {numbers})"

    def replace(self, **settings: Any) -> Simulator:
        """The same with other settings: those of Simulator(...), and `friction`, `law`, `gravity`, `mechanism`.

        friction, law: for all contacts, or {contact name: value}. A default kappa stays one. Compiled code is shared.
        """
        known = ("mechanism", *_SETTINGS, "friction", "law", "gravity")
        for key in settings:
            checks.one_of("Simulator.replace(...)", key, known)
        mech = settings.pop("mechanism", self.mechanism)
        for field in ("friction", "law"):
            if field in settings:
                mech = with_contacts(mech, field, settings.pop(field))
        if "gravity" in settings:
            mech = changed(mech, gravity=settings.pop("gravity"))
        return Simulator(mech, **{**self._given(), **settings})

    def describe(self) -> str:
        """What the scene consists of, what a step computes, and what is left out because nothing needs it."""
        return describe(self)

    def left_out(self, x: ArrayLike, u: ArrayLike | None = None) -> tuple[str, ...]:
        """Names of the contacts that the step from x is solved without, because they are far.

        Their forces, kappa / gap, act all the same, to the tolerance of the step. See `describe()` for the distances.
        """
        return left_out(self, x, u)

    def step(
        self, x: ArrayLike, u: ArrayLike | None = None, *, throw: bool = False, wrenches: Wrenches | None = None
    ) -> StepResult:
        """One time step from x under the input u (zero when left out); wrenches (nbody, 6) as in `rollout`."""
        if wrenches is not None:
            return pushed.step(self, x, u, wrenches, throw)
        state = self._border.state("step", x)
        us = self._border.inputs("step", "u", np.zeros(self.nu) if u is None else u, (self.nu,))
        knot, xs, reports, contacts = self._calls.roll(state, us[None])
        status, iterations, residual, violation = reports[0, :4]
        if knot == 0 and throw:
            raise self._error("Simulator.step", reports[0], state)
        return StepResult(
            xs[knot] if knot else state,
            Status(int(status)),
            int(iterations),
            float(residual),
            float(violation),
            contacts_of(self.mechanism, self.time_step, contacts[0]),
        )

    def rollout(
        self,
        x: ArrayLike,
        us: ArrayLike | Feedback,
        *,
        steps: int | None = None,
        throw: bool = False,
        wrenches: Wrenches | None = None,
    ) -> Trajectory:
        """Steps from x under the inputs us (T, nu); stops at the first step that cannot be solved, and says so.

        us may be a function instead, u = us(time, x), asked before each of so many `steps`.
        wrenches: external ones, (T, nbody, 6), or {body: (6,) or (T, 6)}; a force at the centre of mass [N], then a
        torque [N m], both in world axes and constant over a step.
        """
        if wrenches is not None:
            return pushed.rollout(self, x, us, wrenches, throw, steps)
        state = self._border.state("rollout", x)
        if callable(us):
            found = carried(lambda: roll(self, state, us, steps), lambda pair: self._trajectory(*pair))
        else:
            inputs = self._border.inputs("rollout", "us", us, ("T" if steps is None else steps, self.nu))
            found = carried(lambda: self._calls.roll(state, inputs), lambda rolled: self._trajectory(inputs, rolled))
        if throw and not found.success:
            raise SimulationError(found.message, found.status)
        return found

    def _trajectory(self, inputs: Floats, rolled: Rolled) -> Trajectory:
        """What came of a rollout under the inputs (T, nu)."""
        knot, xs, reports, contacts = rolled
        last = reports[min(knot, len(reports) - 1)] if len(reports) else np.zeros(REPORT)
        status = Status(int(last[0]))
        error = None if status == Status.SOLVED else self._error(f"Simulator.rollout: step {knot}", last, xs[knot])
        return Trajectory(
            simulator=self,
            x=xs[: knot + 1],
            u=inputs[:knot],
            time=self.time_step * np.arange(knot + 1.0),
            status=status,
            knot=knot,
            residual=float(last[2]),
            iterations=reports[:knot, 1].astype(np.int64),
            contacts=contacts_of(self.mechanism, self.time_step, contacts[:knot]),
            message=str(error) if error else MESSAGES[status],
        )

    def _error(self, where: str, report: Floats, x: Floats | None = None) -> SimulationError:
        """Why the last step of this thread was not solved; x (nx,): the state it began from."""
        mech = self.mechanism
        names = [f"Loop joint {j.name!r}" for j in mech.loops] + [f"Gear {g.name!r}" for g in mech.gears]
        gaps = zip(self._calls.open_loops(), names, strict=True) if names else ()
        error = error_of(mech, where, report, self.tolerance, max(gaps, default=None))
        if error.status == Status.ANGULAR_STEP and x is not None:  # over a step that short no turn is one too far
            return SimulationError(f"{error} {fastest(mech, self.replace(time_step=1e-6).maximal(x))}", error.status)
        return error

    def rollout_batch(self, x0s: ArrayLike, us: ArrayLike) -> Batch:
        """Rollouts from the states x0s (n, nx) under the inputs us (n, T, nu), over all cores."""
        call = "Simulator.rollout_batch"
        inputs = self._border.inputs("rollout_batch", "us", us, ("n", "T", self.nu))
        starts = self._border.states(f"{call}(x0s)", checks.array(f"{call}(x0s)", x0s, (len(inputs), self.nx)))
        return carried(lambda: self._calls.roll_batch(starts, inputs), Batch.of)

    def closed_loop(  # noqa: PLR0913
        self,
        x0: ArrayLike,
        us: ArrayLike,
        xs: ArrayLike | None = None,
        ks: ArrayLike | None = None,
        Ks: ArrayLike | None = None,
        gaps: ArrayLike | None = None,
        alpha: float = 1.0,
        limits: tuple[ArrayLike, ArrayLike] | None = None,
        substeps: int = 1,
        kappa: float | None = None,
        wrenches: Wrenches | None = None,
    ) -> Shot:
        """Rollout under a policy, each knot `substeps` steps with u held:

            u_t     = clamp(us_t + alpha ks_t + Ks_t (x_t (-) xs_t))
            x_t+1   = f(x_t, u_t) (+) (alpha - 1) gaps_t+1

        us (T, nu), xs (T + 1, nx), ks (T, nu), Ks (T, nu, ndx), gaps (T + 1, ndx), limits (lower, upper)
        of u; wrenches (T, nbody, 6) as in `rollout`, held over a knot. Stops at the first knot that cannot be solved.
        """
        if wrenches is not None:
            gains: dict[str, Any] = {"xs": xs, "ks": ks, "Ks": Ks, "gaps": gaps, "alpha": alpha, "limits": limits}
            return pushed.closed_loop(self, x0, us, wrenches, substeps=substeps, kappa=kappa, **gains)
        call = "closed_loop"
        state, inputs = self._border.state(call, x0, "x0"), self._border.inputs(call, "us", us, ("T", self.nu))
        name = f"Simulator.{call}"
        factor = checks.number(f"{name}(alpha=...)", alpha)
        bounds = self._border.limits(name, limits)
        policy = self._border.policy(name, state, inputs, (xs, ks, Ks, gaps))
        count, level = whole(f"{name}(substeps=...)", substeps), self._border.kappa(call, kappa)
        return carried(lambda: self._calls.closed_loop(state, policy, factor, bounds, count, level), Shot.of)

    def reactions(
        self, x: ArrayLike, u: ArrayLike | None = None, *, frame: str = "world", wrenches: Wrenches | None = None
    ) -> Reactions:
        """What every joint transmits to its child in the step from x under u: force [N] and torque [N m].

        x (..., nx) and u (..., nu), zero when left out, with the same leading axes: `sim.reactions(t.x[:-1], t.u)` has
        those of a whole trajectory. frame: axes of the "world", of the "joint" frame on the parent, or of the child
        ("body"); wrenches as in `rollout`. See `Reactions` for points. An unsolved step raises SimulationError.
        """
        return pushed.reactions(self, x, u, wrenches, frame)

    def horizon(self, knots: int, substeps: int = 1, limits: tuple[ArrayLike, ArrayLike] | None = None) -> Horizon:
        """Rollouts and derivatives of trajectories of so many knots, for a planner: see `sim.horizon`."""
        call = "Simulator.horizon"
        return Horizon(
            self._calls,
            self._border,
            whole(f"{call}(knots=...)", knots),
            whole(f"{call}(substeps=...)", substeps),
            self._border.limits(call, limits),
        )
