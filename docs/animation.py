"""The animation of README: a quadruped trots, drawn by the viewer in a browser.

python docs/animation.py              writes docs/trot.gif; needs `.[video]` and a Chromium
"""

from __future__ import annotations

import sys
from pathlib import Path

import dojo_opt as dojo

OUT = Path(__file__).resolve().parent / "trot.gif"
SIZE = (540, 300)  # [pixels]
RATE = 20.0  # frames per second


def main() -> int:
    """Plan, draw, write."""
    sim = dojo.Simulator(dojo.models.quadruped(damper=0.5), time_step=0.025)
    plan = dojo.ilqr(dojo.problems.follow(dojo.gaits.trot(sim, speed=0.3), substeps=2))
    if not plan.success:
        print(plan.message)
        return 1
    dojo.viewer.save_video(plan, OUT, size=SIZE, rate=RATE)
    print(f"wrote {OUT}, {OUT.stat().st_size / 1e6:.1f} MB")
    return 0


if __name__ == "__main__":
    sys.exit(main())
