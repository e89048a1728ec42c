"""A quadruped of the A1's size jumps 0.3 m forward and comes to rest, its torques within the motors' limits.

python examples/quadruped_jump.py            prints one line per iteration, writes quadruped_jump.png
python examples/quadruped_jump.py --quick    starts from the kinematic reference instead of standing still

Without --quick the planner starts from a robot that stands still all the time: it has to find out by itself how to
push off, through the smoothed contact.
"""

import numpy as np
from _common import QUICK, finish

import dojo_opt as dojo

problem = dojo.problems.jump(distance=0.3, height=0.2, guess="reference" if QUICK else "standing")
plan = dojo.ilqr(problem, verbose=True)

replay = plan.replay(time_step=problem.knot_time / 20, kappa=1e-8)
fine = replay.simulator
motion = [fine.rollout(x, np.tile(u, (20, 1))).contacts for x, u in zip(replay.x[:-1], replay.u, strict=True)]
clearance = max(contacts.gap.min(axis=1).max() for contacts in motion)  # of the lowest foot, in the air
landed = replay.x[-1, 0] - replay.x[0, 0]

print(
    f"{plan.nit} iterations, apex {plan.x[:, 2].max() - plan.x[0, 2]:.3f} m, all feet {clearance:.3f} m off the ground"
)
print(f"at 1 ms it lands {landed:.4f} m ahead, torques up to {np.abs(replay.u).max():.1f} N m")

finish(dojo.plots.gait(plan), __file__)

assert plan.success, plan.message
assert clearance > 0.1, clearance
assert abs(landed - 0.3) < 0.01, landed
assert np.abs(replay.u).max() <= problem.control_limits[1].max()
