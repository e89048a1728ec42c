"""A chaser in free fall catches a tumbling piece of debris with three claws: contact between bodies, and no ground.

python examples/debris.py        prints what is conserved, writes debris.png

Nothing acts from outside: what the debris loses of its momentum the chaser gains, to the tolerance of the steps.
"""

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import dojo_opt as dojo

DURATION = 10.0 if QUICK else 20.0
OPEN, CLOSED = np.tile([0.9, -0.3], 3), np.tile([0.0, -1.1], 3)  # angles of the claws: upper and lower links [rad]
LINK = {"child_point": (0, 0, -0.25), "axis": (0, 1, 0), "damper": 1.0}

bodies, joints = [dojo.Body("chaser", 60.0, shape=dojo.Box(0.6, 0.6, 0.6))], [dojo.Joint("floating", None, "chaser")]
for k in range(3):  # a third of a turn about the x axis of the chaser per claw; z of a link leads away from it
    c, s = np.cos(np.pi * k / 3), np.sin(np.pi * k / 3)
    root, frame = (0.3, 0.3 * (c * c - s * s), 0.6 * s * c), 0.5 * np.array([c - s, c + s, c - s, c + s])
    bodies += [dojo.Body(f"{name}{k}", 2.0, shape=dojo.Capsule(0.03, 0.5)) for name in ("upper", "lower")]
    joints += [dojo.Joint("revolute", "chaser", f"upper{k}", parent_point=root, orientation=frame, **LINK)]
    joints += [dojo.Joint("revolute", f"upper{k}", f"lower{k}", parent_point=(0, 0, 0.25), **LINK)]
hands = [dojo.Collision("debris", body.name, friction=0.6) for body in bodies]
bodies += [dojo.Body("debris", 12.0, shape=dojo.Box(0.4, 0.3, 0.3))]
joints += [dojo.Joint("floating", None, "debris")]
mech = dojo.Mechanism(bodies, joints, collisions=hands, gravity=(0, 0, 0), name="debris")
sim = dojo.Simulator(mech, time_step=0.02, kappa=1e-8, tolerance=1e-10)
x = sim.neutral()  # the chaser, six angles, the debris
x[7:13], x[13:16], x[16:20] = OPEN, (1.1, 0.02, -0.03), np.array([0.9, 0.3, -0.2, 0.2]) / 0.98**0.5
x[sim.nq + 12 :] = (-0.1, 0.0, 0.02, 0.5, -0.3, 0.4)
states = [x]
for time in np.arange(round(DURATION / sim.time_step)) * sim.time_step:
    target = OPEN + np.clip((time - 0.5) / 3.0, 0.0, 1.0) * (CLOSED - OPEN)
    x = sim.step(x, np.clip(40.0 * (target - x[7:13]) - 8.0 * x[sim.nq + 6 : sim.nq + 12], -5.0, 5.0), throw=True).x
    states.append(x)

time = np.arange(len(states)) * sim.time_step
linear, angular = sim.momentum(np.array(states))
drift = max(np.abs(linear - linear[0]).max(), np.abs(angular - angular[0]).max())
z = sim.maximal(np.array(states))
spins = [Rotation.from_quat(z[:, i, 6:10], scalar_first=True).apply(z[:, i, 10:]) for i in (0, -1)]
spin, apart = (np.linalg.norm(pair, axis=1) for pair in (spins[1] - spins[0], z[:, -1, :3] - z[:, 0, :3]))
print(f"momentum {drift:.1e} off; debris against chaser: spin {spin[0]:.2f} -> {spin[-1]:.4f} rad/s")

figure = Figure(figsize=(8, 6), layout="constrained")
top, bottom = figure.subplots(2, 1, sharex=True)
top.plot(time, spin, label="spin of the debris against the chaser [rad/s]")
top.plot(time, apart, label="distance of the centres [m]")
p = np.stack([12.0 * z[:, -1, 3], linear[:, 0] - 12.0 * z[:, -1, 3], linear[:, 0]])  # [N s]
for part, name in zip(p, ("the debris", "the chaser and its claws", "all"), strict=True):
    bottom.plot(time, part, label=f"momentum of {name} along x [N s]")
for ax in (top, bottom):
    ax.legend(loc="center right")
bottom.set_xlabel("time [s]")
assert drift < 1e-6, drift
assert spin[-1] < 0.05 * spin[0], spin[-1]
assert np.ptp(apart[-25:]) < 1e-3, "not held"
finish(figure, __file__)
