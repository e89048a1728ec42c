"""Teach Gymnasium's half-cheetah to run, through the derivatives of its contacts: about a minute on one core.

python examples/half_cheetah_shac.py        prints returns, writes half_cheetah_shac.png, .html and .npz

The policy learns on models with other friction, springs, masses and time steps than those that it is judged on. In
MuJoCo's HalfCheetah-v5 it runs until it falls on its head, with shorter time steps there as well as here:
python benchmarks/evaluate_policy.py HalfCheetah-v5 half_cheetah_shac.npz
"""

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo

SETTINGS = {"epochs": 100} if QUICK else {}  # otherwise those of the task
task = dojo.learn.half_cheetah()
learned = dojo.learn.shac(task, seed=0, verbose=True, **SETTINGS)
print(learned)
learned.policy.save("half_cheetah_shac.npz")
harder = dojo.learn.evaluate(learned.policy, episodes=4, seed=1, substeps=10, kappa=3e-5)  # never seen while learning
print(f"at half the time step, contacts three times harder: return {harder.returns.mean():.0f}")

start = task.start(np.random.default_rng(2))
plant = dojo.Plant(task.sim, start)
seconds = 2.0 if QUICK else 10.0
loop = dojo.closed_loop(learned.policy.controller, plant, seconds, fallen=lambda x: False)
speed = (loop.x[-1, 0] - loop.x[0, 0]) / seconds
print(f"in a closed loop: {speed:.1f} m/s over {seconds:g} s")
print(f"wrote {dojo.viewer.save_html(loop, 'half_cheetah_shac.html')}")

figure = Figure(figsize=(6.5, 4.0), layout="constrained")
learned.plot(figure.subplots())
assert learned.unsolved == learned.infinite == 0
assert learned.best > (100.0 if QUICK else 2500.0), learned.best
assert harder.returns.mean() > (0.3 if QUICK else 0.5) * learned.best  # a hundred epochs depend on the processor
finish(figure, __file__)
