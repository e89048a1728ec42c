"""`dojo-opt show`: the parts of a model or a file, and its motion under gravity."""

from __future__ import annotations

import argparse
import time
from collections.abc import Sequence
from inspect import signature
from pathlib import Path
from typing import Any

import numpy as np

import dojo_opt as dojo
from dojo_opt.viewer.whole_file import whole_file
from sim.io.json_text import json_text
from sim.mechanism import checks
from sim.mechanism.checks import nearest
from sim.mechanism.memory_limit import check_room

__all__ = ["add_show", "show"]

_PAUSE = 1.0  # [s] between two plays


def add_show(commands: Any) -> None:
    """The arguments of the command."""
    text = "Load a model, a URDF or an MJCF file; print its parts, drop it, and show the motion."
    parser = commands.add_parser("show", help="show a robot: a model, a URDF or an MJCF file", description=text)
    parser.add_argument(
        "robot", metavar="ROBOT", help="name of a model (see `dojo-opt models`), ROBOT.urdf, or ROBOT.xml"
    )
    parser.add_argument("--fixed", action="store_true", help="fix the root of ROBOT.urdf, for example of an arm")
    parser.add_argument(
        "--repair", action="store_true", help="replace inertias of ROBOT.urdf that no rigid body can have"
    )
    parser.add_argument(
        "--contacts",
        nargs="+",
        metavar="LINK",
        help="links of ROBOT.urdf that touch the ground, LINK=RADIUS for a ball about a link's origin [m], all for the "
        "other links; of a model, feet or all (all by default with --drop, where a model has it)",
    )
    parser.add_argument(
        "--meshes",
        choices=("hull", "decompose", "sphere", "box", "capsule", "none"),
        help="shapes in place of the collision meshes of ROBOT.urdf, hull by default",
    )
    parser.add_argument(
        "--seconds", type=float, default=2.0, metavar="S", help="length of the motion [s], 2 by default"
    )
    parser.add_argument("--time-step", type=float, default=0.005, metavar="H", help="time step [s], .005 by default")
    parser.add_argument("--drop", type=float, default=0.0, metavar="M", help="height of the drop [m], 0 by default")
    parser.add_argument("--out", "--plot", type=Path, metavar="FILE", help="write the figure of the motion")
    parser.add_argument("--html", type=Path, metavar="FILE", help="write an animation that opens in a browser")
    parser.add_argument("--json", action="store_true", help="print sizes and motion as JSON instead of text")
    parser.add_argument(
        "--live", action="store_true", help="play the motion in the browser, again and again, until Ctrl-C"
    )


def load(args: argparse.Namespace) -> dojo.Mechanism:
    """The mechanism of a file, or of a model by name."""
    suffix = Path(args.robot).suffix
    if suffix == ".urdf":
        contacts = touching(args.contacts)
        return dojo.load_urdf(
            args.robot, floating=not args.fixed, repair=args.repair, contacts=contacts, meshes=args.meshes or "hull"
        )
    if suffix == ".xml":
        _of_urdf(args, contacts=True)
        return dojo.load_mjcf(args.robot)
    names = dojo.models.__all__
    if args.robot not in names:
        close = nearest(args.robot, names) or "; `dojo-opt models` lists them"
        raise ValueError(f"{args.robot!r} is neither a .urdf nor an .xml file, nor a model{close}")
    _of_urdf(args, contacts=False)
    build = getattr(dojo.models, args.robot)
    chosen: dict[str, Any] = {}
    if args.contacts:
        chosen["contacts"] = args.contacts[0] if len(args.contacts) == 1 else args.contacts
    elif args.drop and "contacts" in signature(build).parameters:
        chosen["contacts"] = "all"
    try:
        found: dojo.Mechanism = build(**chosen)
    except TypeError as error:
        raise ValueError(f"--contacts: {args.robot} has no choice of contacts") from error
    return found


def _of_urdf(args: argparse.Namespace, *, contacts: bool) -> None:
    """Refuse options that only URDF files have; contacts: --contacts, too."""
    given = {"--fixed": args.fixed, "--repair": args.repair, "--meshes": args.meshes}
    given |= {"--contacts": args.contacts} if contacts else {}
    wrong = [name for name, value in given.items() if value]
    if wrong:
        raise ValueError(f"{', '.join(wrong)}: only for .urdf files, got {args.robot!r}")


def touching(words: Sequence[str] | None) -> list[str | dojo.Contact] | None:
    """Contacts of the command line: links, or links with a radius; None for all shapes of the file."""
    if words is None:
        return None
    out: list[str | dojo.Contact] = []
    for word in words:
        link, given, radius = word.partition("=")
        try:
            out.append(dojo.Contact(link, radius=float(radius)) if given else "*" if link == "all" else link)
        except ValueError as error:
            raise ValueError(f"--contacts {word}: expected LINK or LINK=RADIUS in metres: {error}") from None
    return out


def _numbers(sim: dojo.Simulator, motion: dojo.Trajectory) -> dict[str, Any]:
    """Sizes of the robot and its motion, as `dojo-opt run --json` has those of a plan."""
    mechanism = sim.mechanism
    report = getattr(mechanism, "report", None)  # of files
    return {
        "robot": mechanism.name,
        **{name: getattr(sim, name) for name in ("nbody", "nq", "nv", "nu", "ncontact")},
        "bodies": list(mechanism.body_names),
        "joints": list(mechanism.joint_names),
        "report": None if report is None else str(report),
        "success": motion.success,
        "status": int(motion.status),
        "message": motion.message,
        "seconds": float(motion.time[-1]),
        "time": motion.time.tolist(),
        "x": motion.x.tolist(),
    }


def show(args: argparse.Namespace) -> int:
    """Print, simulate, draw; returns the exit status."""
    checks.number("--seconds", args.seconds, above=0.0)
    checks.number("--drop", args.drop)
    if args.json and args.live:
        raise ValueError("--json, --live: expected one of them")
    mechanism = load(args)
    if args.drop and mechanism.joints[0].kind != "floating":
        raise ValueError(f"--drop requires a floating base; {mechanism.joints[0].name!r} is {mechanism.joints[0].kind}")
    sim = dojo.Simulator(mechanism, time_step=args.time_step)
    steps = max(1, round(min(args.seconds / args.time_step, 1e300)))
    check_room("--seconds, --time-step", steps, 8.0 * (sim.nx + sim.nu), "take fewer seconds or longer steps", "steps")
    if not args.json:
        print(sim.describe())
        if getattr(mechanism, "report", None) is not None:
            print(mechanism.report)  # type: ignore[attr-defined]
    x = sim.neutral()
    if args.drop:
        x[2] += args.drop
    motion = sim.rollout(x, np.zeros((steps, sim.nu)))
    if args.out:
        with whole_file(args.out) as file:
            dojo.plots.trajectory(motion).savefig(file, dpi=150)
    if args.html:
        dojo.viewer.save_html(motion, args.html)
    if args.json:
        print(json_text(_numbers(sim, motion)))
        return 0 if motion.success else 1
    print(f"released for {motion.time[-1]:g} s without inputs: {motion.message}{_sunk(sim, motion)}")
    for path in filter(None, (args.out, args.html)):
        print(f"wrote {path}")
    if args.live:
        play(motion)
    return 0 if motion.success else 1


def _sunk(sim: dojo.Simulator, motion: dojo.Trajectory) -> str:
    """How far the base of a robot that floats sinks, which tells whether it stands."""
    if sim.mechanism.joints[0].kind != "floating":
        return ""
    first, last = (sim.maximal(motion.x[k])[0, 2] for k in (0, -1))
    return f" The centre of {sim.mechanism.bodies[0].name} is {last:.3g} m high then, {first:.3g} m at the beginning."


def play(motion: dojo.Trajectory) -> None:
    """Play a motion in the browser in real time, with a pause at its end, until Ctrl-C."""
    with dojo.viewer.live(motion.simulator, open_browser=True) as view:
        print(f"playing at {view.url}; Ctrl-C ends", flush=True)
        try:
            while True:
                begin = time.monotonic()
                for moment, x in zip(motion.time, motion.x, strict=True):
                    time.sleep(max(0.0, begin + moment - time.monotonic()))
                    view.show(x)
                time.sleep(_PAUSE)
        except KeyboardInterrupt:
            print()
