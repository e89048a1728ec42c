"""The cost of a robot's shapes: a Go2 on hull feet beside ball feet, with all its meshes, and with self-collisions.

    pip install example-robot-data trimesh
    python benchmarks/shapes.py

Processor time of a step without a report of contacts, and of one with its derivatives, cases in turns. "rest": an
equilibrium under its torques. "trot": a servo moves the legs on the spot, diagonal feet rising by some 2 cm twice a
second; feet with corners rock from one to the next. Hulls are those of the meshes, of at most so many corners.
Self-collisions: the same robot, without them and with `collisions="self"`.
"""

from __future__ import annotations

import argparse
import sys
import warnings
from typing import Any

import numpy as np
from command import deliver, parser, progress

import dojo_opt as dojo
from benchmarks.robots import ROBOTS, path_of
from dojo_opt.gaits.feet import Feet
from dojo_opt.gaits.legs import Legs
from dojo_opt.report.interleaved_rounds import interleave, ratio
from dojo_opt.report.result import Cell, Report, Row, Table

FEET = tuple(ROBOTS["Go2"].feet or ())
CASES: dict[str, dict[str, Any]] = {
    "ball feet": {"feet": "sphere", "rest": "none", "corners": 8},
    "box feet": {"feet": "box", "rest": "none", "corners": 8},
    "hull feet, 8 corners": {"feet": "hull", "rest": "none", "corners": 8},
    "hull feet, 16 corners": {"feet": "hull", "rest": "none", "corners": 16},
    "hull feet, 32 corners": {"feet": "hull", "rest": "none", "corners": 32},
    "all hulls, 8 corners": {"feet": "hull", "rest": "hull", "corners": 8},
    "all hulls, 32 corners": {"feet": "hull", "rest": "hull", "corners": 32},
}
COLLIDING: dict[str, tuple[str, dict[str, Any]]] = {
    "Go2, spheres": ("Go2", {"meshes": "sphere"}),
    "Go2, capsules": ("Go2", {"meshes": "capsule"}),
    "Go2, hulls of 16 corners": ("Go2", {"mesh_corners": 16}),
    "Go2, hulls of 32 corners": ("Go2", {}),
    "Go1, its own shapes": ("Go1", {}),
}
STEPS = (0.002, 0.01)
BAR = 1.5
STIFFNESS, DAMPING = 30.0, 0.4  # of the servo [N m/rad, N m s/rad]


def loaded(name: str, **options: Any) -> Any:
    """A robot of the package."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", dojo.UrdfWarning)
        return dojo.load_urdf(path_of(ROBOTS[name]), **options)


def on_feet(feet: str, rest: str, corners: int) -> Any:
    """The Go2 with these shapes."""
    return loaded("Go2", meshes={**dict.fromkeys(FEET, feet), "*": rest}, mesh_corners=corners)


class LeggedMotion:
    """A robot at rest or trotting on the spot, for one case."""

    def __init__(self, mech: Any, stance: Any, time_step: float, trot: bool, seconds: float) -> None:
        self.sim = sim = dojo.Simulator(mech, time_step=time_step)
        x = sim.neutral()
        x[: sim.nq] = stance
        x = np.array(Feet(sim).put_down(x))
        self.x, u = dojo.equilibrium(sim, x)
        steps = round(seconds / time_step)
        self.us = np.tile(u, (steps, 1))
        self.K = np.zeros((steps, sim.nu, 2 * sim.nv))
        self.xs = np.tile(self.x, (steps + 1, 1))
        for j, dof in enumerate(range(6, sim.nv)):
            self.K[:, j, dof], self.K[:, j, sim.nv + dof] = -STIFFNESS, -DAMPING
        if trot:
            self.xs[:, 7 : sim.nq] += self._lifts(time_step * np.arange(steps + 1))
        self.u = self.run().u

    def _lifts(self, times: Any) -> Any:
        """Changes of the joints: thighs forward, calves backward, of one diagonal and then of the other."""
        out = np.zeros((len(times), self.sim.nv - 6))
        for joint in self.sim.mechanism.joints[1:]:
            phase = np.pi if joint.name[:2] in ("FR", "RL") else 0.0
            lift = np.maximum(0.0, np.sin(4.0 * np.pi * times + phase))
            if "thigh" in joint.name or "calf" in joint.name:
                at = self.sim.mechanism.v_slice(joint.name).start - 6
                out[:, at] = lift * (0.15 if "thigh" in joint.name else -0.3)
        return out

    def run(self) -> Any:
        """The motion."""
        return self.sim.rollout_feedback(self.x, self.us, xs=self.xs, Ks=self.K, throw=True)

    def derivatives(self) -> Any:
        """The same motion with A and B of each step."""
        return self.sim.linearize_rollout(self.x, self.u, throw=True)


def timed(motions: dict[str, LeggedMotion], first: str, rounds: int) -> list[list[Cell]]:
    """Rows: case, contacts, step and step with derivatives [us], both over those of the first case, iterations."""
    steps = {name: len(motion.us) for name, motion in motions.items()}
    forward = interleave({name: motion.run for name, motion in motions.items()}, rounds)
    whole = interleave({name: motion.derivatives for name, motion in motions.items()}, rounds)
    rows: list[list[Cell]] = []
    for name, motion in motions.items():
        sim = motion.sim
        contacts = len(sim.mechanism.contacts) + len(sim.model.pair_kind)
        us = [1e6 * float(t[name].min()) / steps[name] for t in (forward, whole)]
        slower = [ratio(t[name], t[first]) * steps[first] / steps[name] for t in (forward, whole)]
        rows.append([name, contacts, *us, *slower, float(sim.rollout(motion.x, motion.u).iterations.mean())])
    return rows


HEADER = ("", "contacts", "step [us]", "with A, B [us]", "step / first", "A, B / first", "iterations")


def on_feet_table(stance: Any, trot: bool, h: float, rounds: int, seconds: float) -> Table:
    """The Go2 with the shapes of CASES."""
    motions = {name: LeggedMotion(on_feet(**case), stance, h, trot, seconds) for name, case in CASES.items()}
    return Table(f"Go2, {'trot' if trot else 'rest'}, {1e3 * h:g} ms", HEADER, timed(motions, "ball feet", rounds))


def colliding_rows(name: str, trot: bool, rounds: int, seconds: float) -> list[list[Cell]]:
    """A robot without and with self-collisions, 2 ms."""
    robot, options = COLLIDING[name]
    apart, together = (loaded(robot, collisions=c, **options) for c in (None, "self"))
    stance = Legs(on_feet(**CASES["ball feet"]) if robot == "Go2" else apart).mechanism.neutral
    cases = {name: apart, f"{name}, self-collisions": together}
    return timed(
        {key: LeggedMotion(mech, stance, STEPS[0], trot, seconds) for key, mech in cases.items()}, name, rounds
    )


def run(args: argparse.Namespace) -> Report:
    """All tables."""
    report = Report("Costs of a robot's shapes", "")
    rounds, seconds = (2, 0.1) if args.quick else (7, 0.5)
    stance = Legs(on_feet(**CASES["ball feet"])).mechanism.neutral
    settings = [(f"{'trot' if t else 'rest'}, {1e3 * h:g} ms", (t, h)) for t in (False, True) for h in STEPS]
    for name, (trot, h) in settings:
        table = on_feet_table(stance, trot, h, rounds, seconds)
        report.tables.append(table)
        line = next(row for row in table.rows if row[0] == "hull feet, 32 corners")
        report.rows.append(Row(f"{name}, {line[0]}: step / ball feet", float(line[4]), "", BAR))  # type: ignore[arg-type]
        report.rows.append(Row(f"{name}, {line[0]}: A, B / ball feet", float(line[5]), "", BAR))  # type: ignore[arg-type]
    for trot in (False, True):
        title = f"Self-collisions, {'trot' if trot else 'rest'}, 2 ms"
        named = progress()([(n, n) for n in COLLIDING], title)
        rows = [row for name in named for row in colliding_rows(name, trot, rounds, seconds)]
        report.tables.append(Table(title, HEADER, rows))
    return report


if __name__ == "__main__":
    sys.exit(deliver("shapes", run, parser(__doc__)))
