"""Measurements to run from a checkout: reference scenes, comparisons with other engines, and long benchmarks."""

import sys
from pathlib import Path

# scenes that tests and benchmarks share; appended last, so that an installed dojo_opt stays the one measured
sys.path.append(str(Path(__file__).resolve().parents[1] / "tests"))
