"""Simulator: one mechanism with a time step; its steps, rollouts and derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace as changed
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import room_for
from sim.mechanism.renamed import renamed
from sim.model.record_columns import StepReport
from sim.simulator.arguments import is_plain
from sim.simulator.contact_settings import with_contacts
from sim.simulator.derivative_results import Gradient, Jacobian, Linearization
from sim.simulator.engines.engine import REPORT, Rolled
from sim.simulator.feedback_rollout import Feedback, roll_policy
from sim.simulator.horizon import Horizon
from sim.simulator.reactions import Reactions, reactions
from sim.simulator.results import (
    STATUSES,
    FeedbackRollout,
    RolloutBatch,
    StepResult,
    Trajectory,
    checked,
    contacts_of,
    converted,
    reservation,
    states_and_inputs,
    status_message,
)
from sim.simulator.rollout_duration import simulator_for_duration
from sim.simulator.settings import Settings, default_kappa, with_accuracy
from sim.simulator.step_batch import BatchStepping
from solvers.status import Status
from solvers.types import Floats

Wrenches = ArrayLike | Mapping[str, ArrayLike]

_SETTINGS = ("time_step", "kappa", "tolerance", "max_iterations", "order", "divide", "accuracy")
_ORDERS = (2, 4, 6, 8)


class Simulator(BatchStepping):
    """A mechanism, a time step, and the accuracy of its steps.

    A state is x = [q; v] (nx,), an input u (nu,) in N and N m, a perturbation dx (ndx,) = [dq; dv]; see `describe()`.
    With order 2, v is the mean velocity over the interval that led to q. Otherwise it is that of the node, M(q)^-1 p
    before the ground acts in the next step: standing still, g h/2.

    Every method that steps returns a result with `success`, `status` and `message`, and raises SimulationError for an
    unsolved step only with throw=True. External wrenches are (nbody, 6), with steps in front (T, nbody, 6), or
    {body: (6,) or (T, 6)}: a force at the centre of mass [N], then a torque [N m], in world axes, constant over a step.

    Args:
        mechanism: the mechanism.
        time_step: length h of a step [s].
        kappa: central-path parameter [N s m]: contacts press with kappa / gap, a resting body floats by kappa / impulse
            (default 1e-9 m/s m |g| h with the lightest free mass m, within 1e-13 and 1e-6; see settings.py).
        tolerance: error of the equations of a step [N s, N m s, m], relative to 1 + the largest momentum.
        max_iterations: limit of the iterations of the interior point.
        order: 2, or 4, 6, 8 for trees: explicit steps with 4, 7, 12 evaluations of the dynamics. All keep momentum. The
            energy error of order 2 stays bounded; that of the others is much smaller, but grows. They use steps of
            order 2 near contacts, collisions and limits, and for joints too stiff for an explicit step: see
            `describe()`.
        divide: whether a step that cannot be solved, or turns a body too far, becomes 2, 4, ... up to 1024 steps, as
            few as it needs: see `parts` of results. The parts conserve momentum exactly, unless no pair of
            consecutive poses has this momentum; then part of the relative momentum is lost: see `momentum_fractions`.
        accuracy: allowed error of the joint coordinates per second of motion [m, rad]. Each step is divided into
            sub-steps of order 8 or 2 accordingly, and impacts happen at their own times. `errors` of results has the
            ratio of estimated to allowed error; see sim/integrators/adaptive.py.

    Raises:
        TypeError: for a mechanism or a `divide` of the wrong kind.
        ValueError: for a setting out of range; in all methods, for wrong shapes and numbers that are not finite.
    """

    def __init__(
        self,
        mechanism: Mechanism,
        time_step: float = 0.02,
        kappa: float | None = None,
        tolerance: float = 1e-8,
        max_iterations: int = 500,
        order: int = 2,
        divide: bool = True,
        accuracy: float | None = None,
    ) -> None:
        if not isinstance(mechanism, Mechanism):
            raise TypeError(f"Simulator(mechanism): expected a Mechanism, got {mechanism!r}")
        whole_number("Simulator(max_iterations=...)", max_iterations)
        if not isinstance(divide, bool | np.bool_):
            raise TypeError(f"Simulator(divide=...): expected True or False, got {divide!r}")
        if not isinstance(order, int | np.integer) or order not in _ORDERS:
            raise ValueError(f"Simulator(order=...): expected one of {_ORDERS}, got {order!r}")
        h = checks.number("Simulator(time_step=...)", time_step, above=0.0)
        self._kappa = None if kappa is None else checks.number("Simulator(kappa=...)", kappa, above=0.0)
        level = default_kappa(mechanism, h) if self._kappa is None else self._kappa
        residual = checks.number("Simulator(tolerance=...)", tolerance, above=0.0)
        settings = Settings(h, level, residual, int(max_iterations), int(order), bool(divide))
        super().__init__(mechanism, with_accuracy(settings, accuracy, None if self._kappa else mechanism))

    def __reduce__(self) -> Any:
        return Simulator, (self.mechanism, *self._given().values())

    def _given(self) -> dict[str, Any]:
        """The settings as given: kappa None for the default."""
        given = {name: getattr(self._engine.settings, name) for name in _SETTINGS}
        return {**given, "order": 2 if self.accuracy else self.order, "kappa": self._kappa, "accuracy": self.accuracy}

    def __repr__(self) -> str:
        shown = zip(_SETTINGS[: None if self.accuracy else -1], self._engine.settings, strict=False)
        return f"Simulator({self.mechanism.name}, {', '.join(f'{name}={value:g}' for name, value in shown)})"

    def replace(self, **settings: Any) -> Simulator:
        """The same simulator with other settings. Compiled code is shared, and a default kappa remains the default.

        Args:
            **settings: settings of Simulator(...), `mechanism`, `gravity` (3,) [m/s^2], and `friction` and `law` of
                contacts and collisions: one for all, or {name of a contact or collision: value}.

        Returns:
            The new simulator.

        Raises:
            ValueError: for an unknown setting or contact, or a value out of range.
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

    # -- motions -------------------------------------------------------------------------------------------------------

    def step(
        self, x: ArrayLike, u: ArrayLike | None = None, *, throw: bool = False, wrenches: Wrenches | None = None
    ) -> StepResult:
        """One time step.

        Args:
            x: (nx,) state.
            u: (nu,) input [N, N m]; zero by default.
            throw: raise SimulationError where the step is not solved.
            wrenches: external wrenches, (nbody, 6) or by body.

        Returns:
            StepResult with the state after the step; for an unsolved step, the state before it.
        """
        check = self._arguments
        start: Any = x
        control: Any = self._no_input if u is None else u
        plain = self._engine.in_one_kernel and is_plain(start, (self.nx,)) and is_plain(control, (self.nu,))
        if plain and wrenches is None and (row := self.stepper(1, True)).advance(start, control):
            return checked(row.last_step(), throw)
        state, us = check.state("step", x), check.inputs("step", "u", control, (self.nu,))
        external = None if wrenches is None else check.wrenches("step", wrenches, 1)
        rolled = self._engine.roll(state, us[None], external)
        status, iterations, residual, violation, _, _ = rolled.reports[0].tolist()
        scene, end = (self.mechanism, self.time_step, rolled.contacts[0]), rolled.xs[1 if rolled.solved_steps else 0]
        (parts, share, error), fraction = rolled.division, float(rolled.division.momentum_fractions[0])
        solved = STATUSES[int(status)], int(iterations), residual, violation
        detail = "" if rolled.solved_steps else self._sentence("Simulator.step", rolled.reports[0], end)
        if fraction < 1.0 or error[0] > 1.0:
            detail = reservation(share, error)
        return checked(StepResult(end, *solved, scene, int(parts[0]), fraction, float(error[0]), detail), throw)

    def rollout(
        self,
        x: ArrayLike,
        us: ArrayLike | Feedback | None = None,
        *,
        steps: int | None = None,
        duration: float | None = None,
        throw: bool = False,
        wrenches: Wrenches | None = None,
    ) -> Trajectory:
        """Take steps from x; the rollout ends at the first step that cannot be solved.

        Args:
            x: (nx,) state.
            us: (T, nu) inputs [N, N m], or a function u = us(time, x), called before each step; zero by default.
            steps: number of steps, if `us` does not determine it.
            duration: total duration [s], only with `accuracy`: it is divided evenly among the inputs, or `steps`, or is
                that of a single step. By default each step has the time step.
            throw: raise SimulationError where a step is not solved.
            wrenches: external wrenches, (T, nbody, 6) or by body.

        Returns:
            Trajectory of the solved steps.
        """
        if duration is not None:
            sim, steps = simulator_for_duration(self, self._kappa, us, steps, duration)
            return sim.rollout(x, us, steps=steps, throw=throw, wrenches=wrenches)
        state = self._arguments.state("rollout", x)
        if callable(us):
            count = self._arguments.steps("rollout", steps)
            external = self._arguments.wrenches("rollout", wrenches, count)
            taken, policy = (lambda found: self._trajectory(found[0], found[1], external)), us
            return checked(converted(lambda: roll_policy(self._engine, state, policy, count, external), taken), throw)
        if us is None:
            inputs = np.zeros((self._arguments.steps("rollout", steps), self.nu))
        else:
            inputs = self._arguments.inputs("rollout", "us", us, ("T" if steps is None else steps, self.nu))
        external = self._arguments.wrenches("rollout", wrenches, len(inputs))
        found = converted(
            lambda: self._engine.roll(state, inputs, external),
            lambda rolled: self._trajectory(inputs, rolled, external),
        )
        return checked(found, throw)

    def _trajectory(self, inputs: Floats, rolled: Rolled, wrenches: Floats | None) -> Trajectory:
        """A rollout under the inputs (T, nu)."""
        knot, xs, reports = rolled.solved_steps, rolled.xs, rolled.reports
        last = reports[min(knot, len(reports) - 1)] if len(reports) else np.zeros(REPORT)
        status, (parts, fractions, errors) = STATUSES[int(last[StepReport.STATUS])], rolled.division
        where, solved = f"Simulator.rollout: step {knot}", status == Status.SOLVED
        detail = reservation(fractions, errors) if solved else self._sentence(where, last, xs[knot])
        return Trajectory(
            simulator=self,
            x=xs[: knot + 1],
            u=inputs[:knot],
            time=self.time_step * np.arange(knot + 1.0),
            status=status,
            solved_steps=knot,
            residual=float(last[StepReport.RESIDUAL]),
            iterations=reports[:knot, StepReport.ITERATIONS].astype(np.int64),
            contacts=contacts_of(self.mechanism, self.time_step, rolled.contacts[:knot]),
            parts=parts[:knot],
            momentum_fractions=fractions[:knot],
            errors=errors[:knot],
            detail=detail,
            wrenches=None if wrenches is None else wrenches[:knot],
        )

    def rollout_batch(self, x0s: ArrayLike, us: ArrayLike, *, throw: bool = False) -> RolloutBatch:
        """Rollouts over all cores.

        Args:
            x0s: first states (n, nx).
            us: inputs (n, T, nu) [N, N m].
            throw: raise SimulationError if a step is not solved.

        Returns:
            RolloutBatch of the states.
        """
        call = "Simulator.rollout_batch"
        inputs = self._arguments.inputs("rollout_batch", "us", us, ("n", "T", self.nu))
        starts = self._arguments.states(f"{call}(x0s)", checks.array(f"{call}(x0s)", x0s, (len(inputs), self.nx)))
        return checked(converted(lambda: self._engine.roll_batch(starts, inputs), RolloutBatch.of), throw)

    def rollout_feedback(  # noqa: PLR0913
        self,
        x0: ArrayLike,
        us: ArrayLike,
        xs: ArrayLike | None = None,
        *,
        ks: ArrayLike | None = None,
        Ks: ArrayLike | None = None,
        gaps: ArrayLike | None = None,
        alpha: float = 1.0,
        limits: tuple[ArrayLike, ArrayLike] | None = None,
        substeps: int = 1,
        kappa: float | None = None,
        wrenches: Wrenches | None = None,
        throw: bool = False,
    ) -> FeedbackRollout:
        """Rollout under a feedback law, each knot `substeps` steps with u held:

            u_t     = clamp(us_t + alpha ks_t + Ks_t (x_t (-) xs_t))
            x_t+1   = f(x_t, u_t) (+) (alpha - 1) gaps_t+1

        Args:
            x0: (nx,) state.
            us: (T, nu) inputs [N, N m].
            xs: (T + 1, nx) states that the gains are about.
            ks: (T, nu) steps of the inputs.
            Ks: (T, nu, ndx) gains.
            gaps: (T + 1, ndx) f(xs_t, us_t) (-) xs_t+1, in the rows of the later knots.
            alpha: applied share of ks and of the gaps.
            limits: (lower, upper) of u, each (nu,).
            substeps: time steps per knot.
            kappa: central-path parameter instead of that of the simulator.
            wrenches: external wrenches, (T, nbody, 6) or by body, held over a knot.
            throw: raise SimulationError where a step is not solved.

        Returns:
            FeedbackRollout with the solved knots.
        """
        call = "rollout_feedback"
        state, inputs = self._arguments.state(call, x0, "x0"), self._arguments.inputs(call, "us", us, ("T", self.nu))
        name = f"Simulator.{call}"
        factor = checks.number(f"{name}(alpha=...)", alpha)
        bounds = self._arguments.limits(name, limits)
        external = self._arguments.wrenches(call, wrenches, len(inputs))
        policy = self._arguments.policy(name, state, inputs, external, (xs, ks, Ks, gaps))
        count, level = whole_number(f"{name}(substeps=...)", substeps), self._arguments.kappa(call, kappa)
        found = converted(
            lambda: self._engine.roll_feedback(state, policy, factor, bounds, count, level), FeedbackRollout.of
        )
        return checked(found, throw)

    closed_loop = renamed("rollout_feedback")

    def reactions(
        self,
        x: ArrayLike,
        u: ArrayLike | None = None,
        *,
        frame: str = "world",
        wrenches: Wrenches | None = None,
        throw: bool = False,
    ) -> Reactions:
        """Force [N] and torque [N m] that every joint transmits to its child in the step from x under u.

        Args:
            x: (..., nx) states; `sim.reactions(t.x[:-1], t.u)` has the reactions of a whole trajectory.
            u: (..., nu) inputs with the same leading axes; zero by default.
            frame: axes of the "world", of the "joint" frame on the parent, or of the child ("body").
            wrenches: external wrenches, (nbody, 6) or (T, nbody, 6).
            throw: raise SimulationError where a step is not solved.

        Returns:
            Reactions; NaN in the rows of unsolved steps.

        Raises:
            ValueError: for wrenches and states of different or more leading axes, or an unknown frame.
        """
        states, lead = self._arguments.stacked("reactions", "x", x)
        given = np.zeros((*lead, self.nu)) if u is None else u
        us = self._arguments.inputs("reactions", "u", given, (*lead, self.nu)).reshape(len(states), self.nu)
        if wrenches is not None and len(lead) > 1:
            raise ValueError(
                f"Simulator.reactions(wrenches=...): expected x of shape (nx,) or (T, nx), got {np.shape(x)}"
            )
        external = self._arguments.wrenches("reactions", wrenches, len(states))
        found = reactions(self.mechanism, self._engine, (states, us, external), lead, frame, self._sentence)
        return checked(found, throw)

    def inactive_contacts(self, x: ArrayLike, u: ArrayLike | None = None) -> tuple[str, ...]:
        """Inactive contacts of a step; the solver has no unknowns for them, but their forces kappa / gap act.

        Args:
            x: (nx,) state.
            u: (nu,) input; zero by default.

        Returns:
            Names of the contacts; `describe()` has the distances.

        Raises:
            SimulationError: the step is not solved.
        """
        self.step(x, u, throw=True)
        return tuple(self.mechanism.contact_names[c] for c in np.flatnonzero(self._engine.inactive()))

    def horizon(self, knots: int, substeps: int = 1, limits: tuple[ArrayLike, ArrayLike] | None = None) -> Horizon:
        """Rollouts and derivatives of many trajectories of one length, for a planner: see horizon.py.

        Steps are not divided: a planner does better with refused steps than with divided ones.

        Args:
            knots: number of knots.
            substeps: time steps per knot.
            limits: (lower, upper) of u, each a number or (nu,) [N, N m].

        Returns:
            Horizon with its buffers.
        """
        call = "Simulator.horizon"
        size = room_for(f"{call}(knots)", knots, 8.0 * self.ndx * (self.ndx + 2 * self.nu + 1))
        steps, bounds = whole_number(f"{call}(substeps=...)", substeps), self._arguments.limits(call, limits)
        return Horizon(self._engine.undivided(), self._arguments, size, steps, bounds)

    # -- derivatives ---------------------------------------------------------------------------------------------------

    def linearize(
        self,
        x: ArrayLike,
        u: ArrayLike | None = None,
        *,
        kappa: float | None = None,
        wrt: Sequence[str] | None = None,
        wrenches: Wrenches | None = None,
        throw: bool = False,
    ) -> Jacobian:
        """Derivatives of one step, by the implicit function theorem, in tangent coordinates.

        Args:
            x: (nx,) state.
            u: (nu,) input; zero by default.
            kappa: central-path parameter at which the step is solved; that of the simulator by default.
            wrt: "state", "input" and parameters, as in `parameters`. x and u are held fixed, so the poses and momenta
                that belong to x move with a parameter.
            wrenches: external wrenches, (nbody, 6) or by body, constants.
            throw: raise SimulationError where the step is not solved.

        Returns:
            Jacobian: `A, B = sim.linearize(x, u)`, (ndx, ndx) and (ndx, nu), or by name, each (ndx, n).
        """
        call = "Simulator.linearize"
        state = self._arguments.state("linearize", x)
        us = self._arguments.inputs("linearize", "u", np.zeros(self.nu) if u is None else u, (self.nu,))
        level = self._arguments.kappa("linearize", kappa)
        external = self._arguments.wrenches("linearize", wrenches, 1)
        selected = None if wrt is None else self._by_parameters.select(f"{call}(wrt=...)", wrt)
        if selected is None or not selected[1].names:
            A, B, x_next, report = self._engine.linearize_one(state, us, level, external)
            blocks = {"state": A, "input": B}
        else:
            rolled, J = self._by_parameters.roll(state, us[None], selected[1:], level, external)
            (A,), (B,), x_next, report = rolled.A, rolled.B, rolled.xs[1], rolled.reports[0]
            blocks = {"state": A, "input": B} | {name: J[0][:, rows] for name, rows in selected[1].rows.items()}
        status, accuracy = STATUSES[int(report[StepReport.STATUS])], float(report[StepReport.ACCURACY])
        detail = "" if status == Status.SOLVED else status_message(self.mechanism, call, report, self.tolerance)
        if selected is not None and status == Status.SOLVED:
            blocks = {name: blocks[name] for name in selected[0]}
        return checked(Jacobian(blocks, x_next, status, accuracy, detail), throw)

    def linearize_rollout(
        self,
        x: ArrayLike,
        us: ArrayLike,
        *,
        kappa: float | None = None,
        wrt: Sequence[str] = (),
        wrenches: Wrenches | None = None,
        throw: bool = False,
    ) -> tuple[Floats, Linearization]:
        """A rollout and its derivatives in one pass: `rollout` and `linearize_trajectory`, each step solved once.

        Args:
            x: (nx,) state.
            us: (T, nu) inputs.
            kappa: central-path parameter; that of the simulator by default.
            wrt: names of parameters, whose derivatives (T, ndx, n) are then in `Linearization.parameters`.
            wrenches: external wrenches, (T, nbody, 6) or by body.
            throw: raise SimulationError where a step is not solved.

        Returns:
            States (T + 1, nx) and Linearization; from an unsolved step on, states repeat and derivatives are zero.
        """
        call = "linearize_rollout"
        state, inputs = self._arguments.state(call, x), self._arguments.inputs(call, "us", us, ("T", self.nu))
        level, external = self._arguments.kappa(call, kappa), self._arguments.wrenches(call, wrenches, len(inputs))
        chosen = self._by_parameters.select(f"Simulator.{call}(wrt=...)", wrt)[1:]
        if chosen[0].names:
            rolled, J = self._by_parameters.roll(state, inputs, chosen, level, external)
            blocks = {name: J[:, :, rows] for name, rows in chosen[0].rows.items()}
        else:
            rolled, blocks = self._engine.roll(state, inputs, external, kappa=level, derivatives=True), {}
        knot, reports, detail = rolled.solved_steps, rolled.reports, ""
        if knot < len(inputs):
            detail = status_message(self.mechanism, f"Simulator.{call}: step {knot}", reports[knot], self.tolerance)
            reports[knot:, StepReport.STATUS] = reports[knot, StepReport.STATUS]
            rolled.xs[knot + 1 :] = rolled.xs[knot]
            for array in (rolled.A, rolled.B, *blocks.values()):
                array[knot:] = 0.0
        statuses, accuracy = reports[:, StepReport.STATUS].astype(np.int64), reports[:, StepReport.ACCURACY]
        linear = Linearization(rolled.A, rolled.B, rolled.xs[1:], statuses, blocks, accuracy, detail)
        return rolled.xs, checked(linear, throw)

    def linearize_trajectory(
        self,
        xs: ArrayLike,
        us: ArrayLike,
        *,
        substeps: int = 1,
        kappa: float | None = None,
        wrenches: Wrenches | None = None,
        throw: bool = False,
    ) -> Linearization:
        """`linearize` at the knots (xs_t, us_t), in parallel; each knot spans `substeps` steps with u held.

        Args:
            xs: (T, nx) or (T + 1, nx) states; the last of T + 1 is not used.
            us: (T, nu) inputs.
            substeps: time steps per knot.
            kappa: central-path parameter; that of the simulator by default.
            wrenches: external wrenches, (T, nbody, 6) or by body.
            throw: raise SimulationError where a step is not solved.

        Returns:
            Linearization; the derivatives of unsolved knots are zero.

        Raises:
            ValueError: for numbers of states and inputs that do not match.
        """
        call = "Simulator.linearize_trajectory"
        inputs = self._arguments.inputs("linearize_trajectory", "us", us, ("T", self.nu))
        states = self._arguments.states(f"{call}(xs)", checks.array(f"{call}(xs)", xs, ("T", self.nx)))
        if len(states) - len(inputs) not in (0, 1):
            raise ValueError(f"{call}(xs): expected {len(inputs)} or {len(inputs) + 1} states, got {len(states)}")
        steps = whole_number(f"{call}(substeps=...)", substeps)
        level = self._arguments.kappa("linearize_trajectory", kappa)
        external = self._arguments.wrenches("linearize_trajectory", wrenches, len(inputs))
        A, B, x_next, reports = self._engine.linearize(states, inputs, steps, level, None, external)
        statuses, detail = reports[:, StepReport.STATUS].astype(np.int64), ""
        if statuses.any():
            t = int(np.flatnonzero(statuses)[0])
            detail = status_message(self.mechanism, f"{call}: knot {t}", reports[t], self.tolerance)
        linear = Linearization(A, B, x_next, statuses, accuracy=reports[:, StepReport.ACCURACY], detail=detail)
        return checked(linear, throw)

    def linearize_maximal(
        self, z: ArrayLike, u: ArrayLike | None = None, *, kappa: float | None = None, throw: bool = False
    ) -> Jacobian:
        """Derivatives of the next maximal state by maximal state and input, in the tangents of `maximal_jacobian`.

        The step sees z through minimal(z): violations of joints have no effect, so A is the derivative of
        maximal(step(minimal(z))).

        Args:
            z: (nbody, 13) maximal state, as `maximal` returns it.
            u: (nu,) input; zero by default.
            kappa: central-path parameter; that of the simulator by default.
            throw: raise SimulationError where the step is not solved.

        Returns:
            Jacobian with the blocks (12 nbody, 12 nbody) and (12 nbody, nu).
        """
        bodies = checks.array("Simulator.linearize_maximal(z)", z, (self.nbody, 13))
        found = self.linearize(self.minimal(bodies), u, kappa=kappa, throw=throw)
        if not found.success:
            return found
        out = self.maximal_jacobian(found.x_next)
        blocks = {"state": out @ found.A @ self.minimal_jacobian(bodies), "input": out @ found.B}
        return changed(found, blocks=blocks)

    def vjp(
        self,
        trajectory: Trajectory | tuple[ArrayLike, ArrayLike],
        dL_dx: ArrayLike,
        *,
        wrt: Sequence[str] = ("state", "input"),
        kappa: float | None = None,
        wrenches: Wrenches | None = None,
        throw: bool = False,
    ) -> Gradient:
        """Gradient of a scalar L(x_0, ..., x_T) of a rollout, by one sweep from its end.

        The steps are solved again at `kappa`, and one step is stored at a time: the memory is that of the trajectory.

        Args:
            trajectory: result of `rollout`, or (states (T + 1, nx), inputs (T, nu)).
            dL_dx: (T + 1, ndx) gradient of L by the states, in tangent coordinates.
            wrt: "state", "input" and parameters, as in `parameters`.
            kappa: central-path parameter; that of the simulator by default.
            wrenches: external wrenches, (T, nbody, 6) or by body; those of the trajectory by default.
            throw: raise SimulationError where a step is not solved.

        Returns:
            Gradient by the names of `wrt`: "state" (ndx,), of the first state; "input" (T, nu); parameters (n,).
        """
        call = "Simulator.vjp"
        xs, us = states_and_inputs(f"{call}(trajectory)", trajectory)
        if wrenches is None and isinstance(trajectory, Trajectory):
            wrenches = trajectory.wrenches
        inputs = self._arguments.inputs("vjp", "trajectory", us, ("T", self.nu))
        rows = checks.array(f"{call}(trajectory)", xs, (len(inputs) + 1, self.nx))
        loss = checks.array(f"{call}(dL_dx)", dL_dx, (len(inputs) + 1, self.ndx))
        asked, found, plan = self._by_parameters.select(f"{call}(wrt=...)", wrt)
        path = (self._arguments.states(f"{call}(trajectory)", rows), inputs)
        external = self._arguments.wrenches("vjp", wrenches, len(inputs))
        level = self._arguments.kappa("vjp", kappa)
        knot, line = self._by_parameters.sweep(path, loss, (found, plan), level, external)
        blocks = {"state": line.costate[0], "input": line.inputs}
        blocks = {name: blocks[name] if name in blocks else line.parameters[found.rows[name]] for name in asked}
        if knot >= 0:
            detail = status_message(self.mechanism, f"{call}: step {knot}", line.report[0], self.tolerance)
            return checked(Gradient(blocks, Status(int(line.report[0, StepReport.STATUS])), detail), throw)
        finite = all(np.isfinite(block).all() for block in blocks.values())
        return checked(Gradient(blocks, Status.SOLVED if finite else Status.NOT_FINITE), throw)

    def with_parameters(self, values: Mapping[str, ArrayLike]) -> Simulator:
        """The same simulator, including its kappa, with other values of parameters.

        Args:
            values: {name: value}, with the names of `parameters`.

        Returns:
            The new simulator.

        Raises:
            ValueError: for an unknown name, or a value that no mechanism has.
        """
        mech, time_step = self._by_parameters.with_values("Simulator.with_parameters(...)", values)
        return self.replace(mechanism=mech, time_step=time_step, kappa=self.kappa)
