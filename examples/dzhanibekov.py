"""A handle in space, spun about its middle axis, turns over and over; spun about the others it does not.

python examples/dzhanibekov.py        prints the flips, writes dzhanibekov.png

Momentum is conserved to rounding and energy to a bounded error, or the turning over would come too early and fade.
"""

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo

SPEED, NUDGE = 6.0, 1e-3  # [rad/s]
DURATION = 10.0 if QUICK else 30.0
sim = dojo.Simulator(dojo.models.dzhanibekov(), time_step=0.01, tolerance=1e-12)
time = np.arange(round(DURATION / sim.time_step) + 1) * sim.time_step

figure = Figure(figsize=(9, 6), layout="constrained")
axes = figure.subplots(3, 1, sharex=True)
flips = {}
for ax, (name, k) in zip(axes, (("smallest (y)", 1), ("middle (x)", 0), ("largest (z)", 2)), strict=True):
    spin = np.full(3, NUDGE)
    spin[k] = SPEED
    start = sim.state_from_velocity(sim.neutral()[: sim.nq], np.concatenate([np.zeros(3), spin]))
    t = sim.rollout(start, np.zeros((len(time) - 1, 0)), throw=True)
    linear, angular = sim.momentum(t.x)
    drift = np.abs(angular - angular[0]).max()
    energy = sim.energy(t.x)
    rate = t.x[:, sim.nq + 3 + k]  # about the axis itself, body axes
    flips[name] = int(np.sum(np.diff(np.sign(rate)) != 0))
    ax.plot(time, t.x[:, sim.nq + 3 :], label=["x", "y", "z"])
    ax.set_title(f"spun about the axis of the {name} moment of inertia: {flips[name]} flips", fontsize=10)
    ax.set_ylabel("$\\omega$ [rad/s]")
    print(f"{name}: {flips[name]} flips, momentum {drift:.1e} N m s off, energy {np.ptp(energy) / energy[0]:.1e}")
    assert drift < 1e-9, drift
    assert np.ptp(energy) < 1e-3 * energy[0]
axes[0].legend(loc="upper right", ncols=3)
axes[2].set_xlabel("time [s]")

assert flips["smallest (y)"] == flips["largest (z)"] == 0
assert flips["middle (x)"] >= (2 if QUICK else 6)
finish(figure, __file__)
