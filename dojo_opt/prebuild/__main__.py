"""python -m dojo_opt.prebuild: compile the code that a wheel ships."""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

from dojo_opt.prebuild.tasks import CONTENTS, ENVIRONMENTS, run, tasks
from dojo_opt.prebuild.worker_processes import BuildError, Done, compile_tasks, work
from solvers.compiler import compiled, shipped
from solvers.compiler.cache import ship
from solvers.compiler.crossing import SYSTEMS
from solvers.compiler.shipped import FOLDER
from solvers.compiler.targets import FEATURES, runnable, usual

_MOST = 8  # workers by default: each takes half a gigabyte, and the longest task is a fifth of all


def _cores() -> int:
    """Number of cores that this process may use, at most as many as are of use."""
    return min(_MOST, len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="python -m dojo_opt.prebuild", description=__doc__)
    parser.add_argument("--content", choices=CONTENTS, default="all", help="content to compile (default: all)")
    parser.add_argument(
        "--targets", nargs="+", choices=FEATURES, default=usual(), help="targets that this processor can run"
    )
    parser.add_argument("--out", type=Path, default=FOLDER, help=f"folder of the file (default: {FOLDER})")
    parser.add_argument("--cache", type=Path, help="folder with compiled code to start from (default: a temporary one)")
    parser.add_argument(
        "--jobs", type=int, default=_cores(), help=f"processes (default: one per core, {_MOST} at most)"
    )
    parser.add_argument(
        "--cross",
        nargs="+",
        choices=SYSTEMS,
        default=[],
        help="other systems to translate for, each into a folder of its own in that of the file",
    )
    parser.add_argument("--check", action="store_true", help="fail if anything compiles, write nothing")
    parser.add_argument("--worker", action="store_true", help=argparse.SUPPRESS)
    return parser


def build(content: str, target: str, out: Path, cache: Path, jobs: int, systems: Sequence[str] = ()) -> Path:
    """Compile, and write the file of the target, and those of other systems."""
    begin, names = time.perf_counter(), tasks(content)

    def progress(done: Done, left: int) -> None:
        now = time.perf_counter() - begin
        print(
            f"dojo_opt: {now:5.0f} s, {len(names) - left:3d} of {len(names)}: {done.task}, "
            f"{done.compiled} functions in {done.seconds:.1f} s",
            flush=True,
        )

    compile_tasks(names, target, cache, jobs, progress, systems)
    path, count = ship(cache, out, target)
    seconds = time.perf_counter() - begin
    _tell(path, count, f"{target}, in {seconds:.0f} s")
    for name in systems:
        other, found = ship(cache / name, out / name, SYSTEMS[name].target)
        if found != count:
            raise BuildError(f"{found} of {count} entries were translated for {name}: begin with an empty cache")
        _tell(other, found, f"{SYSTEMS[name].target} on {name}")
    return path


def _tell(path: Path, count: int, what: str) -> None:
    print(f"dojo_opt: {count} entries for {what}, {path.stat().st_size / 1e6:.1f} MB: {path}", flush=True)


def check(content: str) -> int:
    """Carry out the tasks with the shipped code; the exit status is 1 if anything compiles."""
    if not len(shipped()):
        print(f"dojo_opt: {shipped().why_not}", file=sys.stderr)
        return 1
    found: list[str] = []
    for task in tasks(content):
        users = task in ENVIRONMENTS  # whose functions are shipped as well
        before = len(compiled(users))
        run(task)
        found += compiled(users)[before:]
    for name in found:
        print(f"dojo_opt: compiled {name}, which should have been shipped", file=sys.stderr)
    print(f"dojo_opt: {len(shipped())} entries for {shipped().target}, {len(found)} functions compiled")
    return 1 if found else 0


def main() -> int:
    """Run the command; returns the exit status."""
    args = _parser().parse_args()
    if args.worker:
        return work()
    if args.check:
        return check(args.content)
    if not args.targets:
        print("dojo_opt: no code can be shipped for this processor")
    try:
        for target in args.targets:
            if target not in runnable():
                raise BuildError(f"this processor cannot run code for {target}")
            with tempfile.TemporaryDirectory(prefix="dojo_opt_") as scratch:
                systems = args.cross if target == args.targets[0] else ()
                build(args.content, target, args.out, args.cache or Path(scratch), args.jobs, systems)
    except RuntimeError as error:  # a BuildError, or nothing that could be shipped
        print(f"dojo_opt: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
