"""The <flag> and the groups of actuators that an MJCF file switches off, as the mechanism heeds them."""

from __future__ import annotations

from typing import Any

from sim.io.urdf.report import Notes

_CONSTRAINT, _EQUALITY, _FRICTIONLOSS, _LIMIT, _CONTACT = 1, 2, 4, 8, 16  # mjtDisableBit
_SPRING, _DAMPER, _GRAVITY, _CLAMPCTRL, _FILTERPARENT, _ACTUATION = 32, 64, 128, 256, 1024, 2048
_OVERRIDE = 1  # mjtEnableBit

_FIELDS = {  # what each flag sets to zero
    _EQUALITY: ("eq_active0",),
    _FRICTIONLOSS: ("dof_frictionloss", "tendon_frictionloss"),
    _LIMIT: ("jnt_limited", "tendon_limited"),
    _SPRING: ("jnt_stiffness", "jnt_stiffnesspoly", "tendon_stiffness", "tendon_stiffnesspoly"),
    _DAMPER: ("dof_damping", "dof_dampingpoly", "actuator_dampingpoly", "tendon_damping", "tendon_dampingpoly"),
    _CLAMPCTRL: ("actuator_ctrllimited",),
}
_NAMES = {
    _CONSTRAINT: "constraint",
    _EQUALITY: "equality",
    _FRICTIONLOSS: "frictionloss",
    _LIMIT: "limit",
    _CONTACT: "contact",
    _SPRING: "spring",
    _DAMPER: "damper",
    _GRAVITY: "gravity",
    _CLAMPCTRL: "clampctrl",
    _FILTERPARENT: "filterparent",
    _ACTUATION: "actuation",
}


def heed_flags(model: Any, notes: Notes) -> None:
    """Set to zero in the model what its flags disable, with a note on them; the functions below tell the others."""
    off = int(model.opt.disableflags)
    named = [name for bit, name in _NAMES.items() if off & bit]
    if named:
        notes.add("flags of the file that disable these", named)
    for bit, fields in _FIELDS.items():
        whole = bit in (_EQUALITY, _FRICTIONLOSS, _LIMIT) and off & _CONSTRAINT
        for field in fields if off & bit or whole else ():
            if hasattr(model, field):  # not in every version
                getattr(model, field)[:] = 0
    if off & _GRAVITY:
        model.opt.gravity[:] = 0.0
    if off & _SPRING and off & _DAMPER:  # then MuJoCo has no passive forces at all
        model.body_gravcomp[:] = 0.0
        model.opt.density = model.opt.viscosity = 0.0
    if int(model.opt.enableflags) & _OVERRIDE:
        notes.add("the flag that overrides the parameters of contacts is ignored", warn=True)


def contacts_disabled(model: Any) -> bool:
    """Whether no geoms touch."""
    return bool(int(model.opt.disableflags) & (_CONTACT | _CONSTRAINT))


def parents_apart(model: Any) -> bool:
    """Whether a body and its parent do not collide."""
    return not int(model.opt.disableflags) & _FILTERPARENT


def actuator_disabled(model: Any, a: int) -> bool:
    """Whether an actuator, or its group, is switched off."""
    group = int(model.actuator_group[a])
    grouped = 0 <= group <= 30 and bool(int(model.opt.disableactuator) >> group & 1)
    return grouped or actuation_disabled(model)


def actuation_disabled(model: Any) -> bool:
    """Whether the file switches off all actuators."""
    return bool(int(model.opt.disableflags) & _ACTUATION)
