"""Trials of free bodies: a thousand radians per second, inertias a million apart."""

from __future__ import annotations

from benchmarks.studies.stability import scene_measures
from dojo_opt.report.stability.trial import StabilityTrial
from sim.mechanism.body import Body
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism

Three = tuple[float, float, float]


def spin(inertia: Three, omega: Three, time_step: float, *, refusal: str = "") -> StabilityTrial:
    """A free body that spins and tumbles for 1 s."""
    mechanism = Mechanism([Body("body", 1.0, inertia)], [Joint("floating", None, "body")], gravity=(0.0, 0.0, 0.0))
    moments = ", ".join(f"{moment:g}" for moment in inertia)
    return StabilityTrial(
        "spin",
        f"inertia {moments}, {max(omega):g} rad/s for 1 s at {1e3 * time_step:g} ms",
        f"refused as a whole: {refusal}" if refusal else "angular momentum within 1e-10 of its size",
        mechanism,
        (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0),
        (0.0, 0.0, 0.0, *omega),
        time_step,
        1.0,
        scene_measures.angular_momentum,
        1e-10,
        samples=100,
        tolerance=1e-13,
        refusal=refusal,
        why="10 rad in one step: no rotation between two poses says so" if refusal else "",
    )


def trials() -> list[StabilityTrial]:
    """All trials of free bodies."""
    return [
        spin((0.1, 0.2, 0.3), (2.0, 1000.0, 2.0), 1e-4),
        spin((0.1, 0.2, 0.3), (2.0, 1000.0, 2.0), 1e-3),
        spin((0.1, 0.2, 0.3), (600.0, 500.0, 400.0), 1e-3),
        spin((0.1, 0.2, 0.3), (2.0, 1000.0, 2.0), 1e-2, refusal="half a turn"),
        spin((0.1, 0.2, 0.3), (2.0, 1000.0, 2.0), 1e-2),
        spin((0.1, 0.2, 0.3), (2.0, 3000.0, 2.0), 1e-2),
        spin((1e-6, 1.0, 1.0), (1000.0, 2.0, 2.0), 1e-3),
        spin((1e-6, 1.0, 1.0), (2.0, 1000.0, 2.0), 1e-3),
        spin((1.0, 1.0, 1e-6), (600.0, 500.0, 400.0), 1e-3),
    ]
