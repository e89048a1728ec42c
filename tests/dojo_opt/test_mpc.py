"""MPC: ticks, ticks that fail, and the hop in closed loop."""

import pickle

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.mpc.settings import MPCSettings
from dojo_opt.planning.iterate import Iterate
from dojo_opt.planning.options import Options
from dojo_opt.plant.tick import milliseconds
from sim.model.record_columns import StepReport
from sim.simulator.adjustable_simulator import AdjustableSimulator
from sim.simulator.engines.dividing_engine import DividingEngine
from sim.simulator.engines.engine import Engine
from sim.simulator.engines.linked_model import LinkedModel
from solvers.compiler import compiled, local_kernel
from solvers.compiler.kernels import Kernel
from solvers.status import Status
from support.standing_hopper import HOPPER, standing_problem


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"guess": "rollout"}, "guess"),
        ({"kappa": 0.0}, "kappa"),
        ({"delay": -0.1}, "delay"),
        ({"period": 0.0}, "period"),
        ({"gain_scale": float("nan")}, "gain_scale"),
        ({"friction": -0.1}, "friction"),
        ({"patience": 0}, "patience"),
        ({"step_limit": 0.0}, "step_limit"),
        ({"step_limit": [0.1, float("nan")]}, "step_limit"),
    ],
)
def test_settings_are_checked(settings, message):
    with pytest.raises(ValueError, match=message):
        MPCSettings(**settings)


def test_calls_are_checked():
    mpc = dojo.MPC(standing_problem())
    with pytest.raises(ValueError, match=r"MPC\(x\): expected shape \(15,\)"):
        mpc(0.0, np.zeros(3))
    with pytest.raises(ValueError, match=r"MPC\(time\)"):
        mpc(np.nan, HOPPER.neutral())
    with pytest.raises(ValueError, match="whole number"):
        dojo.MPC(standing_problem(), iterations=0)
    with pytest.raises(ValueError, match=r"step_limit.*\(7,\), got \(2,\)"):
        dojo.MPC(standing_problem(), step_limit=[0.1, 0.1])


def test_plans_once_per_period_and_one_iteration_each():
    mpc = dojo.MPC(standing_problem())
    plant = dojo.Plant(HOPPER.replace(time_step=0.01, kappa=1e-8))
    loop = dojo.closed_loop(mpc, plant, 0.5)
    assert loop.survived
    np.testing.assert_allclose([t.time for t in mpc.log], 0.05 * np.arange(10), atol=1e-9)
    assert mpc.log[0].first and not any(t.first for t in mpc.log[1:])
    assert all(t.iterations <= 1 for t in mpc.log[1:])
    assert milliseconds(mpc.log).shape == (9,)
    assert all(t.contacts == ("foot",) for t in mpc.log)
    assert mpc.log[3].error.shape == (7,)
    assert np.abs(loop.x[-1, :8] - HOPPER.neutral()[:8]).max() < 5e-3


@pytest.mark.parametrize(("patience", "begun"), [(None, [0, 0, 0, 0, 0]), (2, [0, 0, 3, 3, 3])])
def test_stalled_ticks_begin_with_rollouts_after_the_patience(monkeypatch, patience, begun):
    """From the measured state, without gaps: the states of an old plan are far from it by then. The first plan counts
    as a new one; rollouts under the gains, half of them, and none are compared.
    """
    mpc = dojo.MPC(standing_problem(), patience=patience, log=1)  # a log that is shorter than the patience
    x = HOPPER.neutral()
    mpc(0.0, x)
    rollouts, closed = [], []
    roll, iterate = mpc._solver.rollout, mpc._solver.iterate

    def watched(guess, K, **given):
        closed.append(guess.gaps is None and guess.kappa is not None)
        return iterate(guess, K, **given)

    monkeypatch.setattr(mpc._solver, "iterate", watched)
    monkeypatch.setattr(mpc._solver, "rollout", lambda *given: (rollouts.append(1), roll(*given))[1])
    monkeypatch.setattr(mpc, "_usable", lambda result, guess: False)
    monkeypatch.setattr(mpc, "_rolled", lambda guess, K: None)
    counts = []
    for tick in range(1, 6):
        del rollouts[:]
        mpc(tick * mpc.period, x)
        counts.append(len(rollouts))
        assert mpc.log[-1].fallback
    assert counts == begun
    assert closed == [count > 0 for count in begun]


def test_runs_are_the_same_again_and_after_pickling():
    mpc = dojo.MPC(standing_problem(), period=0.025)
    plant = dojo.Plant(HOPPER.replace(time_step=0.005, kappa=1e-8), offset=0.1 * np.eye(14)[7], noise=1e-4, seed=3)
    first = dojo.closed_loop(mpc, plant, 0.3)
    again = dojo.closed_loop(mpc, plant, 0.3)
    np.testing.assert_array_equal(first.x, again.x)
    fresh = dojo.closed_loop(mpc.fresh(), plant, 0.3)
    np.testing.assert_array_equal(first.x, fresh.x)
    copied = dojo.closed_loop(pickle.loads(pickle.dumps(mpc)), plant, 0.3)
    np.testing.assert_array_equal(first.x, copied.x)


def test_problems_with_compiled_residuals_can_be_sent_to_other_processes():
    def height(x, u, out):
        out[0] = x[2] * u[2]

    problem = standing_problem()
    terms = [*problem.specs[0], dojo.cost.ResidualCost(local_kernel(height), 1)]
    problem = dojo.Problem(HOPPER, problem.start, 8, cost=terms, controls0=problem.controls0)
    xs = np.tile(problem.start, (9, 1))
    copied = pickle.loads(pickle.dumps(problem))
    assert copied.cost(xs, copied.controls0) == problem.cost(xs, problem.controls0) > 100.0
    assert copied.costs[0].reference is not problem.costs[0].reference


def test_the_log_keeps_the_last_ticks_and_a_loop_all_of_its_own():
    assert MPCSettings().log == 10_000
    mpc = dojo.MPC(standing_problem(), log=4)
    loop = dojo.closed_loop(mpc, dojo.Plant(HOPPER.replace(time_step=0.01, kappa=1e-8)), 0.5)
    assert [tick.time for tick in mpc.log] == [tick.time for tick in loop.log[-4:]]
    assert len(mpc.log) == 4 and len(loop.log) == 10 and loop.log[0].first
    everything = dojo.MPC(standing_problem(), log=None)
    dojo.closed_loop(everything, dojo.Plant(HOPPER.replace(time_step=0.01, kappa=1e-8)), 0.5)
    assert len(everything.log) == 10
    with pytest.raises(ValueError, match=r"MPC\(log=...\): expected a whole number"):
        MPCSettings(log=0)


def test_a_tick_without_time_keeps_the_old_plan():
    mpc = dojo.MPC(standing_problem(), time_limit=1e-9)
    x = HOPPER.neutral()
    mpc(0.0, x)
    before = mpc.policy
    u = mpc(0.05, HOPPER.integrate(x, 1e-3 * np.ones(14)))
    assert mpc.log[-1].fallback and mpc.log[-1].status == Status.TIME_LIMIT
    assert mpc.policy is before
    measured = mpc.log[-1].x
    np.testing.assert_allclose(u, before.control(0.05) + before.feedback(0.05, measured), rtol=1e-12)


def test_a_model_that_cannot_be_solved_keeps_the_old_plan():
    mpc = dojo.MPC(standing_problem(), mean_velocity=False)
    x = HOPPER.neutral()
    mpc(0.0, x)
    before = mpc.policy
    wild = x.copy()
    wild[11:14] = [300.0, 0.0, 0.0]  # more than half a turn per step
    u = mpc(0.05, wild)
    assert mpc.log[-1].fallback
    assert mpc.policy is before
    assert np.isfinite(u).all()


def test_a_rejected_step_keeps_the_old_plan():
    """No step is short enough and no decrease large enough, and the gains do not lead back to the plan either."""
    mpc = dojo.MPC(
        standing_problem(), options=Options(halvings=0, armijo=1e9, max_increase_ratio=0.0, penalty_growth=1.0)
    )
    x = HOPPER.neutral()
    mpc(0.0, x)
    before = mpc.policy
    mpc(0.05, HOPPER.integrate(x, 0.05 * np.eye(14)[0]))
    assert mpc.log[-1].fallback and mpc.log[-1].alpha == 0.0
    assert mpc.policy is before


def test_a_rejected_step_near_the_plan_rolls_it_out_with_its_gains():
    mpc = dojo.MPC(
        standing_problem(), options=Options(halvings=0, armijo=1e9, max_increase_ratio=0.0, penalty_growth=1.0)
    )
    x = HOPPER.neutral()
    mpc(0.0, x)
    before = mpc.policy
    mpc(0.05, HOPPER.integrate(x, 1e-4 * np.eye(14)[0]))
    assert mpc.log[-1].fallback and mpc.log[-1].alpha == 0.0
    now = mpc.policy
    assert now is not before and now.time == 0.05
    np.testing.assert_array_equal(now.x[0], mpc.log[-1].x)
    again = HOPPER.rollout_feedback(now.x[0], now.u, kappa=mpc.settings.kappa).x
    np.testing.assert_allclose(again, now.x, rtol=1e-6, atol=1e-6)


def test_first_plan_can_be_given_and_has_to_fit():
    problem = standing_problem()
    plan = dojo.ilqr(problem)
    mpc = dojo.MPC(problem, plan=plan)
    mpc(0.0, problem.start)
    np.testing.assert_array_equal(mpc.policy.u, plan.u)
    with pytest.raises(ValueError, match=r"MPC\(plan=...\): expected inputs of shape \(5, 3\), got \(8, 3\)"):
        dojo.MPC(standing_problem(horizon=5), plan=plan)
    with pytest.raises(TypeError, match=r"MPC\(plan=...\): expected a Plan"):
        dojo.MPC(problem, plan="a")


def test_limits_hold_for_feedback_too():
    mpc = dojo.MPC(standing_problem(control_limits=([-1.0, -1.0, 0.0], [1.0, 1.0, 45.0])))
    x = HOPPER.neutral()
    mpc(0.0, x)
    far = HOPPER.integrate(x, np.concatenate([[0, 0, -0.1, 0.3, 0.3, 0], np.zeros(8)]))
    u = mpc(0.01, far)
    assert np.all(np.abs(u[:2]) <= 1.0) and 0.0 <= u[2] <= 45.0
    assert np.any(np.abs(u[:2]) == 1.0) or u[2] in (0.0, 45.0)


def test_constraints_hold_in_closed_loop():
    """The leg lifts the body by 5 cm: with 100 N at once, or with the 45 N that a constraint allows."""
    start = HOPPER.neutral()
    raised = start.copy()
    raised[[2, 7]] += 0.05
    hold = np.array([0.0, 0.0, 9.81 * 4.18])
    tracking = dojo.cost.Tracking(raised, np.r_[10.0 * np.ones(7), 0.01 * np.ones(7)])
    largest = []
    for constraints in ([], [dojo.constraint.ControlBounds(-np.inf, 45.0, components=[2])]):
        costs = [tracking, dojo.cost.Effort(1e-6, reference=hold)]
        problem = dojo.Problem(HOPPER, start, 8, cost=costs, constraints=constraints, controls0=hold)
        mpc = dojo.MPC(problem, iterations=3, gain_scale=0.0)
        loop = dojo.closed_loop(mpc, dojo.Plant(HOPPER.replace(time_step=5e-3, kappa=1e-8)), 1.0)
        assert loop.x[-1, 2] == pytest.approx(0.6, abs=2e-3)
        largest.append(loop.u[:, 2].max())
    assert largest[0] > 90.0 and largest[1] < 50.0  # the penalty of a tick is not the last word


@pytest.mark.parametrize(
    "settings",
    [
        {"rescue": dojo.Rescue(splines=1), "patience": 1, "kappa_grad": 1e-3},
        {"computation": 0.02, "servo": (1.0, 0.1), "learn_ground": True},
        {"delay": 0.02, "guess": "feedback", "step_limit": 0.01},
        {"adapt": dojo.Adaptation(["friction:*"], shear=0.2), "learn_ground": True, "friction": 0.5},
    ],
)
def test_no_tick_loads_code(monkeypatch, settings):
    """Every kernel that a tick calls, with these types, and every link that it needs, was there after the first plan.

    Not even where steps of a prediction are divided, the line search fails, or a foot slides.
    """
    used = set()
    call, linked, steps, failed = Kernel.__call__, LinkedModel.linked, Engine.take_steps, iter(range(10_000))

    def called(self, *args):
        used.add((self.__qualname__, tuple(map(self.entry.typeof_pyval, args))))
        return call(self, *args)

    def needed(self, *given):
        used.update(given)
        return linked(self, *given)

    def refused(self, model, motion, *given):
        if type(self) is DividingEngine and next(failed) % 5 == 4:
            motion.reports[0, StepReport.STATUS] = Status.MAX_ITERATIONS
            return 0
        return steps(self, model, motion, *given)

    monkeypatch.setattr(Kernel, "__call__", called)
    monkeypatch.setattr(LinkedModel, "linked", needed)
    monkeypatch.setattr(Engine, "take_steps", refused)
    mpc = dojo.MPC(standing_problem(constraints=[dojo.constraint.ControlBounds(-1.0, 60.0)]), **settings)
    mpc(0.0, HOPPER.neutral())
    before, count, log = used.copy(), len(compiled(users=True)), len(mpc.log)
    random = np.random.default_rng(0)
    for tick in range(1, 40):
        mpc(0.01 * tick, HOPPER.integrate(HOPPER.neutral(), 0.02 * random.standard_normal(HOPPER.ndx)))
    assert len(mpc.log) == 8 and log == 1
    assert (next(failed) > 10) == bool(settings.keys() & {"computation", "delay", "adapt"})  # plans refuse such steps
    assert used == before and len(compiled(users=True)) == count


def test_a_tick_rolls_nothing_out_within_its_step_limit():
    """Where all steps are longer than the limit, ticks are those without one."""
    inputs, rolled = [], []
    for limit in (None, 1e-12, np.inf):
        mpc = dojo.MPC(standing_problem(), step_limit=limit)
        mpc(0.0, HOPPER.neutral())
        before = mpc._solver.step_iterations
        pushed = HOPPER.integrate(HOPPER.neutral(), 0.01 * np.eye(14)[7])
        inputs.append([mpc(0.05 * tick, pushed) for tick in range(1, 4)])
        rolled.append(mpc._solver.step_iterations - before)
        assert not any(t.fallback for t in mpc.log)
    np.testing.assert_array_equal(inputs[1], inputs[0])
    assert rolled[0] == rolled[1] > 0 == rolled[2]
    np.testing.assert_allclose(inputs[2], inputs[0], atol=2.0)  # of 41 N: a step of another length, from the same gains


@pytest.mark.parametrize("guess", ["states", "feedback", "open loop"])
def test_every_guess_keeps_the_hopper_standing(guess):
    mpc = dojo.MPC(standing_problem(), guess=guess)
    plant = dojo.Plant(HOPPER.replace(time_step=0.005, kappa=1e-8), offset=0.05 * np.eye(14)[7])
    assert dojo.closed_loop(mpc, plant, 0.4).survived


@pytest.mark.slow
def test_hopper_hops_and_survives_a_payload_that_the_open_loop_guess_does_not():
    """Planning facts, section 2.6: the initial guess of a tick decides."""
    mpc = dojo.tasks.hopper_mpc()
    loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, payload=2.35), 2.0)
    assert loop.survived, loop.message
    assert loop.rms((0, 1, 2)) < 0.08
    foot = mpc.sim.maximal(loop.x)[:, 1, 2] - 0.05
    assert foot.max() > 0.1, "it does not hop"
    control = dojo.tasks.hopper_mpc(guess="open loop")
    assert not dojo.closed_loop(control, dojo.tasks.plant(control, 2e-3, payload=2.35), 2.0).survived


def test_a_tick_whose_plan_is_rejected_starts_again_from_the_best_rollout(monkeypatch):
    """Of the old plan under its gains, half of them and none, and of its inputs with splines; else it stays in force."""
    mpc = dojo.MPC(standing_problem(), rescue=dojo.Rescue(splines=2, spread=1.0))
    x = HOPPER.neutral()
    mpc(0.0, x)
    rollouts, begun = [], []
    roll, iterate = mpc._solver.rollout, mpc._solver.iterate

    def rolled(*given):
        rollouts.append(roll(*given))
        return rollouts[-1]

    def iterated(now, K, **given):
        begun.append(now)
        return iterate(now, K, **given)

    monkeypatch.setattr(mpc._solver, "rollout", rolled)
    monkeypatch.setattr(mpc._solver, "iterate", iterated)
    monkeypatch.setattr(mpc, "_usable", lambda result, guess: any(guess is shot for shot in rollouts))
    moved = HOPPER.integrate(x, 1e-3 * np.eye(14)[0])
    mpc(0.05, moved)
    assert len(rollouts) == 5 and len(begun) == 2 and mpc.log[-1].iterations == 2
    assert begun[1].merit == min(shot.merit for shot in rollouts)
    assert len({shot.merit for shot in rollouts[2:]}) == 3
    assert not mpc.log[-1].fallback and mpc.log[-1].cost <= begun[1].cost
    np.testing.assert_array_equal(mpc.policy.x[0], mpc.log[-1].x)
    del rollouts[:], begun[:]
    monkeypatch.setattr(mpc, "_usable", lambda result, guess: True)
    mpc(0.1, moved)
    assert not rollouts and len(begun) == 1


@pytest.mark.parametrize(("iterations", "tried", "begun"), [(1, 1, 1), (10_000, 5, 2)])
def test_a_rescue_ends_with_its_iterations(monkeypatch, iterations, tried, begun):
    """The best start so far is then the plan as it is: it begins where the robot is, and has no gaps."""
    mpc = dojo.MPC(standing_problem(), rescue=dojo.Rescue(splines=2, iterations=iterations))
    x = HOPPER.neutral()
    mpc(0.0, x)
    shots, closed, counts = [], [], []
    roll, iterate = mpc._solver.rollout, mpc._solver.iterate
    monkeypatch.setattr(mpc._solver, "rollout", lambda *given: (shots.append(roll(*given)), shots[-1])[1])
    monkeypatch.setattr(mpc._solver, "iterate", lambda *a, **b: (closed.append(iterate(*a, **b)), closed[-1])[1])
    monkeypatch.setattr(mpc, "_usable", lambda result, guess: any(guess is shot for shot in shots))
    for tick in (1, 2):  # every tick has as many
        before = mpc._solver.step_iterations
        mpc(0.05 * tick, HOPPER.integrate(x, 1e-3 * np.eye(14)[tick]))
        counts.append((len(shots), len(closed)))
        assert mpc._solver.step_iterations > before and not mpc.log[-1].fallback
    assert counts == [(tried, begun), (2 * tried, 2 * begun)]
    np.testing.assert_array_equal(mpc.policy.u, shots[-1].u if begun == 1 else closed[-1].now.u)


@pytest.mark.parametrize(("factor", "begun"), [(0.5, 2), (2.0, 1)])
def test_every_tick_takes_a_better_start_if_it_is_asked_to(monkeypatch, factor, begun):
    mpc = dojo.MPC(standing_problem(), rescue=dojo.Rescue(splines=0, always=True))
    x = HOPPER.neutral()
    mpc(0.0, x)
    starts, iterate = [], mpc._solver.iterate

    def iterated(now, K, **given):
        starts.append(iterate(now, K, **given))
        return starts[-1]

    def best(*old):
        start = mpc._solver.rollout(Iterate(*old[:2]), old[2])
        return start._replace(merit=factor * starts[0].now.merit)

    monkeypatch.setattr(mpc._solver, "iterate", iterated)
    monkeypatch.setattr(mpc._starts, "best", best)
    mpc(0.05, HOPPER.integrate(x, 1e-3 * np.eye(14)[0]))
    assert len(starts) == begun
    np.testing.assert_array_equal(mpc.policy.u, starts[-1].now.u)


def test_a_start_of_a_rescue_is_the_plan_where_none_follows_from_it(monkeypatch):
    """It is finite, and the log has no status of a failed plan; a tick without time has no rescue."""
    mpc = dojo.MPC(standing_problem(), rescue=dojo.Rescue(splines=0))
    x = HOPPER.neutral()
    mpc(0.0, x)
    shots, roll = [], mpc._solver.rollout

    def rolled(*given):
        shot = roll(*given)
        shots.append(shot if shots else shot._replace(merit=np.nan))
        return shots[-1]

    monkeypatch.setattr(mpc._solver, "rollout", rolled)
    monkeypatch.setattr(mpc, "_usable", lambda result, guess: False)
    mpc(0.05, HOPPER.integrate(x, 1e-3 * np.eye(14)[0]))
    assert len(shots) == 3 and (mpc.log[-1].status, mpc.log[-1].fallback) == (Status.LINE_SEARCH, False)
    best = min(shots[1:], key=lambda shot: shot.merit)
    np.testing.assert_array_equal(mpc.policy.u, best.u)
    late = dojo.MPC(standing_problem(), rescue=dojo.Rescue(), time_limit=1e-9)
    late(0.0, x)
    late(0.05, HOPPER.integrate(x, 1e-3 * np.eye(14)[0]))
    assert late.log[-1].fallback and late.log[-1].status == Status.TIME_LIMIT


def test_a_rescue_has_a_start_where_no_rollout_under_gains_reaches_the_end(monkeypatch):
    mpc = dojo.MPC(standing_problem(), guess="feedback", rescue=dojo.Rescue(splines=1))
    x = HOPPER.neutral()
    mpc(0.0, x)
    roll = mpc._solver.rollout
    monkeypatch.setattr(mpc._solver, "rollout", lambda start, gains, *few: roll(start, gains, *few) if few else None)
    mpc(0.05, HOPPER.integrate(x, 1e-3 * np.eye(14)[0]))
    assert not mpc.log[-1].fallback and mpc.log[-1].status != Status.SIMULATION_FAILED


def test_a_tick_whose_start_cannot_be_predicted_keeps_the_old_plan():
    mpc = dojo.MPC(standing_problem(), computation=0.02)
    x = HOPPER.neutral()
    mpc(0.0, x)
    before, fine = mpc.policy, mpc._predict._fine
    mpc._predict._fine = AdjustableSimulator.like(fine.replace(max_iterations=1, divide=False))
    mpc(0.05, HOPPER.integrate(x, 1e-2 * np.ones(14)))
    assert mpc.policy is before and mpc.log[-1].fallback and mpc.log[-1].status == Status.SIMULATION_FAILED
    mpc._predict._fine = fine
    mpc(0.1, x)
    assert not mpc.log[-1].fallback


def test_plans_find_bodies_thinner_by_the_shrinkage():
    """The larger of two balls, and no contact with the ground; plants keep their sizes."""
    task = dojo.tasks.idto.jaco_ball()
    planned, own = (sim.mechanism for sim in (task.mpc.sim, task.mpc.nominal))
    for thin, whole in zip(planned.collisions, own.collisions, strict=True):
        assert whole.shape_a.radius - thin.shape_a.radius == pytest.approx(task.mpc.settings.shrinkage)
        assert thin.shape_b == whole.shape_b
    assert [contact.radius for contact in planned.contacts] == [contact.radius for contact in own.contacts]
    with pytest.raises(ValueError, match=r"MPC\(shrinkage=...\): expected collisions of a sphere or a capsule thicker"):
        dojo.tasks.idto.jaco_ball(shrinkage=0.1)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"splines": -1}, r"Rescue\(splines=...\)"),
        ({"points": 1}, r"Rescue\(points=...\)"),
        ({"iterations": 0}, r"Rescue\(iterations=...\)"),
        ({"spread": -0.1}, r"Rescue\(spread=...\)"),
        ({"spread": [[0.1]]}, r"Rescue\(spread=...\)"),
    ],
)
def test_settings_of_a_rescue_are_checked(settings, message):
    with pytest.raises(ValueError, match=message):
        dojo.Rescue(**settings)
    with pytest.raises(ValueError, match=r"Rescue\(spread=...\): expected a number or \(3,\)"):
        dojo.MPC(standing_problem(), rescue=dojo.Rescue(spread=[0.1, 0.2]))
    with pytest.raises(TypeError, match=r"MPC\(rescue=...\)"):
        MPCSettings(rescue=3)
