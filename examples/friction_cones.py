"""A block slides in eight directions: the friction cone stops it on a circle, the four-sided pyramid does not.

python examples/friction_cones.py        prints the distances, writes friction_cones.png

A pyramid pulls the block sideways, out of its direction. With MuJoCo installed, its pyramid and its cone beside ours:
the soft contact of the cone pulls sideways as well.
"""

from importlib.util import find_spec

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo
from benchmarks.engines import mujoco_scene

SPEED, FRICTION = 2.0, 0.5  # [m/s]
EXPECTED = SPEED**2 / (2.0 * FRICTION * 9.81)  # [m] for Coulomb's law in every direction
H = 0.01 if QUICK else 0.005
STEPS = round(0.8 / H)
angles = np.arange(8) * np.pi / 4 + np.pi / 16  # off the axes of the pyramid


def block(law):
    """The simulator of a block of 20 cm."""
    return dojo.Simulator(dojo.models.block(edge=0.2, friction=FRICTION, law=law), time_step=H, kappa=1e-8)


def ours(law, velocity):
    """Path of the block on the ground, (n, 2) [m], and its speed in the end."""
    sim = block(law)
    t = sim.rollout(sim.start(sim.neutral()[:7], velocity), np.zeros((STEPS, sim.nu)), throw=True)
    return t.x[:, :2], np.linalg.norm(t.x[-1, 7:9])


def theirs(cone, velocity):
    """The same of MuJoCo, from where the block has come to rest on the ground."""
    import mujoco

    sim = block("nonlinear")
    model = mujoco_scene.load(sim.model, H, integrator="implicitfast", cone=cone)
    data = mujoco_scene.state(model, sim.neutral())
    mujoco.mj_step(model, data, 200)
    begin, path = data.qpos[:2].copy(), np.zeros((STEPS + 1, 2))
    data.qvel[:] = velocity
    for k in range(STEPS):
        mujoco.mj_step(model, data)
        path[k + 1] = data.qpos[:2] - begin
    return path, np.linalg.norm(data.qvel[:2])


panels = {"linear": (ours, "linear"), "nonlinear": (ours, "nonlinear")}
if find_spec("mujoco"):
    panels |= {"MuJoCo, pyramidal": (theirs, "pyramidal"), "MuJoCo, elliptic": (theirs, "elliptic")}
figure = Figure(figsize=(4.5 * len(panels), 4.8), layout="constrained")
errors = {}
for ax, (name, (run, law)) in zip(figure.subplots(1, len(panels)), panels.items(), strict=True):
    ends, slips = [], []
    for angle in angles:
        way, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        path, speed = run(law, np.concatenate([SPEED * way, np.zeros(4)]))
        ends.append(path[-1])
        slips.append(np.abs(path @ across).max())
        ax.plot(*path.T, color="C0")
        ax.plot(*(1.4 * EXPECTED * way), ".", color="0.7")
        assert run is theirs or speed < 1e-3
    distance = np.linalg.norm(ends, axis=1)
    errors[name] = (np.abs(distance / EXPECTED - 1.0).max(), max(slips))
    print(f"{name}: {distance.min():.4f} to {distance.max():.4f} m, Coulomb {EXPECTED:.4f} m; ", end="")
    print(f"sideways by up to {max(slips):.5f} m")
    circle = np.linspace(0.0, 2.0 * np.pi, 100)
    ax.plot(EXPECTED * np.cos(circle), EXPECTED * np.sin(circle), "k--", linewidth=0.8)
    ax.plot(*np.array(ends).T, "o", color="C3")
    label = name if run is theirs else f"dojo-opt, {name}"
    ax.set_title(
        f"{label}: way off by up to {100 * errors[name][0]:.1f} %,\nsideways by up to {1e3 * max(slips):.1f} mm"
    )
    ax.set_aspect("equal")
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")

finish(figure, __file__)
assert errors["nonlinear"][0] < 0.02 and errors["nonlinear"][1] < 1e-3, errors
assert errors["linear"][0] > 0.1 and errors["linear"][1] > 0.01, errors
