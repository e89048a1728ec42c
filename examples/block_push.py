"""A force at its centre pushes a block one metre to the right, then lifts it one metre up: one method for both.

python examples/block_push.py        prints the two solves, writes block_push.png

From zero forces "up" is the hard one: to the first order no small force moves a block that rests on the ground. The
smoothed contact still has a gradient there.
"""

from _common import finish
from matplotlib.figure import Figure

import dojo_opt as dojo

figure = Figure(figsize=(15, 6.5), layout="constrained")
columns = figure.subfigures(1, 2)

for goal, column in zip(("right", "up"), columns, strict=True):
    problem = dojo.problems.block(goal=goal)
    plan = dojo.ilqr(problem, verbose=True)
    print(f"{goal}: cost {plan.fun:.3f}, violation {plan.violation:.1e}, {plan.nit} iterations")
    dojo.plots.trajectory(plan, figure=column)
    column.suptitle(goal)
    assert plan.success, plan.message
    assert plan.violation < 1e-3, plan.violation

finish(figure, __file__)
