"""Command line, `dojo-opt` or `python -m dojo_opt`.

It runs a reference problem, measures a robot, lists or shows the models, and compiles ahead of time.

Every command returns its exit status: 0 on success, 1 on failure (a plan that did not converge, a missed bar with
--strict), 2 for an invalid command.
"""

from __future__ import annotations

import argparse
import ast
import os
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict
from math import isfinite
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn

import dojo_opt as dojo

# NumPy, Numba and most rooms are imported by the functions that need them, so that `program` begins before they are
if TYPE_CHECKING:
    from dojo_opt.tasks.plan_task import PlanTask

# names for `run`; the gaits of the quadruped also have the names of their examples, quadruped_trot and so on
PROBLEMS = (
    *("hop", "block", "swingup", "trot", "bound", "pace", "walk", "turn", "jump"),
    *("leap", "humanoid_leap", "backflip"),
)
GAITS = ("trot", "bound", "pace", "walk", "turn", "jump", "leap")
LOOPS = ("free_gait_mpc", "hopper_mpc", "humanoid_mpc", "quadruped_mpc")  # run in closed loop with a plant
SUITES = ("crisp", "idto", "jin")  # of tasks that are run by SUITE.TASK, such as idto.spinner
_ENDED_BY_SIGINT = 128 + 2  # as shells say it


def _parser() -> argparse.ArgumentParser:
    from dojo_opt.report import STUDIES
    from dojo_opt.report.command import CHECKOUT, MOVED, add_arguments
    from dojo_opt.viewer.show import add_show

    parser = argparse.ArgumentParser(prog="dojo-opt", description="Plan motion through contact, and measure it.")
    parser.add_argument("--version", action="version", version=f"dojo-opt {dojo.__version__}")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")

    text = "Plan a reference problem, or run a closed-loop task."
    run = commands.add_parser("run", help="plan a reference problem, or run a closed-loop task", description=text)
    run.add_argument(
        "name", metavar="NAME", help=", ".join([*PROBLEMS, *LOOPS, *(f"{suite}.TASK" for suite in SUITES)])
    )
    run.add_argument(
        "--set",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="argument of the problem or task, such as target=(1,0)",
    )
    run.add_argument(
        "--perturb",
        action="append",
        default=[],
        metavar="KEY=VALUE",
        help="change of the plant of a task, such as payload=1.0",
    )
    run.add_argument("--seconds", type=float, metavar="S", help="length of a closed loop [s]; 4, or that of its suite")
    run.add_argument("--out", "--plot", type=Path, metavar="FILE", help="write the figure of the plan (png, pdf, svg)")
    run.add_argument("--html", type=Path, metavar="FILE", help="write an animation that opens in a browser")
    run.add_argument("--json", action="store_true", help="print the result as JSON instead of a table")

    text = "Measure a robot. Print tables; with --out, write a page with figures and every number as JSON."
    measure = commands.add_parser("report", help="measure a robot", description=text, epilog=CHECKOUT)
    add_arguments(measure, STUDIES, MOVED)

    models = commands.add_parser("models", help="list the models", description="List the models and their sizes.")
    models.add_argument("--json", action="store_true", help="print JSON")
    models.add_argument("--thumbnails", type=Path, metavar="DIR", help="write a picture of each model, DIR/NAME.png")

    add_show(commands)

    warmup = commands.add_parser(
        "warmup", help="compile ahead of time", description="Compile and cache the kernels of a plan."
    )
    warmup.add_argument("--json", action="store_true", help="print JSON")
    return parser


def _arguments(pairs: Sequence[str]) -> dict[str, Any]:
    """`["goal=up", "target=(0.5, 0.5)"]` as keyword arguments; a value that is not a Python literal stays a string."""
    arguments: dict[str, Any] = {}
    for pair in pairs:
        key, equals, text = pair.partition("=")
        if not equals or not key.isidentifier():
            raise ValueError(f"--set, --perturb: expected KEY=VALUE, got {pair!r}")
        try:
            arguments[key] = ast.literal_eval(text)
        except (SyntaxError, ValueError):
            arguments[key] = text
    return arguments


def _save(figure: Any, path: Path, dpi: int = 150) -> None:
    """Write a figure of Matplotlib as a whole."""
    from dojo_opt.viewer.whole_file import whole_file

    with whole_file(path) as file:
        figure.savefig(file, dpi=dpi)


def _print_json(value: Any) -> None:
    from sim.io.json_text import json_text

    print(json_text(value))


def _refuse(kind: str, name: str, owner: str, there: Sequence[str]) -> NoReturn:
    """Refuse an unknown name; the message lists the known ones."""
    from sim.mechanism.checks import nearest

    raise ValueError(f"no {kind} {name!r}; {owner} {', '.join(there)}{nearest(name, there)}")


def _run(args: argparse.Namespace) -> int:
    if args.name in LOOPS:
        return _run_loop(args)
    if args.name.partition(".")[0] in SUITES:
        return _run_suite(args)
    name = args.name.removeprefix("quadruped_") if args.name.removeprefix("quadruped_") in GAITS else args.name
    if name not in PROBLEMS:
        there = [*PROBLEMS, *LOOPS, *(f"{suite}.TASK" for suite in SUITES)]
        _refuse("problem or task", args.name, "there are", there)
    if args.perturb or args.seconds is not None:
        raise ValueError(f"--perturb and --seconds apply to closed loops ({', '.join(LOOPS)}); {name} is a plan")
    problem = getattr(dojo.problems, name)(**_arguments(args.set))
    start = time.perf_counter()
    plan = dojo.ilqr(problem, verbose=not args.json)
    seconds = time.perf_counter() - start
    if args.out:
        figure = dojo.plots.gait(plan) if name in GAITS else dojo.plots.trajectory(plan)
        _save(figure, args.out)
    if args.html:
        dojo.viewer.save_html(plan, args.html)
    if args.json:
        numbers = {"problem": args.name, "success": bool(plan.success), "status": int(plan.status)}
        numbers |= {"message": plan.message, "iterations": int(plan.nit), "cost": float(plan.fun)}
        numbers |= {"violation": float(plan.violation), "seconds": seconds}
        numbers |= {"x": plan.x.tolist(), "u": plan.u.tolist()}
        _print_json(numbers)
    else:
        for path in filter(None, (args.out, args.html)):
            print(f"wrote {path}")
    return 0 if plan.success else 1


def _run_loop(args: argparse.Namespace) -> int:
    import numpy as np

    from dojo_opt.plant.tick import milliseconds

    mpc = getattr(dojo.tasks, args.name)(**_arguments(args.set))
    plant = dojo.tasks.plant(mpc, **_arguments(args.perturb))
    loop = dojo.closed_loop(mpc, plant, 4.0 if args.seconds is None else args.seconds)
    if args.out:
        _save(dojo.plots.closed_loop(loop), args.out)
    if args.html:
        dojo.viewer.save_html(loop, args.html)
    ms, fallbacks = milliseconds(loop.log), sum(tick.fallback for tick in loop.log)
    numbers = {"task": args.name, "survived": loop.survived, "message": loop.message, "seconds": loop.duration}
    numbers |= {"rms": loop.rms(), "rms_by_coordinate": (each := loop.by_coordinate())}
    numbers |= {"ticks": len(loop.log), "fallbacks": fallbacks}
    numbers |= {"tick_median_ms": float(np.median(ms)), "tick_99_ms": float(np.percentile(ms, 99))} if ms.size else {}
    if args.json:
        _print_json(numbers | {"time": loop.time.tolist(), "x": loop.x.tolist()})
    else:
        print(f"{loop.message}  rms {loop.rms():.3f} (m, rad) in {loop.duration:.2f} s over all tracked coordinates:")
        print("  " + ", ".join(f"{name} {value:.3f}" for name, value in each.items()))
        if ms.size:
            times = "ticks: median {tick_median_ms:.2f} ms, 99 % {tick_99_ms:.2f} ms, {fallbacks} fallbacks"
            print(times.format(**numbers))
    return 0 if loop.survived else 1


def _run_suite(args: argparse.Namespace) -> int:
    from dojo_opt.tasks.plan_task import PlanTask

    suite, _, name = args.name.partition(".")
    there = getattr(dojo.tasks, suite)
    if name not in there.__all__:
        _refuse("task", args.name, f"{suite} has", there.__all__)
    given = _arguments(args.set)
    seed = given.pop("seed", None)
    task = getattr(there, name)(**given)
    if isinstance(task, PlanTask):
        return _plan_task(args, task)
    loop = task.run(plant=task.plant(seed, **_arguments(args.perturb)), seconds=args.seconds)
    outcome = task.outcome(loop)
    if args.out:
        _save(dojo.plots.closed_loop(loop), args.out)
    if args.html:
        dojo.viewer.save_html(loop, args.html)
    numbers = {"task": args.name, "success": outcome.success, "survived": loop.survived, "message": loop.message}
    numbers |= {"seconds": loop.duration, "measures": outcome.measures, "ticks": len(loop.log)}
    numbers |= {
        "tick_median_ms": outcome.tick_median_ms,
        "tick_99_ms": outcome.tick_99_ms,
        "fallbacks": outcome.fallbacks,
    }
    numbers |= {"rate_hz": task.rate, "penetration_mm": 1e3 * outcome.penetration}
    if args.json:
        _print_json(numbers | {"time": loop.time.tolist(), "x": loop.x.tolist()})
    else:
        print(f"{'success' if outcome.success else 'no success'}: {loop.message}")
        print("  " + ", ".join(f"{measure} {value:.3g}" for measure, value in outcome.measures.items()))
        ticks = "ticks at {rate_hz:g} Hz: median {tick_median_ms:.2f} ms, 99 % {tick_99_ms:.2f} ms of processor time"
        ticks = ticks if isfinite(outcome.tick_median_ms) else "too short for a second tick"
        print((ticks + ", {fallbacks} fallbacks; penetration {penetration_mm:.2g} mm").format(**numbers))
    return 0 if outcome.success else 1


def _plan_task(args: argparse.Namespace, task: PlanTask) -> int:
    if args.perturb or args.seconds is not None or "seed" in _arguments(args.set):
        raise ValueError(f"--perturb, --seconds and seed apply to closed loops; {args.name} is a plan")
    begin = time.process_time()
    plan = task.run()
    seconds = time.process_time() - begin
    outcome = task.outcome(plan)
    if args.out:
        _save(dojo.plots.trajectory(plan), args.out)
    if args.html:
        dojo.viewer.save_html(plan, args.html)
    numbers = {"task": args.name, "message": plan.message, "seconds": seconds, **outcome._asdict()}
    if args.json:
        _print_json(numbers | {"x": plan.x.tolist(), "u": plan.u.tolist()})
    else:
        print(f"{'success' if outcome.success else 'no success'}: {plan.message}")
        print("  " + ", ".join(f"{measure} {value:.3g}" for measure, value in outcome.measures.items()))
        print("cost {cost:.4g}, {iterations} iterations, {seconds:.2f} s of processor time".format(**numbers))
    return 0 if outcome.success else 1


def _models(args: argparse.Namespace) -> int:
    entries = dojo.models.catalog()
    if args.thumbnails:
        args.thumbnails.mkdir(parents=True, exist_ok=True)
        for entry in entries:
            _save(dojo.plots.thumbnail(entry.build()), args.thumbnails / f"{entry.name}.png", dpi=100)
    if args.json:
        rows = [asdict(entry) for entry in entries]
        _print_json([{name: row[name] for name in row if name != "builder"} for row in rows])
        return 0
    print(f"{'name':<18}{'bodies':>7}{'nq':>4}{'nv':>4}{'nu':>4}{'contacts':>9}{'limits':>7}{'kg':>8}  description")
    for e in entries:
        sizes = f"{e.bodies:>7}{e.nq:>4}{e.nv:>4}{e.nu:>4}{e.contacts:>9}{e.limits:>7}{e.mass:>8.4g}"
        print(f"{e.name:<18}{sizes}  {e.what}")
    return 0


def _warmup(args: argparse.Namespace) -> int:
    from solvers.compiler import cache_folder, compiled_signatures

    wall, cpu = time.perf_counter(), time.process_time()
    plan = dojo.ilqr(dojo.problems.hop())
    numbers = {"seconds": time.perf_counter() - wall, "cpu_seconds": time.process_time() - cpu}
    numbers |= {"kernels": len(compiled_signatures()), "signatures": sum(compiled_signatures().values())}
    folder = cache_folder()
    if args.json:
        _print_json({**numbers, "cache": str(folder) if folder else None})
    else:
        where = f"cached in {folder}" if folder else "not cached (DOJO_OPT_CACHE=0, or no usable folder)"
        print("{signatures} signatures of {kernels} kernels in {seconds:.1f} s, ".format(**numbers) + where)
    return 0 if plan.success else 1


def _report(args: argparse.Namespace) -> int:
    from dojo_opt.report.command import report

    return report(args)


def _show(args: argparse.Namespace) -> int:
    from dojo_opt.viewer.show import show

    return show(args)


_COMMANDS: dict[str, Callable[[argparse.Namespace], int]] = {
    "run": _run,
    "report": _report,
    "models": _models,
    "show": _show,
    "warmup": _warmup,
}


def _check_files(args: argparse.Namespace) -> None:
    """Refuse output files that cannot be written, before the work begins."""
    folder = {"report": "out", "models": "thumbnails"}.get(args.command, "")
    if folder and (path := getattr(args, folder)) is not None and path.exists() and not path.is_dir():
        raise ValueError(f"--{folder}: expected a folder, and {str(path)!r} is a file")
    for name in ("out", "html"):
        path = getattr(args, name, None)
        if path is None or name == folder:
            continue
        if not path.parent.is_dir():
            raise ValueError(f"--{name}: there is no folder {str(path.parent)!r}")
        if path.is_dir():
            raise ValueError(f"--{name}: expected a file, and {str(path)!r} is a folder")
        if not os.access(path if path.exists() else path.parent, os.W_OK):
            raise ValueError(f"--{name}: {str(path)!r} cannot be written")
        if name == "out":
            from matplotlib.backend_bases import FigureCanvasBase

            from sim.mechanism.checks import one_of

            kinds = [f".{kind}" for kind in sorted(FigureCanvasBase.get_supported_filetypes())]
            one_of("--out: the ending", path.suffix, kinds)


def _close_output() -> None:
    """Send what is left of the output nowhere: Python writes it as it ends, and would fail once more."""
    with suppress(OSError, ValueError):  # of an output that is no file
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit status."""
    args = _parser().parse_args(arguments)
    try:
        _check_files(args)
        status = _COMMANDS[args.command](args)
        if sys.stdout is not None:
            sys.stdout.flush()
        return status
    except BrokenPipeError:  # the reader, such as `head`, has enough
        _close_output()
        return 1
    except (ValueError, TypeError, OSError, ImportError) as error:
        print(f"dojo-opt {args.command}: {error}", file=sys.stderr)
        if isinstance(error, OSError):
            _close_output()
        return 2
    except (dojo.SimulationError, MemoryError) as error:
        print(f"dojo-opt {args.command}: {str(error) or 'out of memory'}", file=sys.stderr)
        return 1


def program() -> int:
    """`main` as a program: Ctrl-C ends it without a traceback, with the status 130 of a shell.

    It ends by the signal itself, which stops a script around it, too. While the packages are imported, nothing is there
    to be cleaned up, and modules in C could lose an exception: the signal ends the program at once.
    """
    try:
        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # not of a shell's job in the background
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            _parser()
            signal.signal(signal.SIGINT, signal.default_int_handler)
        return main()
    except KeyboardInterrupt:
        signal.signal(signal.SIGINT, signal.SIG_IGN)
        with suppress(OSError, ValueError):
            sys.stdout.flush()
        if sys.platform != "win32":
            signal.signal(signal.SIGINT, signal.SIG_DFL)
            os.kill(os.getpid(), signal.SIGINT)
        return _ENDED_BY_SIGINT


if __name__ == "__main__":
    sys.exit(program())
