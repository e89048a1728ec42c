"""How a cube on the ground answers to a push: derivatives at several kappa, finite differences of MuJoCo beside.

python examples/contact_gradients.py        writes contact_gradients.png

The cube, 1 kg, is pulled up, or pushed sideways, for 50 ms. Below its weight, or below friction, it does not
move: hard contact has a derivative of zero there, which tells a planner nothing. A larger kappa sees the other side.
"""

from importlib.util import find_spec

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo
from benchmarks.engines import mujoco_scene

KAPPAS, TIME_STEP, STEPS, POINTS = (1e-3, 1e-4, 1e-5, 1e-6), 0.01, 5, 21 if QUICK else 81
sim = dojo.Simulator(dojo.models.block(friction=0.5), time_step=TIME_STEP)
pushes = {"up": (2, np.linspace(5.0, 15.0, POINTS)), "sideways": (0, np.linspace(0.1, 9.9, POINTS))}


def ours(axis, force, kappa):
    """d(displacement)/d(force) of STEPS steps [m/N]; at rest its eight corners float 8 kappa / (m g h) high."""
    start, u = sim.neutral(), np.zeros(3)
    start[2] += 8.0 * kappa / (9.81 * TIME_STEP)
    u[axis] = force
    return sim.linearize_trajectory(start[None], u[None], substeps=STEPS, kappa=kappa).B[0, axis, axis]


def difference(axis, force, step=1e-4):
    """The same by a central difference of MuJoCo, from its own rest."""
    import mujoco

    model = mujoco_scene.load(sim.model, TIME_STEP, integrator="implicitfast")
    places = []
    for f in (force - step, force + step):
        data = mujoco_scene.state(model, sim.neutral())
        mujoco.mj_step(model, data, 200)
        data.ctrl[axis] = f
        mujoco.mj_step(model, data, STEPS)
        places.append(data.qpos[axis])
    return (places[1] - places[0]) / (2.0 * step)


figure = Figure(figsize=(10, 4.5), layout="constrained")
for ax, (name, (axis, forces)) in zip(figure.subplots(1, 2), pushes.items(), strict=True):
    curves = np.array([[ours(axis, f, kappa) for f in forces] for kappa in KAPPAS])
    for kappa, curve in zip(KAPPAS, curves, strict=True):
        ax.plot(forces, curve, label=f"dojo-opt, $\\kappa$ = {kappa:.0e}")
    if find_spec("mujoco"):
        ax.plot(forces, [difference(axis, f) for f in forces], "k.", label="MuJoCo, differences")
    ax.set_yscale("symlog", linthresh=1e-6)
    ax.set(xlabel=f"force {name} [N]", ylabel="d(displacement)/d(force) after 50 ms [m/N]")
    ax.legend(fontsize=8)
    print(name, "weakest push:", ", ".join(f"{k:.0e}: {c:.1e} m/N" for k, c in zip(KAPPAS, curves[:, 0], strict=True)))
    assert np.all(np.diff(curves[:, 0]) < 0.0)  # a larger kappa tells more from afar
    free = 0.5 * TIME_STEP**2 * STEPS * (STEPS + 1)  # in flight, 1 kg
    assert abs(curves[-1, -1] / free - 1.0) < 0.1, (curves[-1, -1], free)
finish(figure, __file__)
