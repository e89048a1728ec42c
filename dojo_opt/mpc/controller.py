"""`MPC`: the planner in closed loop, one iteration per tick from the shifted plan."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dojo_opt.mpc.adaptation import ParameterEstimator
from dojo_opt.mpc.delay import Delay, Prediction
from dojo_opt.mpc.foot_shear import FootShear
from dojo_opt.mpc.ground_estimate import Ground
from dojo_opt.mpc.measurement import Measurement
from dojo_opt.mpc.moving_reference import References, own_reference
from dojo_opt.mpc.policy import Policy
from dojo_opt.mpc.receding_horizon import shift_multipliers, tail
from dojo_opt.mpc.rescue import SCALES, Starts
from dojo_opt.mpc.servo import ModelServo, Servo
from dojo_opt.mpc.settings import MPCSettings
from dojo_opt.mpc.shrinkage import shrunk
from dojo_opt.planning.ilqr import Solver
from dojo_opt.planning.iterate import Iterate, Iteration
from dojo_opt.planning.plan import Plan
from dojo_opt.planning.problem import Problem
from dojo_opt.planning.same_robot import check_same_knots, check_same_robot, check_same_velocities
from dojo_opt.planning.term import StateTerm
from dojo_opt.plant.monte_carlo import MonteCarlo, Sampler, monte_carlo
from dojo_opt.plant.plant import Plant
from dojo_opt.plant.tick import Tick
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from sim.mechanism.mechanism import Mechanism
from sim.simulator.adjustable_simulator import AdjustableSimulator
from sim.simulator.results import SimulationError
from solvers.status import Status
from solvers.types import Matrix, Stack, Vector

_ROUNDING = 1e-9  # [s] times are sums of floating-point steps
_LATEST = 100_000  # knots that a plan is shifted by, at most: all of them are rolled out
_LOST = 10.0  # times the merit of the guess of a tick: a rollout worse than that has left it

__all__ = ["MPC"]


class MPC:
    """Model-predictive control: `u = mpc(time, x)`, called at any rate, plans anew once per `period`.

    A tick shifts the plan by the elapsed time and keeps its states as the guess, with the measured state in front: the
    disturbance is then the first gap, which the iteration closes. (A rollout of the shifted inputs would fall over
    together with the robot.) If the planner rejects a plan, the previous one stays in force. `log` has one `Tick` per
    plan; `estimator` has the parameters that `adapt` names, None without.

    Args:
        problem: its simulator is the model; the plant may be another one. Its start and guess are those of the first
            plan only, which is solved to the end, with the settings `first`; `reference` overwrites its references.
        iterations: iterations of the planner per tick (default 1). One is enough for costs, control limits and
            equalities. Inequalities take about 3, because an iteration from the feasible side ignores them.
        reference: states to track over time, see `dojo_opt.mpc.moving_reference.References` (default None: the
            reference of the problem at every tick).
        plan: the first plan, at the time of the first call, of the problem's robot, horizon and knots (default None:
            that of `ilqr` without refinement). One with shorter time steps, as of a refined problem, has these knots.
        **settings: fields of `dojo.MPCSettings` by name, whose help has their units and defaults: period, kappa,
            kappa_grad, guess, step_limit, patience, rescue, gain_scale, delay, computation, servo, feedforward,
            time_limit, mean_velocity, friction, shrinkage, learn_ground, adapt, options, first, log.

    Raises:
        TypeError: for an unknown setting, or an argument of the wrong kind.
        ValueError: for a setting out of range, a reference of the wrong shape or of another robot, a first plan with
            another robot, horizon, length of the knots or kind of velocities, or a plan that takes longer than its
            period.
    """

    def __init__(
        self, problem: Problem, iterations: int = 1, *, reference: Any = None, plan: Plan | None = None, **settings: Any
    ) -> None:
        iterations = whole_number("MPC(iterations=...)", iterations)
        if not isinstance(problem, Problem):
            raise TypeError(f"MPC(problem): expected a Problem, got {problem!r}")
        checks.keywords("MPC(...)", settings, MPCSettings.__dataclass_fields__)
        self.settings = MPCSettings(**settings)
        self._again = partial(_another, problem, iterations, reference=reference, plan=plan, **settings)
        changed: dict[str, Any] = {} if self.settings.friction is None else {"friction": self.settings.friction}
        if self.settings.shrinkage:
            changed["mechanism"] = shrunk(problem.sim.mechanism, self.settings.shrinkage)
        self.nominal = problem.sim  # the simulator that plants are made from
        self.sim = AdjustableSimulator.like(problem.sim.replace(**changed))  # the model that plans are made with
        self.problem = problem.with_own_terms(self.sim)
        self.start = problem.start.copy()  # (nx,) where the problem starts, and a plant may
        self.period = float(self.settings.period or self.problem.knot_time)
        self._solver = Solver(self.problem, self.settings.planner(iterations), self.settings.steps(self.sim.nv))
        rescue = self.settings.rescue
        self._starts = None if rescue is None else Starts(self._solver, rescue)
        self.references = References(self.problem, reference)
        if self.settings.computation > self.period + _ROUNDING:
            raise ValueError(
                f"MPC(computation=...): expected at most the period between plans, {self.period:g} s, got "
                f"{self.settings.computation:g} s"
            )
        self._delay = Delay(self.sim, self.settings.delay)
        self._predict = Prediction(self.sim, self.settings.computation)
        servo = self.settings.servo
        self._actuator = ModelServo(self.sim, servo) if isinstance(servo, Mechanism) else None
        self._servo = None if servo is None or isinstance(servo, Mechanism) else Servo(self.sim, servo)
        terms = (t for t in self.problem.costs if isinstance(t, StateTerm) and t.knots[0] == 0)
        self._tracking = next(terms, None)  # whose error is logged
        if plan is not None and not isinstance(plan, Plan):
            raise TypeError(f"MPC(plan=...): expected a Plan, got {checks.shown(plan)}")
        if plan is not None:
            _check_plan(problem, plan)
        self._first = plan
        self._ground = Ground(self.sim, self.settings.kappa if self.settings.learn_ground == "slope" else None)
        self.estimator: ParameterEstimator | None = None  # of the parameters that `adapt` names
        if self.settings.adapt is not None:
            most = np.inf if self.settings.friction is None else self.settings.friction
            self.estimator = ParameterEstimator(self.nominal, self.sim, self.settings.adapt, most)
            _check_points(self.problem, self.estimator.space.labels)
        shear = 0.0 if self.settings.adapt is None else self.settings.adapt.shear
        self._shear = FootShear(self.sim, shear) if shear else None
        self.reset()

    def __reduce__(self) -> Any:
        return self._again, ()

    def fresh(self) -> MPC:
        """A controller made from the same arguments, without plan, measurements and log, for another robot.

        Returns:
            The new controller.
        """
        return self._again()

    def monte_carlo(self, plant: Plant, sampler: Sampler, duration: float, **settings: Any) -> MonteCarlo:
        """Run closed loops under random perturbations, see `dojo.monte_carlo`.

        Args:
            plant: the plant; each run perturbs a copy of it.
            sampler: generator -> Perturbation, such as `dojo.Disturbances`.
            duration: length of each run [s].
            **settings: further arguments of `dojo.monte_carlo`: runs, seed, executor, control_step, components.

        Returns:
            All runs, in the order of their numbers.

        Raises:
            TypeError: for an argument of the wrong kind, or a sampler that returns no Perturbation.
            ValueError: for a number out of range.
            Interrupted: after Ctrl-C, a KeyboardInterrupt; its `result` is the MonteCarlo of the finished runs.
        """
        return monte_carlo(self, plant, sampler, duration, **settings)

    def reset(self) -> None:
        """Forget plan, measurements and log, and where references were anchored."""
        self.references.reset()
        self.log: list[Tick] = []
        self._fallbacks = 0  # ticks in a row without a new plan
        self.policy: Policy | None = None  # in force
        self._next: Policy | None = None  # made, and not yet in force
        self._measured = Measurement(self.sim, self.settings.mean_velocity)
        self._delay.forget(self.problem.controls0[0])
        self._due = -np.inf
        self.problem.start = self.start.copy()
        self._ground.forget()
        if self.estimator is not None:
            self.estimator.forget()
        if self._shear is not None:
            self._shear.forget()
        if self._starts is not None:
            self._starts.forget()
        self._solver.reset()

    def __call__(self, time: float, x: ArrayLike) -> Vector:
        """The input for a measured state.

        Args:
            time: time of the measurement [s], not before that of the last plan.
            x: (nx,) measured state.

        Returns:
            (nu,) input [N, N m], of servos in the model the forces of their actuators; with a `delay`, that for time +
            delay.

        Raises:
            ValueError: for a time before the last plan or 100,000 knots after it, or a state of the wrong shape or with
                numbers that are not finite.
            SimulationError: the model cannot predict the first plan's start, over the delay; later such ticks keep the
                previous plan, with that status in the log.
        """
        now = checks.number("MPC(time)", time)
        last = self.log[-1].time if self.log else now
        if now < last:
            raise ValueError(f"MPC(time): expected a time after {last:g} s, got {now:g} s; call reset() to start again")
        if now > last + _LATEST * self.problem.knot_time:
            late = f"expected at most {_LATEST:,} knots after {last:g} s"
            raise ValueError(f"MPC(time): {late}, got {now:g} s; call reset() to start again")
        measured = checks.array("MPC(x)", x, (self.sim.nx,))
        self._measured.add(now, measured)
        if self._next is not None and now >= self._next.time - _ROUNDING:
            self.policy, self._next = self._next, None
        if self.policy is None:
            self._begin(now)
        elif now >= self._due - _ROUNDING:
            self._tick(now, self.policy)
        u = self._command(now, self._measured.state, measured)
        if self._shear is not None and self.estimator is not None:
            u = self._limited(u + self._shear(now, measured, self._ground, self.estimator.knows_friction))
        self._delay.issue(now, u)
        if self.estimator is not None:
            self.estimator.observe(now, measured, self._delay.acting(now, u), self._ground)
        return u if self._actuator is None else self._actuator(u, measured)

    def _command(self, now: float, state: Callable[[], Vector], sample: Vector) -> Vector:
        """The planned input, with feedback unless that is switched off.

        state: () -> (nx,) measured state in the model's convention, which only gains ask for; sample: as measured.
        """
        policy, settings = self.policy, self.settings
        assert policy is not None
        u = policy.control(now + settings.delay) if settings.feedforward else np.zeros(self.sim.nu)
        scale = 1.0 if self.log and self.log[-1].fallback else settings.gain_scale
        if self._servo is not None:
            u += self._servo(policy, now, sample)
        elif scale > 0.0:
            u += scale * policy.feedback(now, state())
        return self._limited(u)

    def _limited(self, u: Vector) -> Vector:
        """The input within its limits, in place."""
        limits = self.problem.control_limits
        if limits is not None:
            np.clip(u, *limits, out=u)
        return u

    def _ahead(self, now: float) -> Vector:
        """State (nx,) of the model when the plan that begins now takes effect."""
        if self.settings.computation and self.policy is not None:
            return self._predict(now, self._measured, lambda time, x: self._command(time, lambda: x, x))
        return self._delay.ahead(now, self._measured)

    @property
    def _later(self) -> float:
        """Time from a measurement to the plan made from it [s]."""
        settings = self.settings
        return settings.delay if self.policy is None else settings.delay + settings.computation

    def _begin(self, now: float) -> None:
        """The first plan."""
        begin = clock.perf_counter(), clock.thread_time()
        self._due = now + self.period
        self.problem.start = self._delay.ahead(now, self._measured)
        self.references.move(now + self.settings.delay, x=self.problem.start)
        plan = self._first or Solver(self.problem, self.settings.first).solve()
        self._solver.reset(plan.multipliers)
        self.policy = self._policy(now, plan.x, plan.u, plan.K)
        self._next = None
        fallback = not np.isfinite(plan.fun) or plan.status == Status.SIMULATION_FAILED
        self._record(now, begin, plan.status, fallback, plan.nit, plan.fun, 1.0, plan.x[0])
        if np.isfinite(plan.x).all():
            self._rehearse(now, plan)

    def _rehearse(self, now: float, plan: Plan) -> None:
        """A tick right after the first plan, with what only some ticks do, whose results are thrown away.

        It takes its time now, so that no later tick compiles, loads or lays out anything.
        """
        policy, start, log, fallbacks = self.policy, self.problem.start, self.log.copy(), self._fallbacks
        assert policy is not None
        try:
            self._tick(now, policy)
            self._rolled(Iterate(policy.x, policy.u), policy.K)
            tail(policy, self.references, 1)
            self._delay.rehearse(start)
            self._predict.rehearse(start)
            if self.estimator is not None:
                self.estimator.rehearse(start)
            if self._starts is not None:
                self._starts.best(policy.x, policy.u, policy.K)
                self._starts.forget()
        finally:
            self._ground.forget()
            self._solver.reset(plan.multipliers)
            self.policy, self._next, self.problem.start, self.log[:] = policy, None, start, log
            self._fallbacks = fallbacks

    def _tick(self, now: float, old: Policy) -> None:
        """Shift, iterate, and take the new plan when it is one."""
        begin = clock.perf_counter(), clock.thread_time()
        solver, problem = self._solver, self.problem
        self._due = now + self.period
        try:
            start = solver.states("MPC(x)", self._ahead(now))
        except SimulationError:
            self._record(now, begin, Status.SIMULATION_FAILED, True, 0, self.log[-1].cost, 1.0, problem.start)
            return
        if self.settings.learn_ground:
            self._ground.learn(old, now, self._measured.last[1], self._measured.first)
        self.references.move(now + self._later, self._ground.plane, start)
        shifted = old.shifted(now + self._later, lambda count: tail(old, self.references, count))
        problem.start = start
        shift_multipliers(problem.constraints, (now - self.log[-1].time) / problem.knot_time)
        if self._starts is not None:
            self._starts.begin(begin[0] + self.settings.time_limit)
        guess = self._guess(shifted)
        if guess is None and self._starts is not None:
            guess = self._starts.best(shifted.x, shifted.u, shifted.K)
        if guess is None:
            self._record(now, begin, Status.SIMULATION_FAILED, True, 0, self.log[-1].cost, 1.0, shifted.x[0])
            return
        result = solver.iterate(guess, shifted.K, began=begin[0])
        after = result.now if self._usable(result, guess) else None
        result, after = self._rescued(shifted, result, after, begin[0])
        if after is not None and after.gap == 0.0:  # the violations of an inconsistent trajectory say little
            solver.update_multipliers(after)
        taken = after is not None
        if after is None and (result.success or result.status == Status.LINE_SEARCH):
            after = self._rolled(guess, result.K)
        if after is not None:
            made = self._policy(now, after.x, after.u, result.K.copy())
            if self.settings.computation:
                self._next = made
            else:
                self.policy = made
        cost = self.log[-1].cost if after is None else after.cost
        iterations = len(result.history)
        self._record(now, begin, result.status, not taken, iterations, cost, result.alpha, shifted.x[0])

    def _rescued(
        self, shifted: Policy, result: Iteration, after: Iterate | None, began: float
    ) -> tuple[Iteration, Iterate | None]:
        """The result of a tick and its trajectory, or those from another start where these are none, or worse.

        A start from which no plan follows is one itself: it is a rollout.
        """
        if self._starts is None or not (after is None or self._starts.always) or result.status == Status.TIME_LIMIT:
            return result, after
        start = self._starts.best(shifted.x, shifted.u, shifted.K)
        if start is None or (after is not None and start.merit >= after.merit):
            return result, after
        before = list(result.history)
        if not self._starts.exhausted:
            other = self._solver.iterate(start, shifted.K, began=began)
            before += other.history
            if self._usable(other, start):
                return other._replace(history=before), other.now
        return result._replace(status=Status.LINE_SEARCH, now=start, K=shifted.K, history=before), start

    def _rolled(self, guess: Iterate, K: Stack) -> Iterate | None:
        """After a rejected step: the rollout of the shifted plan under its gains, None when it is nowhere near it."""
        there = self._solver.rollout(guess, K)
        return there if there is not None and _near(there, guess) else None

    def _policy(self, now: float, x: Matrix, u: Matrix, K: Stack) -> Policy:
        """A plan made at `now`, which starts when its first input can act."""
        lead = (now, self._measured.state()) if self.settings.delay else None
        return Policy(self.sim, now + self._later, x, u, K, self.problem.substeps, lead)

    def _usable(self, result: Iteration, guess: Iterate) -> bool:
        """Whether the result is a trajectory of the model, up to the gaps that a short step leaves open.

        Without an accepted step it is a rollout of the guess, which may have fallen.
        """
        ended = result.success or result.status in (Status.LINE_SEARCH, Status.TIME_LIMIT)
        stepped = any(record["alpha"] > 0.0 for record in result.history)
        near = stepped or _near(result.now, guess)
        return ended and bool(np.isfinite(result.now.merit)) and result.consistent and near

    def _guess(self, shifted: Policy) -> Iterate | None:
        """First trajectory of a tick: the shifted plan, or the best rollout under its gains or a share of them.

        A plan that has been in force for `patience` ticks is no guess of states any more.
        """
        solver, patience = self._solver, self.settings.patience
        stalled = patience is not None and self._fallbacks >= patience
        if self.settings.guess == "states" and not stalled:
            xs = shifted.x.copy()
            xs[0] = self.problem.start
            return solver.guess(xs, shifted.u)
        scales = (0.0,) if self.settings.guess == "open loop" else SCALES
        nominal = Iterate(shifted.x, shifted.u)
        shots = (solver.rollout(nominal, scale * shifted.K) for scale in scales)
        return min((shot for shot in shots if shot is not None), key=lambda shot: shot.merit, default=None)

    def _record(
        self,
        now: float,
        begin: tuple[float, float],
        status: Status,
        fallback: bool,
        iterations: int,
        cost: float,
        alpha: float,
        expected: Vector,
    ) -> None:
        """Add to the log; expected: (nx,) where the plan before expected the start of this one."""
        x, first = self.problem.start, not self.log
        others = [expected] if self._tracking is None else [expected, self._tracking.reference[0]]
        off = self.sim.difference(x, np.stack(others))
        contacts = self._ground.touching(self._measured.last[1])
        ms, cpu = 1e3 * (clock.perf_counter() - begin[0]), 1e3 * (clock.thread_time() - begin[1])
        gap, error = float(np.abs(off[0]).max()), off[1:, : self.sim.nv].ravel()
        self._fallbacks = self._fallbacks + 1 if fallback else 0
        self.log.append(
            Tick(now, ms, cpu, iterations, float(cost), alpha, gap, status, fallback, contacts, error, x, first)
        )
        if self.settings.log is not None:
            del self.log[: -self.settings.log]


def _near(there: Iterate, guess: Iterate) -> bool:
    """Whether a rollout is still near the guess that it began from."""
    return there.merit - guess.merit <= (_LOST - 1.0) * abs(guess.merit)


def _another(problem: Problem, iterations: int, *, reference: Any, **arguments: Any) -> MPC:
    """A controller whose reference is its own."""
    return MPC(problem, iterations, reference=own_reference(reference), **arguments)


def _check_plan(problem: Problem, plan: Plan) -> None:
    """Refuse a first plan that is not one of the problem: its knots are taken for those of the problem."""
    call = "MPC(plan=...)"
    check_same_robot(f"{call}: expected a plan", problem.sim, plan.simulator, plan.x, plan.u.shape[1])
    shape = (problem.horizon, problem.sim.nu)
    if plan.u.shape != shape:
        raise ValueError(f"{call}: expected inputs of shape {shape}, got {plan.u.shape}")
    check_same_knots(call, plan, problem.knot_time, "the problem")
    check_same_velocities(call, problem.sim, plan.simulator)


def _check_points(problem: Problem, labels: Sequence[str]) -> None:
    """Refuse centres of mass that would move away from points of terms, which are measured from them."""
    moving = {label.partition(":")[2].partition("[")[0]: label for label in labels if label.startswith("com:")}
    for term in (*problem.costs, *problem.constraints):
        body = None if term.point_body is None else problem.sim.mechanism.body_names[term.point_body]
        if body in moving:
            raise ValueError(
                f"MPC(adapt=...): {moving[body]!r} moves the centre of mass from which a {term.name} measures its place"
            )
