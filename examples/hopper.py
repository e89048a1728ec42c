"""A Raibert hopper plans one hop, half a metre forward and half a metre to the left: iLQR through contact.

python examples/hopper.py            prints one line per iteration, writes hopper.png
"""

import numpy as np
from _common import finish

import dojo_opt as dojo

target = np.array([0.5, 0.5])
problem = dojo.problems.hop(target=tuple(target))
plan = dojo.ilqr(problem, verbose=True)

landed = plan.x[-1, :2] - plan.x[0, :2]
print(f"cost {plan.fun:.3f}, {plan.nit} iterations, apex {plan.x[:, 2].max():.2f} m")
print(f"landed at {landed[0]:.4f}, {landed[1]:.4f} m; largest violation of a constraint {plan.violation:.1e}")

finish(dojo.plots.trajectory(plan), __file__)

assert plan.success, plan.message
assert np.abs(landed - target).max() < 1e-3, landed
