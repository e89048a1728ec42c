"""Learning: gradients of rollouts under policies, algorithms that repeat to the bit, and policies as controllers."""

from __future__ import annotations

import io
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numba
import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.learn.action_delay import ActionDelay
from dojo_opt.learn.discounted_sum import DiscountedSum
from dojo_opt.learn.network import Adam, Network, perceptron
from dojo_opt.learn.observation_statistics import ObservationStatistics
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.policy_rollout import Noise
from dojo_opt.learn.randomization import Drawn, Models
from solvers.compiler import threads


def _task(steps=30, tolerance=1e-8):
    """A pendulum is to hang down, as far as the ground lets it, which its end touches."""
    rod = dojo.Body("rod", 1.0, (0.02, 0.02, 0.001))
    pivot = dojo.Joint("revolute", None, "rod", child_point=(0, 0, 0.25), axis=(0, 1, 0), damper=0.05, name="pivot")
    brush = dojo.Contact("rod", point=(0.0, 0.0, -0.25), height=-0.49, friction=0.3)
    mech = dojo.Mechanism([rod], [pivot], [brush], [dojo.Input("pivot")])
    sim = dojo.Simulator(mech, time_step=0.02, kappa=1e-3, tolerance=tolerance)

    def observation(x, out):
        out[0], out[1], out[2] = np.cos(x[0]), np.sin(x[0]), 0.2 * x[1]

    def reward(x, a, after):
        return -(after[0] ** 2) - 0.1 * after[1] ** 2 - 0.01 * a[0] ** 2

    def start(rng):
        return rng.uniform([0.3, -1.0], [0.9, 1.0])

    def terminated(x):
        return abs(x[1]) > 15.0

    low, high = np.array([-3.0]), np.array([4.0])
    return dojo.learn.Task(sim, 2, observation, 3, reward, low, high, start, terminated, steps=steps)


@pytest.fixture(scope="module")
def task():
    return _task()


def _policy(task, hidden=(5, 4), activation="elu"):
    rng = np.random.default_rng(5)
    network = Network((task.observations, *hidden, task.sim.nu), activation)
    return dojo.learn.LearnedPolicy(
        network, network.start(rng), 0.1 * rng.standard_normal(3), rng.uniform(0.5, 2, 3), task
    )


CLOSE = {"rtol": 2e-6, "atol": 2e-6}


@pytest.mark.parametrize(
    ("hidden", "activation", "delay"), [((5, 4), "elu", 0), ((6,), "tanh", 0), ((), "tanh", 0), ((6,), "tanh", 2)]
)
def test_gradients_of_returns_are_those_of_central_differences(hidden, activation, delay):
    """Differences of steps that end early are off by the root of their tolerance: steps of this task are exact."""
    task = _task(tolerance=1e-12)
    policy, rng = _policy(task, hidden, activation), np.random.default_rng(6)
    starts, weights = task.starts([rng] * 3), rng.uniform(0.5, 1.0, (6, 3))
    noise = Noise.draw(rng, task, (6, 3), 0.1, dojo.learn.Randomization(noise=0.02))
    seeds, drawn = rng.standard_normal((6, 3, task.sim.ndx)), replace(Drawn.of(task), delay=delay)

    def value(states):
        roll = dojo.learn.roll_policy_batch(policy, states, 6, drawn=drawn, noise=noise)
        ends = task.sim.difference(roll.after.reshape(18, -1), np.tile(task.sim.neutral(), (18, 1)))
        return float((weights * roll.rewards).sum() + (seeds.reshape(18, -1) * ends).sum())

    found = dojo.learn.roll_policy_batch(policy, starts, 6, drawn=drawn, noise=noise, slopes=True)
    found = found.gradient(weights, seeds)
    for i in range(0, policy.network.count, 3):
        kept, sides = policy.weights[i], []
        for step in (1e-5, -1e-5):
            policy.weights[i] = kept + step
            sides.append(value(starts))
        policy.weights[i] = kept
        np.testing.assert_allclose(found.weights[i], (sides[0] - sides[1]) / 2e-5, **CLOSE)
    for row in range(3):
        for j in range(task.sim.ndx):
            e = np.zeros_like(starts)
            e[row, j] = 1e-5
            np.testing.assert_allclose(found.states[row, j], (value(starts + e) - value(starts - e)) / 2e-5, **CLOSE)
    assert found.clipped == 0


@pytest.mark.skipif(numba.config.NUMBA_NUM_THREADS < 2, reason="one thread")
def test_an_epoch_has_the_same_bits_on_any_number_of_threads(task):
    """More rows than a part of network_rows.py, and not a whole number of its blocks."""
    options, found = {"epochs": 2, "environments": 35, "horizon": 4, "hidden": (6,), "episode": 6}, []
    for count in (1, 2):
        with threads(count):
            run = dojo.learn.shac(task, **options, randomization=MODELS, evaluations=1, episodes=1)
        found.append((run.state["weights"], run.state["value"], run.state["x"]))
    for one, two in zip(*found, strict=True):
        np.testing.assert_array_equal(one, two)


def test_a_smooth_probability_of_survival_has_the_derivative_of_what_it_makes_less():
    task = _task(tolerance=1e-12)

    def survival_probability(x):
        return 1.0 / (1.0 + np.exp((abs(x[1]) - 8.0) / 4.0))

    mortal = replace(task, survival=5.0, survival_probability=survival_probability)
    policy, starts, by_state = _policy(mortal), np.array([[0.25, -1.0], [0.8, 1.5]]), np.array([0.3, -0.2])

    def total(slopes=False):
        roll = dojo.learn.roll_policy_batch(policy, starts, 6, slopes=slopes)
        after = 5.0 + roll.after @ by_state
        return DiscountedSum(roll, after, 0.9)

    found = total(slopes=True)
    assert found.roll.survival.min() < 0.9 and found.follows.min() > 0.0
    gradient = found.roll.gradient(*found.weights(np.broadcast_to(by_state, (6, 2, 2)))).weights
    for i in range(0, policy.network.count, 3):
        kept, sides = policy.weights[i], []
        for step in (1e-5, -1e-5):
            policy.weights[i] = kept + step
            sides.append(total().first().sum())
        policy.weights[i] = kept
        np.testing.assert_allclose(gradient[i], (sides[0] - sides[1]) / 2e-5, **CLOSE)
    np.testing.assert_allclose(found.traced(1.0)[0], found.first())  # which the critic learns


def test_rows_start_anew_where_their_survival_is_improbable(task):
    """Where the pendulum turns backwards; its episodes go on."""

    def survival_probability(x):
        return 1.0 / (1.0 + np.exp(-(x[1] + 0.5) / 0.01))

    forwards = replace(task, steps=1000, survival_probability=survival_probability)
    options = {"epochs": 1, "environments": 16, "horizon": 20, "hidden": (4,), "evaluations": 1, "episodes": 1}
    free, held = (dojo.learn.shac(t, **options) for t in (replace(forwards, survival_probability=None), forwards))
    young = held.state["age"] < 20
    assert young.sum() > free.state["age"][free.state["age"] < 20].size
    assert dojo.learn.evaluate(held.policy, 2).lengths.tolist() == [1000, 1000]


def test_errors_of_functions_of_a_task_leave_the_threads(task):
    def terminated(x):
        if x[1] > 4.0:
            raise ValueError("too fast")
        return False

    mortal = replace(task, terminated=terminated)
    dojo.learn.roll_policy_batch(_policy(mortal), np.array([[0.3, 0.0]] * 5), 1)
    with pytest.raises(ValueError, match="too fast"):
        dojo.learn.roll_policy_batch(_policy(mortal), np.array([[0.3, 0.0]] * 5 + [[0.3, 9.0]]), 1)


def test_saturated_outputs_cost_what_brings_them_back(task):
    policy, starts = _policy(task), np.array([[0.25, -1.0], [0.8, 1.5]])
    policy.weights[-1] = 4.0  # the bias of the output
    roll = dojo.learn.roll_policy_batch(policy, starts, 1, slopes=True)
    assert roll.outputs.min() > 1.5
    nothing = np.zeros((1, 2))
    pull = roll.gradient(nothing, saturation=0.1).weights[-1] - roll.gradient(nothing).weights[-1]
    np.testing.assert_allclose(pull, -0.2 * (roll.outputs - 1.5).sum())


def test_a_row_that_starts_anew_passes_no_gradient_back(task):
    policy, starts = _policy(task), task.starts([np.random.default_rng(0)] * 2)

    def restart(roll, t):
        if t == 2:
            roll.x[t + 1, 0] = starts[1]
        return np.array([t == 2, False])

    weights = np.ones((5, 2))
    weights[:3, 0] = 0.0  # rewards of row 0 after its new start do not depend on its first state
    found = dojo.learn.roll_policy_batch(policy, starts, 5, slopes=True, restart=restart).gradient(weights)
    assert not found.states[0].any() and found.states[1].any()


def test_kappa_of_gradients_is_their_own(task):
    policy, starts = _policy(task), np.array([[0.25, -1.0], [0.4, -2.0]])
    hard = dojo.learn.roll_policy_batch(policy, starts, 4, slopes=True)
    soft = dojo.learn.roll_policy_batch(policy, starts, 4, slopes=True, kappa_grad=0.3)
    np.testing.assert_array_equal(hard.x, soft.x)
    assert np.abs(hard.gradient(np.ones((4, 2))).weights - soft.gradient(np.ones((4, 2))).weights).max() > 1e-6


def test_one_observation_has_the_action_of_a_batch(task):
    policy = _policy(task)
    X = task.starts([np.random.default_rng(k) for k in range(4)])
    batch = task.inputs(policy.actions(task.observe(X)[0]))
    np.testing.assert_allclose([policy(x) for x in X], batch, rtol=1e-13)
    sizes = np.array([2, 1], dtype=np.int64)
    work = np.zeros(4)
    first = perceptron(sizes, np.array([2.0, 3.0, 0.5]), 0, np.array([1.0, -1.0]), work)
    assert work[first] == -0.5


ALGORITHMS = {
    "shac": {"epochs": 12, "environments": 8, "horizon": 8, "hidden": (16,), "episode": 20},
    "ars": {"epochs": 6, "directions": 6},
    "gradient_search": {"epochs": 6, "environments": 4, "rate": 0.3},
}
MODELS = dojo.learn.Randomization(
    values={"friction:*": (0.2, 0.4)},
    factors={"mass": (0.9, 1.1)},
    substeps=(1, 2),
    kappa=(1e-4, 1e-2),
    noise=0.02,
    models=3,
    delays=(0, 1),
)


@pytest.mark.parametrize("algorithm", ["ars", "gradient_search"])
def test_noise_and_pushes_of_a_randomization_reach_whole_episodes(task, algorithm):
    learn, options = getattr(dojo.learn, algorithm), {**ALGORITHMS[algorithm], "epochs": 1, "evaluations": 1}
    plain, noisy, pushed = (
        learn(task, seed=2, randomization=dojo.learn.Randomization(**given), **options).policy.weights
        for given in ({}, {"noise": 0.1}, {"pushes": (0.1, 0.5)})
    )
    assert min(np.abs(a - b).max() for a, b in ((plain, noisy), (plain, pushed), (noisy, pushed))) > 1e-6


def test_adam_moves_weights_as_its_paper_says_however_many_steps_are_behind():
    adam, weights, rng = Adam(3, (0.7, 0.95)), np.zeros(3), np.random.default_rng(0)
    m, v, expected = np.zeros(3), np.zeros(3), np.zeros(3)
    for t in range(1, 2500):  # 0.7^t is no normal number from 1986 steps on
        g = rng.standard_normal(3)
        m, v = 0.7 * m + 0.3 * g, 0.95 * v + 0.05 * g**2
        expected -= 0.01 * m / (1.0 - 0.7**t) / (np.sqrt(v / (1.0 - 0.95**t)) + 1e-8)
        adam.step(weights, g, 0.01)
    np.testing.assert_allclose(weights, expected, rtol=1e-9)
    assert np.all(adam.moments[2] == 2499.0)


def test_a_delayed_action_is_applied_later_and_forgotten_where_an_episode_begins(task):
    policy, starts, drawn = _policy(task), np.array([[0.25, -1.0], [0.8, 1.5]]), replace(Drawn.of(task), delay=1)

    def restart(roll, t):
        return np.array([t == 2, False])

    delays = ActionDelay(2, 2, task.sim.nu)
    delays.actions[1:, 1] = 0.5  # decided before the rollout
    roll = dojo.learn.roll_policy_batch(policy, starts, 5, drawn=drawn, slopes=True, delays=delays, restart=restart)
    assert roll.applied[0].tolist() == [[0.0], [0.5]] and roll.decided_in[0].tolist() == [-1, -1]
    np.testing.assert_array_equal(roll.applied[1:, 1], roll.actions[:-1, 1])
    np.testing.assert_array_equal(roll.applied[[1, 2, 4], 0], roll.actions[[0, 1, 3], 0])
    assert roll.applied[3, 0] == 0.0 and roll.decided_in[:, 0].tolist() == [-1, 0, 1, -1, 3]
    alone = task.sim.step_batch(starts[1:], task.inputs(np.array([[0.5]])), task.substeps)
    np.testing.assert_array_equal(roll.after[0, 1], alone.x[0])
    np.testing.assert_array_equal(delays.actions[-1], roll.actions[-1])
    now, later = (dojo.learn.evaluate(policy, 2, delay=delay).states for delay in (0, 2))
    assert np.abs(now[1] - later[1]).max() > 1e-6  # actions of 0 first


@pytest.mark.parametrize("by_row", [True, False])
def test_rows_of_an_epoch_have_models_of_their_own_or_one(task, by_row):
    models = Models(task, replace(MODELS, by_row=by_row), np.random.default_rng(0))
    drawn = models.draw(np.random.default_rng(1), 12)
    assert len(drawn.kappa) == 12 and (len(np.unique(drawn.kappa)) > 1) == by_row
    for values in (drawn.parameters["mass"], drawn.parameters["friction:*"]):  # one row, which step_batch need not sort
        assert len(values) == (12 if by_row else 1) and (len(np.unique(values[:, 0])) > 1) == by_row
    some = drawn.rows(np.array([1, 1, 5]))
    assert len(some.kappa) == 3 and all(len(values) == (3 if by_row else 1) for values in some.parameters.values())
    again = models.draw(np.random.default_rng(2), 12)
    assert again.kappa[0] != drawn.kappa[0]


@pytest.mark.parametrize("name", ALGORITHMS)
def test_a_seed_repeats_to_the_bit_and_a_run_can_be_resumed(task, name, tmp_path):
    algorithm = getattr(dojo.learn, name)
    options = ALGORITHMS[name] | {"randomization": MODELS, "evaluations": 3, "episodes": 2, "seed": 3}
    whole = algorithm(task, **options)
    half = algorithm(task, **options, callback=lambda record: _stop(record, options["epochs"] // 2))
    assert half.status == dojo.Status.STOPPED and not half.success
    half.save(tmp_path / "half.npz")
    rest = algorithm(task, **options, resume=dojo.learn.Learned.load(tmp_path / "half.npz", task))
    assert whole.success and rest.success and whole.infinite == rest.unsolved == 0
    np.testing.assert_array_equal(whole.policy.weights, rest.policy.weights)
    np.testing.assert_array_equal(whole.state["weights"], rest.state["weights"])
    assert [r["return"] for r in whole.history] == [r["return"] for r in rest.history]
    assert whole.best == rest.best and whole.steps == rest.steps
    other = algorithm(task, **(options | {"seed": 4}))
    assert np.abs(other.state["weights"] - whole.state["weights"]).max() > 1e-6


def test_pushes_change_an_evaluation_by_their_size_alone(task):
    policy = _policy(task)
    calm, pushed, again = (
        dojo.learn.evaluate(policy, 3, 1, pushes=pushes).returns
        for pushes in ((0.1, [0.0]), (task.knot_time, [2.0]), (task.knot_time, [2.0]))
    )
    np.testing.assert_array_equal(calm, dojo.learn.evaluate(policy, 3, 1).returns)
    np.testing.assert_array_equal(pushed, again)
    assert np.abs(pushed - calm).min() > 1e-3
    np.testing.assert_array_equal(pushed[:2], dojo.learn.evaluate(policy, 2, 1, pushes=(task.knot_time, [2.0])).returns)
    with pytest.raises(ValueError, match=r"evaluate\(pushes=...\): expected at most 1 deviations"):
        dojo.learn.evaluate(policy, 1, pushes=(0.1, [1.0, 1.0]))


@pytest.mark.slow
def test_a_robust_policy_is_the_best_of_the_sums_with_and_without_pushes(task, tmp_path):
    pushes = (task.knot_time, [3.0])
    models = dojo.learn.Randomization(pushes=pushes)
    options = {"epochs": 6, "environments": 4, "horizon": 5, "evaluations": 6, "episodes": 2, "rate": 0.02, "seed": 5}
    options |= {"randomization": models, "robust": True}
    found, seen = dojo.learn.shac(task, **options), []
    for epoch in range(1, 7):
        part = dojo.learn.shac(task, **options, callback=lambda record, last=epoch: _stop(record, last))
        now = LearnedPolicy(part.policy.network, part.state["weights"], *_scaling(part), task)
        with_pushes = dojo.learn.evaluate(now, 2, 5, pushes=pushes).returns.mean()
        seen.append((part.history[-1]["evaluated"], with_pushes))
    alone, sums = np.array(seen)[:, 0], np.sum(seen, axis=1)
    assert found.best == alone[np.argmax(sums)] and found.state["score"] == sums.max()
    assert np.argmax(sums) != np.argmax(alone)  # of this seed, so that the rule matters
    part = dojo.learn.shac(task, **options, callback=lambda record: _stop(record, 5))
    part.save(tmp_path / "half.npz")
    rest = dojo.learn.shac(task, **options, resume=dojo.learn.Learned.load(tmp_path / "half.npz", task))
    assert rest.best == found.best and rest.state["score"] == found.state["score"]
    with pytest.raises(TypeError, match="robust"):
        dojo.learn.shac(task, epochs=1, robust=3)


def test_pushes_grow_from_the_first_to_the_last_factor(task):
    few = {"environments": 4, "horizon": 5, "evaluations": 0, "episodes": 1, "rate": 0.02, "seed": 5}

    def weights(size, factors, last):
        models = dojo.learn.Randomization(pushes=(task.knot_time, [size]))
        options = few | {"epochs": 10, "randomization": models, "push_factors": factors}
        return dojo.learn.shac(task, **options, callback=lambda record: _stop(record, last)).state["weights"]

    np.testing.assert_array_equal(weights(3.0, (0.5, 0.5), 3), weights(1.5, (1.0, 1.0), 3))
    growing, calm = (0.0, 1.0), (0.0, 0.0)
    np.testing.assert_array_equal(weights(3.0, growing, 1), weights(3.0, calm, 1))
    assert np.abs(weights(3.0, growing, 2) - weights(3.0, calm, 2)).max() > 1e-9
    with pytest.raises(ValueError, match=r"shac\(push_factors=...\): expected two numbers from 0"):
        dojo.learn.shac(task, epochs=1, push_factors=(-1.0, 1.0))


def _scaling(run):
    """(mean, deviation) of observations at the end of a run."""
    statistics = ObservationStatistics(len(run.policy.mean))
    statistics.sums[...] = run.state["sums"]
    return statistics.sums[0].copy(), statistics.deviation()


def _stop(record, epoch):
    if record["epoch"] == epoch:
        raise StopIteration


def test_a_policy_acts_in_several_threads_as_in_one():
    rng, interval = np.random.default_rng(0), sys.getswitchinterval()
    net = Network((4, 256, 256, 2))
    policy = LearnedPolicy(net, net.start(rng), np.zeros(4), np.ones(4))
    seen = rng.normal(size=(400, 4))
    alone = np.array([policy.action(x) for x in seen])
    sys.setswitchinterval(1e-6)
    try:
        with ThreadPoolExecutor(4) as pool:
            together = list(pool.map(lambda x: policy.action(x), np.tile(seen, (4, 1))))
    finally:
        sys.setswitchinterval(interval)
    np.testing.assert_array_equal(together, np.tile(alone, (4, 1)))


@pytest.mark.slow
def test_workers_find_the_same_policies(task):
    options = {"epochs": 3, "directions": 20, "randomization": MODELS, "evaluations": 1, "episodes": 2}
    alone = dojo.learn.seeds(dojo.learn.ars, task, (3, 4), **options)
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:  # a task is pickled with its functions
        together = dojo.learn.ars(task, seed=3, executor=pool, **options)
        runs = dojo.learn.seeds(dojo.learn.ars, task, (3, 4), executor=pool, **options)
    for run, other in ((together, alone[0]), (runs[0], alone[0]), (runs[1], alone[1])):
        np.testing.assert_array_equal(run.policy.weights, other.policy.weights)
        np.testing.assert_array_equal(run.state["sums"], other.state["sums"])
        assert run.policy.task is task and (run.steps, run.best) == (other.steps, other.best)
    assert np.abs(runs[0].policy.weights - runs[1].policy.weights).max() > 1e-6


def test_a_policy_that_was_better_before_is_kept_and_the_message_tells(task):
    """Updates far too long, where an arm without actions has the best return."""
    still = replace(task, steps=9, reward=lambda x, a, after: -(a[0] ** 2))
    spoilt = dojo.learn.ars(still, epochs=2, directions=2, best=1, rate=50.0, noise=0.5, evaluations=2, episodes=1)
    assert spoilt.success and "before the first is the best" in spoilt.message and spoilt.best == 0.0
    assert not spoilt.policy.weights.any() and spoilt.history[-1]["evaluated"] < -1.0
    resumed = dojo.learn.ars(
        still, epochs=2, directions=2, best=1, rate=50.0, noise=0.5, evaluations=2, episodes=1, resume=spoilt
    )
    assert resumed.message == spoilt.message and resumed.best == 0.0


@pytest.mark.slow
def test_policies_learn_and_hold_the_pendulum_down_in_a_closed_loop(task, tmp_path):
    lines = io.StringIO()
    learned = dojo.learn.shac(
        task, epochs=120, environments=16, horizon=10, hidden=(16,), rate=5e-3, verbose=True, stream=lines
    )
    before = dojo.learn.evaluate(_policy(task), 8).returns.mean()
    assert learned.success and learned.unsolved == learned.infinite == 0
    assert learned.best > 0.4 * before, (learned.best, before)  # returns are negative
    assert len(lines.getvalue().splitlines()) == 11 and "SOLVED" in learned.summary()
    learned.policy.save(tmp_path / "policy.npz")
    again = dojo.learn.LearnedPolicy.load(tmp_path / "policy.npz", task)
    loop = dojo.closed_loop(again.controller, dojo.Plant(task.sim, [0.6, 0.0]), 2.0, control_step=task.knot_time)
    assert loop.survived and abs(loop.x[-1, 0]) < 0.3
    assert len(learned.plot().lines) == 2


@pytest.mark.slow
def test_the_best_of_several_beginnings_goes_on(task):
    options = {"environments": 8, "horizon": 8, "hidden": (16,), "episode": 8, "episodes": 2, "evaluations": 2}
    whole = {k: dojo.learn.shac(task, seed=k, epochs=20, **options) for k in (1, 2, 3)}
    after = {k: run.history[4]["return"] for k, run in whole.items()}
    found = dojo.learn.best_of(dojo.learn.shac, task, (1, 2, 3), epochs=20, share=0.25, **options)
    assert found.success and found.seed == max(after, key=after.get), after
    np.testing.assert_array_equal(found.policy.weights, whole[found.seed].policy.weights)
    assert found.best == whole[found.seed].best and found.steps == (20 + 2 * 5) * 64
    assert [record["steps"] for record in found.history] == [(k + 1 + 2 * 5) * 64 for k in range(20)]
    assert found.history[-1]["seconds"] <= found.seconds
    with pytest.raises(ValueError, match=r"best_of\(share=\.\.\.\)"):
        dojo.learn.best_of(dojo.learn.shac, task, epochs=20, share=2.0)


@pytest.mark.slow
def test_imitated_policies_have_the_feedback_of_plans_and_can_learn_on(task, tmp_path):
    gain, xs, us = np.array([[-2.0, -0.4]]), [np.array([0.7, 0.5])], []
    for _ in range(40):
        us.append(gain @ xs[-1])
        xs.append(task.sim.step_batch(xs[-1][None], us[-1][None], task.substeps).x[0])
    plan = np.array(xs), np.array(us), np.repeat(gain[None], 40, axis=0)
    options = {"epochs": 400, "hidden": (16,), "spread": 0.1, "evaluations": 1}
    learned = dojo.learn.imitate(task, [plan], **options)
    blind = dojo.learn.imitate(task, [(*plan[:2], np.zeros_like(plan[2]))], **options)
    errors = {}
    for name, policy in (("told", learned.policy), ("blind", blind.policy)):
        slopes = [[(policy(x + e) - policy(x - e)) / 2e-4 for e in 1e-4 * np.eye(2)] for x in plan[0][:-1:8]]
        errors[name] = np.abs(np.array(slopes)[:, :, 0] - gain).max()
    assert errors["told"] < 0.3 and errors["blind"] > 0.6, errors
    np.testing.assert_allclose([learned.policy(x) for x in plan[0][:-1]], plan[1], atol=0.1)
    further = dojo.learn.shac(task, epochs=1, environments=2, rate=1e-9, start=learned.policy, evaluations=1)
    assert abs(further.best - learned.best) < 0.02 * abs(learned.best)
    onnx = pytest.importorskip("onnx.reference")
    learned.policy.export_onnx(tmp_path / "policy.onnx")
    seen = task.observe(plan[0])[0]
    (actions,) = onnx.ReferenceEvaluator(str(tmp_path / "policy.onnx")).run(None, {"observation": np.float32(seen)})
    np.testing.assert_allclose(actions, learned.policy.actions(seen), atol=1e-5)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda t: dojo.learn.imitate(t, [(np.zeros((3, 2)), np.zeros((2, 1)))]), "states, inputs, gains"),
        (lambda t: dojo.learn.shac(t, epoch=3), r"shac\(\.\.\.\).*epoch"),
        (lambda t: dojo.learn.ars(t, best=40), r"ars\(best=\.\.\.\): expected at most 32"),
        (
            lambda t: dojo.learn.shac(t, resume=dojo.learn.ars(t, epochs=1, directions=4, best=1)),
            "expected a run of shac",
        ),
        (lambda t: dojo.learn.Randomization(kappa=(1.0, 0.1)), "kappa"),
    ],
)
def test_bad_arguments_are_named(task, call, message):
    with pytest.raises((ValueError, TypeError), match=message):
        call(task)
