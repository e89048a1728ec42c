"""Every pair of shapes that can collide: distance, frame and derivatives against independent ones.

    python benchmarks/collision_pairs.py

The table of `dojo-opt report mechanics` (dojo_opt/report/mechanics/collisions.py), alone.
"""

from __future__ import annotations

from dojo_opt.report.mechanics.collisions import BARS, DEPTHS, check
from dojo_opt.report.mechanics.solids import PAIRS


def main() -> None:
    """Print a row per pair."""
    columns = [f"{what} {where}" for what in BARS for where in DEPTHS]
    print(f"{'':<20}" + "".join(f"{c.replace('derivative', 'deriv.'):>18}" for c in columns))
    for name in PAIRS:
        errors = check(name)
        print(f"{name:<20}" + "".join(f"{errors[c]:>18.0e}" for c in columns), flush=True)


if __name__ == "__main__":
    main()
