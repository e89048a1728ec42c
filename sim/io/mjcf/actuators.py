"""Inputs from the actuators of an MJCF file, and the dry friction of its joints."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from sim.io.mjcf.flags import actuator_disabled
from sim.io.mjcf.joints import BALL, FREE
from sim.io.mjcf.welded_bodies import Where, name_of, pose_of
from sim.io.urdf.report import Notes
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from solvers.types import Floats

_JOINT, _JOINT_IN_PARENT, _SITE = 0, 1, 4  # mjtTrn
_FIXED_GAIN, _NO_BIAS, _NO_DYNAMICS = 0, 0, 0  # mjtGain, mjtBias, mjtDyn
_AFFINE_BIAS = 1
_PID_GAIN, _PLACE = 5, 1  # mjtGain, and the control of a PID that is its place


def find_inputs(
    model: Any, homes: dict[int, tuple[str, int]], where: Where, notes: Notes
) -> tuple[list[Input], Floats, Floats, Floats]:
    """(inputs, gear, low, high): one input per actuator on a hinge, a slide or a site; bounds of u = gear * ctrl.

    That of a site is the wrench that moves with it, per unit of the actuator's force; that of a servo is its target.
    """
    inputs: list[Input] = []
    rows: list[tuple[float, float, float]] = []
    for a in range(model.nactuator):
        name, j = name_of(model, "actuator", a), int(model.actuator_trnid[a, 0])
        if actuator_disabled(model, a):
            notes.add("actuators that the file switches off are omitted", [name])
            continue
        if int(model.actuator_ctrlnum[a]) != 1 or int(model.actuator_outnum[a]) != 1:
            notes.add("actuators with several controls or forces are omitted", [name], warn=True)
            continue
        wrench = _at_site(model, a, name, where)
        on_joint = int(model.actuator_trntype[a]) in (_JOINT, _JOINT_IN_PARENT)
        if wrench is None and (not on_joint or model.jnt_type[j] in (FREE, BALL)):
            notes.add("actuators that do not drive a hinge, a slide or a site are omitted", [name], warn=True)
            continue
        servo = None if wrench else _servo(model, a)
        if servo is not None:
            part, ratio = replace(servo, joint=homes[j][0], dof=homes[j][1], name=name), 1.0 / _gear(model, a)
            low, high = _ctrl_bounds(model, a, ratio)
            forces = _within(_force_range(model, a, _gear(model, a)), _joint_range(model, j))
            part = replace(part, force_limits=forces)
            inputs.append(replace(part, limits=(low, high)) if low < high else part)
            rows.append((ratio, low, high))
            continue
        plain = model.actuator_gaintype[a] == _FIXED_GAIN and model.actuator_biastype[a] == _NO_BIAS
        if not plain or model.actuator_dyntype[a] != _NO_DYNAMICS:
            notes.add(
                "actuators with dynamics, or with a bias that is not that of a servo, are loaded as plain forces",
                [name],
                warn=True,
            )
        ratio = 1.0 if wrench else _gear(model, a)
        gear = ratio * (float(model.actuator_gainprm[a, 0]) if plain else 1.0)
        low, high = _bounds(model, a, gear, ratio, bool(plain))
        if not wrench:
            low, high = _within((low, high), _joint_range(model, j))
        if not low < high:
            text = "inputs without bounds, where those of the file leave one value"
            notes.add(text, [f"{name} ({low:g})"], warn=True)
        part = wrench or Input(homes[j][0], dof=homes[j][1], name=name)
        inputs.append(replace(part, limits=(low, high)) if low < high else part)
        rows.append((gear, low, high))
    _note_shared_ranges(model, notes)
    table = np.array(rows, dtype=np.float64).reshape(-1, 3)
    return inputs, table[:, 0], table[:, 1], table[:, 2]


def _gear(model: Any, a: int) -> float:
    """Force on its joint per unit of the force of an actuator."""
    return float(model.actuator_gear[model.actuator_outadr[a], 0])


def reflect_actuators(model: Any, notes: Notes) -> None:
    """Give the model's hinges and slides the armature and damping of their actuators, times gear^2.

    MuJoCo has both even where an actuator is switched off.
    """
    for a in np.flatnonzero((model.actuator_armature != 0.0) | (model.actuator_damping != 0.0)):
        j = int(model.actuator_trnid[a, 0])
        on_joint = int(model.actuator_trntype[a]) in (_JOINT, _JOINT_IN_PARENT)
        if not on_joint or model.jnt_type[j] in (FREE, BALL):
            text = "armature and damping of actuators that do not drive a hinge or a slide are omitted"
            notes.add(text, [name_of(model, "actuator", int(a))], warn=True)
            continue
        d, square = int(model.jnt_dofadr[j]), _gear(model, int(a)) ** 2
        model.dof_armature[d] += square * model.actuator_armature[a]
        model.dof_damping[d] += square * model.actuator_damping[a]


def _servo(model: Any, a: int) -> Input | None:
    """The servo that an actuator of a joint is, for a target in units of the joint; None of others.

    Its force is kp ctrl - kp l - kd l' or kd (ctrl - l') of the length l = gear q.
    """
    pid = model.actuator_gaintype[a] == _PID_GAIN and model.actuator_ctrlspec[a] == _PLACE  # for a place alone
    gained = pid or model.actuator_gaintype[a] == _FIXED_GAIN
    affine = gained and model.actuator_biastype[a] == _AFFINE_BIAS
    gear = _gear(model, a)
    if not affine or model.actuator_dyntype[a] != _NO_DYNAMICS or gear == 0.0:
        return None
    constant, place, rate = model.actuator_biasprm[a, :3].tolist()
    gain = -place if pid else float(model.actuator_gainprm[a, 0])
    if constant != 0.0 or gain <= 0.0 or rate > 0.0:
        return None
    if place == -gain:
        return Input("a joint", servo="position", stiffness=gain * gear**2, damping=-rate * gear**2)
    if place == 0.0 and rate == -gain:
        return Input("a joint", servo="velocity", damping=gain * gear**2)
    return None


def _at_site(model: Any, a: int, name: str, where: Where) -> Input | None:
    """The force and torque of an actuator on a site of a moving body, about its centre of mass; None of others."""
    site, reference = (int(k) for k in model.actuator_trnid[a])
    if int(model.actuator_trntype[a]) != _SITE or reference >= 0:
        return None
    group, frame = where[int(model.site_bodyid[site])]
    gear = np.array(model.actuator_gear[model.actuator_outadr[a]], dtype=np.float64)
    if group is None or not gear.any():
        return None
    at = frame.then(pose_of(model.site_pos[site], model.site_quat[site]))
    force, torque = at.rotation @ gear[:3], at.rotation @ gear[3:]
    torque = torque + np.cross(at.point - group.com, force)
    return Input(body=group.name, force=force, torque=torque, frame="body", name=name)


def _bounds(model: Any, a: int, gear: float, ratio: float, plain: bool) -> tuple[float, float]:
    """Bounds of an input from those of its control, and of its force times the ratio [N, N m]."""
    free = (-np.inf, np.inf)
    return _within(_ctrl_bounds(model, a, gear) if plain else free, _force_range(model, a, ratio))


def _force_range(model: Any, a: int, ratio: float) -> tuple[float, float]:
    """Bounds of the force of an actuator, times the ratio."""
    if not model.actuator_forcelimited[a]:
        return -np.inf, np.inf
    low, high = sorted(float(ratio * x) for x in model.actuator_forcerange[a])
    return low, high


def _joint_range(model: Any, j: int) -> tuple[float, float]:
    """Bounds of what all actuators together do to a joint [N, N m]."""
    if not model.jnt_actfrclimited[j]:
        return -np.inf, np.inf
    low, high = (float(x) for x in model.jnt_actfrcrange[j])
    return low, high


def _within(bounds: tuple[float, float], outer: tuple[float, float]) -> tuple[float, float]:
    """Bounds, each clamped to others, as MuJoCo clamps one number after the other."""
    low, high = (float(x) for x in np.clip(bounds, *outer))
    return low, high


def _note_shared_ranges(model: Any, notes: Notes) -> None:
    """A note on the joints where an actuatorfrcrange bounds a sum, which here bounds each part of it."""
    active = [a for a in range(model.nactuator) if not actuator_disabled(model, a)]
    on_joint = [a for a in active if int(model.actuator_trntype[a]) in (_JOINT, _JOINT_IN_PARENT)]
    driven = [int(model.actuator_trnid[a, 0]) for a in on_joint]
    limited = np.flatnonzero(model.jnt_actfrclimited).tolist()
    several = [j for j in limited if driven.count(j) > 1 or len(on_joint) < len(active)]
    text = "actuatorfrcrange of joints bounds each of their actuators alone, and none at a site"
    if several:
        notes.add(text, [name_of(model, "joint", j) for j in several], warn=True)


def _ctrl_bounds(model: Any, a: int, gear: float) -> tuple[float, float]:
    """Bounds of an input from those of its control."""
    c = int(model.actuator_ctrladr[a])
    if not model.actuator_ctrllimited[c]:
        return -np.inf, np.inf
    low, high = sorted(float(gear * x) for x in model.actuator_ctrlrange[c])
    return low, high


def with_friction(
    model: Any, joints: list[Joint], homes: dict[int, tuple[str, int]], wanted: bool, notes: Notes
) -> list[Joint]:
    """The joints with the dry friction of the file, where it is wanted and they can have it."""
    forces = {joint.name: np.zeros(joint.nv) for joint in joints}
    rough = sorted({int(model.dof_jntid[d]) for d in np.flatnonzero(model.dof_frictionloss)})
    missing = []
    for j in rough:
        if not wanted or model.jnt_type[j] in (FREE, BALL):
            missing.append(name_of(model, "joint", j))
            continue
        name, dof = homes[j]
        forces[name][dof] = model.dof_frictionloss[model.jnt_dofadr[j]]
    if missing:
        text = "dry friction of joints is omitted; joint_friction=True adds that of hinges and slides"
        notes.add(text, missing, warn=True)
    return [replace(joint, friction=forces[joint.name]) if forces[joint.name].any() else joint for joint in joints]
