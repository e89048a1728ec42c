"""A quadruped of the A1's size trots forward: torques planned through the contacts of its feet by iLQR.

python examples/quadruped_trot.py            prints one line per iteration, writes quadruped_trot.png
python examples/quadruped_trot.py --quick    one period instead of two

The guess is a kinematic reference and its torques by inverse dynamics. The plan is then replayed on a simulation with
a fifth of the time step, its feedback held over every knot.
"""

import numpy as np
from _common import QUICK, finish

import dojo_opt as dojo

problem = dojo.problems.trot(speed=0.2, cycles=1 if QUICK else 2)
plan = dojo.ilqr(problem, verbose=True)


def upright(x):
    """Cosine of the angle between the base's z axis and the vertical."""
    return 1.0 - 2.0 * (x[:, 4] ** 2 + x[:, 5] ** 2)


replay = plan.replay(time_step=problem.knot_time / 5)
traveled, drift = plan.x[-1, 0] - plan.x[0, 0], np.abs(replay.x[-1, :3] - plan.x[-1, :3]).max()

limit = problem.control_limits[1][0]
print(f"{plan.nit} iterations, {traveled:.3f} m, largest torque {np.abs(plan.u).max():.1f} N m of {limit:.1f}")
print(
    f"upright {upright(plan.x).min():.4f}; at a fifth of the time step {upright(replay.x).min():.4f}, {drift:.4f} m off"
)

finish(dojo.plots.gait(plan), __file__)

assert plan.success, plan.message
assert abs(traveled - 0.2 * plan.time[-1]) < 5e-3, traveled
assert min(upright(plan.x).min(), upright(replay.x).min()) > 0.99
assert drift < 0.02, drift
