"""Trials of joints: springs to 1e8, dampers to 1e6, jammed limits, poses at the edge of a joint's range."""

from __future__ import annotations

import numpy as np

from benchmarks.studies.stability import scene_measures
from dojo_opt.models.quadruped import quadruped
from dojo_opt.report.stability import measures
from dojo_opt.report.stability.trial import StabilityTrial
from sim.mechanism.body import Body
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism


def slider(*, gravity: tuple[float, float, float] = (0.0, 0.0, 0.0), **joint: object) -> Mechanism:
    """1 kg on a rail along x, with a force on it."""
    rail = Joint("prismatic", None, "mass", axis=(1.0, 0.0, 0.0), **joint)  # type: ignore[arg-type]
    return Mechanism([Body("mass", 1.0, (0.1, 0.1, 0.1))], [rail], gravity=gravity)


def spring(stiffness: float, time_step: float) -> StabilityTrial:
    """An undamped mass on a spring."""
    return StabilityTrial(
        "springs",
        f"1 kg on {stiffness:.0e} N/m for 1 s at {1e3 * time_step:g} ms",
        "amplitude kept within 1 %",
        slider(spring=stiffness),
        (0.1,),
        (0.0,),
        time_step,
        1.0,
        scene_measures.amplitude_error,
        0.01,
    )


def turning_spring(kind: str, stiffness: float, time_step: float) -> StabilityTrial:
    """A rod of 1 m and 1 kg that hangs on a hinge or a ball joint with a spring, turned by 0.1 rad."""
    joint = Joint(kind, None, "rod", axis=(1.0, 0.0, 0.0), child_point=(0.0, 0.0, 0.5), spring=stiffness)
    mechanism = Mechanism([Body("rod", 1.0, (1.0 / 12.0, 1.0 / 12.0, 1e-3))], [joint], gravity=(0.0, 0.0, 0.0))
    q = (0.1,) if kind == "revolute" else (np.cos(0.05), np.sin(0.05), 0.0, 0.0)
    return StabilityTrial(
        "springs",
        f"rod on a {kind} joint of {stiffness:.0e} N m/rad for 1 s at {1e3 * time_step:g} ms",
        "amplitude kept within 1 %",
        mechanism,
        q,
        np.zeros(mechanism.nv),
        time_step,
        1.0,
        scene_measures.amplitude_error,
        0.01,
    )


def damper(coefficient: float, time_step: float) -> StabilityTrial:
    """1 kg at 1 m/s against a damper."""
    return StabilityTrial(
        "dampers",
        f"1 kg at 1 m/s into {coefficient:.0e} N s/m at {1e3 * time_step:g} ms",
        "stops after m v/d within 10 %, never moves back",
        slider(damper=coefficient),
        (0.0,),
        (1.0,),
        time_step,
        1.0,
        scene_measures.traveled(0, 0, 1.0 / coefficient),
        0.1,
    )


def jammed(width: float) -> StabilityTrial:
    """A mass between two stops, pressed on one with 10 kN and then on the other."""
    push = np.r_[np.full(50, 1e4), np.full(50, -1e4)][:, None]
    return StabilityTrial(
        "limits",
        f"stops {width:g} m apart, 10 kN to and fro, at 10 ms",
        "1e-8 m beyond a stop",
        slider(limits=(0.0, width)),
        (0.5 * width,),
        (0.0,),
        1e-2,
        1.0,
        scene_measures.beyond(0, 0, 0.0, width),
        1e-8,
        inputs=push,
    )


def jammed_fingers() -> StabilityTrial:
    """Ten sliders in a row, each with stops 1 mm apart, squeezed by 1 kN at the end: every stop presses."""
    count = 10
    bodies = [Body(f"plate_{i}", 1.0 if i < count - 1 else 100.0, (0.1, 0.1, 0.1)) for i in range(count)]
    joints = [
        Joint("prismatic", f"plate_{i - 1}" if i else None, f"plate_{i}", axis=(1.0, 0.0, 0.0), limits=(0.0, 1e-3))
        for i in range(count)
    ]
    push = Input(body=f"plate_{count - 1}", force=(1.0, 0.0, 0.0))
    return StabilityTrial(
        "limits",
        "ten plates with play of 1 mm, squeezed by 1 kN, the last 100 times heavier, at 10 ms",
        "1e-8 m beyond the stops together",
        Mechanism(bodies, joints, inputs=[push], gravity=(0.0, 0.0, 0.0)),
        np.full(count, 5e-4),
        np.zeros(count),
        1e-2,
        1.0,
        scene_measures.beyond(count - 1, 0, 0.0, count * 1e-3),
        1e-8,
        inputs=(-1e3,),
    )


def straight_legs(angle: float) -> StabilityTrial:
    """The quadruped dropped from 0.2 m on legs that are straight, or nearly."""
    mechanism = quadruped(limits=False, damper=0.1, contacts="all", stance=(angle / 2.0, -angle))
    q = np.asarray(mechanism.neutral) + np.r_[0.0, 0.0, 0.2, np.zeros(16)]
    return StabilityTrial(
        "singular poses",
        f"quadruped dropped from 0.2 m on legs bent by {angle:g} rad, at 10 ms",
        "no penetration (1e-8 m), no gain of energy (0.1 % of that at the start)",
        mechanism,
        q,
        np.zeros(mechanism.nv),
        1e-2,
        2.0,
        measures.growth_and_penetration(1e-3 * 13.5 * 9.81 * 0.6, 1e-8),
        1.0,
    )


def trials() -> list[StabilityTrial]:
    """All trials of joints."""
    springs = [spring(k, h) for k in (1e2, 1e4, 1e6, 1e8) for h in (1e-3, 1e-2)] + [spring(1e8, 0.5)]
    turning = [turning_spring(kind, 1e8, h) for kind in ("revolute", "spherical") for h in (1e-3, 1e-2)]
    dampers = [damper(d, 1e-2) for d in (1e2, 1e4, 1e6)]
    limits = [jammed(1.0), jammed(1e-6), jammed_fingers()]
    return [*springs, *turning, *dampers, *limits, straight_legs(0.0), straight_legs(1e-6), straight_legs(0.1)]
