"""Closed-loop MPC: survival and tick times of the hopper and of the quadruped, in tables.

python benchmarks/mpc.py [hopper] [quadruped] [monte_carlo] [terrain] [--runs N] [--seed N] [--quick]

hopper       six cases times six seeds, one iteration per 50 ms, plant at 1 kHz with kappa 1e-8; beside it the control
             run whose ticks start from an open-loop rollout of the shifted inputs
quadruped    a trot at 0.2 m/s for 6 s, one iteration of 20 knots per 40 ms, plant at 2 ms with kappa 1e-8, case by case
monte_carlo  the quadruped under all disturbances at once, drawn from a seed
terrain      the same trot for 6 s over five grounds, of which the model knows the height, or takes it from the feet
             that stand, or believes the ground level all the time. A run passes when the robot stays up, its root mean
             square distance from the path is at most 0.08 m, and its trunk's mean height above the ground below it is
             within 0.03 m of the one it starts with

Ticks are timed by the clock ("ms") and by the processor ("cpu"), which is what is left on a machine with other work.
Use NUMBA_NUM_THREADS=1 for figures of one core.
"""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from typing import Any

import numpy as np

import dojo_opt as dojo
from dojo_opt.mpc.tick import milliseconds

MASS = 4.7  # of the hopper [kg]
HOPPER = {
    "nominal": {},
    "payload +25 %": {"payload": 0.25 * MASS},
    "payload +50 %": {"payload": 0.5 * MASS},
    "friction .5 -> .25": {"friction": 0.25},
    "push 4 N s": {"push": 4.0},
    "push 6 N s": {"push": 6.0},
}
SIDE = np.array([0.0, 1.0, 0.0])
QUADRUPED: dict[str, dict[str, Any]] = {
    "nominal": {},
    "payload +3 kg": {"payload": 3.0, "payload_inertia": 0.03},
    "friction .8 -> .4": {"friction": 0.4},
    "slope 5 deg, up": {"slope": np.radians(5.0)},
    "slope 5 deg, down": {"slope": -np.radians(5.0)},
    "slope 5 deg, side": {"slope": np.radians(5.0), "slope_heading": 0.5 * np.pi},
    "push 8 N s, left": {"pushes": [dojo.Push(2.0, 8.0 * SIDE)]},
    "push 8 N s, right": {"pushes": [dojo.Push(2.0, -8.0 * SIDE)]},
    "delay 20 ms": {"delay": 0.02},
    "delay 20 ms, known": {"delay": 0.02},
}
LINES = np.arange(-1.0, 2.5, 0.05)
TERRAIN = {
    "slope 5 deg, up": dojo.Terrain.slope(np.radians(5.0)),
    "slope 5 deg, down": dojo.Terrain.slope(-np.radians(5.0)),
    "step 40 mm, up": dojo.Terrain.steps([0.04], start=0.6),
    "stairs 2 x 30 mm, down": dojo.Terrain.steps([-0.03, -0.03], depth=0.4, start=0.5),
    "waves +-20 mm, 0.6 m": dojo.Terrain.from_function(
        lambda x, y: 0.02 * np.sin(2.0 * np.pi * x / 0.6) + 0.0 * y, LINES, [0.0]
    ),
}
MODELS = ("knows", "learns", "blind")
HEADER = (
    f"{'case':<22}{'survive':>9}{'rms xy':>8}{'worst':>8}{'ms':>8}{'99 %':>8}{'cpu':>8}{'99 %':>8}{'fell back':>11}"
)


def hopper_perturbation(case: dict[str, float], seed: int) -> dojo.Perturbation:
    """Initial velocity within 0.15 m/s along x and y; a push at a random time in a random direction."""
    rng = np.random.default_rng(seed)
    offset = np.zeros(14)
    offset[7:9] = rng.uniform(-0.15, 0.15, 2)
    angle, when = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(1.0, 2.5)
    fields = {key: value for key, value in case.items() if key != "push"}
    pushes = [dojo.Push(when, case["push"] * np.array([np.cos(angle), np.sin(angle), 0.0]))] if "push" in case else []
    return dojo.Perturbation(offset=offset, pushes=pushes, **fields)


def row(name: str, loops: Sequence[Any]) -> str:
    """One line of a table; rms and worst are those of the runs that survive [m]."""
    rms = [loop.rms() for loop in loops if loop.survived] or [np.nan]
    ms, cpu = (np.concatenate([milliseconds(loop.log, cpu=c) for loop in loops]) for c in (False, True))
    ticks, fallbacks = sum(len(loop.log) for loop in loops), sum(t.fallback for loop in loops for t in loop.log)
    survive = f"{sum(loop.survived for loop in loops)}/{len(loops)}"
    times = "".join(f"{np.median(a):8.2f}{np.percentile(a, 99):8.2f}" for a in (ms, cpu))
    return f"{name:<22}{survive:>9}{np.median(rms):8.3f}{max(rms):8.3f}{times}{f'{fallbacks}/{ticks}':>11}"


def hopper(seeds: int, duration: float) -> None:
    """Two tables of the hopper."""
    for title, settings in (
        ("shifted states as guess", {}),
        ("the same without feedback between ticks", {"gain_scale": 0.0}),
        ("control run: open-loop rollout of the shifted inputs as guess", {"guess": "open loop"}),
    ):
        mpc = dojo.tasks.hopper_mpc(**settings)
        plant = dojo.tasks.plant(mpc, 1e-3)
        print(f"\nhopper, {title}\n{HEADER}")
        everything = []
        for name, case in HOPPER.items():
            perturbations = [hopper_perturbation(case, seed) for seed in range(seeds)]
            loops = [dojo.closed_loop(mpc, plant.perturbed(p), duration) for p in perturbations]
            everything += loops
            print(row(name, loops), flush=True)
        print(row("all", everything), flush=True)


def quadruped(duration: float) -> None:
    """The table of the quadruped."""
    print(f"\nquadruped, trot at 0.2 m/s for {duration:g} s\n{HEADER}")
    everything = []
    for name, case in QUADRUPED.items():
        mpc = dojo.tasks.quadruped_mpc(delay=0.02 if name.endswith("known") else 0.0)
        loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, **case), duration)
        everything.append(loop)
        print(row(name, [loop]) + ("" if loop.survived else "  " + loop.message), flush=True)
    print(row("all", everything))


def monte_carlo(runs: int, duration: float, seed: int) -> None:
    """The study of the quadruped."""
    mpc = dojo.tasks.quadruped_mpc()
    disturbances = dojo.Disturbances(
        nv=mpc.sim.nv,
        velocity=0.15,
        push=(0.0, 8.0),
        push_time=(1.0, 4.0),
        payload=(0.0, 3.0),
        payload_inertia=0.01,
        friction=(0.4, 0.8),
        slope=(0.0, float(np.radians(5.0))),
    )
    print(f"\nquadruped, {runs} runs of {duration:g} s, seed {seed}, every disturbance in every run:\n  {disturbances}")
    begin = time.perf_counter()
    study = mpc.monte_carlo(dojo.tasks.plant(mpc, 2e-3), disturbances, duration, runs=runs, seed=seed)
    cpu = np.concatenate([milliseconds(o.log, cpu=True) for o in study.outcomes])
    print(study.summary())
    print(f"cpu median {np.median(cpu):.2f} ms, 99 % {np.percentile(cpu, 99):.2f} ms of a period of 40 ms")
    softened = sum(o.softened for o in study.outcomes)
    print(f"{softened} steps of the plant needed softer contact; {time.perf_counter() - begin:.0f} s in all")
    for i, outcome in enumerate(study.outcomes):
        if not outcome.survived:
            print(f"  run {i}: {outcome.message}")


def terrain(duration: float) -> None:
    """The table of the quadruped on ground that is not level."""
    print(f"\nquadruped on terrain, {duration:g} s; above: mean height over the ground, less the first [m]")
    print(f"{'ground':<24}{'model':<8}{'passes':>8}{'rms xy':>8}{'above':>8}{'cpu':>8}{'99 %':>8}{'fell back':>11}")
    passed = []
    for name, ground in TERRAIN.items():
        for model in MODELS:
            knows = model == "knows"
            mpc = dojo.tasks.quadruped_mpc(terrain=ground if knows else None, learn_ground=model == "learns")
            plant = dojo.tasks.plant(mpc, 2e-3, **({} if knows else {"terrain": ground}))
            loop = dojo.closed_loop(mpc, plant, duration)
            over = loop.x[:, 2] - ground.height(loop.x[:, 0], loop.x[:, 1])
            above, cpu = float(over.mean() - over[0]), milliseconds(loop.log, cpu=True)
            passed.append(loop.survived and loop.rms() <= 0.08 and abs(above) <= 0.03)
            back = f"{sum(t.fallback for t in loop.log)}/{len(loop.log)}"
            times = f"{np.median(cpu):8.2f}{np.percentile(cpu, 99):8.2f}{back:>11}"
            end = "" if loop.survived else "  " + loop.message
            print(f"{name:<24}{model:<8}{passed[-1]!s:>8}{loop.rms():8.3f}{above:8.3f}{times}{end}", flush=True)
    share = ", ".join(f"{sum(passed[i :: len(MODELS)])} of {len(TERRAIN)} {m}" for i, m in enumerate(MODELS))
    print(f"{sum(passed)} of {len(passed)} pass: {share}")


def main() -> None:
    """Print what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tables", nargs="*", default=["hopper", "quadruped", "monte_carlo", "terrain"])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0, help="of the Monte Carlo study")
    parser.add_argument("--quick", action="store_true")
    args = parser.parse_args()
    if "hopper" in args.tables:
        hopper(1 if args.quick else 6, 1.0 if args.quick else 4.0)
    if "quadruped" in args.tables:
        quadruped(0.4 if args.quick else 6.0)
    if "monte_carlo" in args.tables:
        monte_carlo(2 if args.quick else args.runs, 0.4 if args.quick else 6.0, args.seed)
    if "terrain" in args.tables:
        terrain(0.4 if args.quick else 6.0)


if __name__ == "__main__":
    main()
