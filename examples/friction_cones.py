"""A block slides in eight directions: the friction cone stops it on a circle, the four-sided pyramid does not.

python examples/friction_cones.py        prints the distances, writes friction_cones.png

A pyramid pulls the block sideways, out of its direction. With MuJoCo installed, its pyramid and its cone beside ours.
"""

from importlib.util import find_spec

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo
from benchmarks.engines import mujoco_motions

SPEED, FRICTION = 2.0, 0.5  # [m/s]
EXPECTED = SPEED**2 / (2.0 * FRICTION * 9.81)  # [m] for Coulomb's law in every direction
H, STEPS = (0.01, 80) if QUICK else (0.005, 160)
angles = np.arange(8) * np.pi / 4 + np.pi / 16


def ours(law, velocity):
    """Path of the block on the ground, (n, 2) [m]; at the end it is at rest."""
    sim = dojo.Simulator(dojo.models.block(edge=0.2, friction=FRICTION, law=law), time_step=H, kappa=1e-8)
    t = sim.rollout(sim.state_from_velocity(sim.neutral()[:7], velocity), np.zeros((STEPS, sim.nu)), throw=True)
    assert np.linalg.norm(t.x[-1, 7:9]) < 1e-3
    return t.x[:, :2]


def theirs(cone, velocity):
    """That of MuJoCo."""
    sim = dojo.Simulator(dojo.models.block(edge=0.2, friction=FRICTION), time_step=H)
    return mujoco_motions.slide(sim, cone, velocity, STEPS)


panels = {"dojo-opt, pyramid": (ours, "linear"), "dojo-opt, cone": (ours, "nonlinear")}
if find_spec("mujoco"):
    panels |= {"MuJoCo, pyramid": (theirs, "pyramidal"), "MuJoCo, cone": (theirs, "elliptic")}
figure, off = Figure(figsize=(4.5 * len(panels), 4.8), layout="constrained"), {}
for ax, (name, (run, law)) in zip(figure.subplots(1, len(panels)), panels.items(), strict=True):
    ends, slips = [], []
    for angle in angles:  # off the axes of the pyramid
        way, across = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        path = run(law, np.r_[SPEED * way, np.zeros(4)])
        ends, slips = [*ends, path[-1]], [*slips, np.abs(path @ across).max()]
        ax.plot(*path.T, color="C0")
    distance = np.linalg.norm(ends, axis=1)
    off[name] = np.abs(distance / EXPECTED - 1.0).max(), max(slips)
    print(
        f"{name}: {distance.min():.4f} to {distance.max():.4f} m, Coulomb {EXPECTED:.4f}; sideways {max(slips):.4f} m"
    )
    circle = np.exp(2.0j * np.pi * np.linspace(0.0, 1.0, 100))
    ax.plot(EXPECTED * circle.real, EXPECTED * circle.imag, "k--", linewidth=0.8)
    ax.plot(*np.array(ends).T, "o", color="C3")
    ax.set_title(f"{name}: errors up to {100 * off[name][0]:.1f} % along,\n{1e3 * max(slips):.1f} mm across")
    ax.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
finish(figure, __file__)
cone, pyramid = off["dojo-opt, cone"], off["dojo-opt, pyramid"]
assert cone[0] < 0.02 and cone[1] < 1e-3 and pyramid[0] > 0.1 and pyramid[1] > 0.01, off
