"""Returns here and in MuJoCo: the same first states and the same actions, both with time steps of 1 ms.

    python benchmarks/agreement.py [--tasks HalfCheetah ...]

Gaits are sines of time in every actuator, drawn at random: of 64, the four with the largest returns here, each from
four first states, for two seconds, or until the episode ends. MuJoCo runs Gymnasium's own environment, version 5. The
table has mean returns, the difference of the means, and the share of episodes whose returns differ by less than 5 %:
also beside MuJoCo with contacts and limits ten times as stiff, and of both engines beside themselves at half a
millisecond, which is what the time step does not determine either. First states are within the limits of joints, and
contacts have the default kappa.
"""

from __future__ import annotations

import argparse
import sys
from typing import Any, NamedTuple

import gymnasium
import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.learn.registration import task_of
from dojo_opt.learn.task import Task
from dojo_opt.report.result import Report, Table
from solvers.types import Floats

H, SECONDS, GAITS, BEST, STARTS = 1e-3, 2.0, 64, 4, 4
WITHIN, CLEARANCE = 0.05, 1e-3  # [rad]
PEERS: dict[str, tuple[str, dict[str, Any]]] = {  # name: environment of Gymnasium, its options
    "Cartpole": ("InvertedPendulum-v5", {}),
    "HalfCheetah": ("HalfCheetah-v5", {}),
    "Hopper": ("Hopper-v5", {}),
    "Walker2d": ("Walker2d-v5", {}),
    "Ant": ("Ant-v5", {"include_cfrc_ext_in_observation": False, "contact_cost_weight": 0.0}),
    "Humanoid": ("Humanoid-v5", {"contact_cost_weight": 0.0}),
}


class Episodes(NamedTuple):
    """First states, and the actions of each."""

    x: Floats  # (n, nx)
    actions: Floats  # (n, T, nu)


def gaits(task: Task, rng: np.random.Generator, count: int) -> Floats:
    """(count, T, nu) sines of time, of up to 3 Hz."""
    t = np.arange(0.0, SECONDS, task.knot_time)[None, :, None]
    size, phase = (rng.uniform(0.0, high, (count, 1, task.sim.nu)) for high in (0.8, 2.0 * np.pi))
    rate, offset = rng.uniform(0.5, 3.0, (count, 1, 1)), rng.uniform(-0.2, 0.2, (count, 1, task.sim.nu))
    return np.clip(offset + size * np.sin(2.0 * np.pi * rate * t + phase), -1.0, 1.0)


def ours(task: Task, episodes: Episodes, time_step: float) -> Floats:
    """(n,) returns."""
    substeps = round(task.knot_time / time_step)
    sim = dojo.Simulator(task.sim.mechanism, time_step=task.knot_time / substeps)  # default kappa: hard contacts
    x, out, alive = episodes.x.copy(), np.zeros(len(episodes.x)), np.arange(len(episodes.x))
    for k in range(episodes.actions.shape[1]):
        acts = np.ascontiguousarray(episodes.actions[alive, k])
        found = sim.step_batch(x[alive], task.inputs(acts), substeps, throw=True)
        over = task.ends(found.x)
        out[alive] += task.rewards(x[alive], acts, found.x)[0] + task.survival * ~over
        x[alive] = found.x
        alive = alive[~over]
        if not len(alive):
            break
    return out


def harden(model: Any) -> None:
    """Contacts and limits of joints ten times as stiff, friction in round cones without creep."""
    for reference, impedance in ((model.geom_solref, model.geom_solimp), (model.jnt_solref, model.jnt_solimp)):
        reference[:] = 2e-3, 1.0
        impedance[:, :3] = 0.99, 0.999, 5e-4
    model.geom_margin[:] = 0.0
    model.opt.cone, model.opt.impratio = 1, 100.0


def theirs(name: str, task: Task, episodes: Episodes, time_step: float, hard: bool = False) -> Floats:
    """(n,) returns in Gymnasium's environment."""
    made, options = PEERS[name]
    env: Any = gymnasium.make(made, **options).unwrapped
    env.model.opt.timestep, env.frame_skip = time_step, round(task.knot_time / time_step)
    if hard:
        harden(env.model)
    low, high = env.action_space.low, env.action_space.high
    out = np.zeros(len(episodes.x))
    for i, (x, actions) in enumerate(zip(episodes.x, episodes.actions, strict=True)):
        env.reset(seed=0)
        env.set_state(x[: task.sim.nq], x[task.sim.nq :])
        for a in actions:
            _, reward, over, _, _ = env.step(0.5 * (high + low) + 0.5 * (high - low) * a)
            out[i] += float(reward)
            if over:
                break
    return out


def inside(task: Task, xs: Floats) -> Floats:
    """States whose joints are within their limits, where the noise of first states has moved them beyond."""
    mech, out = task.sim.mechanism, xs.copy()
    for joint in mech.joints:
        if joint.limits is not None and joint.nv == 1:
            low, high = np.ravel(joint.limits)
            part = mech.q_slice(joint.name)
            out[:, part] = np.clip(out[:, part], low + CLEARANCE, high - CLEARANCE)
    return out


def chosen(task: Task) -> Episodes:
    """The best gaits, each from some first states."""
    rng = np.random.default_rng(0)
    every = gaits(task, rng, GAITS)
    first = np.repeat(inside(task, task.starts([np.random.default_rng((0, 0))])), GAITS, axis=0)
    best = np.argsort(-ours(task, Episodes(first, every), task.sim.time_step))[:BEST]
    starts = inside(task, task.starts([np.random.default_rng((1, i)) for i in range(STARTS)]))
    return Episodes(np.tile(starts, (BEST, 1)), np.repeat(every[best], STARTS, axis=0))


def apart(a: Floats, b: Floats) -> tuple[float, float]:
    """(difference of the means over their size, share of pairs within 5 %)."""
    scale = np.maximum(np.maximum(np.abs(a), np.abs(b)), 1e-9)
    mean = abs(a.mean() - b.mean()) / max(abs(a.mean()), abs(b.mean()), 1e-9)
    return float(mean), float(np.mean(np.abs(a - b) / scale <= WITHIN))


def run(given: argparse.Namespace) -> Report:
    """All tasks, or some."""
    report, cells = Report("Returns here and in MuJoCo, 1 ms", ""), []
    names = ["Cartpole"] if given.quick else given.tasks
    for name in progress()([(n, n) for n in names], "task"):
        task = task_of(name)
        episodes = chosen(task)
        here, there = ours(task, episodes, H), theirs(name, task, episodes, H)
        hard = theirs(name, task, episodes, H, True)
        pairs = {
            "": (here, there),
            "stiff MuJoCo: ": (here, hard),
            "here, 1 and 0.5 ms: ": (here, ours(task, episodes, 0.5 * H)),
            "MuJoCo, 1 and 0.5 ms: ": (there, theirs(name, task, episodes, 0.5 * H)),
        }
        shares = [100 * share for pair in pairs.values() for share in apart(*pair)]
        means = [float(returns.mean()) for returns in (here, there, hard)]
        cells.append([name, *(round(n, 1) for n in (*means, *shares))])
        header = ["task", "here", "MuJoCo", "stiff MuJoCo"]
        for label in pairs:
            header += [f"{label}difference [%]", f"{label}within 5 % [%]"]
    report.tables.append(Table("returns", tuple(header), cells))
    report.rows = [number(f"{row[0]}, difference of mean returns", row[4], 100 * WITHIN, unit="%") for row in cells]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report."""
    arguments = parser(__doc__)
    arguments.add_argument("--tasks", nargs="+", choices=list(PEERS), default=list(PEERS))
    return deliver("agreement", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
