"""Robots of a package stand up, trot, walk, jump, reach and push: problems from their files alone, and closed loops.

    pip install example-robot-data
    python benchmarks/robots.py                      one line per robot and task
    python benchmarks/robots.py --match go1

Feet, stance and weights are found as `dojo_opt.gaits.legs` does; only feet that a file has as meshes, or not at all,
are named here. A plan is replayed under its gains at a fifth of its time step. It counts as done when it is solved, all
steps of the replay are solved, and the robot ends within 2 cm of the plan and is upright all the time, or the hand of
an arm ends within 5 mm of its target, or the box it pushes within 2 cm. "steered" is `dojo.tasks.legged_mpc` for 3 s on
a plant with steps of 1 ms, once undisturbed and once with a push to the side: done when neither falls.
"""

from __future__ import annotations

import argparse
import sys
import time
import warnings
from collections.abc import Callable
from importlib.metadata import files
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from command import deliver, number, parser, progress

import dojo_opt as dojo
from dojo_opt.gaits.legs import Legs
from dojo_opt.plant.tick import milliseconds
from dojo_opt.report.result import Cell, Report, Row, Table

UPRIGHT = 0.85  # least cosine between the z axis of the base and the vertical
OFF = 0.02  # [m] of the base
REACHED = 0.005  # [m] of a hand
LEAST = 0.9  # share of the tasks that have to be done


class TestedRobot(NamedTuple):
    """A file of the package, and the numbers that it omits."""

    path: str
    feet: dict[str, float] | None = None  # radius of the ball about the origin of a link [m]
    hand: str = ""
    q: tuple[float, ...] = ()  # where an arm begins; its hand reaches from there


def _four(names: str, radius: float) -> dict[str, float]:
    return dict.fromkeys(names.split(), radius)


ROBOTS = {
    "Go1": TestedRobot("go1_description/urdf/go1.urdf"),
    "Go2": TestedRobot("go2_description/urdf/go2.urdf", _four("FL_foot FR_foot RL_foot RR_foot", 0.022)),
    "A1": TestedRobot("a1_description/urdf/a1.urdf"),
    "B1": TestedRobot("b1_description/urdf/b1.urdf"),
    "Laikago": TestedRobot("laikago_description/urdf/laikago.urdf", _four("FL_foot FR_foot RL_foot RR_foot", 0.026)),
    "Solo12": TestedRobot("solo_description/robots/solo12.urdf", _four("FL_FOOT FR_FOOT HL_FOOT HR_FOOT", 0.016)),
    "ANYmal B": TestedRobot("anymal_b_simple_description/robots/anymal.urdf"),
    "ANYmal C": TestedRobot("anymal_c_simple_description/urdf/anymal.urdf"),
    "HyQ": TestedRobot("hyq_description/robots/hyq_no_sensors.urdf"),
    "Bolt": TestedRobot("bolt_description/robots/bolt.urdf", {"FL_FOOT": 0.0275, "FR_FOOT": 0.0275}),
    "G1": TestedRobot("g1_description/urdf/g1_29dof_rev_1_0.urdf"),
    "Talos": TestedRobot("talos_data/robots/talos_reduced.urdf"),
    "Panda": TestedRobot(
        "panda_description/urdf/panda.urdf", None, "panda_hand", (0, -0.8, 0, -2.3, 0, 1.6, 0.8, 0.02, 0.02)
    ),
    "Z1": TestedRobot("z1_description/urdf/z1.urdf", None, "gripperStator", (0, 1.5, -1.5, 0.5, 0, 0, -0.5)),
    "UR5": TestedRobot("ur_description/urdf/ur5_robot.urdf", None, "tool0", (0, -1.2, 1.2, -1.5, -1.5, 0)),
}
WAY = np.array([-0.1, 0.15, 0.1])  # of a hand [m]
FAR = np.array([0.2, 0.0])  # of a box [m]
PUSH = 0.3  # [m/s] of the velocity that a push gives a robot as high as the A1, in proportion to the root of the height
TASKS = ("stand_up", "trot", "walk", "jump")
BIPEDS = ("Bolt",)  # without feet that balance: only in closed loop


def path_of(robot: TestedRobot) -> Path:
    """The file of a robot."""
    for file in files("example-robot-data") or ():
        if str(file).endswith(f"robots/{robot.path}"):
            return Path(str(file.locate()))
    raise FileNotFoundError(f"example-robot-data has no {robot.path}")


def loaded(robot: TestedRobot) -> Any:
    """Its mechanism."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dojo.UrdfWarning)
        return dojo.load_urdf(path_of(robot), floating=not robot.hand)


def replayed(plan: Any) -> Any:
    """The plan under its gains at a fifth of its time step."""
    return plan.replay(time_step=plan.time_step / 5)


def walked(robot: TestedRobot, task: str) -> list[Cell]:
    """A line of a robot with legs."""
    begin = time.perf_counter()
    plan = dojo.ilqr(getattr(dojo.problems, task)(loaded(robot), feet=robot.feet))
    seconds, shot = time.perf_counter() - begin, replayed(plan)
    x = shot.x
    upright = float((1.0 - 2.0 * (x[:, 4] ** 2 + x[:, 5] ** 2)).min())
    off = float(np.abs(x[-1, :3] - plan.x[-1, :3]).max())
    done = bool(plan.success and shot.success and upright > UPRIGHT and off < OFF)
    return [plan.status.name, plan.nit, seconds, float(np.abs(plan.u).max()), off, upright, done]


def reached(robot: TestedRobot) -> list[Cell]:
    """A line of an arm."""
    mech = loaded(robot)
    begin = time.perf_counter()
    sim = dojo.Simulator(mech, time_step=0.02)
    kin, q = dojo.Kinematics(sim), np.array(robot.q)
    goal = kin.pose(robot.hand, q)[0] + WAY
    plan = dojo.ilqr(dojo.problems.reach(sim, robot.hand, goal, start=q))
    seconds, shot = time.perf_counter() - begin, replayed(plan)
    off = float(np.linalg.norm(kin.pose(robot.hand, shot.x[-1, : sim.nq])[0] - goal))
    done = bool(plan.success and shot.success and off < REACHED)
    return [plan.status.name, plan.nit, seconds, float(np.abs(plan.u).max()), off, None, done]


def pushed(robot: TestedRobot) -> list[Cell]:
    """A line of an arm that pushes a box."""
    mech, box = loaded(robot), dojo.Body("box", 0.5, shape=dojo.Box(0.1, 0.1, 0.1))
    begin = time.perf_counter()
    plan = dojo.ilqr(dojo.problems.push(mech, box, FAR, frame=robot.hand, start=robot.q))
    seconds, shot = time.perf_counter() - begin, replayed(plan)
    at = plan.problem.sim.mechanism.q_slice("box")
    moved = shot.x[-1, at][:2] - shot.x[0, at][:2]
    off = float(np.abs(moved - FAR).max())
    done = bool(plan.success and shot.success and off < OFF)
    return [plan.status.name, plan.nit, seconds, float(np.abs(plan.u).max()), off, None, done]


def steered(robot: TestedRobot) -> list[Cell]:
    """A line of a robot under a velocity command; its time is the median of a tick."""
    mech = loaded(robot)
    legs = Legs(mech, robot.feet)
    mpc = dojo.tasks.legged_mpc(mech, feet=robot.feet)
    push = dojo.Push(1.0, (0.0, PUSH * legs.mass * legs.size**0.5, 0.0), duration=0.1)
    calm, hit = (dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 1e-3, pushes=p), 3.0) for p in ((), (push,)))
    ms = milliseconds(calm.log, cpu=True)
    upright = min(float((1.0 - 2.0 * (run.x[:, 4] ** 2 + run.x[:, 5] ** 2)).min()) for run in (calm, hit))
    largest = float(np.abs(calm.u).max())
    off = float(np.abs(calm.error()[-1, :3]).max())
    end = "upright" if calm.survived and hit.survived else "fell"
    return [end, None, float(np.median(ms)) / 1e3, largest, off, upright, bool(calm.survived and hit.survived)]


def cases(args: argparse.Namespace) -> list[tuple[str, Callable[[], list[Cell]]]]:
    """The trials, by name."""
    out: list[tuple[str, Callable[[], list[Cell]]]] = []
    for name, robot in ROBOTS.items():
        if args.match.lower() not in name.lower():
            continue
        if robot.hand:
            out.append((f"{name}: reach", lambda robot=robot: reached(robot)))
            out.append((f"{name}: push", lambda robot=robot: pushed(robot)))
            continue
        tasks = () if name in BIPEDS else TASKS
        out += [(f"{name}: {task}", lambda robot=robot, task=task: walked(robot, task)) for task in tasks]
        out.append((f"{name}: steered", lambda robot=robot: steered(robot)))
    return [case for case in out if "Go1: stand" in case[0] or "UR5: reach" in case[0]] if args.quick else out


def _done(name: str, lines: list[list[Cell]]) -> Row:
    """How many of them are done."""
    done = sum(bool(line[-1]) for line in lines)
    return Row(name, done, f"of {len(lines)}", int(LEAST * len(lines)), at_least=True)


def run(args: argparse.Namespace) -> Report:
    """The table."""
    report = Report("Robots from their files", "")
    lines: list[list[Cell]] = []
    for name, case in progress()([(name, (name, case)) for name, case in cases(args)], "robots"):
        try:
            lines.append([name, *case()])
        except (ValueError, dojo.SimulationError) as error:
            report.notes.append(f"{name}: {error}")
            lines.append([name, "refused", None, None, None, None, None, False])
    header = ("", "planned", "iterations", "time [s]", "largest input", "off [m]", "upright", "done")
    report.tables.append(
        Table("Robots", header, lines, "time of problem and plan, kernels compiled on the way; when steered, of a tick")
    )
    loops = [line for line in lines if str(line[0]).endswith(": steered")]
    plans = [line for line in lines if line not in loops]
    iterations = [line[2] for line in lines if line[2] is not None]
    report.rows += [
        _done("plans done, and replayed at a fifth of the step", plans),
        _done("closed loops without a fall", loops),
        number("iterations, median", float(np.median(iterations)) if iterations else np.nan),
        number("iterations, most", max(iterations, default=np.nan)),
    ]
    return report


def main(argv: list[str] | None = None) -> int:
    """Print or write the report; exit status 1 if more than a tenth of the tasks were not done."""
    arguments = parser(__doc__)
    arguments.add_argument("--match", default="", help="only robots with this in their names")
    return deliver("robots", run, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
