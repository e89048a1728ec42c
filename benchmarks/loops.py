"""Mechanisms with closed loops over many steps: how far the loops open, what happens to energy, what a step costs.

    python benchmarks/loops.py [steps]        100,000 by default; in chunks, so that memory stays small

gap        largest violation of any loop constraint, every tenth step [m, rad]
energy     largest change against the energy at the first step, over the largest kinetic energy; of the models without
           their contacts, limits and dampers
us         processor time per step [us] of those, and of the same mechanism with its loops cut, as a tree
"""

from __future__ import annotations

import sys
import time
from dataclasses import replace

import numpy as np

import dojo_opt as dojo

NAMES = ("fourbar", "fivebar", "minitaur_leg", "stewart", "delta")
STEP, CHUNK = 0.005, 5000
# what keeps the motion away from singular configurations, where loops part ways
HELD = {
    "fivebar": {"spring": 20.0},
    "minitaur_leg": {"gravity": (0.0, 0.0, 0.0)},
    "stewart": {"spring": 500.0, "gravity": (0.0, 0.0, 0.0)},
    "delta": {"gravity": (0.0, 0.0, 0.0)},
}
MOTOR_SPRING = {"delta": 20.0}  # [N m/rad], at rest in the neutral state


def passive(name: str) -> dojo.Mechanism:
    """The model without contacts, limits, dampers and armature."""
    mech = getattr(dojo.models, name)(**HELD.get(name, {}))
    joints = [replace(j, damper=0.0, limits=None, armature=0.0) for j in mech.joints]
    if name in MOTOR_SPRING:
        at = {j.name: float(mech.neutral[mech.q_slice(j.name).start]) for j in joints}
        held = {"spring": MOTOR_SPRING[name]}
        joints = [replace(j, **held, rest=at[j.name]) if j.name.startswith("motor") else j for j in joints]
    return replace(mech, contacts=(), joints=joints)


def start(sim: dojo.Simulator, speed: float) -> np.ndarray:
    """The neutral state, on the move."""
    x = sim.neutral()
    x[sim.nq :] = speed * np.random.default_rng(0).normal(size=sim.nv)
    return sim.close(x)


def seconds(sim: dojo.Simulator, x: np.ndarray, steps: int = 2000) -> float:
    """Processor time of a step."""
    us = np.zeros((steps, sim.nu))
    sim.rollout(x, us[:10])
    begin = time.process_time()
    done = sim.rollout(x, us)
    return (time.process_time() - begin) / max(1, done.knot)


def gap(sim: dojo.Simulator, x: np.ndarray) -> float:
    """Largest violation of a loop."""
    return max(float(np.abs(g).max()) for g in sim.loop_gaps(x).values())


def run(name: str, steps: int) -> tuple[int, float, float, float, float]:
    """(steps solved, largest gap, energy error, us per step, us per step of the tree)."""
    sim = dojo.Simulator(passive(name), time_step=STEP, tolerance=1e-11)
    x = start(sim, 0.3)
    cost = 1e6 * seconds(sim, x)
    tree = dojo.Simulator(replace(sim.mechanism, loops=()), time_step=STEP, tolerance=1e-11)
    apart = 1e6 * seconds(tree, x)
    done, worst, energies, kinetic = 0, 0.0, [], 0.0
    while done < steps:
        t = sim.rollout(x, np.zeros((min(CHUNK, steps - done), sim.nu)))
        worst = max(worst, *(gap(sim, y) for y in t.x[1::10]))
        energies.append(sim.energy(t.x[1:]))
        kinetic = max(kinetic, float(sim.kinetic_energy(t.x[1:]).max()))
        x, done = t.x[-1], done + t.knot
        if not t.success:
            print(f"{name}: {t.message}")
            break
    energy = np.concatenate(energies)
    return done, worst, float(np.abs(energy - energy[0]).max() / kinetic), cost, apart


def main(steps: int) -> None:
    """Print one row per mechanism."""
    print(f"{'':14}{'steps':>8}{'gap':>10}{'energy':>10}{'us':>8}{'tree us':>9}")
    for name in NAMES:
        done, worst, energy, cost, apart = run(name, steps)
        print(f"{name:14}{done:8d}{worst:10.1e}{energy:10.1e}{cost:8.1f}{apart:9.1f}", flush=True)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 100_000)
