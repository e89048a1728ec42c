"""Servos in a time step: a spring and a damper of the joint, and a force proportional to the input."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from sim.mechanism.input import Input
from sim.mechanism.joint import Joint

if TYPE_CHECKING:
    from sim.mechanism.mechanism import Mechanism

__all__ = ["is_limited", "limited_servos", "passive", "with_servos"]


def is_limited(part: Input) -> bool:
    """Whether an input is a servo whose force has limits."""
    return bool(np.all(np.isfinite(part.force_limits)))


def limited_servos(inputs: Iterable[Input]) -> list[tuple[int, Input]]:
    """The servos whose force has limits, with their numbers among the inputs: springs and dampers of joints have none.

    Args:
        inputs: the inputs.

    Returns:
        (number, input) of each.
    """
    return [(k, part) for k, part in enumerate(inputs) if is_limited(part)]


def with_servos(joints: Sequence[Joint], inputs: Iterable[Input]) -> tuple[Joint, ...]:
    """The joints with the springs and dampers of the servos that drive them, but for those with limits of their force.

    A servo's spring is at rest at zero, where its force for a target of zero is zero: two springs on one coordinate are
    one, at rest between them.

    Args:
        joints: the joints.
        inputs: the inputs.

    Returns:
        The joints, those without a servo unchanged.
    """
    by_joint: dict[str, list[Input]] = {}
    for part in inputs:
        if part.joint is not None and part.servo is not None and not is_limited(part):
            by_joint.setdefault(part.joint, []).append(part)
    return tuple(_driven(joint, by_joint[joint.name]) if joint.name in by_joint else joint for joint in joints)


def _driven(joint: Joint, servos: list[Input]) -> Joint:
    """The joint with the springs and dampers of its servos."""
    spring, damper, rest = (
        np.array(np.broadcast_to(value, joint.nv), dtype=np.float64)
        for value in (joint.spring, joint.damper, joint.rest)
    )
    for servo in servos:
        d, own = servo.dof, spring[servo.dof]
        damper[d] += servo.damping
        if servo.stiffness > 0.0:
            rest[d] *= own / (own + servo.stiffness)
            spring[d] += servo.stiffness
    return replace(joint, spring=spring, damper=damper, rest=rest)


def passive(mech: Mechanism) -> Mechanism:
    """The mechanism with the springs and dampers of its servos in its joints, and forces as inputs.

    Args:
        mech: the mechanism.

    Returns:
        A mechanism that moves in the same way under u times the gains of the servos; `mech` itself without a servo.
        Servos with limits of their force stay servos.
    """
    inputs = mech.inputs or ()
    if all(part.servo is None for part in inputs):
        return mech
    plain = [p if is_limited(p) else _as_force(p) for p in inputs]
    return replace(mech, joints=with_servos(mech.joints, inputs), inputs=plain)


def _as_force(part: Input) -> Input:
    """The input as a force, with the limits of the force u times the gain."""
    limits = (part.gain * part.limits[0], part.gain * part.limits[1])
    return replace(part, servo=None, stiffness=0.0, damping=0.0, limits=limits)
