"""Tasks of a build: optional kernels one by one, and public calls on scenes."""

from __future__ import annotations

import sim.simulator.link  # noqa: F401  the optional kernels
from solvers.compiler.optional import optional_kernels

__all__ = ["CONTENTS", "run", "tasks"]

CONTENTS = ("all", "examples", "none")


def tasks(content: str):
    return ["kernel:"+k.name for k in optional_kernels() if "interior" in k.name or "gradient" in k.name][:3]+["hop"]


def run(task: str) -> None:
    if task.startswith("kernel:"):
        {k.name: k for k in optional_kernels()}[task[7:]].address()
    else:
        import dojo_opt as dojo
        dojo.ilqr(dojo.problems.hop())
