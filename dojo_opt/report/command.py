"""The command line of studies: `dojo-opt report`, and `benchmarks/compare.py` with more of them."""

from __future__ import annotations

import argparse
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path

from dojo_opt.report.page import write_page
from dojo_opt.report.study import STUDIES, Studies, run_reports
from dojo_opt.viewer.show import touching
from sim.io.json_text import json_text
from sim.io.urdf.load import load_urdf

CHECKOUT = "For reference scenes and other engines, run python benchmarks/compare.py --help from a checkout."
MOVED = ("contact", "planning", "mechanics", "compile")  # studies that `dojo-opt report` had


def add_arguments(parser: argparse.ArgumentParser, studies: Studies, moved: Sequence[str] = ()) -> None:
    """Add the arguments of studies; refuse the names in `moved` with the command that runs them."""
    names = {"all": "every study", **{name: text for name, (text, *_) in studies.items()}}
    listing = "; ".join(f"{name}: {text}" for name, text in names.items())
    parser.add_argument("name", type=_named(names, moved), metavar="NAME", help=listing)
    parser.add_argument(
        "robot", nargs="?", type=Path, metavar="ROBOT.urdf", help="robot to measure; a quadruped by default"
    )
    parser.add_argument("--fixed", action="store_true", help="fix the root of ROBOT.urdf, for example of an arm")
    parser.add_argument(
        "--contacts",
        nargs="+",
        metavar="LINK[=RADIUS]",
        help="links of ROBOT.urdf that touch the ground, by their shapes or by a ball of RADIUS [m] about their origin",
    )
    parser.add_argument(
        "--cold",
        action="store_true",
        help="lean: compile every feature from an empty cache, too: seconds and functions, in a quarter of an hour",
    )
    parser.add_argument("--json", action="store_true", help="print every number as JSON instead of the tables")
    parser.add_argument("--quick", action="store_true", help="run fewer and shorter rounds, as a check")
    parser.add_argument("--out", type=Path, metavar="DIR", help="write report.html, .md, .json and a PNG per study")
    parser.add_argument("--strict", action="store_true", help="exit with status 1 if a bar is missed")


def _named(names: dict[str, str], moved: Sequence[str]) -> Callable[[str], str]:
    """The name of a study, checked."""

    def checked(name: str) -> str:
        if name in moved:
            raise argparse.ArgumentTypeError(f"run {name} from a checkout: python benchmarks/compare.py {name}")
        if name not in names:
            raise argparse.ArgumentTypeError(f"no study {name!r}; there are {', '.join(names)}")
        return name

    return checked


def report(
    args: argparse.Namespace, studies: Studies = STUDIES, program: Sequence[str] = ("dojo-opt", "report")
) -> int:
    """Run studies, print and write their reports.

    Returns:
        The exit status: 1 when a study ended with an error or, with --strict, a bar was missed.

    Raises:
        ValueError: an option that does not belong to the study, or to no robot.
    """
    mechanism = None
    if args.robot is None:
        for option in ("fixed", "contacts"):
            if getattr(args, option):
                raise ValueError(f"report --{option}: it belongs to a ROBOT.urdf, which is missing")
    else:
        mechanism = load_urdf(args.robot, floating=not args.fixed, contacts=touching(args.contacts))
    names = list(studies) if args.name == "all" else [args.name]
    if args.cold and "lean" not in names:
        raise ValueError(f"report --cold: it belongs to the report lean, got {args.name}")
    reports = run_reports(names, quick=args.quick, mechanism=mechanism, cold=args.cold, verbose=True, studies=studies)
    for name, made in reports.items():
        made.command = _command(args, name, program)
    if args.json:
        print(json_text({name: made.as_dict() for name, made in reports.items()}, indent=1))
    else:
        print("\n\n".join(made.as_text() for made in reports.values()))
    if args.out:
        write_page(reports, args.out, _command(args, args.name, program))
    missed = args.strict and not all(made.met() for made in reports.values())
    return 1 if missed or any("error" in made.details for made in reports.values()) else 0


def _command(args: argparse.Namespace, name: str, program: Sequence[str]) -> str:
    """The command that reproduces a study, with all arguments that affect it."""
    robot, fixed = [str(args.robot)] if args.robot else [], ["--fixed"] * args.fixed
    contacts = ["--contacts", *args.contacts] if args.contacts else []
    cold = ["--cold"] * (args.cold and name in ("all", "lean"))
    return shlex.join([*program, name, *robot, *fixed, *contacts, *cold, *["--quick"] * args.quick])
