"""Closed-loop MPC: survival and tick times of the hopper and of the quadruped, in tables.

python benchmarks/mpc.py [hopper] [quadruped] [monte_carlo] [--runs N] [--quick]

hopper       six cases times six seeds, one iteration per 50 ms, plant at 1 kHz with kappa 1e-8; beside it the control
             run whose ticks start from an open-loop rollout of the shifted inputs
quadruped    a trot at 0.2 m/s for 6 s, one iteration of 20 knots per 40 ms, plant at 2 ms with kappa 1e-8, case by case
monte_carlo  the quadruped under all disturbances at once, drawn from a seed

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


def monte_carlo(runs: int, duration: float) -> None:
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
    print(f"\nquadruped, {runs} runs of {duration:g} s, every disturbance in every run:\n  {disturbances}")
    begin = time.perf_counter()
    study = mpc.monte_carlo(dojo.tasks.plant(mpc, 2e-3), disturbances, duration, runs=runs)
    cpu = np.concatenate([milliseconds(o.log, cpu=True) for o in study.outcomes])
    print(study.summary())
    print(f"cpu median {np.median(cpu):.2f} ms, 99 % {np.percentile(cpu, 99):.2f} ms of a period of 40 ms")
    softened = sum(o.softened for o in study.outcomes)
    print(f"{softened} steps of the plant needed softer contact; {time.perf_counter() - begin:.0f} s in all")
    for i, outcome in enumerate(study.outcomes):
        if not outcome.survived:
            print(f"  run {i}: {outcome.message}")


def main() -> None:
    """Print what was asked for."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("tables", nargs="*", default=["hopper", "quadruped", "monte_carlo"])
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--quick", action="store_true")
    args = parser.parse_args()
    if "hopper" in args.tables:
        hopper(1 if args.quick else 6, 1.0 if args.quick else 4.0)
    if "quadruped" in args.tables:
        quadruped(0.4 if args.quick else 6.0)
    if "monte_carlo" in args.tables:
        monte_carlo(2 if args.quick else args.runs, 0.4 if args.quick else 6.0)


if __name__ == "__main__":
    main()
