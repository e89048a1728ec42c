"""Measurements that are run from a checkout: reference scenes, other engines beside ours, and long benchmarks."""

import sys
from pathlib import Path

# scenes that tests and benchmarks share; behind what is installed, so that an installed dojo_opt stays the one measured
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
