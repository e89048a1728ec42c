"""Atlas, 174 kg on eight balls under its soles, takes three steps: torques of 30 hinges planned through the contacts.

python examples/atlas_step.py            prints one line per iteration, writes atlas_step.png and atlas_step.html
python examples/atlas_step.py --quick    one step

The guess is a kinematic reference in balance: the weight goes onto one foot, the other swings forward, the weight goes
between the two. The plan is replayed at a fifth of its time step, where it would fall over without its gains.
"""

from dataclasses import replace

import numpy as np
from _common import QUICK, finish

import dojo_opt as dojo
from dojo_opt.constraint import Goal
from dojo_opt.cost import Effort, Tracking
from dojo_opt.gaits.feet import Feet

STEPS = [("l_foot", 0.2), ("r_foot", 0.4), ("l_foot", 0.2)][: 1 if QUICK else 3]  # [m]
sim = dojo.Simulator(dojo.models.atlas(damper=5.0), time_step=0.05, kappa=1e-6)  # that of plans
reference = None
for foot, length in STEPS:
    reference = dojo.gaits.step(sim, swinging=foot, length=length, lower=0.1, after=reference)
torques = reference.torques()
# squares per second: place and attitude of the pelvis, hinges; their velocities; torques
weight = np.concatenate([np.full(3, 30.0), np.full(3, 10.0), np.full(30, 0.2), np.full(6, 0.01), np.full(30, 1e-3)])
problem = dojo.Problem(
    sim,
    reference.x[0],
    len(torques),
    cost=[Tracking(reference.x, sim.time_step * weight), Effort(sim.time_step * 1e-5, reference=torques)],
    constraints=[Goal(reference.x[-1], components=np.arange(6))],
    controls0=torques,
    states0=reference.x,
)
plan = dojo.ilqr(problem, verbose=True)
gains = dojo.tracking_gains(problem, plan)
replay = replace(plan, K=gains).replay(time_step=sim.time_step / 5)

feet = Feet(sim)
planned, replayed = (np.abs(feet.positions(x[-1]) - reference.feet[-1]).max() for x in (plan.x, replay.x))
moved = (feet.positions(replay.x[-1]) - feet.positions(replay.x[0]))[:, 0]
upright = 1.0 - 2.0 * (replay.x[:, 4] ** 2 + replay.x[:, 5] ** 2).max()
speed = np.abs(replay.x[-1, sim.nq :]).max()
print(f"{plan.nit} iterations, largest torque {np.abs(plan.u).max():.0f} N m; feet {1e3 * planned:.1f} mm off")
print(f"at a fifth of the time step: feet {1e3 * replayed:.1f} mm off, moved {moved.min():.3f} and {moved.max():.3f} m")
print(f"upright {upright:.4f}, at the end it moves with {speed:.3f} rad/s")
dojo.viewer.save_html(plan, "atlas_step.html")
finish(dojo.plots.gait(plan), __file__)

assert plan.success, plan.message
assert replay.status.name == "SOLVED", replay.status
assert planned < 0.01
assert replayed < 0.02
assert upright > 0.99
assert speed < 0.2
