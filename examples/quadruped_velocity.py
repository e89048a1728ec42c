"""A quadruped learns to keep a commanded velocity, through the derivatives of its contacts: minutes on one core.

python examples/quadruped_velocity.py        writes quadruped_velocity.png, .html and .npz

The policy learns on models with other masses and friction than the robot that it is judged on, and under pushes. There,
the time step is a fifth, contacts are a hundred times harder, the ground is slippery, and somebody pushes.
"""

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo

LABELS = "forwards [m/s]", "to the left [m/s]", "turning [rad/s]"
HOLD, COMMANDS = 2.0, 3 if QUICK else 10  # [s] of a command
task = dojo.learn.quadruped()
learned = dojo.learn.shac(task, seed=0, verbose=True, **({"epochs": 20, "evaluations": 1} if QUICK else {}))
print(learned)
learned.policy.save("quadruped_velocity.npz")

commands = np.random.default_rng(1).uniform((-1.0, -0.5, -1.0), (1.0, 0.5, 1.0), (COMMANDS, 3))


def command(time):
    """Forwards, to the left [m/s], turning [rad/s]."""
    return commands[min(int(time / HOLD + 1e-9), COMMANDS - 1)]


world = task.sim.replace(time_step=0.002, kappa=1e-6)
pushes = [dojo.Push(t, (0.0, 4.0, 0.0)) for t in np.arange(5.0, HOLD * COMMANDS, 7.0)]  # [N s] to the left
plant = dojo.Plant(world, friction=0.6, payload=1.0, pushes=pushes)
loop = dojo.closed_loop(
    learned.policy.commanded(command), plant, HOLD * COMMANDS, control_step=task.knot_time, fallen=task.terminated
)
print(f"{loop.message} wrote {dojo.viewer.save_html(loop, 'quadruped_velocity.html')}")
wanted = np.array([command(t) for t in loop.time])
error = dojo.learn.velocity_error(loop.x, wanted)
late = loop.time % HOLD > 1.0  # a second after the command has changed
for name, rows in (("all the time", late | True), ("from a second after a new command on", late)):
    rms = np.sqrt(np.mean(error[rows] ** 2, axis=0))
    print(f"rms of the error {name}: {rms[0]:.3f} m/s, {rms[1]:.3f} m/s, {rms[2]:.3f} rad/s")

figure = Figure(figsize=(7.0, 6.0), layout="constrained")
for k, (axes, label) in enumerate(zip(figure.subplots(3, 1, sharex=True), LABELS, strict=True)):
    axes.plot(loop.time, wanted[:, k] + error[:, k], lw=0.8, label="robot")
    axes.plot(loop.time, wanted[:, k], "k--", lw=1.0, label="command")
    axes.set(ylabel=label)
axes.set(xlabel="time [s]")
axes.legend(loc="upper right")
assert learned.infinite == 0
assert QUICK or (loop.survived and np.all(rms < (0.25, 0.25, 0.35)))
finish(figure, __file__)
