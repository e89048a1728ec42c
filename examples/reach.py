"""An arm moves its hand to a pose around a ball: costs and constraints in task space, one line each.

python examples/reach.py            prints one line per iteration, writes reach.png
python examples/reach.py --quick    with fewer knots
"""

import matplotlib.pyplot as plt
import numpy as np
from _common import QUICK, finish

import dojo_opt as dojo

sim = dojo.Simulator(dojo.models.panda(gripper=False), time_step=0.05 if QUICK else 0.02)
kin, hand, down = dojo.Kinematics(sim), "link7", (0.0, np.cos(np.pi / 8), -np.sin(np.pi / 8), 0.0)
start = sim.neutral()
start[: sim.nq] = dojo.ik(sim, {hand: ((0.45, -0.3, 0.35), down)}, start[: sim.nq]).q
goal, horizon = np.array([0.45, 0.3, 0.35]), round(1.5 / sim.time_step)
ball = dojo.Sphere(0.12, center=(0.5, 0.0, 0.35))

problem = dojo.Problem(
    sim,
    start,
    horizon,
    cost=[dojo.cost.Effort(1e-4), dojo.cost.Tracking(start, {"v": 0.1})],
    constraints=[
        dojo.constraint.Frame(hand, goal, down, knots=-1),
        dojo.constraint.Velocity(hand, knots=-1),  # ends at rest
        dojo.constraint.Clearance(hand, ball, shape_a=dojo.Sphere(0.05)),
        dojo.constraint.JointLimits(margin=0.05),
    ],
    controls0=kin.gravity_torques(start[: sim.nq]),
)
plan = dojo.ilqr(problem, verbose=True)

at, turn = kin.pose(hand, plan.x[:, : sim.nq])
clear = np.linalg.norm(at - ball.center, axis=1) - 0.17
off = np.linalg.norm(at[-1] - goal)
print(f"{plan.nit} iterations; the hand ends {1e3 * off:.2f} mm off, {1e3 * clear.min():.1f} mm clear of the ball")

figure, (front, time) = plt.subplots(1, 2, figsize=(9, 3.5), layout="constrained")
front.plot(at[:, 1], at[:, 2], marker=".")
front.add_patch(plt.Circle(ball.center[1:], 0.12, color="0.85"))
front.add_patch(plt.Circle(at[clear.argmin(), 1:], 0.05, fill=False, ls=":"))  # the hand where it is nearest
front.plot(*goal[1:], "kx")
front.annotate("goal", goal[1:], xytext=(-10, 10), textcoords="offset points")
front.annotate("ball", ball.center[1:], ha="center", va="center")
front.set(xlabel="y [m]", ylabel="z [m]", aspect="equal", ylim=(0.1, 0.65), title="the hand from the front")
front.margins(x=0.15)
time.plot(plan.time, 1e3 * clear)
time.axhline(0.0, color="k", lw=0.8)
time.set(xlabel="time [s]", ylabel="hand to ball [mm]", title="clearance")
finish(figure, __file__)

assert plan.success, plan.message
assert off < 2e-3, off
assert clear.min() > -2e-3, clear.min()
