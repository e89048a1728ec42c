"""A guess of states in which something rests that has to move gets the smooth stages, as without a guess."""

from __future__ import annotations

import io
from types import SimpleNamespace

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.planning.ilqr import Solver
from dojo_opt.planning.ilqr_start import at_rest as resting_joint
from dojo_opt.planning.refinement import FAILED
from solvers.status import Status


def at_rest(sim, start, horizon, **terms):
    return dojo.Problem(sim, start, horizon, states0=np.tile(start, (horizon + 1, 1)), **terms)


def pushed_box(rng):
    """A finger on two slides pushes a box along a table."""
    edge, mass = rng.uniform(0.08, 0.2), rng.uniform(0.2, 2.0)
    box = dojo.Mechanism(
        [dojo.Body("block", mass, shape=dojo.Box(edge, edge, edge))],
        [dojo.Joint("floating", None, "block")],
        neutral={"block": (0, 0, edge / 2, 1, 0, 0, 0)},
    ).with_obstacle(dojo.HalfSpace(), bodies=["block"], name="table", friction=rng.uniform(0.2, 0.6))
    arm = dojo.Mechanism(
        [dojo.Body("cart", 0.2, inertia=(1e-3,) * 3), dojo.Body("finger", 0.3, inertia=(1e-3,) * 3)],
        [
            dojo.Joint("prismatic", None, "cart", axis=(1, 0, 0)),
            dojo.Joint("prismatic", "cart", "finger", axis=(0, 0, 1)),
        ],
    )
    scene = arm.add(box, pose=(0.03 + edge / 2 + rng.uniform(0.01, 0.05), 0, 0), prefix="box/")
    tip = dojo.Sphere(0.03, center=(0, 0, edge * rng.uniform(0.3, 0.5)))
    scene = scene.with_collisions(dojo.Collision("finger", "box/block", shape_a=tip, friction=0.3, name="tip"))
    sim = dojo.Simulator(scene, time_step=0.02, kappa=1e-6)
    goal, hold = sim.neutral(), np.array([0.0, 0.3 * 9.81])
    goal[2] += rng.uniform(0.1, 0.3)
    return at_rest(
        sim,
        sim.neutral(),
        40,
        cost=[Tracking(goal, {"q": 1e-3, "box/block": 1.0, "v": 5e-3}), Effort(1e-4, reference=hold)],
        constraints=[Goal(goal, components=("box/block x", "box/block y"))],
        control_limits=(-30, 30),
        controls0=hold,
    )


def hop(rng):
    """The hopper at rest jumps to a place."""
    p = dojo.problems.hop(target=rng.uniform(-0.5, 0.5, 2), height=rng.uniform(0.2, 0.5))
    return at_rest(p.sim, p.start, p.horizon, cost=p.specs[0], constraints=p.specs[1], controls0=p.controls0)


def block(rng):
    """Forces on a block that lies on the ground lift it, or push it aside."""
    p = dojo.problems.block(str(rng.choice(["right", "up"])), friction=rng.uniform(0.2, 0.8))
    return at_rest(p.sim, p.start, p.horizon, cost=p.specs[0], constraints=p.specs[1])


def reach(rng):
    """An arm moves to a pose, without contact."""
    sim = dojo.Simulator(dojo.models.panda(), time_step=0.02, kappa=1e-6)
    goal = sim.neutral()
    goal[:7] += rng.uniform(-0.1, 0.1, 7)
    costs = [Tracking(goal, {"q": 0.1, "v": 0.01}), Effort(1e-5)]
    return at_rest(sim, sim.neutral(), 40, cost=costs, constraints=[Goal(goal, components="q")])


@pytest.mark.sweep(3)
@pytest.mark.parametrize("make", [pushed_box, hop, block, reach], ids=lambda f: f.__name__)
@pytest.mark.parametrize("seed", range(5))
def test_plans_from_rest_succeed(make, seed):
    problem = make(np.random.default_rng(seed))
    plan = dojo.ilqr(problem)
    assert plan.success, plan.closing_line()
    assert plan.history[0]["kappa_eval"] == dojo.Options().stages[0].kappa_eval
    motion = plan.replay(time_step=plan.time_step, kappa=1e-6)
    np.testing.assert_allclose(motion.x, plan.x, atol=1e-5)


@pytest.mark.parametrize("seed", [4, 7, 9])
def test_the_quadruped_jumps_from_states_at_rest(seed):
    """Of 12 such jumps 7 are planned; none of them with a start at hard contact, 5 from a rollout of the torques."""
    rng = np.random.default_rng(seed)
    height, top = rng.uniform(0.1, 0.25), int(rng.integers(24, 32))
    sim = dojo.Simulator(dojo.models.quadruped(damper=0.5), time_step=0.02, kappa=1e-6)
    stand, torques = dojo.equilibrium(sim)
    weight = np.r_[0.5, 0.5, 0.0, np.full(15, 0.5), np.full(18, 0.005)]
    plan = dojo.ilqr(
        at_rest(
            sim,
            stand,
            50,
            cost=[Tracking(stand, weight), Effort(1e-4, reference=torques)],
            constraints=[
                Goal(stand, components="q"),
                dojo.constraint.StateBounds(stand[2] + height, np.inf, components=[2], knots=top),
            ],
            control_limits=(-33.5, 33.5),
            controls0=torques,
        )
    )
    assert plan.success, plan.closing_line()
    assert plan.x[top, 2] > stand[2] + height - 2e-3


def test_a_guess_that_rests_at_its_goal_begins_at_the_hardest_stage():
    """Nothing has to move: smooth contact would only lift it off the ground, and the table lists the skipped stages."""
    sim = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.05, kappa=1e-6)
    start, hold = sim.neutral(), np.array([0.0, 0.0, 9.81 * 4.18])
    start, hold = dojo.equilibrium(sim)
    problem = at_rest(sim, start, 10, cost=[Tracking(start, 1.0), Effort(1e-4, reference=0.9 * hold)], controls0=hold)
    table = io.StringIO()
    plan = dojo.ilqr(problem, verbose=True, stream=table)
    assert plan.success and {r["kappa_eval"] for r in plan.history} == {1e-6}
    line = "k_eval 3e-02, 3e-03, 1e-04 skipped: the guess of states fits 1e-06 best"
    assert line in table.getvalue().splitlines()[1] and line in plan.summary()


def test_a_guess_of_the_arm_alone_gets_smoothing_for_the_box():
    """The finger moves in it, and the box that it has to push does not."""
    problem = pushed_box(np.random.default_rng(1))
    problem.states0[:, 0] += np.linspace(0.0, 0.02, 41)
    plan = dojo.ilqr(problem)
    assert plan.success and plan.history[0]["kappa_eval"] == 3e-2


def test_where_one_stage_fails_the_planner_begins_at_another(monkeypatch):
    problem = hop(np.random.default_rng(1))
    solver = Solver(problem)
    descend, firsts = solver._descend, []

    def failing(first):
        firsts.append(first)
        return descend(first) if first == 2 else Status.INFEASIBLE

    monkeypatch.setattr(solver, "_descend", failing)
    plan = solver.solve()
    assert firsts == [0, 1, 2] and plan.success
    assert "INFEASIBLE; restart from the guess at k_eval 1e-04" in plan.summary()
    firsts.clear()
    monkeypatch.setattr(solver, "_descend", lambda first: firsts.append(first) or Status.INFEASIBLE)
    assert solver.solve().status == Status.INFEASIBLE and firsts == [0, 1, 2, 3]
    firsts.clear()
    monkeypatch.setattr(solver, "_descend", lambda first: firsts.append(first) or Status.TIME_LIMIT)
    assert solver.solve().status == Status.TIME_LIMIT and firsts == [0] and Status.TIME_LIMIT not in FAILED


@pytest.mark.parametrize(
    ("slope", "curvature", "asked"), [(1e-29, 1e-34, False), (1e-5, 1e-3, True), (1e-5, 0.0, True)]
)
def test_rounding_of_a_gradient_asks_no_joint_to_move(slope, curvature, asked):
    """A wrist that turns about the tip has no part in the task, and yet its Newton step, 0/0, is not zero."""
    sim = dojo.Simulator(dojo.models.double_pendulum(), time_step=0.02)
    x = np.tile(sim.neutral(), (6, 1))
    x[:, 0] += np.linspace(0.0, 0.1, 6)  # the second link rests
    g, H = np.zeros((6, sim.ndx + sim.nu)), np.zeros((6, sim.ndx + sim.nu, sim.ndx + sim.nu))
    g[-1, [0, 1]], H[-1, [0, 1], [0, 1]] = (1e-3, slope), (1.0, curvature)
    objective = SimpleNamespace(g=g, H=H, expand=lambda x, u: None)
    assert resting_joint(sim, objective, SimpleNamespace(x=x, u=None)) == asked
