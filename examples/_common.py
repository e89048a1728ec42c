"""`finish`: the last line of every example; the only file that examples share."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure

# MuJoCo beside ours, from benchmarks/; behind installed packages, so that an installed dojo_opt is the one that runs
sys.path.append(str(Path(__file__).resolve().parents[1]))

QUICK = "--quick" in sys.argv[1:]  # used by the tests: the same claim, less of it


def finish(figure: Figure, script: str) -> None:
    """Save the figure beside the place where the script is run, under the script's name."""
    target = Path(script).with_suffix(".png").name
    figure.savefig(target, dpi=150)
    print(f"wrote {target}")
