"""Random collisions of two free bodies: how many motions are solved to the end, keep momentum, and gain no energy.

    python benchmarks/collisions.py

Every motion: two bodies of 1 and 2 kg, a metre apart, turned and spinning at random, towards one another at 4 m/s,
friction 0.5, no gravity, 60 steps of 10 ms.
"""

from __future__ import annotations

import numpy as np

import dojo_opt as dojo

SHAPES = {"sphere": dojo.Sphere(0.2), "capsule": dojo.Capsule(0.15, 0.4), "box": dojo.Box(0.4, 0.3, 0.5)}
MOTIONS = 60
GAIN = 1e-2  # [J] more than kappa pushes from afar


def scene(a: str, b: str) -> dojo.Mechanism:
    """Two free bodies that collide."""
    bodies = [
        dojo.Body("a", 1.0, (0.02, 0.03, 0.04), shape=SHAPES[a]),
        dojo.Body("b", 2.0, (0.05, 0.06, 0.07), shape=SHAPES[b]),
    ]
    joints = [dojo.Joint("floating", None, name) for name in ("a", "b")]
    return dojo.Mechanism(bodies, joints, collisions=[dojo.Collision("a", "b")], gravity=(0, 0, 0))


def start(seed: int) -> np.ndarray:
    """State of a motion."""
    rng = np.random.default_rng(seed)
    n = rng.normal(size=3)
    n /= np.linalg.norm(n)
    turns = [q / np.linalg.norm(q) for q in rng.normal(size=(2, 4))]
    v = rng.normal(size=12)
    v[:3] -= 2.0 * n
    v[6:9] += 2.0 * n
    return np.concatenate([n, turns[0], np.zeros(3), turns[1], v])


def main() -> None:
    """Print a row per pair of shapes."""
    print(f"{'':<18}{'unsolved':>9}{'gain':>6}{'momentum':>10}{'iterations in contact: median':>31}{'99 %':>6}")
    names = list(SHAPES)
    for k, a in enumerate(names):
        for b in names[k:]:
            sim = dojo.Simulator(scene(a, b), time_step=0.01)
            runs = [sim.rollout(start(seed), np.zeros((60, sim.nu))) for seed in range(MOTIONS)]
            gains = sum(bool(np.diff(sim.energy(run.x)).max() > GAIN) for run in runs)
            drift = max(float(np.ptp(np.hstack(sim.momentum(run.x)), axis=0).max()) for run in runs)
            touching = [np.abs(run.contacts.impulse).max(axis=(1, 2)) > 1e-2 for run in runs]
            steps = np.concatenate([run.iterations[now] for run, now in zip(runs, touching, strict=True)])
            counts = f"{sum(not run.success for run in runs):>9}{gains:>6}{drift:>10.0e}"
            print(f"{a + ' ' + b:<18}{counts}{np.median(steps):>31.0f}{np.percentile(steps, 99):>6.0f}", flush=True)


if __name__ == "__main__":
    main()
