"""The filmstrips of docs/mpc_suites.md: tasks in closed loop, from their given starts, drawn at equal times.

python docs/filmstrips.py             writes docs/filmstrips.png
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import dojo_opt as dojo
from sim.mechanism.joint import WORLD

OUT = Path(__file__).resolve().parent / "filmstrips.png"
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


def clothed(mechanism: dojo.Mechanism) -> dojo.Mechanism:
    """The mechanism with the shapes of its collisions and contacts on its bodies."""
    shapes: dict[str, list[Any]] = {body.name: [] for body in mechanism.bodies}
    for touch in mechanism.collisions:
        for name, shape in ((touch.a, touch.shape_a), (touch.b, touch.shape_b)):
            if name not in (WORLD, None) and shape is not None and shape not in shapes[str(name)]:
                shapes[str(name)].append(shape)
    bodies = [replace(body, shape=shapes[body.name] or None) for body in mechanism.bodies]
    return replace(mechanism, bodies=bodies, collisions=())


def strip(name: str, seconds: float) -> np.ndarray:
    """Pictures of one task, side by side: (height, width, 4) bytes."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    task = getattr(dojo.tasks.idto, name)()
    loop = task.run(seconds=seconds)
    robot = clothed(task.model.mechanism)
    steps = np.linspace(0, len(loop.x) - 1, FRAMES).round().astype(int)
    figures = [dojo.plots.thumbnail(robot, loop.x[k, : task.model.nq]) for k in steps]
    limits = np.array([[figure.axes[0].get_xlim(), figure.axes[0].get_ylim()] for figure in figures])
    middle = 0.5 * (limits[:, :, 0].min(axis=0) + limits[:, :, 1].max(axis=0))
    half = 0.5 * (limits[:, :, 1].max(axis=0) - limits[:, :, 0].min(axis=0)).max()
    pictures = []
    for step, figure in zip(steps, figures, strict=True):
        ax = figure.axes[0]
        ax.set_xlim(middle[0] - half, middle[0] + half)
        ax.set_ylim(middle[1] - half, middle[1] + half)
        label = f"{step * task.model.time_step:.2g} s"
        ax.text(0.97, 0.03, label, transform=ax.transAxes, ha="right", fontsize=7)
        if step == 0:
            ax.text(0.03, 0.92, name, transform=ax.transAxes, fontsize=8)
        figure.set_dpi(DPI)
        canvas = FigureCanvasAgg(figure)
        canvas.draw()
        pictures.append(np.asarray(canvas.buffer_rgba()))
    return np.concatenate(pictures, axis=1)


def main() -> int:
    """Run, draw, write."""
    from matplotlib.image import imsave

    imsave(OUT, np.concatenate([strip(name, seconds) for name, seconds in SECONDS.items()]))
    print(f"wrote {OUT}, {OUT.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
