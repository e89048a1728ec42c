"""A Raibert hopper plans a hop onto a step of 0.15 m, and one over a hill: terrain in the planner.

python examples/terrain.py            prints one line per iteration, writes terrain.png
"""

import dataclasses

import matplotlib.pyplot as plt
import numpy as np
from _common import finish

import dojo_opt as dojo

KNOT, HORIZON = 0.05, 20
STEP = dojo.Terrain.steps([0.15], start=0.4, edge=0.1)
LINES = np.linspace(-1.0, 2.0, 121)
HILL = dojo.Terrain.from_function(lambda x, y: 0.1 * np.exp(-((x - 0.35) ** 2) / 0.01) + 0.0 * y, LINES, [0.0])


def onto(terrain, distance):
    """The hop of `dojo.problems.hop` on this ground, to the place `distance` ahead [m]."""
    flat = dojo.problems.hop(target=(distance, 0.0))
    mech = flat.sim.mechanism
    mech = dataclasses.replace(mech, contacts=[dataclasses.replace(c, terrain=terrain) for c in mech.contacts])
    rise = float(terrain.height(distance, 0.0))
    apex, goal = flat.start.copy(), flat.start.copy()
    goal[[0, 2]] += distance, rise
    apex[[0, 2]] += distance, rise + 0.5
    weight = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.1, 1.0, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01, 0.01])
    path = np.array([apex] * (HORIZON // 2) + [goal] * (HORIZON - HORIZON // 2 + 1))
    sim = dojo.Simulator(mech, time_step=KNOT)
    return dojo.Problem(
        sim,
        flat.start,
        HORIZON,
        cost=[dojo.cost.Tracking(path, weight), dojo.cost.Effort(0.01 * KNOT**2)],
        constraints=[dojo.constraint.Goal(goal, components=np.arange(sim.nv))],
        controls0=np.array([0.0, 0.0, 9.81 * mech.bodies[0].mass]),
    )


figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 6), layout="constrained")
for ax, name, terrain, distance in zip(axes, ("onto a step", "over a hill"), (STEP, HILL), (0.65, 0.6), strict=True):
    plan = dojo.ilqr(onto(terrain, distance), verbose=True)
    foot = plan.problem.sim.maximal(plan.x)[:, 1, :3]
    x = np.linspace(-0.3, 1.0, 500)
    ax.fill_between(x, terrain.height(x, 0.0), -0.1, color="0.8")
    ax.plot(plan.x[:, 0], plan.x[:, 2], ".-", label="body")
    ax.plot(foot[:, 0], foot[:, 2], ".-", label="foot")
    ax.set(ylabel="height [m]", title=f"{name}: {plan.nit} iterations", xlim=(-0.3, 1.0), aspect="equal")
    clear = plan.problem.sim.mechanism.contacts[0].gap(foot).min()
    print(f"{plan.nit} iterations; lands at {plan.x[-1, 0]:.4f} m, {plan.x[-1, 2] - plan.x[0, 2]:.4f} m higher")
    assert plan.success, plan.message
    assert abs(plan.x[-1, 0] - distance) < 1e-3
    assert clear > -1e-6, clear
axes[1].set_xlabel("x [m]")
axes[0].legend()
finish(figure, __file__)
