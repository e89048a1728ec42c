"""A user's count that sizes arrays is refused by name where the memory does not hold them, before any work."""

from functools import cache

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.learn.network import Network
from sim.mechanism import memory_limit
from support.refusals import check_refused

N = 10**12
SIM = dojo.Simulator(dojo.models.pendulum(), time_step=0.01)
BATCHED, ORDER6 = dojo.Simulator(dojo.models.block()), SIM.replace(order=6)
X, ZERO = SIM.neutral(), np.zeros(1)
PLANT = dojo.Plant(SIM)
PROBLEM = dojo.Problem(SIM, X, 10, cost=dojo.cost.Effort(1.0))


@cache
def motion():
    """A trajectory at rest."""
    return SIM.rollout(X, steps=3)


def still(time, x):
    return ZERO


def observed(x, out):
    out[0], out[1] = x[0], x[1]


def paid(x, a, after):
    return 0.0


def never(x):
    return False


def study(**given):
    run = {"controller": still, "plant": PLANT, "sampler": lambda rng: dojo.Perturbation(), "duration": 0.05, "runs": 1}
    return dojo.monte_carlo(**{**run, **given})


def rows(count):
    """Inputs that take no memory themselves."""
    return np.broadcast_to(ZERO, (count, 1))


# fmt: off
COUNTS = {
    "rollout": (lambda: SIM.rollout(X, steps=N), "Simulator.rollout(steps=...)"),
    "rollout under a policy": (lambda: SIM.rollout(X, still, steps=N), "Simulator.rollout(steps=...)"),
    "rollout with an accuracy": (lambda: SIM.replace(accuracy=1e-4).rollout(X, steps=N), "Simulator.rollout(steps=...)"),
    "rollout of order 6": (lambda: ORDER6.rollout(X, steps=N), "Simulator.rollout(steps=...)"),
    "rollout of inputs": (lambda: SIM.rollout(X, rows(N)), "Simulator.rollout(us)"),
    "rollout of no inputs": (lambda: BATCHED.rollout(BATCHED.neutral(), np.zeros((N, 0))), "Simulator.rollout(us)"),
    "batch": (lambda: SIM.rollout_batch(X[None], rows(N)[None]), "Simulator.rollout_batch(us)"),
    "closed loop of inputs": (lambda: SIM.rollout_feedback(X, rows(N)), "Simulator.rollout_feedback(us)"),
    "derivatives": (lambda: SIM.linearize_rollout(X, rows(N)), "Simulator.linearize_rollout(us)"),
    "rows": (lambda: SIM.step_batch(np.broadcast_to(X, (N, 2)), rows(N)), "Simulator.step_batch(U)"),
    "substeps of rows": (lambda: SIM.step_batch(X[None], ZERO[None], N), "Simulator.step_batch(substeps=...)"),
    "horizon": (lambda: SIM.horizon(N), "Simulator.horizon(knots)"),
    "problem": (lambda: dojo.Problem(SIM, X, N), "Problem(horizon=...)"),
    "starts": (lambda: dojo.ilqr(PROBLEM, starts=N), "ilqr(starts=...)"),
    "closed loop": (lambda: dojo.closed_loop(still, PLANT, 1e12), "closed_loop(duration)"),
    "closed loop for ever": (lambda: dojo.closed_loop(still, PLANT, 1e300), "closed_loop(duration)"),
    "runs": (lambda: study(runs=N), "monte_carlo(runs=...)"),
    "runs for ever": (lambda: study(duration=1e300), "monte_carlo(duration)"),
    "pendulums": (lambda: dojo.models.npendulum(N), "npendulum(n)"),
    "sliders": (lambda: dojo.models.nslider(N), "nslider(n)"),
    "links": (lambda: dojo.models.orbital(N), "orbital(n)"),
    "fits": (lambda: dojo.identify(SIM, [motion()], ["mass"], fits=N), "identify(fits=...)"),
    "environments": (lambda: dojo.learn.shac(task(), environments=N), "shac(environments=..., horizon=...)"),
    "directions": (lambda: dojo.learn.ars(task(), directions=N), "ars(directions=..., horizon=...)"),
    "models": (lambda: dojo.learn.Randomization(models=N), "Randomization(models=...)"),
    "a wide layer": (lambda: dojo.learn.shac(task(), hidden=(N,)), "Network(sizes)"),
    "episodes": (lambda: dojo.learn.evaluate(policy(), episodes=N), "evaluate(episodes)"),
}
# fmt: on


def task():
    """Hold the pendulum."""
    return dojo.learn.Task(SIM, 2, observed, 2, paid, -ZERO - 1.0, ZERO + 1.0, still, never, steps=5)


def policy():
    return dojo.learn.LearnedPolicy(Network((2, 1)), np.zeros(3), np.zeros(2), np.ones(2), task())


@pytest.mark.parametrize("case", COUNTS)
def test_it_is_refused(case):
    call, *words = COUNTS[case]
    check_refused(call, *words, "GiB")


def test_the_memory_is_that_of_the_machine_its_container_and_the_process(monkeypatch, tmp_path):
    limit = tmp_path / "memory.max"
    limit.write_text("1048576\n")
    monkeypatch.setattr(memory_limit, "_GROUPS", (str(limit),))
    memory_limit.memory.cache_clear()
    try:
        assert memory_limit.memory() == 2**20
        limit.write_text("max\n")
        memory_limit.memory.cache_clear()
        assert 2**20 < memory_limit.memory() < float("inf")
        with pytest.raises(ValueError, match=r"f\(n\): 1e\+15 rows need at least .* GiB of memory; .* take fewer"):
            memory_limit.room_for("f(n)", 10**15, 8.0)
    finally:
        memory_limit.memory.cache_clear()


def test_an_input_that_is_held_for_ever_ends_with_a_status(monkeypatch):
    from sim.simulator.engines import adaptive_engine

    monkeypatch.setattr(adaptive_engine, "_MOST", 1000)
    found = SIM.replace(accuracy=1e-4).rollout(X + [1.0, 0.0], duration=1e9)
    assert not found.success and found.status == dojo.Status.MAX_ITERATIONS
