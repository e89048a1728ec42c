"""Simulator: one mechanism with a time step; its steps, rollouts and derivatives."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace as changed
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.memory_limit import room_for
from sim.mechanism.renamed import renamed
from sim.simulator.arguments import is_plain
from sim.simulator.contact_settings import with_contacts
from sim.simulator.derivative_results import Gradient, Jacobian, Linearization
from sim.simulator.feedback_rollout import Feedback, roll_policy
from sim.simulator.horizon import Horizon
from sim.simulator.knot_stepper import KnotStepper
from sim.simulator.reactions import Reactions, reactions
from sim.simulator.results import (
    FeedbackRollout,
    RolloutBatch,
    StepResult,
    Trajectory,
    checked,
    converted,
    states_and_inputs,
)
from sim.simulator.rolled_results import step_result, trajectory
from sim.simulator.rollout_duration import simulator_for_duration
from sim.simulator.row_impulses import RowImpulses
from sim.simulator.row_steps import RowSteps
from sim.simulator.settings import SETTING_NAMES, checked_settings, with_accuracy
from sim.simulator.state_space import StateSpace
from sim.simulator.step_batch import StepBatch
from solvers.types import Floats

if TYPE_CHECKING:
    from sim.simulator.linearizer import Linearizer

Wrenches = ArrayLike | Mapping[str, ArrayLike]


class Simulator(StateSpace):
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
            few as it needs: see `parts` of results. They conserve momentum exactly, unless no pair of consecutive poses
            has this momentum; then part of the relative momentum is lost: see `momentum_fractions`.
        accuracy: allowed error of the joint coordinates per second of motion [m, rad]: sub-steps of order 8, 4 or 2,
            impacts at their own times (sim/integrators/adaptive.py). `errors` of results: estimated over allowed error.
        cutoff: stiffness relative to the mass of its body up to which a contact with the ground is far: its impulse
            follows from the state before the step, and derivatives omit it: see sim/contact/far_contacts.py.

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
        cutoff: float = 0.0,
    ) -> None:
        if not isinstance(mechanism, Mechanism):
            raise TypeError(f"Simulator(mechanism): expected a Mechanism, got {mechanism!r}")
        self._kappa = None if kappa is None else checks.number("Simulator(kappa=...)", kappa, above=0.0)
        steps = checked_settings(mechanism, time_step, self._kappa, tolerance, max_iterations, order, divide, cutoff)
        super().__init__(mechanism, with_accuracy(steps, accuracy, None if self._kappa else mechanism))

    def __reduce__(self) -> Any:
        return Simulator, (self.mechanism, *self._given().values())

    def _given(self) -> dict[str, Any]:
        """The settings as given: kappa None for the default."""
        given = {name: getattr(self._engine.settings, name) for name in SETTING_NAMES}
        return {**given, "order": 2 if self.accuracy else self.order, "kappa": self._kappa, "accuracy": self.accuracy}

    def __repr__(self) -> str:
        return f"Simulator({self.mechanism.name}, {self._engine.settings.shown()})"

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
        known = ("mechanism", *SETTING_NAMES, "friction", "law", "gravity")
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
        start: Any = x
        control: Any = self._no_input if u is None else u
        plain = self._engine.in_one_kernel and is_plain(start, (self.nx,)) and is_plain(control, (self.nu,))
        if plain and wrenches is None:
            row = self._rows.stepper(1, True)
            if row.advance(start, control):
                return checked(row.last_step(), throw)
            if row.began:
                return checked(row.unsolved_step(partial(self._sentence, "Simulator.step")), throw)
        state, us = self._arguments.state("step", x), self._arguments.inputs("step", "u", control, (self.nu,))
        external = self._arguments.wrenches("step", wrenches, 1)
        rolled = self._engine.roll(state, us[None], external)
        return checked(step_result(self.mechanism, self.time_step, rolled, self._sentence), throw)

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
            count, policy = self._arguments.steps("rollout", steps), us
            external = self._arguments.wrenches("rollout", wrenches, count)
            taken: Any = partial(trajectory, self, external, self._sentence)
            made = converted(lambda: roll_policy(self._engine, state, policy, count, external), lambda f: taken(*f))
            return checked(made, throw)
        if us is None:
            inputs = np.zeros((self._arguments.steps("rollout", steps), self.nu))
        else:
            inputs = self._arguments.inputs("rollout", "us", us, ("T" if steps is None else steps, self.nu))
        external = self._arguments.wrenches("rollout", wrenches, len(inputs))
        taken = partial(trajectory, self, external, self._sentence, inputs)
        return checked(converted(lambda: self._engine.roll(state, inputs, external), taken), throw)

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

    def step_batch(  # noqa: PLR0913
        self,
        X: ArrayLike,
        U: ArrayLike,
        substeps: int = 1,
        derivatives: bool = False,
        kappa: ArrayLike | None = None,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        contacts: bool = False,
        impulses: RowImpulses | None = None,
        throw: bool = False,
    ) -> StepBatch:
        """One knot of independent rows, over all cores: row i goes from X[i] by `substeps` steps with U[i] held.

        A row starts from its own state alone, so its result depends neither on the other rows nor on the cores.

        Args:
            X: (n, nx) states.
            U: (n, nu) inputs [N, N m].
            substeps: time steps per knot.
            derivatives: whether to return those of every row by its state and input, too.
            kappa: central-path parameter, one or (n,); that of the simulator by default. Order 2 only.
            parameters: {name: (n,) or (n, components), or one row for all}, as in `parameters`: the rows are those of
                `with_parameters`, with the kappa of this simulator. A model is made once for each row of new values,
                and kept.
            contacts: whether to return those of the last step of every row, too. Order 2 only, without derivatives.
            impulses: those with which the last steps of these rows ended, of `row_impulses`; written, so that a motion
                of many calls starts each knot where the last one ended, with fewer iterations. `forget` rows that jump
                (default None: every row starts from its state alone).
            throw: raise SimulationError where a step is not solved.

        Returns:
            StepBatch with the states after the knot, and A (n, ndx, ndx), B (n, ndx, nu).
        """
        return checked(self._rows.step(X, U, substeps, derivatives, kappa, parameters, contacts, impulses), throw)

    def row_impulses(self, count: int) -> RowImpulses:
        """Room for the impulses of independent rows between calls of `step_batch`; in the beginning, none are known.

        Args:
            count: number of rows.

        Returns:
            RowImpulses.
        """
        return self._rows.impulses(count)

    def stepper(self, substeps: int = 1, contacts: bool = False) -> KnotStepper:
        """Steps of a single state, as `step_batch` takes them, without checks of arguments: for many short calls.

        Args:
            substeps: time steps per knot.
            contacts: whether those of the last step are kept.

        Returns:
            KnotStepper of this thread, whose `step(X, U)` takes finite (1, nx) and (1, nu).

        Raises:
            ValueError: the simulator has no stepper.
        """
        return self._rows.stepper(substeps, contacts)

    @property
    def has_stepper(self) -> bool:
        """Whether there is a `stepper`: steps of one order in compiled loops, without an accuracy."""
        return self._engine.in_one_kernel

    single_row = renamed("stepper")
    has_single_rows = renamed("has_stepper")

    @cached_property
    def _rows(self) -> RowSteps:
        """Steps of rows, with what they keep between calls."""
        size, make = (lambda name: len(self.parameters((name,)).values)), self.with_parameters
        return RowSteps(self.mechanism, self._engine, self._arguments, size, lambda values: make(values)._engine)

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
        roll = partial(self._engine.roll_feedback, state, policy, factor, bounds, count, level)
        made = partial(FeedbackRollout.of, made_by=self, kappa=level, substeps=count, wrenches=external)
        return checked(converted(roll, made), throw)

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
            call = "Simulator.reactions(wrenches=...)"
            raise ValueError(f"{call}: expected x of shape (nx,) or (T, nx), got {np.shape(x)}")
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
        state = self._arguments.state("linearize", x)
        us = self._arguments.inputs("linearize", "u", np.zeros(self.nu) if u is None else u, (self.nu,))
        level = self._arguments.kappa("linearize", kappa)
        external = self._arguments.wrenches("linearize", wrenches, 1)
        return checked(self._linearizer.step(state, us, wrt, level, external), throw)

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
        xs, linear = self._linearizer.rollout(state, inputs, wrt, level, external)
        return xs, checked(linear, throw)

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
        return checked(self._linearizer.knots(states, inputs, steps, level, external), throw)

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
        out, into = self.maximal_jacobian(found.x_next), self.minimal_jacobian(bodies)
        return changed(found, blocks={"state": out @ found.A @ into, "input": out @ found.B})

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
        Of several solutions, and divisions, that of the trajectory counts, if `kappa` is that of the simulator.

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
        path = (self._arguments.states(f"{call}(trajectory)", rows), inputs)
        external, level = self._arguments.wrenches("vjp", wrenches, len(inputs)), self._arguments.kappa("vjp", kappa)
        return checked(self._linearizer.gradient(path, loss, wrt, level, external), throw)

    @cached_property
    def _linearizer(self) -> Linearizer:
        """Derivatives; their modules are imported on first use."""
        from sim.simulator.linearizer import Linearizer

        return Linearizer(self.mechanism, self._engine, self._by_parameters)

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
