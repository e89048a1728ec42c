"""A block slides in eight directions: the friction cone stops it on a circle, the four-sided pyramid does not.

python examples/friction_cones.py        prints the distances, writes friction_cones.png
"""

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo

SPEED, FRICTION = 2.0, 0.5  # [m/s]
EXPECTED = SPEED**2 / (2.0 * FRICTION * 9.81)  # [m] for Coulomb's law in every direction
H = 0.01 if QUICK else 0.005
angles = np.arange(8) * np.pi / 4 + np.pi / 16  # off the axes of the pyramid

figure = Figure(figsize=(9, 4.8), layout="constrained")
errors = {}
for ax, law in zip(figure.subplots(1, 2), ("linear", "nonlinear"), strict=True):
    sim = dojo.Simulator(dojo.models.block(edge=0.2, friction=FRICTION, law=law), time_step=H, kappa=1e-8)
    ends = []
    for angle in angles:
        way = np.array([np.cos(angle), np.sin(angle)])
        velocity = np.concatenate([SPEED * way, np.zeros(4)])
        t = sim.rollout(sim.start(sim.neutral()[:7], velocity), np.zeros((round(0.8 / H), sim.nu)), throw=True)
        ends.append(t.x[-1, :2])
        ax.plot(*t.x[:, :2].T, color="C0")
        ax.plot(*(1.4 * EXPECTED * way), ".", color="0.7")
        assert np.linalg.norm(t.x[-1, 7:9]) < 1e-3
    distance = np.linalg.norm(ends, axis=1)
    turned = [
        np.degrees(np.arccos(e @ (np.cos(a), np.sin(a)) / d)) for e, d, a in zip(ends, distance, angles, strict=True)
    ]
    errors[law] = (np.abs(distance / EXPECTED - 1.0).max(), max(turned))
    print(f"{law}: {distance.min():.4f} to {distance.max():.4f} m, Coulomb {EXPECTED:.4f} m; ", end="")
    print(f"turned by up to {max(turned):.3f} degrees")
    circle = np.linspace(0.0, 2.0 * np.pi, 100)
    ax.plot(EXPECTED * np.cos(circle), EXPECTED * np.sin(circle), "k--", linewidth=0.8)
    ax.plot(*np.array(ends).T, "o", color="C3")
    ax.set_title(f"{law}: stopping distance off by up to {100 * errors[law][0]:.1f} %")
    ax.set_aspect("equal")
    ax.set_xlabel("x [m]")
    ax.set_ylabel("y [m]")

assert errors["nonlinear"][0] < 0.02 and errors["nonlinear"][1] < 0.5, errors
assert errors["linear"][0] > 0.1 and errors["linear"][1] > 2.0, errors
finish(figure, __file__)
