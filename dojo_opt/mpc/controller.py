"""`MPC`: the planner in closed loop, one iteration per tick from the shifted plan."""

from __future__ import annotations

import time as clock
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from dojo_opt.line_search import Iterate
from dojo_opt.mpc.delay import Delay
from dojo_opt.mpc.ground import Ground
from dojo_opt.mpc.horizon import shift_multipliers, tail, with_own_terms
from dojo_opt.mpc.measurement import Measurement
from dojo_opt.mpc.moving import References
from dojo_opt.mpc.policy import Policy
from dojo_opt.mpc.tick import Settings, Tick
from dojo_opt.plan import Plan
from dojo_opt.planner import Solver
from dojo_opt.plant.plant import Plant
from dojo_opt.plant.study import Sampler, Study, monte_carlo
from dojo_opt.problem import Problem
from dojo_opt.term import StateTerm
from sim.mechanism import checks
from sim.mechanism.checks import whole_number
from solvers.status import Status

Vector = NDArray[np.float64]
Matrix = NDArray[np.float64]
Stack = NDArray[np.float64]

_SCALES = (1.0, 0.5, 0.0)  # of the gains of the rollouts that guess="feedback" chooses from
_LOST = 10.0  # times the merit of the shifted plan: a rollout worse than that has left it

__all__ = ["MPC"]


class MPC:
    """Model-predictive control: `u = mpc(time, x)`, called at any rate, plans anew once per `period`.

    problem     its simulator is the model; the plant may be another one. Its start and guess are those of the first
                plan only, which is solved to the end; its references are overwritten where `reference` is given.
    iterations  of the planner per tick. One is enough for costs, control limits and equalities; an inequality among the
                constraints is not seen by an iteration that starts on its good side, and takes about three
    reference   what to track over time, see `mpc.moving.References`; without it, the problem's own at every tick
    plan        the first plan, at the time of the first call; without it, that of `ilqr` without refinement
    settings    fields of `dojo_opt.mpc.tick.Settings` by name

    A tick shifts the plan by the time that has passed and keeps its states as the guess, the measured one in front: the
    disturbance then sits in the first gap, which the iteration closes. (A rollout of the shifted inputs, instead, falls
    over together with the robot.) A plan that the planner rejects is not used: the one before stays in force.
    `log` has one `Tick` per plan, of the last 10,000 or as many as the setting `log` says; None keeps all.
    """

    def __init__(
        self, problem: Problem, iterations: int = 1, *, reference: Any = None, plan: Plan | None = None, **settings: Any
    ) -> None:
        iterations = whole_number("MPC(iterations=...)", iterations)
        if not isinstance(problem, Problem):
            raise TypeError(f"MPC(problem): expected a Problem, got {problem!r}")
        checks.keywords("MPC(...)", settings, Settings.__dataclass_fields__)
        self.settings = Settings(**settings)
        self._again = partial(MPC, problem, iterations, reference=reference, plan=plan, **settings)
        friction = {} if self.settings.friction is None else {"friction": self.settings.friction}
        self.nominal = problem.sim  # what a plant is made from
        self.problem = with_own_terms(problem, **friction)
        self.sim = self.problem.sim  # what plans are made with
        self.start = problem.start.copy()  # (nx,) where the problem starts, and a plant may
        self.period = float(self.settings.period or self.problem.knot_time)
        self._solver = Solver(self.problem, self.settings.planner(iterations))
        self.references = References(self.problem, reference)
        self._delay = Delay(self.sim, self.settings.delay)
        terms = (t for t in self.problem.costs if isinstance(t, StateTerm) and t.knots[0] == 0)
        self._tracking = next(terms, None)  # whose error is logged
        self._first = plan
        self._ground = Ground(self.sim)
        self.reset()

    def __reduce__(self) -> Any:
        return self._again, ()

    def fresh(self) -> MPC:
        """Another one, made from the same arguments."""
        return self._again()

    def monte_carlo(self, plant: Plant, sampler: Sampler, duration: float, **settings: Any) -> Study:
        """Closed loops under random perturbations; see `dojo_opt.plant.study`."""
        return monte_carlo(self, plant, sampler, duration, **settings)

    def reset(self) -> None:
        """Forget plan, measurements and log."""
        self.log: list[Tick] = []
        self.policy: Policy | None = None
        self._measured = Measurement(self.sim, self.settings.mean_velocity)
        self._delay.forget(self.problem.controls0[0])
        self._due = -np.inf
        self.problem.start = self.start.copy()
        self._ground.forget()
        self._solver.descent.reset()
        self._solver.objective.reset()

    def __call__(self, time: float, x: ArrayLike) -> Vector:
        """Input (nu,) [N, N m] for the measured state x (nx,) at `time` [s]; with a `delay`, that for time + delay."""
        now = checks.number("MPC(time)", time)
        if self.log and now < self.log[-1].time:
            raise ValueError(f"MPC(time): time goes on, {now:g} s is before {self.log[-1].time:g} s; see reset()")
        measured = checks.array("MPC(x)", x, (self.sim.nx,))
        self._measured.add(now, measured)
        if self.policy is None:
            self._begin(now)
        elif now >= self._due - 1e-9:
            self._tick(now, self.policy)
        return self._command(now)

    def _command(self, now: float) -> Vector:
        """The planned input, with feedback unless it is switched off."""
        policy, settings = self.policy, self.settings
        assert policy is not None
        u = policy.control(now + settings.delay)
        scale = 1.0 if self.log[-1].fallback else settings.gain_scale
        if scale > 0.0:
            u += scale * policy.feedback(now, self._measured.state())
        limits = self.problem.control_limits
        if limits is not None:
            np.clip(u, *limits, out=u)
        self._delay.issue(now, u)
        return u

    def _begin(self, now: float) -> None:
        """The first plan."""
        begin = clock.perf_counter(), clock.thread_time()
        self._due = now + self.period
        self.references.move(now + self.settings.delay)
        self.problem.start = self._delay.ahead(now, self._measured)
        plan = self._first or Solver(self.problem).solve()
        shape = (self.problem.horizon, self.sim.nu)
        if plan.u.shape != shape:
            raise ValueError(f"MPC(plan=...): expected inputs of shape {shape}, got {plan.u.shape}")
        self._solver.objective.reset(plan.multipliers)
        self.policy = self._policy(now, plan.x, plan.u, plan.K)
        fallback = not np.isfinite(plan.fun) or plan.status == Status.SIMULATION_FAILED
        self._record(now, begin, plan.status, fallback, plan.nit, plan.fun, 1.0, plan.x[0])

    def _tick(self, now: float, old: Policy) -> None:
        """Shift, iterate, and take the new plan when it is one."""
        begin = clock.perf_counter(), clock.thread_time()
        solver, problem = self._solver, self.problem
        start = self._solver.horizon.states("MPC(x)", self._delay.ahead(now, self._measured))
        if self.settings.learn_ground:
            self._ground.learn(old, now, self._measured.last[1], self._measured.first)
        self._due = now + self.period
        self.references.move(now + self.settings.delay, self._ground.rise)
        shifted = old.shifted(now + self.settings.delay, lambda count: tail(old, self.references, count))
        problem.start = start
        continuation = solver.continuation
        continuation.reset()
        solver.descent.K[:] = shifted.K
        solver.descent.k.fill(0.0)
        shift_multipliers(problem.constraints, (now - self.log[-1].time) / problem.knot_time)
        guess, kappa = self._guess(shifted)
        if guess is None:
            status = Status.SIMULATION_FAILED
        else:
            continuation.start(guess, kappa)
            status = continuation.run(solver.options.stages[0])
        history = continuation.journal.records
        alpha = history[-1]["alpha"] if history else 1.0
        taken = status in (Status.SOLVED, Status.LINE_SEARCH, Status.TIME_LIMIT) and self._usable()
        rolled = not taken and status in (Status.SOLVED, Status.LINE_SEARCH) and self._roll()
        if taken or rolled:
            after = continuation.now
            if taken and after.gaps is None:  # what an inconsistent trajectory violates says little
                solver.objective.update_multipliers(after.x, after.u)
            self.policy = self._policy(now, after.x, after.u, solver.descent.K.copy())
        cost = continuation.now.cost if taken or rolled else self.log[-1].cost
        self._record(now, begin, status, not taken, len(history), cost, alpha, shifted.x[0])

    def _roll(self) -> bool:
        """After a rejected step: roll the shifted plan out with its gains; False when that leads nowhere near it."""
        continuation = self._solver.continuation
        before = continuation.now.merit
        return continuation.roll_with_gains(self.settings.kappa) and continuation.now.merit <= _LOST * before

    def _policy(self, now: float, x: Matrix, u: Matrix, K: Stack) -> Policy:
        """A plan made at `now`, which starts when its first input can act."""
        delay = self.settings.delay
        lead = (now, self._measured.state()) if delay else None
        return Policy(self.sim, now + delay, x, u, K, self.problem.substeps, lead)

    def _usable(self) -> bool:
        """Whether the present iterate is a trajectory of the model, up to what a short step leaves open."""
        now, history = self._solver.continuation.now, self._solver.continuation.journal.records
        moved = any(record["alpha"] > 0.0 for record in history)
        return bool(np.isfinite(now.merit)) and (moved or now.gaps is None)

    def _guess(self, shifted: Policy) -> tuple[Iterate | None, float | None]:
        """First iterate of a tick, and the smoothing at which its gaps are known to be closed."""
        solver, kappa = self._solver, self.settings.kappa
        if self.settings.guess == "states":
            xs = shifted.x.copy()
            xs[0] = self.problem.start
            return Iterate(xs, shifted.u, None, *solver.objective.evaluate(xs, shifted.u)), None
        scales = _SCALES if self.settings.guess == "feedback" else (0.0,)
        nominal = Iterate(shifted.x, shifted.u, None, np.inf, np.inf)
        best = None
        for scale in scales:
            shot = solver.line_search.roll(nominal, None, scale * shifted.K, 1.0, kappa)
            if shot.status == Status.SOLVED:
                trial = solver.line_search.accept(shot, None)
                if best is None or trial.merit < best.merit:
                    best = trial
        return best, kappa

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
        self.log.append(
            Tick(now, ms, cpu, iterations, float(cost), alpha, gap, status, fallback, contacts, error, x, first)
        )
        if self.settings.log is not None:
            del self.log[: -self.settings.log]
