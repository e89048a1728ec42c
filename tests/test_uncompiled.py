"""NUMBA_DISABLE_JIT=1: the same numbers without compilation, slowly, for whoever steps through a kernel."""

import json

import numpy as np
import pytest

from support.programs import python

PROGRAM = """
import json, warnings, numpy as np, dojo_opt as dojo
warnings.simplefilter("ignore", RuntimeWarning)  # NumPy's, of divisions by zero that kernels mean
found = {}

@dojo.jit
def error(x):
    return x[1] - 2.0

def residual(x, u, out):
    out[0] = error(x)

sim = dojo.Simulator(dojo.models.pendulum(), 0.05)
terms = [dojo.cost.ResidualCost(residual, 1), dojo.cost.Effort(1e-3)]
plan = dojo.ilqr(dojo.Problem(sim, sim.neutral(), 5, cost=terms))
found["plan with a residual"] = [plan.nit, plan.fun, *plan.x.ravel()]
for name in ("raiberthopper", "fourbar", "quadruped"):
    sim = dojo.Simulator(getattr(dojo.models, name)(), 0.02)
    r = sim.rollout(sim.neutral(), np.zeros((3, sim.nu)))
    A, B = sim.linearize(sim.neutral(), np.zeros(sim.nu), kappa=1e-3)
    found[name] = [int(r.status), *r.x.ravel(), float(A.sum()), float(B.sum())]
boxes = [dojo.Body(name, 1.0, shape=dojo.Box(0.1, 0.1, 0.1)) for name in "ab"]
joints = [dojo.Joint("floating", None, name) for name in "ab"]
neutral = {"a": (0, 0, 0.05, 1, 0, 0, 0), "b": (0.02, 0, 0.151, 1, 0, 0, 0)}
stack = dojo.Mechanism(boxes, joints, neutral=neutral, collisions=[dojo.Collision("a", "b")])
sim = dojo.Simulator(stack.with_obstacle(dojo.HalfSpace(), bodies=["a"], name="table", friction=0.4), 0.02)
found["boxes"] = [*sim.rollout(sim.neutral(), np.zeros((2, sim.nu))).x.ravel()]
plan = dojo.ilqr(dojo.problems.block("right"), max_iterations=3)
found["block"] = [plan.nit, plan.fun, *plan.x.ravel()]
print(json.dumps(found))
"""


@pytest.mark.slow
def test_kernels_run_uncompiled_with_the_same_result():
    compiled = json.loads(python(PROGRAM))
    plain = json.loads(python(PROGRAM, NUMBA_DISABLE_JIT="1"))
    for name, numbers in compiled.items():
        np.testing.assert_allclose(plain[name], numbers, rtol=1e-7, atol=1e-7, err_msg=name)
