"""Processes that chaos.py interrupts, forks, kills, or starts with a damaged cache."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import NamedTuple

import numpy as np

import dojo_opt as dojo

__all__ = ["FORKS", "LONG", "SMALL", "Heard", "Victim", "answer", "environment"]

HOME = Path(dojo.__file__).resolve().parent.parent
PATIENCE = 300.0  # [s]; a longer call counts as hung
DEAF = 30.0  # [s] after a signal; a process that says nothing until then is killed, and counts as hung

LONG = {
    "ilqr": "dojo.ilqr(trot, tolerance=1e-12, violation=1e-14)",
    "MPC": "dojo.closed_loop(mpc, plant, 1e4)",
    "rollout": "sim.rollout(x, np.zeros((400_000, sim.nu)))",
    "batch": "sim.rollout_batch(np.tile(x, (64, 1)), np.zeros((64, 8_000, sim.nu)))",
    "derivatives": "sim.linearize_trajectory(np.tile(x, (40_000, 1)), np.zeros((40_000, sim.nu)))",
    "gradient": "sim.vjp((np.tile(x, (20_001, 1)), np.zeros((20_000, sim.nu))), "
    "np.zeros((20_001, sim.ndx)), kappa=1e-4)",
}
# one process per call: it says when a call begins, gets a signal, and says when it has heard it
VICTIM = """
import signal, sys, time
signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a shell's background jobs, and in CI
import numpy as np
import dojo_opt as dojo
sim = dojo.Simulator(dojo.models.raiberthopper(), 0.02)
x = sim.neutral()
trot = dojo.problems.trot(cycles=10)
mpc = dojo.tasks.hopper_mpc()
plant = dojo.tasks.plant(mpc, 2e-3)
us = np.full((60, sim.nu), 0.5)
def check():
    t, b = sim.rollout(x, us), sim.rollout_batch(np.tile(x, (4, 1)), np.tile(us, (4, 1, 1)))
    return t.x.tobytes() + b.x.tobytes() + sim.linearize_trajectory(t.x, us).A.tobytes()
expected = check()
dojo.ilqr(trot, max_iterations=2)
dojo.closed_loop(mpc, plant, 0.02)
sim.vjp(sim.rollout(x, us), np.zeros((61, sim.ndx)))
for line in sys.stdin:
    said = "ended"
    try:
        print("begin", flush=True)
        while True:
            CALL
    except KeyboardInterrupt as stop:
        heard = time.time()
        result = getattr(stop, "result", None)
        said = f"{heard!r} {type(result).__name__}"
    print(said, "same" if check() == expected else "different", flush=True)
"""
SMALL = """
import hashlib
import numpy as np
import dojo_opt as dojo
sim = dojo.Simulator(dojo.models.pendulum(), 0.01)
t = sim.rollout(np.array([0.5, 0.0]), np.full((50, 1), 0.1))
print(hashlib.sha256(t.x.tobytes() + sim.linearize_trajectory(t.x, t.u).A.tobytes()).hexdigest())
"""
FORKS = """
import multiprocessing, sys
import numpy as np
import dojo_opt as dojo
sim = dojo.Simulator(dojo.models.pendulum(), 0.01)
def job(seed):
    us = np.random.default_rng(seed).normal(size=(8, 50, 1))
    return sim.rollout_batch(np.zeros((8, 2)), us).x.tobytes()
expected = [job(seed) for seed in range(4)]
with multiprocessing.get_context("fork").Pool(2) as pool:
    print("same" if pool.map(job, range(4)) == expected else "different")
"""


class Heard(NamedTuple):
    """One interrupt."""

    call: str
    seconds: float  # until it was heard; NaN where it never was
    kept: str  # the exception's result
    outcome: str  # "same": the same result afterwards; "crashed", "hung"


def environment(**more: str) -> dict[str, str]:
    """Environment of a process that finds these packages."""
    return {**os.environ, "PYTHONPATH": str(HOME), **more}


class Victim:
    """A process that makes one call again and again."""

    def __init__(self, call: str) -> None:
        self.call = call
        program = VICTIM.replace("CALL", LONG[call])
        self.process = subprocess.Popen(
            [sys.executable, "-c", program], env=environment(), stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )

    def interrupt(self, after: float) -> Heard:
        """Begin a call, and send SIGINT `after` seconds later."""
        assert self.process.stdin is not None and self.process.stdout is not None
        patience = threading.Timer(after + DEAF, self.process.kill)
        sent, words = time.time(), list[str]()
        try:
            self.process.stdin.write("go\n")
            self.process.stdin.flush()
            if self.process.stdout.readline() == "begin\n":
                patience.start()
                time.sleep(after)
                sent = time.time()
                self.process.send_signal(signal.SIGINT)
                words = self.process.stdout.readline().split()
        except BrokenPipeError:
            pass
        finally:
            patience.cancel()
        if len(words) != 3:
            return Heard(self.call, np.nan, "", "hung" if time.time() > sent + 0.9 * DEAF else "crashed")
        return Heard(self.call, float(words[0]) - sent, words[1], words[2])

    def end(self) -> None:
        """Close its input, which ends it."""
        assert self.process.stdin is not None
        self.process.stdin.close()
        try:
            self.process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            self.process.kill()


def answer(program: str, cache: Path, **more: str) -> str:
    """Output of a process with this cache, or its failure."""
    try:
        done = subprocess.run(
            [sys.executable, "-c", program],
            env=environment(NUMBA_CACHE_DIR=str(cache), **more),
            capture_output=True,
            text=True,
            timeout=PATIENCE,
        )
    except subprocess.TimeoutExpired:
        return "hung"
    said = (done.stderr.strip().splitlines() or [""])[-1]
    return done.stdout.strip() if done.returncode == 0 else f"exit status {done.returncode}: {said}"
