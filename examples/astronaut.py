"""An astronaut in space moves its limbs for a second, then drifts: momentum and energy against the time step.

python examples/astronaut.py        prints a table, writes astronaut.png

Inner torques cannot change its momentum. Steps of order 2 keep it to rounding, and the energy to second order; those of
order 8, or of a given accuracy, keep both. With MuJoCo installed, the same beside it (hinges for orbital joints).
"""

from dataclasses import replace
from importlib.util import find_spec

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo
from benchmarks.engines import mujoco_motions

DURATION, STEPS = (3, (0.05, 0.02, 0.01)) if QUICK else (11, (0.05, 0.02, 0.01, 0.005, 0.002))  # [s]
robot = replace(dojo.models.humanoid(damper=0.0, gravity=(0.0, 0.0, 0.0)), contacts=())
drawn = np.random.default_rng(0).uniform(-0.5, 0.5, (10, 19))  # [N m] one row after the other, 0.1 s each


SETTINGS = {"dojo-opt": {"tolerance": 1e-13}}
if not QUICK:
    SETTINGS |= {"dojo-opt, order 8": {"order": 8}, "dojo-opt, accuracy 1e-6": {"accuracy": 1e-6}}
lines = {name: [] for name in SETTINGS} | ({"MuJoCo implicitfast": [], "MuJoCo RK4": []} if find_spec("mujoco") else {})
for h in STEPS:
    torques = np.concatenate([np.repeat(drawn, round(0.1 / h), axis=0), np.zeros((round((DURATION - 1) / h), 19))])
    for name, settings in SETTINGS.items():
        sim = dojo.Simulator(robot, time_step=h, **settings)
        t = sim.rollout(sim.neutral(), torques, throw=True)
        energy = sim.energy(t.x)[round(1.0 / h) :]
        lines[name].append((np.abs(sim.momentum(t.x)[1]).max(), np.ptp(energy) / energy[0]))
    for name in list(lines)[len(SETTINGS) :]:
        lines[name].append(mujoco_motions.drift(sim, torques, name.removeprefix("MuJoCo "), round(1.0 / h)))
    print(f"{h:6.3f} s  " + ", ".join(f"{n}: L {v[-1][0]:.1e} N m s, E {v[-1][1]:.1e}" for n, v in lines.items()))
figure = Figure(figsize=(9, 4.5), layout="constrained")
for k, ax in enumerate(figure.subplots(1, 2)):
    for name, values in lines.items():
        ax.loglog(STEPS, np.array(values)[:, k], "o-", label=name)
    ax.minorticks_off()
    ax.set_xticks(STEPS, [f"{1e3 * h:g}" for h in STEPS])
    ax.set(
        xlabel="time step [ms]", title=["largest angular momentum [N m s]", "change of energy"][k], ylim=(None, 10.0)
    )
    if k == 0:
        ax.legend(fontsize=8)
finish(figure, __file__)
assert max(v[0] for v in lines["dojo-opt"]) < 1e-9
