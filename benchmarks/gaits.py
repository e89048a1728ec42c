"""Gaits of a quadruped by iLQR: iterations, cost, and what is left of a plan at a fifth of its time step.

    python benchmarks/gaits.py           the table below, 72 random gaits, 32 leaps, 40 random leaps (three minutes)
    python benchmarks/gaits.py --quick   the table with fewer rows, 10 random gaits, 8 leaps, 4 random leaps

Columns: iterations, rejected ones included, and the rejected ones; cost; largest violation of the constraints;
least cosine between the base's z axis and the vertical; largest torque [N m]; how far the base rises [m]. Then, for
the plan under its own gains with every knot cut into five steps: how far the base ends from the plan [m], its least
cosine, the largest torque, the way that loaded feet slide [m, all feet together], and the greatest height of the lowest
foot [m]. Periodic plans are repeated five times for that. Jumps and leaps end with every time step cut into
`refinement`; their iterations are all of them, and what is left of them is at a fifth of the shorter step.

MuJoCo 4 with finite differences and a hand-written iLQR, same weights, on the first two rows: 4 iterations and cost
.0161 at damping 5 (8 to 12 from a rollout); 27 to 50 and .041 to .049 at damping .5, with its feet pressed 2 mm into
the ground, and upside-down from a rollout.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

import dojo_opt as dojo

QUICK = "--quick" in sys.argv[1:]
STANDING = {"guess": "standing"}
TABLE: list[tuple[str, dict[str, Any]]] = [
    ("trot", {"damping": 5.0}),
    ("trot", {}),
    ("jump", {"refinement": 1}),
    ("jump", {}),
    ("bound", {}),
    ("trot", STANDING),
    ("jump", STANDING),
    ("bound", STANDING),
    ("leap", {"refinement": 1}),
    ("leap", {}),
    ("leap", {"distance": 0.5}),
    ("leap", {"height": 0.3}),
    ("leap", {"distance": 0.0, "height": 0.3}),
    ("leap", {"distance": 0.5, "height": 0.3}),
    ("trot", {"cycles": 1, "periodic": True}),
    ("trot", {"cycles": 2, "periodic": True}),
    ("trot", {"speed": 0.0}),
    ("trot", {"speed": 0.4}),
    ("trot", {"damping": 0.05}),
    ("trot", {"damping": 5.0, **STANDING}),
    ("trot", {"speed": 0.0, **STANDING}),
    ("trot", {"speed": 0.4, **STANDING}),
    ("jump", {"distance": 0.0, "height": 0.3, "crouch": 0.12}),
    ("jump", {"distance": -0.2}),
    ("pace", {}),
    ("walk", {}),
    ("turn", {}),
    ("pace", {"cycles": 1, "periodic": True}),
    ("walk", {"cycles": 1, "periodic": True}),
    ("bound", {"cycles": 1, "periodic": True}),
    ("trot", {"cycles": 1, "periodic": True, "speed": 0.4}),
    ("trot", {"cycles": 1, "periodic": True, "damping": 0.05}),
]


def upright(x: Any) -> float:
    """Least cosine between the z axis of the base and the vertical."""
    return float((1.0 - 2.0 * (x[:, 4] ** 2 + x[:, 5] ** 2)).min())


def replay(plan: Any) -> str:
    """The plan under its gains at a fifth of the time step, a periodic one five times in a row."""
    problem = plan.problem
    plan = plan if plan.stride is None else plan.repeated(5)
    fine, cut = problem.sim.replace(time_step=problem.sim.time_step / 5), 5 * problem.substeps
    limits = problem.control_limits
    shot = fine.closed_loop(plan.x[0], plan.u, xs=plan.x, Ks=plan.K, substeps=cut, limits=limits)
    if shot.status != 0:
        return f"{shot.status.name} at knot {shot.knot}"
    knots = [fine.rollout(x, np.tile(u, (cut, 1))).contacts for x, u in zip(shot.x[:-1], shot.u, strict=True)]
    loaded = np.concatenate([c.normal_force for c in knots]) > 1.0
    slid = float((np.concatenate([c.slip for c in knots]) * loaded).sum() * fine.time_step)
    lift = max(float(c.gap.min(axis=1).max()) for c in knots)
    off = float(np.abs(shot.x[-1, :3] - plan.x[-1, :3]).max())
    return f"{off:7.4f} {upright(shot.x):7.4f} {np.abs(shot.u).max():6.1f} {slid:6.3f} {lift:6.3f}"


def random_gaits(count: int) -> None:
    """Gaits of random speed, damping and guess: how many are planned without falling over."""
    rng = np.random.default_rng(1)
    names = ["trot", "bound", "pace", "walk", "turn", "jump"]
    iterations, failed = [], 0
    for i in range(count):
        name = names[i % len(names)]
        settings: dict[str, Any] = {"damping": 10 ** rng.uniform(-1.3, 0.0)}
        settings["guess"] = "standing" if i // len(names) % 2 else "reference"
        if name == "turn":
            settings["heading_rate"] = rng.uniform(-1.0, 1.0)
        elif name == "jump":
            settings |= {"distance": rng.uniform(-0.2, 0.4), "height": rng.uniform(0.1, 0.3)}
        else:
            settings["speed"] = rng.uniform(0.0, {"trot": 0.4, "bound": 0.8, "pace": 0.5, "walk": 0.2}[name])
        if name == "trot":
            settings |= {"period": 0.5, "time_step": 0.025, "step_height": 0.05, "footholds": None, "height": None}
        plan = dojo.ilqr(getattr(dojo.problems, name)(**settings))
        good = plan.success and upright(plan.x) > 0.85
        failed += not good
        iterations.append(plan.nit)
        if not good:
            print(f"not planned: {name} {settings}: {plan.status.name}, upright {upright(plan.x):.3f}")
    spread = f"iterations {np.median(iterations):.0f} at the median, {max(iterations)} at most"
    print(f"{count - failed} of {count} random gaits planned and upright; {spread}")


def leaps(count: int) -> None:
    """Leaps on a grid of distances and heights, then random ones: how many are planned, and rise as asked within 1 cm.

    Random: -.3 to .55 m far, .1 to .33 m high, crouch .05 to .14 m, damping .05 to 1 N m s/rad, .8 to 1.2 s long.
    """
    rng = np.random.default_rng(5)
    far = np.arange(-2, 6)[:: 7 if QUICK else 1] / 10.0
    grid = [{"distance": float(d), "height": h} for d in far for h in (0.15, 0.2, 0.25, 0.3)]
    ranges = {"distance": (-0.3, 0.55), "height": (0.1, 0.33), "crouch": (0.05, 0.14), "duration": (0.8, 1.2)}
    drawn = [
        {key: rng.uniform(*ends) for key, ends in ranges.items()} | {"damping": 10 ** rng.uniform(-1.3, 0.0)}
        for _ in range(count)
    ]
    for kind, cases in (("leaps", grid), ("random leaps", drawn)):
        plans = [dojo.ilqr(dojo.problems.leap(**settings)) for settings in cases]
        good = [
            plan.success and upright(plan.x) > 0.85 and plan.x[:, 2].max() - plan.x[0, 2] > settings["height"] - 0.01
            for plan, settings in zip(plans, cases, strict=True)
        ]
        for settings, plan, fine in zip(cases, plans, good, strict=True):
            if not fine:
                print(f"not planned: leap {settings}: {plan.status.name}, violated by {plan.violation:.2g}")
        iterations = [plan.nit for plan in plans]
        spread = f"iterations {np.median(iterations):.0f} at the median, {max(iterations)} at most"
        print(f"{sum(good)} of {len(cases)} {kind} planned, upright, and as high as asked; {spread}", flush=True)


def main() -> None:
    """Print the table."""
    print(f"{'':42}   it  rej    cost    viol upright  torque   rise |    off upright torque   slid   lift")
    for name, settings in TABLE[:5] if QUICK else TABLE:
        plan = dojo.ilqr(getattr(dojo.problems, name)(**settings))
        rejected = sum(record["alpha"] == 0.0 for record in plan.history)
        label = f"{name} " + " ".join(f"{key}={value}" for key, value in settings.items())
        row = f"{label:42} {plan.nit:4d} {rejected:4d} {plan.fun:7.4f} {plan.violation:7.1e} {upright(plan.x):7.4f}"
        end = "" if plan.success else f"  {plan.status.name}"
        rise = plan.x[:, 2].max() - plan.x[0, 2]
        print(f"{row} {np.abs(plan.u).max():7.1f} {rise:6.3f} | {replay(plan)}{end}", flush=True)
    random_gaits(10 if QUICK else 72)
    leaps(4 if QUICK else 40)


if __name__ == "__main__":
    main()
