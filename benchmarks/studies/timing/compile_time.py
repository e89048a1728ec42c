"""Report `compile`: time of the first plan in a new process: cache empty, cache filled, code shipped.

The plan is a hop, or a swing-up in a quick study, which compiles half as much.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.studies.timing.cold_features import SCENES, cold_step, cold_table
from dojo_opt.report.result import Report, Row
from dojo_opt.report.study import Progress
from solvers.compiler import shipped as shipped_code

# One new process: the import, the first plan, and the same plan again, which is the time of the solve alone.
_PROGRAM = """
import json, os, time
def spent():
    return sum(os.times()[:4])  # of the process that helps to compile, too
wall, cpu = time.perf_counter(), spent()
import dojo_opt as dojo
imported = time.perf_counter() - wall, spent() - cpu
plan = dojo.ilqr(dojo.problems.PROBLEM())
first = time.perf_counter() - wall, spent() - cpu
wall, cpu = time.perf_counter(), spent()
again = dojo.ilqr(dojo.problems.PROBLEM())
second = time.perf_counter() - wall, spent() - cpu
assert plan.success and again.success, plan.message + again.message
from solvers.compiler import compiled, compiled_signatures, shipped
kernels = compiled_signatures()
print(json.dumps({"import": imported, "first": first, "again": second,
                  "compiled": len(compiled()), "why_not": shipped().why_not,
                  "kernels": len(kernels), "signatures": sum(kernels.values()),
                  "several": {k: n for k, n in kernels.items() if n > 1}}))
"""


@dataclass(frozen=True)
class CompileTimeStudy:
    """One cold start, then warm ones (1 quick, otherwise the median of 5), each in its own process; then as many with
    shipped code and again an empty cache.
    """

    quick: bool = False

    def run(self, progress: Progress) -> Report:
        """Measure."""
        report = Report("Start of a new process, to the first plan")
        several, problem = (1, "swingup") if self.quick else (5, "hop")
        starts = ["cold", *["warm"] * several]
        with tempfile.TemporaryDirectory() as folder:
            cold, *warm = [_start(folder, problem) for _ in progress([(name, None) for name in starts], "compile")]
            size = sum(f.stat().st_size for f in Path(folder).rglob("*") if f.is_file())
        with tempfile.TemporaryDirectory() as folder:
            shipped = [_start(folder, problem, shipped=True) for _ in range(several)] if len(shipped_code()) else []
        report.details = {"cold": cold, "warm": warm, "shipped": shipped, "cache_bytes": size}

        def median(quantity: str, clock: int, runs: list[dict[str, Any]] = warm) -> float:
            return float(np.median([run[quantity][clock] for run in runs]))

        beyond = float(np.median([run["first"][0] - run["again"][0] for run in warm]))
        report.rows = [
            Row("import dojo_opt", median("import", 0), "s", 0.7),
            Row("cold start to first plan, CPU", cold["first"][1], "s", 40.0),
            Row("cold start to first plan, wall", cold["first"][0], "s"),
            Row("warm start to first plan, wall", median("first", 0), "s"),
            Row("of which the solve", median("again", 0), "s", note="the same plan again"),
            Row("of which the rest", beyond, "s", 1.5, note="imports, loading compiled code"),
            Row("kernels", cold["kernels"], "", note="of the process itself, not of the one that helps it"),
            Row("signatures", cold["signatures"], ""),
            Row("cache", size / 1e6, "MB"),
        ]
        if shipped:
            report.rows += [
                Row("shipped code, start to first plan, CPU", median("first", 1, shipped), "s", 1.5),
                Row("shipped code, start to first plan, wall", median("first", 0, shipped), "s"),
                Row("shipped code, functions compiled", max(run["compiled"] for run in shipped), "", 0.0),
            ]
        else:
            report.notes.append(f"shipped code: {shipped_code().why_not}")
        if not self.quick:
            features = {name: cold_step(name) for name in SCENES}
            report.details["features"] = features
            report.tables.append(cold_table(features))
        if cold["several"]:
            report.notes += ["more than one signature: " + ", ".join(f"{k} {n}" for k, n in cold["several"].items())]
        return report


def _start(folder: str, problem: str, shipped: bool = False) -> dict[str, Any]:
    """Run the program in a new process with its cache below `folder`, with or without shipped code."""
    own = {"NUMBA_CACHE_DIR": folder, "DOJO_OPT_CACHE": "1", "DOJO_OPT_SHIPPED": str(int(shipped))}
    environment = {**os.environ, **own}
    done = subprocess.run(
        [sys.executable, "-c", _PROGRAM.replace("PROBLEM", problem)], env=environment, capture_output=True, text=True
    )
    if done.returncode != 0:
        raise RuntimeError(f"report compile: the measured process failed\n{done.stderr}")
    return json.loads(done.stdout)
