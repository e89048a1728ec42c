"""How a cube on the ground answers to a push: derivatives at several kappa, gradient bundles, and MuJoCo beside.

python examples/contact_gradients.py        writes contact_gradients.png

The cube, 1 kg, is pulled up, or pushed sideways, for 50 ms. Below its weight, or below friction, it does not
move: hard contact has a derivative of zero there, which tells a planner nothing. A larger kappa sees the other side.
So does a gradient bundle, the mean of hard derivatives at random pushes (Suh, Pang, Tedrake, RA-L 2022).
"""

from importlib.util import find_spec

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure
from scipy.stats import norm

import dojo_opt as dojo
from benchmarks.engines import mujoco_motions

KAPPAS, TIME_STEP, STEPS, POINTS = (1e-3, 1e-4, 1e-5, 1e-6), 0.01, 5, 21 if QUICK else 81
HARD, DEVIATIONS, SAMPLES = 1e-9, (0.3, 1.0), 100  # of gradient bundles: kappa, of the pushes [N], how many
sim = dojo.Simulator(dojo.models.block(friction=0.5), time_step=TIME_STEP)
pushes = {"up": (2, np.linspace(5.0, 15.0, POINTS)), "sideways": (0, np.linspace(0.1, 9.9, POINTS))}


def ours(axis, forces, kappa):
    """d(displacement)/d(force) of STEPS steps [m/N]; at rest its eight corners float 8 kappa / (m g h) high."""
    starts, us = np.tile(sim.neutral(), (len(forces), 1)), np.zeros((len(forces), 3))
    starts[:, 2] += 8.0 * kappa / (9.81 * TIME_STEP)
    us[:, axis] = forces
    return sim.linearize_trajectory(starts, us, substeps=STEPS, kappa=kappa).B[:, axis, axis]


def bundle(axis, forces, deviation):
    """Mean of the hard derivatives at normally distributed forces, one of each of SAMPLES equally likely parts."""
    parts = norm.ppf((np.arange(SAMPLES) + 0.5) / SAMPLES)
    return np.array([ours(axis, force + deviation * parts, HARD).mean() for force in forces])


figure = Figure(figsize=(10, 4.5), layout="constrained")
for ax, (name, (axis, forces)) in zip(figure.subplots(1, 2), pushes.items(), strict=True):
    curves = np.array([ours(axis, forces, kappa) for kappa in (*KAPPAS, HARD)])
    for kappa, curve in zip((*KAPPAS, HARD), curves, strict=True):
        ax.plot(forces, curve, label=f"dojo-opt, $\\kappa$ = {kappa:.0e}", color="0.6" if kappa == HARD else None)
    for deviation in DEVIATIONS:
        mean = bundle(axis, forces, deviation)
        ax.plot(forces, mean, "--", label=f"bundle of {SAMPLES} hard ones, {deviation:g} N")
    if find_spec("mujoco"):
        theirs = [mujoco_motions.push_rate(sim, axis, force, STEPS) for force in forces]
        ax.plot(forces, theirs, "k.", label="MuJoCo, differences")
    ax.set_yscale("symlog", linthresh=1e-6)
    ax.set(xlabel=f"force {name} [N]", ylabel="d(displacement)/d(force) after 50 ms [m/N]")
    ax.legend(fontsize=7)
    print(name, "weakest push:", ", ".join(f"{k:.0e}: {c:.1e} m/N" for k, c in zip(KAPPAS, curves[:, 0], strict=False)))
    assert np.all(np.diff(curves[:, 0]) < 0.0)  # a larger kappa tells more from afar
    free = 0.5 * TIME_STEP**2 * STEPS * (STEPS + 1)  # in flight, 1 kg
    assert abs(curves[-1, -1] / free - 1.0) < 0.1, (curves[-1, -1], free)
    border = 9.81 if name == "up" else 0.5 * 9.81  # half of the pushes about it move the cube
    assert 0.3 < np.interp(border, forces, mean) / mean[-1] < 0.7
finish(figure, __file__)
