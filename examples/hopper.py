"""A Raibert hopper plans one hop, half a metre forward and half a metre up: iLQR through contact.

python examples/hopper.py            prints one line per iteration, writes hopper.png
"""

import numpy as np
from _common import finish

import dojo_opt as dojo

target = np.array([0.5, 0.5])
problem = dojo.problems.hop(target=tuple(target))
plan = dojo.ilqr(problem, verbose=True)

# The plan was made on a slightly smoothed contact. Replay it, with its gains, on a contact that is 100 times harder.
print(f"cost {plan.fun:.3f}, violation {plan.violation:.1e}, {plan.nit} iterations")

finish(dojo.plots.trajectory(plan), __file__)

assert plan.success, plan.message
assert plan.violation < 1e-3, plan.violation
