"""The filmstrips of docs/mpc_suites.md: tasks in closed loop, from their given starts, drawn at equal times.

python docs/filmstrips.py               writes docs/filmstrips.png
python docs/filmstrips.py humanoids     writes docs/humanoids.png; needs example-robot-data for the second strip
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import dojo_opt as dojo
from sim.mechanism.joint import WORLD

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parent / "benchmarks"))
SECONDS = {
    "jaco_ball": 3.0,
    "jaco": 1.5,
    "dual_jaco": 1.25,
    "allegro": 5.0,
    "air_hockey": 2.0,
    "spinner": 2.5,
    "mini_cheetah": 2.5,
}  # of a task
FRAMES = 6
DPI = 90
PUSHED, SHOWN = 3.0, 1.75  # [s] when a humanoid is pushed, and how long it is drawn from then on


def clothed(mechanism: dojo.Mechanism) -> dojo.Mechanism:
    """The mechanism with the shapes of its collisions and contacts on its bodies."""
    shapes: dict[str, list[Any]] = {body.name: [] for body in mechanism.bodies}
    for touch in mechanism.collisions:
        for name, shape in ((touch.a, touch.shape_a), (touch.b, touch.shape_b)):
            if name not in (WORLD, None) and shape is not None and shape not in shapes[str(name)]:
                shapes[str(name)].append(shape)
    bodies = [replace(body, shape=shapes[body.name] or None) for body in mechanism.bodies]
    return replace(mechanism, bodies=bodies, collisions=())


def strip(robot: dojo.Mechanism, states: np.ndarray, times: np.ndarray, name: str) -> np.ndarray:
    """Pictures of states (n, nq) at times [s], side by side: (height, width, 4) bytes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    figures = [dojo.plots.thumbnail(robot, q) for q in states]
    limits = np.array([[figure.axes[0].get_xlim(), figure.axes[0].get_ylim()] for figure in figures])
    middle = 0.5 * (limits[:, :, 0].min(axis=0) + limits[:, :, 1].max(axis=0))
    half = 0.5 * (limits[:, :, 1].max(axis=0) - limits[:, :, 0].min(axis=0)).max()
    pictures = []
    for k, (time, figure) in enumerate(zip(times, figures, strict=True)):
        ax = figure.axes[0]
        ax.set_xlim(middle[0] - half, middle[0] + half)
        ax.set_ylim(middle[1] - half, middle[1] + half)
        ax.text(0.97, 0.03, f"{time:.2g} s", transform=ax.transAxes, ha="right", fontsize=7)
        if k == 0:
            ax.text(0.03, 0.92, name, transform=ax.transAxes, fontsize=8)
        figure.set_dpi(DPI)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        pictures.append(np.asarray(canvas.buffer_rgba()))
    return np.concatenate(pictures, axis=1)


def suite(name: str, seconds: float) -> np.ndarray:
    """The strip of a task of IDTO."""
    task = getattr(dojo.tasks.idto, name)()
    loop = task.run(seconds=seconds)
    steps = np.linspace(0, len(loop.x) - 1, FRAMES).round().astype(int)
    q = loop.x[steps, : task.model.nq]
    return strip(clothed(task.model.mechanism), q, steps * task.model.time_step, name)


def pushed(name: str) -> np.ndarray:
    """The strip of a humanoid that walks, and is pushed to the left by 30 N s."""
    from humanoids import robot

    mpc = dojo.tasks.humanoid_mpc((0.4, 0.0, 0.0), robot=robot(name))
    plant = dojo.tasks.plant(mpc, pushes=[dojo.Push(PUSHED, (0.0, 30.0, 0.0))])
    loop = dojo.closed_loop(mpc, plant, PUSHED + SHOWN)
    if not loop.survived:
        raise SystemExit(f"{name}: {loop.message}")
    times = np.linspace(PUSHED, PUSHED + SHOWN, FRAMES + 2)
    steps = (times / loop.simulator.time_step).round().astype(int)
    return strip(mpc.nominal.mechanism, loop.x[steps, : mpc.nominal.nq], times, name)


def main(argv: list[str] | None = None) -> int:
    """Run, draw, write."""
    from matplotlib.image import imsave

    walking = "humanoids" in (sys.argv[1:] if argv is None else argv)
    strips = [pushed(name) for name in ("atlas", "talos")] if walking else [suite(*task) for task in SECONDS.items()]
    out = HERE / ("humanoids.png" if walking else "filmstrips.png")
    imsave(out, np.concatenate(strips))
    print(f"wrote {out}, {out.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
