"""Forked processes, threads, and processes with one core: loops over the cores come back, with the same numbers."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from support.programs import HOME

LAYERS = ("omp", "workqueue")
PATIENCE = 240  # [s]; a hang is one that lasts longer

SETUP = """
import os, sys, threading
import numpy as np
import numba
import dojo_opt as dojo

sim = dojo.Simulator(dojo.models.raiberthopper(), 0.02)

def job(seed):
    us = np.random.default_rng(seed).normal(size=(8, 60, sim.nu))
    batch = sim.rollout_batch(np.tile(sim.neutral(), (8, 1)), us)
    return batch.x.tobytes() + sim.linearize_trajectory(batch.x[0], us[0]).A.tobytes()

if __name__ == "__main__":
    expected = [job(seed) for seed in range(4)]
    print(numba.threading_layer(), flush=True)
"""
WAYS = {
    "Pool.map": """
    import multiprocessing
    with multiprocessing.get_context("fork").Pool(2) as pool:
        found = pool.map(job, range(4))
""",
    "ProcessPoolExecutor": """
    import concurrent.futures, multiprocessing
    with concurrent.futures.ProcessPoolExecutor(2, mp_context=multiprocessing.get_context("fork")) as pool:
        found = list(pool.map(job, range(4)))
""",
    "os.fork": """
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        with os.fdopen(write, "wb") as pipe:
            pipe.write(b"".join(job(seed) for seed in range(4)))
        os._exit(0)
    os.close(write)
    with os.fdopen(read, "rb") as pipe:
        joined = pipe.read()
    assert os.waitpid(child, 0)[1] == 0
    found = expected if joined == b"".join(expected) else None
""",
    "a fork of a fork": """
    statuses = []
    child = os.fork()
    if child == 0:
        if os.fork() == 0:
            os._exit(0 if job(1) == expected[1] else 7)
        os._exit(os.waitstatus_to_exitcode(os.wait()[1]))
    found = expected if os.waitpid(child, 0)[1] == 0 else None
""",
    "a fork during a running loop": """
    stop = threading.Event()
    def work():
        while not stop.is_set():
            job(0)
    thread = threading.Thread(target=work)
    thread.start()
    children = []
    for seed in range(4):
        child = os.fork()
        if child == 0:
            os._exit(0 if job(seed) == expected[seed] else 7)
        children.append(child)
    statuses = [os.waitpid(child, 0)[1] for child in children]
    stop.set()
    thread.join()
    found = expected if statuses == [0] * 4 else statuses
""",
    "threads": """
    found = [None] * 4
    def work(seed):
        for _ in range(5):
            found[seed] = job(seed)
    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(4)]
    for thread in threads: thread.start()
    for thread in threads: thread.join()
""",
}


def run(program: Path, *prefix: str, **environment: str) -> str:
    """Output of a program that has to end in time."""
    env = {**os.environ, "PYTHONPATH": str(HOME), "NUMBA_NUM_THREADS": "2", **environment}
    done = subprocess.run(
        [*prefix, sys.executable, str(program)], env=env, capture_output=True, text=True, timeout=PATIENCE
    )
    assert done.returncode == 0, (done.returncode, done.stdout, done.stderr)
    return done.stdout


@pytest.mark.slow
@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
@pytest.mark.parametrize("layer", LAYERS)
def test_loops_after(layer: str, tmp_path: Path) -> None:
    """All ways in one process, each after those above it; the output of one that hangs ends with its name."""
    steps = "".join(
        f"    print({way!r}, flush=True)\n{text}    assert found == expected\n" for way, text in WAYS.items()
    )
    program = tmp_path / "program.py"
    program.write_text(SETUP + steps)
    assert run(program, NUMBA_THREADING_LAYER=layer).splitlines() == [layer, *WAYS]


@pytest.mark.slow
def test_jax_on_one_core(tmp_path: Path) -> None:
    pytest.importorskip("jax")
    if not hasattr(os, "sched_setaffinity"):
        pytest.skip("processes cannot be bound to a core here")
    program = tmp_path / "program.py"
    program.write_text(
        "import os\nos.sched_setaffinity(0, {min(os.sched_getaffinity(0))})\n"
        "import jax, numpy as np\njax.config.update('jax_enable_x64', True)\nimport dojo_opt as dojo\n"
        "sim = dojo.Simulator(dojo.models.pendulum(), 0.01)\nstep, _ = dojo.bridges.to_jax(sim)\n"
        "x = np.random.default_rng(0).normal(size=(20_000, 2))\n"
        "total = jax.jit(lambda x: jax.numpy.sum(jax.vmap(step)(x, jax.numpy.zeros((len(x), 1))) ** 2))\n"
        "expected = sim.rollout_batch(x, np.zeros((len(x), 1, 1))).x[:, 1]\n"
        "assert abs(float(total(x)) - np.sum(expected**2)) < 1e-6\n"
        "slope = jax.grad(total)(x)\nassert np.isfinite(slope).all()\nprint('same')\n"
    )
    assert run(program).split() == ["same"]
