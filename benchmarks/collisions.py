"""Random collisions of two free bodies: how many motions are solved to the end, keep momentum, and gain no energy.

    python benchmarks/collisions.py             60 motions per pair of shapes; then what far pairs cost
    python benchmarks/collisions.py --motions 240

Every motion: two bodies of 1 and 2 kg, a metre apart, turned and spinning at random, towards one another at 4 m/s,
friction 0.5, no gravity, 60 steps of 10 ms.

Far pairs: 20 balls in space that hardly move, on a grid; one pair of them may collide, or 19, or all 190.
"""

from __future__ import annotations

import argparse
import time
from itertools import combinations

import numpy as np

import dojo_opt as dojo
from dojo_opt.report.mechanics.encounters import ALL, approaching, two

BALLS = [f"b{k}" for k in range(20)]
GAIN = 1e-2  # [J] more than kappa pushes from afar


def collisions(motions: int) -> None:
    """Print a row per pair of shapes."""
    print(
        f"{'':<18}{'unsolved':>9}{'gain':>6}{'momentum':>10}{'iterations in contact: median':>31}{'99 %':>6}{'most':>6}"
    )
    names = list(ALL)
    for k, a in enumerate(names):
        for b in names[k:]:
            sim = dojo.Simulator(two(ALL[a], ALL[b]), time_step=0.01)
            runs = [sim.rollout(approaching(sim, seed, 1.0), np.zeros((60, sim.nu))) for seed in range(motions)]
            gains = sum(bool(np.diff(sim.energy(run.x)).max() > GAIN) for run in runs)
            drift = max(float(np.ptp(np.hstack(sim.momentum(run.x)), axis=0).max()) for run in runs)
            touching = [np.abs(run.contacts.impulse).max(axis=(1, 2)) > 1e-2 for run in runs]
            steps = np.concatenate([run.iterations[now] for run, now in zip(runs, touching, strict=True)])
            counts = f"{sum(not run.success for run in runs):>9}{gains:>6}{drift:>10.0e}"
            spread = f"{np.median(steps):>31.0f}{np.percentile(steps, 99):>6.0f}{steps.max():>6}"
            print(f"{a + ' ' + b:<18}{counts}{spread}", flush=True)


def cost(pairs: list[tuple[str, str]], spacing: float, kappa: float) -> float:
    """Processor time of a step of 20 balls [us], the least of five rollouts of 50 steps."""
    bodies = [dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in BALLS]
    joints = [dojo.Joint("floating", None, name) for name in BALLS]
    mech = dojo.Mechanism(bodies, joints, collisions=[dojo.Collision(a, b) for a, b in pairs], gravity=(0, 0, 0))
    sim = dojo.Simulator(mech, time_step=0.01, kappa=kappa)
    grid = spacing * np.array([(k // 10, k // 5 % 2, k % 5) for k in range(len(BALLS))])
    q = np.hstack([grid, np.tile([1.0, 0.0, 0.0, 0.0], (len(BALLS), 1))]).ravel()
    x = np.concatenate([q, 0.1 * np.random.default_rng(0).normal(size=sim.nv)])
    us = np.zeros((50, sim.nu))
    best = np.inf
    for _ in range(5):
        begin = time.process_time()
        sim.rollout(x, us, throw=True)
        best = min(best, time.process_time() - begin)
    return 1e6 * best / len(us)


def far_pairs() -> None:
    """Print what pairs cost that may collide, by how far apart they are."""
    print(f"\n{'us per step of 20 balls':<32}{'1 pair':>9}{'19 pairs':>10}{'190 pairs':>11}{'more, per pair':>16}")
    for kappa in (1e-10, 1e-8, 1e-6):
        for spacing in (0.4, 1.0, 3.0):
            sets = [(BALLS[0], BALLS[1])], list(zip(BALLS[:-1], BALLS[1:], strict=True)), list(combinations(BALLS, 2))
            one, chain, every = (cost(pairs, spacing, kappa) for pairs in sets)
            label = f"kappa {kappa:g}, {spacing:g} m apart"
            print(f"{label:<32}{one:>9.0f}{chain:>10.0f}{every:>11.0f}{(every - one) / 189:>16.2f}", flush=True)


def main() -> None:
    """Run both."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--motions", type=int, default=60, help="per pair of shapes")
    collisions(parser.parse_args().motions)
    far_pairs()


if __name__ == "__main__":
    main()
