"""Gradient of a touch-down: d(velocity after the step)/d(height before it), for several kappa and for MuJoCo.

    python benchmarks/touchdown.py                      writes touchdown.png; needs the bench extra for MuJoCo

A ball of 1 kg falls at 1 m/s towards the ground; one step of 20 ms. Without contact the gradient is 0. Where the step
reaches the ground the hard answer is v+ = -height / h, a gradient of -1/h = -50 per second: the step arrives exactly
on the ground. A central path of parameter kappa blends the two over a length sqrt(kappa h / m). MuJoCo's gradient is
its own finite difference, mjd_transitionFD, of the same ball with default contact, with solimp[0] = 0 (its manual:
contact that switches on smoothly), and that with a time constant of two steps.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

import dojo_opt as dojo

Vector = NDArray[np.float64]
H, SPEED, RADIUS = 0.02, 1.0, 0.1
KAPPAS = (1e-2, 1e-3, 1e-4, 1e-6)

BALL = """<mujoco><option timestep="{h}" cone="elliptic"/><worldbody>
<geom type="plane" size="5 5 .1" solref="{solref}" solimp="{solimp}"/>
<body pos="0 0 {radius}"><freejoint/>
<geom type="sphere" size="{radius}" mass="1" solref="{solref}" solimp="{solimp}"/></body></worldbody></mujoco>"""
MUJOCO = {
    "MuJoCo, default": ("0.02 1", "0.9 0.95 0.001 0.5 2"),
    "MuJoCo, solimp[0] = 0": ("0.02 1", "0 0.95 0.001 0.5 2"),
    "MuJoCo, solimp[0] = 0 over 10 mm": (f"{2 * H} 1", "0 0.95 0.01 0.5 2"),
}


def ours(heights: Vector, kappa: float) -> tuple[Vector, Vector]:
    """Next vertical velocity and its derivative by the implicit function theorem; height of the lowest point."""
    body = dojo.Body("ball", 1.0, inertia=np.full(3, 0.4 * RADIUS**2))
    contact = dojo.Contact("ball", radius=RADIUS)
    mech = dojo.Mechanism([body], [dojo.Joint("floating", None, "ball")], [contact])
    sim = dojo.Simulator(mech, time_step=H, kappa=kappa, tolerance=1e-11)
    velocity, gradient = np.empty_like(heights), np.empty_like(heights)
    for i, height in enumerate(heights):
        x = np.r_[0.0, 0.0, RADIUS + height, 1.0, np.zeros(5), -SPEED, np.zeros(3)]
        A, _ = sim.linearize(x, np.zeros(sim.nu), kappa=kappa)
        velocity[i], gradient[i] = sim.step(x, np.zeros(sim.nu)).x[9], A[8, 2]
    return velocity, gradient


def mujoco_ball(heights: Vector, solref: str, solimp: str) -> tuple[Vector, Vector]:
    """The same by mj_step and mjd_transitionFD (centred, eps 1e-6)."""
    import mujoco

    model = mujoco.MjModel.from_xml_string(BALL.format(h=H, radius=RADIUS, solref=solref, solimp=solimp))
    data, A = mujoco.MjData(model), np.zeros((12, 12))
    velocity, gradient = np.empty_like(heights), np.empty_like(heights)
    for i, height in enumerate(heights):
        mujoco.mj_resetData(model, data)
        data.qpos[2], data.qvel[2] = RADIUS + height, -SPEED
        mujoco.mjd_transitionFD(model, data, 1e-6, 1, A, None, None, None)
        mujoco.mj_step(model, data)
        velocity[i], gradient[i] = data.qvel[2], A[8, 2]
    return velocity, gradient


def draw(heights: Vector, curves: dict[str, tuple[Vector, Vector]], path: Path) -> None:
    """Velocity above, gradient below; ours in colour, MuJoCo in grey."""
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    figure, (top, bottom) = plt.subplots(2, 1, figsize=(7.5, 7.5), sharex=True, layout="constrained")
    colours = iter(plt.get_cmap("viridis")(np.linspace(0.85, 0.05, len(KAPPAS))))
    greys = iter((("0.6", "-"), ("0.45", "--"), ("0.2", ":")))
    for label, (velocity, gradient) in curves.items():
        if label.startswith("MuJoCo"):
            colour, style = next(greys)
            look = {"color": colour, "linestyle": style, "linewidth": 1.4, "zorder": 1}
        else:
            look = {"color": next(colours), "linewidth": 2.0, "zorder": 2}
        top.plot(1e3 * heights, velocity, label=label, **look)
        bottom.plot(1e3 * heights, gradient, label=label, **look)
    reach = 1e3 * H * (SPEED + 9.81 * H)
    for axis in (top, bottom):
        axis.axvline(reach, color="0.8", zorder=0)
        axis.grid(alpha=0.25)
    top.text(reach + 0.5, 0.6, "below this height\nthe step reaches\nthe ground", fontsize=9, color="0.35", va="top")
    top.set_ylabel("velocity after the step [m/s]")
    top.set_title(f"A ball falls at {SPEED:g} m/s; one step of {1e3 * H:g} ms", fontsize=11)
    bottom.set_ylabel("d velocity / d height [1/s]")
    bottom.set_xlabel("height of the ball above the ground before the step [mm]")
    bottom.set_ylim(-1.3 / H, 0.2 / H)
    bottom.legend(fontsize=9, loc="lower right")
    cut = [f"{label}: {g.min():,.0f}" for label, (_, g) in curves.items() if g.min() < -1.3 / H]
    if cut:
        note = "outside the frame, lowest values\n" + "\n".join(cut)
        bottom.text(0.8, -0.06 / H, note, fontsize=8, color="0.35", va="top")
    figure.savefig(path, dpi=150)
    plt.close(figure)


def main(argv: list[str] | None = None) -> int:
    """Compute the curves, print them at a few heights, save the figure."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("touchdown.png"))
    parser.add_argument("--points", type=int, default=401)
    args = parser.parse_args(argv)
    heights = np.linspace(-0.01, 0.05, args.points)
    curves = {f"dojo-opt, kappa {kappa:g}": ours(heights, kappa) for kappa in KAPPAS}
    try:
        curves |= {label: mujoco_ball(heights, *options) for label, options in MUJOCO.items()}
    except ImportError:
        print("MuJoCo is not installed: pip install dojo-opt[bench]", file=sys.stderr)
    shown = np.searchsorted(heights, (-0.005, 0.0, 0.01, 0.02, 0.024, 0.03, 0.04))
    print(f"{'d velocity / d height [1/s]':<34}" + "".join(f"{1e3 * heights[i]:>9.1f} mm" for i in shown))
    for label, (_, gradient) in curves.items():
        print(f"{label:<34}" + "".join(f"{gradient[i]:>12.3f}" for i in shown))
    draw(heights, curves, args.out)
    print(f"wrote {args.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
