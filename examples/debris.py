"""A chaser in free fall closes two jaws on a tumbling piece of debris: contact between bodies, and no ground.

python examples/debris.py        prints conserved quantities, writes debris.png

Captured: relative to the chaser, the debris ends with less than a thousandth of the speed and spin it came with.
Nothing acts from outside: the chaser gains the momentum that the debris loses, to the tolerance of the steps.
"""

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import dojo_opt as dojo

GRIP, HELD, DURATION = 20.0, 1e-3, 3.0 if QUICK else 10.0  # force on a jaw [N], share of the motion left, [s]

bodies = [
    dojo.Body("chaser", 60.0, shape=dojo.Box(0.6, 0.6, 0.6)),
    dojo.Body("debris", 12.0, shape=dojo.Box(0.4, 0.3, 0.3)),
]
joints = [dojo.Joint("floating", None, name) for name in ("chaser", "debris")]
for name, side in (("left", 1), ("right", -1)):  # plates on rails, 0.9 m in front of the chaser's centre
    bodies.append(dojo.Body(name, 3.0, shape=dojo.Box(0.5, 0.04, 0.5)))
    rail = {"parent_point": (0.9, 0.5 * side, 0), "axis": (0, -side, 0)}
    joints.append(dojo.Joint("prismatic", "chaser", name, damper=30.0, **rail))
grips = [dojo.Collision("debris", name, friction=0.6) for name in ("chaser", "left", "right")]
mech = dojo.Mechanism(bodies, joints, collisions=grips, gravity=(0, 0, 0), name="debris")
sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-8, tolerance=1e-11)
x = sim.neutral()
x[mech.q_slice("debris")] = [1.0, 0.02, -0.03, *np.array([0.9, 0.3, -0.2, 0.2]) / 0.98**0.5]
x[sim.nq :][mech.v_slice("debris")] = [-0.1, 0.0, 0.02, 0.5, -0.3, 0.4]
t = sim.rollout(x, np.tile([GRIP, GRIP], (round(DURATION / sim.time_step), 1)), throw=True)

linear, angular = sim.momentum(t.x)
drift = max(np.ptp(linear, axis=0).max(), np.ptp(angular, axis=0).max())
z = sim.maximal(t.x)
turns = [Rotation.from_quat(z[:, i, 6:10], scalar_first=True) for i in (0, 1)]
chaser, debris = (turn.apply(z[:, i, 10:]) for i, turn in enumerate(turns))
slip = z[:, 1, 3:6] - z[:, 0, 3:6] - np.cross(chaser, z[:, 1, :3] - z[:, 0, :3])  # as seen from the chaser
speed, spin = np.linalg.norm(slip, axis=1), np.linalg.norm(debris - chaser, axis=1)
print(
    f"momentum kept to {drift:.1e}; speed {speed[0]:.2f} -> {speed[-1]:.1e} m/s, spin {spin[0]:.2f} -> {spin[-1]:.1e}"
)

figure = Figure(figsize=(8, 6), layout="constrained")
top, bottom = figure.subplots(2, 1, sharex=True)
top.semilogy(t.time, spin, label="spin [rad/s]")
top.semilogy(t.time, speed, label="speed of the centre [m/s]")
top.set_title("the debris, as seen from the chaser")
own = np.einsum("tij,j,tkj,tk->ti", turns[1].as_matrix(), np.diag(mech.bodies[1].inertia), turns[1].as_matrix(), debris)
orbit = own + 12.0 * np.cross(z[:, 1, :3], z[:, 1, 3:6])
for part, name in ((orbit, "debris"), (angular - orbit, "chaser and jaws"), (angular, "all")):
    bottom.plot(t.time, part[:, 1], label=name)
bottom.set(title="angular momentum about y [N m s]", xlabel="time [s]", xlim=(0.0, 3.0))
for ax in (top, bottom):
    ax.legend(loc="upper right")
assert drift < 1e-9, drift
assert speed[-1] < HELD * speed[0] and spin[-1] < HELD * spin[0], (speed[-1], spin[-1])
finish(figure, __file__)
