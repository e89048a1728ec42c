"""Let robots fall for a second, and count the motions in which a step was not solved.

    pip install gymnasium mujoco        for gymnasium's robots, beside the models of the toolkit
    python benchmarks/falls.py          --match quadruped for some of them

Every robot falls from its neutral state, at rest and with two random velocities (normal, 1 m/s and 1 rad/s per degree
of freedom), for time steps of 5, 10 and 20 ms and at three kappa, the default among them. Random states, as in
robustness.py, do not find the jammed landings that a motion leads to by itself.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Iterator
from importlib.util import find_spec
from pathlib import Path

import numpy as np

import dojo_opt as dojo

MODELS = (
    "ant", "atlas", "block", "exoskeleton", "halfcheetah", "hopper", "humanoid", "quadruped", "rexhopper", "snake",
    "twister", "walker", "youbot",
)  # fmt: skip
TIME_STEPS = (0.005, 0.01, 0.02)  # [s]
KAPPAS = (None, 1e-6, 1e-10)  # [N s m]; None: the default
STARTS = 3


def robots() -> Iterator[tuple[str, Callable[[], dojo.Mechanism]]]:
    """Names, and what builds them."""
    for name in MODELS:
        yield name, getattr(dojo.models, name)
    gym = find_spec("gymnasium")
    if gym is not None and gym.origin is not None and find_spec("mujoco") is not None:
        for file in sorted((Path(gym.origin).parent / "envs/mujoco/assets").glob("*.xml")):
            yield file.name, lambda file=file: dojo.load_mjcf(file)


def unsolved(mechanism: dojo.Mechanism, time_step: float, kappa: float | None) -> list[str]:
    """What the motions that stopped say."""
    sim = dojo.Simulator(mechanism, time_step, kappa)
    messages = []
    for seed in range(STARTS):
        x = sim.neutral()
        x[sim.nq :] += (seed > 0) * np.random.default_rng(seed).normal(size=sim.nv)
        t = sim.rollout(x, np.zeros((round(1.0 / time_step), sim.nu)))
        if not t.success:
            messages.append(f"{1e3 * time_step:g} ms, kappa {sim.kappa:.1e}, start {seed}: {t.message}")
    return messages


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--match", default="", help="only robots whose name contains this")
    match = parser.parse_args().match
    warnings.simplefilter("ignore")
    totals = dict.fromkeys(KAPPAS, 0)
    falls = 0
    for name, build in robots():
        if match not in name:
            continue
        mechanism = build()
        falls += STARTS * len(TIME_STEPS)
        for kappa in KAPPAS:
            messages = [m for h in TIME_STEPS for m in unsolved(mechanism, h, kappa)]
            totals[kappa] += len(messages)
            for message in messages:
                print(f"{name}: {message}", flush=True)
    for kappa, count in totals.items():
        print(f"kappa {'default' if kappa is None else kappa}: {count} of {falls} falls not solved to the end")


if __name__ == "__main__":
    main()
