"""A leg with a closed loop plans a hop: two motors at the hip, four links, the foot where they meet.

python examples/parallel_leg.py      prints one line per iteration, writes parallel_leg.png
"""

import numpy as np
from _common import finish

import dojo_opt as dojo

FORWARD, UP = 0.15, 0.18  # [m]
sim = dojo.Simulator(dojo.models.minitaur_leg(), time_step=0.02)
start = sim.neutral()
apex, goal = start.copy(), start.copy()
goal[0] += FORWARD
apex[:2] = FORWARD / 2, start[1] + UP
weight = np.array([1.0, 1.0, 1.0, 0.1, 0.1, 0.0, 0.0, *[0.01] * 3, *[1e-3] * 4])
horizon = 30
hold = 9.81 * sum(b.mass for b in sim.mechanism.bodies) * 0.112 / 2  # [N m], half of the weight times d(leg)/d(angle)
problem = dojo.Problem(
    sim,
    start,
    horizon,
    cost=[dojo.cost.Tracking(np.array([apex] * 15 + [goal] * 16), weight), dojo.cost.Effort(1e-4)],
    constraints=[dojo.constraint.Goal(goal, components=np.arange(5))],
    control_limits=(-8.0, 8.0),
    controls0=np.array([hold, -hold]),
)
plan = dojo.ilqr(problem, verbose=True)
gap = max(float(np.abs(g).max()) for x in plan.x for g in sim.loop_gaps(x).values())
pin = np.linalg.norm(sim.reactions(plan.x[:-1], plan.u)["foot"].force, axis=-1).max()
foot = sim.rollout(start, plan.u, throw=True).contacts.gap[:, 0].max()
print(f"the foot rises to {foot:.3f} m, landed at {plan.x[-1, 0]:.4f} m; its pin carries up to {pin:.0f} N")
print(f"the loop is open by {gap:.1e} at most; largest violation of a constraint {plan.violation:.1e}")

finish(dojo.plots.trajectory(plan), __file__)

assert plan.success, plan.message
assert abs(plan.x[-1, 0] - FORWARD) < 1e-3 and foot > 0.01 and gap < 1e-8
