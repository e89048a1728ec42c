"""A top whose centre of mass is below its centre turns over and spins on its knob: friction lifts its weight.

python examples/tippetop.py        prints the height it gains, writes tippetop.png
"""

import numpy as np
from _common import finish
from matplotlib.figure import Figure

import dojo_opt as dojo

SPIN, TILT, RADIUS = 200.0, 0.1, 0.02  # [rad/s], [rad], [m]
DURATION = 4.0  # [s]
inertia = 0.4 * 0.015 * RADIUS**2 * np.array([1.0, 1.0, 1.0])
top = dojo.models.tippetop(mass=0.015, radius=RADIUS, inertia=inertia, scale=0.2, offset=0.004, friction=0.3)
sim = dojo.Simulator(top, time_step=5e-4, kappa=1e-9)

x = sim.neutral()
x[3:7] = np.cos(TILT / 2), np.sin(TILT / 2), 0.0, 0.0
x[2] = RADIUS - 0.004 * np.cos(TILT)
x = sim.state_from_velocity(x[: sim.nq], np.array([0.0, 0.0, 0.0, 0.0, SPIN * np.sin(TILT), SPIN * np.cos(TILT)]))
t = sim.rollout(x, np.zeros((round(DURATION / sim.time_step), 0)), throw=True)

w, i, j, k = t.x[:, 3:7].T
tilt = np.degrees(np.arccos(np.clip(1.0 - 2.0 * (i * i + j * j), -1.0, 1.0)))
energy = sim.energy(t.x)
gap = t.contacts.gap.min()
rise = 1e3 * (t.x[-1, 2] - t.x[0, 2])
print(f"tilt {tilt[0]:.0f} -> {tilt[-1]:.0f} degrees, centre of mass {rise:+.2f} mm, smallest gap {gap:.1e} m")
print(f"energy {1e3 * energy[0]:.2f} -> {1e3 * energy[-1]:.2f} mJ")

figure = Figure(figsize=(9, 6), layout="constrained")
axes = figure.subplots(3, 1, sharex=True)
axes[0].plot(t.time, tilt)
axes[0].set_ylabel("tilt [degrees]")
axes[1].plot(t.time, 1e3 * t.x[:, 2])
axes[1].set_ylabel("height [mm]")
axes[2].plot(t.time, 1e3 * energy)
axes[2].set_ylabel("energy [mJ]")
axes[2].set_xlabel("time [s]")

assert tilt.max() > 160.0 and tilt[-1] > 150.0, tilt
assert t.x[-1, 2] > t.x[0, 2]
assert gap > -1e-9 and np.all(np.diff(energy) < 1e-5 * energy[0])
finish(figure, __file__)
