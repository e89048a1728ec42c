"""Recommendations to the user from the trials of a robot, in sentences."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from dojo_opt.report.accuracy.setting_trial import SettingTrial
from sim.mechanism.mechanism import Mechanism

Choose = Callable[[Sequence["SettingTrial"], float], "SettingTrial"]
_ROUGH = 1e-2  # [m] good enough for a plan that feedback follows


def recommendation(best: SettingTrial, target: float, own: float) -> str:
    """The first sentences of the report; own: change of the converged motion when its step is doubled [m]."""
    asked = f"{1e3 * target:.2g} mm"
    if target == 2.0 * own:
        asked += ", twice the change of the converged motion when its step is doubled"
    call = f"dojo.Simulator(mechanism, time_step={best.time_step:g}, kappa={best.kappa:g})"
    found = f"{1e3 * best.error:.2g} mm off after .1 s, {best.realtime:.3g} times as fast as real time"
    if best.error <= target:
        return f"Use {call}: {found}. The target was {asked}."
    if best.message:
        return f"No setting tried carries the motion to its end: {best.message}"
    return f"No setting tried meets the target, {asked}. The best one is {call}: {found}."


def hints(
    mechanism: Mechanism,
    best: SettingTrial,
    trials: Sequence[SettingTrial],
    choose: Choose,
) -> list[str]:
    """Further remarks: missing contacts, planning, derivatives, kappa."""
    contacts = bool(mechanism.contacts or mechanism.collisions)
    said = []
    if not contacts:
        said.append(f"{mechanism.name} has no contacts: this is its motion in the air and at its stops.")
    if not contacts and mechanism.joints[0].kind == "floating":
        said.append(
            "Landing and walking are not measured. Meshes make no contacts: name the links that touch the ground "
            "with --contacts LINK, or LINK=RADIUS for a ball about the origin of its frame; in Python, "
            "load_urdf(contacts=[...])."
        )
    rough = choose(trials, _ROUGH)
    if contacts and best.error < rough.error <= _ROUGH:
        said.append(
            f"For planning, if {1e3 * rough.error:.2g} mm after .1 s is enough, use time_step={rough.time_step:g} and "
            f"kappa={rough.kappa:g}, {rough.realtime:.3g} times as fast as real time; replay the plan with the "
            "recommended ones."
        )
    if contacts:
        said.append(
            "A contact acts at a distance, with a force of kappa/(gap h): smaller steps need a smaller kappa, or their "
            "errors grow again. For the largest kappa with derivatives of hard contact, run dojo-opt report gradients "
            "ROBOT.urdf. For the largest stable time step, run dojo-opt report stability ROBOT.urdf."
        )
        if len(mechanism.contacts) > 50:
            said.append(
                f"{len(mechanism.contacts)} contacts: those that never touch cost little, those that do are most of a "
                "step. Name the links that are to touch the ground, with --contacts, to make it faster."
            )
    return said
