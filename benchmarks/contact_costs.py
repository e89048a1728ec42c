"""The cost of steps in contact, beside MuJoCo: towers of boxes, and robots that fall on the ground.

    pip install mujoco
    python benchmarks/contact_costs.py

Towers: boxes of 1 kg at rest on one another, 10 ms. Robots: limp from their neutral state, feet on the ground, for one
second, at 2, 5 and 10 ms. Processor time of a step, the least of some rounds taken in turns. MuJoCo with elliptic
cones, "implicitfast" for towers and "discrete" for robots, whose springs and dampers its other integrators lose.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable
from typing import Any

import numpy as np
from command import deliver, parser, progress

import dojo_opt as dojo
from dojo_opt.report.interleaved_rounds import interleave
from dojo_opt.report.result import Cell, Report, Row, Table
from support.towers import EDGE, tower

HEIGHTS = (2, 3, 5, 10, 20, 40)
ROBOTS: dict[str, Callable[[], dojo.Mechanism]] = {
    "half-cheetah": dojo.models.halfcheetah,
    "humanoid": dojo.models.humanoid,
    "A1": lambda: dojo.models.quadruped(contacts="all"),
}
STEPS = 100
TOWER_BAR, ROBOT_BAR, LINEAR_BAR = 3.0, 1.2, 1.3


def boxes(count: int, time_step: float) -> str:
    """MJCF of a tower."""
    half = 0.5 * EDGE
    stack = "".join(
        f'<body pos="0 0 {EDGE * (0.5 + k) + 1e-4 * (k + 1)}"><freejoint/>'
        f'<geom type="box" size="{half} {half} {half}" mass="1"/></body>'
        for k in range(count)
    )
    option = f'<option timestep="{time_step}" integrator="implicitfast" cone="elliptic"/>'
    return f'<mujoco>{option}<worldbody><geom type="plane" size="0 0 1"/>{stack}</worldbody></mujoco>'


def clocked(ours: Callable[[], Any], theirs: Callable[[], Any], steps: int, rounds: int) -> tuple[float, float]:
    """Least times of a step [us]."""
    seconds = interleave({"ours": ours, "theirs": theirs}, rounds)
    return 1e6 * float(seconds["ours"].min()) / steps, 1e6 * float(seconds["theirs"].min()) / steps


def stacked(count: int, rounds: int) -> list[Cell]:
    """A row of the towers, both settled first: boxes, us of a step, its gradient, MuJoCo's step, ratio, iterations.

    Last, whether MuJoCo's tower still stands: its default contacts throw the upper boxes of the tallest into the air.
    """
    import mujoco

    from benchmarks.engines import mujoco_scene

    sim = dojo.Simulator(tower(dojo.Box(EDGE, EDGE, EDGE), [1.0] * count), 0.01)
    us = np.zeros((STEPS, 0))
    x = sim.rollout(sim.neutral(), us, throw=True).x[-1]
    motion = sim.rollout(x, us, throw=True)
    model = mujoco_scene.without_reset(mujoco.MjModel.from_xml_string(boxes(count, 0.01)))
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 2 * STEPS)
    ours, theirs = clocked(lambda: sim.rollout(x, us), lambda: mujoco.mj_step(model, data, STEPS), STEPS, rounds)
    whole = interleave({"gradient": lambda: sim.linearize_rollout(x, us[:20])}, rounds)["gradient"].min()
    gradient = 1e6 * float(whole) / 20 - ours
    stands = bool(np.abs(data.qpos[2::7] - EDGE * (0.5 + np.arange(count))).max() < 0.5 * EDGE)
    return [count, ours, gradient, theirs, ours / theirs, float(motion.iterations.mean()), stands]


def fallen(name: str, time_step: float, rounds: int) -> list[Cell]:
    """A row of the robots: name, ms, us of a step, MuJoCo's, ratio, iterations, mean number of pressed contacts."""
    import mujoco

    from benchmarks.engines import mujoco_scene

    sim = dojo.Simulator(ROBOTS[name](), time_step)
    steps = round(1.0 / time_step)
    x, us = sim.neutral(), np.zeros((steps, sim.nu))
    motion = sim.rollout(x, us, throw=True)
    pressed = (np.abs(motion.contacts.impulse).max(axis=2) > 1e-6).sum(axis=1).mean()
    model = mujoco_scene.load(sim.model, time_step, hinges=True, integrator="discrete")
    data = mujoco_scene.state(model, x)
    full = mujoco.mjtState.mjSTATE_INTEGRATION
    start = np.empty(mujoco.mj_stateSize(model, full))
    mujoco.mj_getState(model, data, start, full)

    def theirs() -> None:
        mujoco.mj_setState(model, data, start, full)
        mujoco.mj_step(model, data, steps)

    ours, other = clocked(lambda: sim.rollout(x, us), theirs, steps, rounds)
    iterations = float(motion.iterations.mean())
    return [name, 1e3 * time_step, ours, other, ours / other, iterations, float(pressed)]


def run(args: argparse.Namespace) -> Report:
    """Both tables."""
    report = Report("Costs of steps in contact, beside MuJoCo", "")
    rounds = 2 if args.quick else 7
    heights = HEIGHTS[:2] if args.quick else HEIGHTS
    towers = [stacked(n, rounds) for n in progress()([(f"{n} boxes", n) for n in heights], "towers")]
    header = ("boxes", "step [us]", "gradient [us]", "MuJoCo [us]", "step / MuJoCo", "iterations", "MuJoCo's stands")
    report.tables.append(Table("Towers at rest, 10 ms", header, towers))
    cases = [(name, h) for name in ROBOTS for h in ((0.01,) if args.quick else (0.002, 0.005, 0.01))]
    named = [(f"{name}, {1e3 * h:g} ms", (name, h)) for name, h in cases]
    robots = [fallen(name, h, rounds) for name, h in progress()(named, "robots")]
    header = ("", "ms", "step [us]", "MuJoCo [us]", "step / MuJoCo", "iterations", "contacts that press")
    report.tables.append(Table("Robots on the ground", header, robots))
    if not args.quick:
        time = {int(line[0]): float(line[1]) for line in towers}  # type: ignore[arg-type]
        report.rows += [
            Row("20 boxes: step / MuJoCo's", float(towers[HEIGHTS.index(20)][4]), "", TOWER_BAR),  # type: ignore[arg-type]
            Row("40 boxes / 20 boxes, per box", time[40] / time[20] / 2.0, "", LINEAR_BAR),
        ]
        for line in robots:
            report.rows.append(Row(f"{line[0]}, {line[1]:g} ms: step / mj_step", float(line[4]), "", ROBOT_BAR))  # type: ignore[arg-type]
    return report


if __name__ == "__main__":
    sys.exit(deliver("contact_costs", run, parser(__doc__)))
