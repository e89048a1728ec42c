"""A ball hits the ground: hard contact with several time steps and with an accuracy, beside MuJoCo's soft contact.

python examples/impact.py        prints a table, writes impact.png

At a fixed step the ball stops at the first node on the ground; with an accuracy it stops when it gets there.
"""

from importlib.util import find_spec

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo
from benchmarks.engines import mujoco_motions

HEIGHT, DURATION, G = 1.0, 0.6, 9.81  # [m], [s], [m/s^2]
TOUCH = np.sqrt(2.0 * HEIGHT / G)  # [s] exact time of the impact
SHOWN = (0.02, 0.005)  # [s] steps that are drawn
ball = dojo.models.sphere()


def exact(times):
    """Gap of the ball [m]: free fall, then rest."""
    return np.where(times < TOUCH, HEIGHT - 0.5 * G * times**2, 0.0)


motions = {}  # name: times [s], gaps [m]
free = dojo.Simulator(ball, accuracy=1e-5)
rest = free.neutral()[2]
high = free.neutral()[: free.nq] + HEIGHT * (np.arange(free.nq) == 2)
for h in SHOWN if QUICK else (0.02, 0.01, 0.005, 0.001):
    sim, steps = dojo.Simulator(ball, time_step=h), round(DURATION / h)
    start, times = sim.state_from_velocity(high, np.zeros(sim.nv)), h * np.arange(steps + 1)
    motions[f"dojo-opt, {1e3 * h:g} ms"] = times, sim.rollout(start, steps=steps, throw=True).x[:, 2] - rest
    if find_spec("mujoco"):
        motions[f"MuJoCo, {1e3 * h:g} ms"] = times, mujoco_motions.drop(sim, start, steps)[:, 2] - rest
times = np.union1d(np.linspace(0.0, DURATION, 601), TOUCH + np.linspace(-0.01, 0.02, 301))
t = free.rollout(free.state_from_velocity(high, np.zeros(free.nv)), duration=DURATION, throw=True)
motions["dojo-opt, accuracy 1e-5"] = times, t.at(times)[:, 2] - rest

sunk, off = {}, {}
for name, (times, gap) in motions.items():
    sunk[name], off[name] = max(0.0, -float(gap.min())), float(np.abs(gap - exact(times)).max())
    print(f"{name:24s} sinks {1e3 * sunk[name]:8.2g} mm, differs from the exact motion by {1e3 * off[name]:8.2g} mm")

figure = Figure(figsize=(11, 4.5), layout="constrained")
for ax, engine in zip(figure.subplots(1, 2, sharey=True), ("dojo-opt", "MuJoCo"), strict=True):
    fine = TOUCH + np.linspace(-0.012, 0.06, 400)
    ax.plot(1e3 * fine, 1e3 * exact(fine), "k--", linewidth=0.9, label="exact")
    for name in (f"{engine}, {end}" for end in (*(f"{1e3 * h:g} ms" for h in SHOWN), "accuracy 1e-5")):
        if name in motions:
            style = {"linewidth": 2} if "accuracy" in name else {"marker": "o", "markersize": 4}
            ax.plot(1e3 * motions[name][0], 1e3 * motions[name][1], label=name, **style)
    ax.axhspan(-60.0, 0.0, color="0.9")
    ax.set(xlim=(1e3 * (TOUCH - 0.012), 1e3 * (TOUCH + 0.06)), ylim=(-50.0, 55.0), xlabel="time [ms]", title=engine)
    ax.legend(loc="upper right", title="gap of the ball [mm]")
finish(figure, __file__)
assert all((depth < 1e-5) == name.startswith("dojo-opt") for name, depth in sunk.items()), sunk
assert off["dojo-opt, accuracy 1e-5"] < 1e-5, off
