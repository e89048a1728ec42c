"""A chaser in free fall catches a tumbling piece of debris with three claws: contact between bodies, and no ground.

python examples/debris.py        prints what is conserved, writes debris.png

Nothing acts from outside: what the debris loses of its momentum the chaser gains, to the tolerance of the steps.
"""

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo

DURATION = 8.0 if QUICK else 16.0
OPEN, CLOSED = np.tile([0.9, -0.3], 3), np.tile([0.0, -1.1], 3)  # angles of the claws: upper and lower links [rad]

bodies = [dojo.Body("chaser", 60.0, shape=dojo.Box(0.6, 0.6, 0.6))]
joints = [dojo.Joint("floating", None, "chaser")]
for k in range(3):
    c, s = np.cos(np.pi * k / 3), np.sin(np.pi * k / 3)
    outward = (0.3, 0.3 * (c * c - s * s), 0.6 * s * c)  # a third of a turn about the x axis of the chaser per claw
    frame = (0.5 * (c - s), 0.5 * (c + s), 0.5 * (c - s), 0.5 * (c + s))  # z of a link leads away from the chaser
    for name, parent, point, at in ((f"upper{k}", "chaser", outward, frame), (f"lower{k}", f"upper{k}", (0, 0, 0.25), (1, 0, 0, 0))):
        bodies.append(dojo.Body(name, 2.0, shape=dojo.Capsule(0.03, 0.5)))
        hinge = {"parent_point": point, "child_point": (0, 0, -0.25), "axis": (0, 1, 0), "orientation": at}
        joints.append(dojo.Joint("revolute", parent, name, damper=1.0, **hinge))
hands = [dojo.Collision("debris", body.name, friction=0.6) for body in bodies]
bodies.append(dojo.Body("debris", 12.0, shape=dojo.Box(0.4, 0.3, 0.3)))
joints.append(dojo.Joint("floating", None, "debris"))
mech = dojo.Mechanism(bodies, joints, collisions=hands, gravity=(0, 0, 0), name="debris")
sim = dojo.Simulator(mech, time_step=0.02, kappa=1e-8, tolerance=1e-10)

x = sim.neutral()
claws = slice(7, 13)
x[claws] = OPEN
debris = mech.q_slice("debris")
x[debris] = [1.1, 0.02, -0.03, *np.array([0.9, 0.3, -0.2, 0.2]) / np.sqrt(0.98)]
x[sim.nq + mech.v_slice("debris").start :] = [-0.1, 0.0, 0.02, 0.5, -0.3, 0.4]
states, pushes = [x], []
for k in range(round(DURATION / sim.time_step)):
    share = np.clip((k * sim.time_step - 0.5) / 3.0, 0.0, 1.0)
    target = OPEN + share * (CLOSED - OPEN)
    u = np.clip(40.0 * (target - x[claws]) - 8.0 * x[sim.nq + 6 : sim.nq + 12], -5.0, 5.0)
    step = sim.step(x, u)
    assert step.success, step.message
    x = step.x
    states.append(x)
    pushes.append(step.contacts.normal_force.sum())
