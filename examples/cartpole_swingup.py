"""A cart swings its pole up by pushing left and right: no contact, so no contact code is compiled.

python examples/cartpole_swingup.py  prints one line per iteration, writes cartpole_swingup.png
"""

import numpy as np
from _common import finish

import dojo_opt as dojo

problem = dojo.problems.swingup("cartpole")
plan = dojo.ilqr(problem, verbose=True)
print(f"cost {plan.fun:.3f}, violation {plan.violation:.1e}, {plan.nit} iterations")

finish(dojo.plots.trajectory(plan), __file__)

assert plan.success, plan.message
upright = abs(np.cos(plan.x[-1, 1]) - np.cos(plan.x[0, 1]))  # from hanging to standing the cosine changes by two
assert upright > 1.99, f"the pole ends {np.degrees(np.arccos(1 - upright)):.1f} degrees from where it started"
