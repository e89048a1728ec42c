"""The engines that studies run side by side on the same mechanism: ours, and the others that are installed."""

from __future__ import annotations

from importlib import import_module
from importlib.util import find_spec

from dojo_opt.report.dojo_engine import Ours
from dojo_opt.report.engine import PhysicsEngine, Run

__all__ = ["PhysicsEngine", "Ours", "Run", "installed"]

# required package -> module of this folder with `engines()`
_PEERS = {"mujoco": "mujoco", "pydrake": "drake", "pybullet": "bullet"}


def installed() -> list[PhysicsEngine]:
    """One engine per integrator of every peer that can be imported here."""
    peers: list[PhysicsEngine] = []
    for package, module in _PEERS.items():
        if find_spec(package) is not None:
            peers += import_module(f"benchmarks.engines.{module}").engines()
    return peers
