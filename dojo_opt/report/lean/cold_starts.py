"""Cold starts by feature: processor time and functions that a feature adds to the first step of a scene.

Each row is a process without shipped code. A base starts from an empty cache; the scene with the feature, from a cache
that holds all of the base, so that it compiles what the feature needs beyond that. Its seconds are those of the process
less those of the base with the same cache. With the feature, an empty cache costs the sum.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import NamedTuple

from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.study import Progress

__all__ = ["SCENES", "ColdScene", "ColdStart", "add_cold_starts", "chosen", "measure"]

QUICK = ("pendulum", "spring")  # of a check that it runs

_HEAD = """
import json, sys, time
begin = time.process_time()
import numpy as np
import dojo_opt as dojo

def swinging(kind="revolute", **features):
    body = dojo.Body("a", 1.0, (0.1, 0.2, 0.3))
    joint = dojo.Joint(kind, None, "a", child_point=(0.0, 0.0, -0.1), **features)
    return dojo.Mechanism([body], [joint])

def falling(**features):
    foot = dojo.Contact("b", radius=0.1, **features)
    return dojo.Mechanism([dojo.Body("b", 1.0, (0.1, 0.1, 0.1))], [dojo.Joint("floating", None, "b")], [foot])

def touching(a=None, b=None, ground=False):
    bodies = [dojo.Body(name, 1.0, (0.1, 0.1, 0.1)) for name in "ab"]
    joints = [dojo.Joint("floating", None, name) for name in "ab"]
    pair = dojo.Collision("a", "b", a or dojo.Sphere(0.1), b or a or dojo.Sphere(0.1))
    feet = [dojo.Contact(name, radius=0.1) for name in "ab"] if ground else []
    near = {"b": (0.15, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)}
    return dojo.Mechanism(bodies, joints, feet, collisions=[pair], neutral=near)

def geared():
    bodies = [dojo.Body(name, 1.0, (0.1, 0.2, 0.3)) for name in "ab"]
    joints = [dojo.Joint("revolute", None, name, child_point=(0.0, 0.0, -0.1), name=f"j{name}") for name in "ab"]
    return dojo.Mechanism(bodies, joints, gears=[dojo.Gear("jb", "ja", -2.0)])

def hollow(points):
    return np.abs(points).max(axis=1) - 0.1

def learn():
    def observation(x, out):
        out[0], out[1] = x[0], x[1]

    def reward(x, action, after):
        return -after[0] ** 2

    sim, one = dojo.Simulator(actuated(), time_step=0.01), np.ones(1)
    task = dojo.learn.Task(sim, 1, observation, 2, reward, -one, one, lambda rng: np.zeros(2), steps=4)
    dojo.learn.shac(task, epochs=1, environments=2, horizon=2, evaluations=1, episodes=1)

def actuated():
    swing = swinging(name="pivot")
    return dojo.Mechanism(swing.bodies, swing.joints, inputs=[dojo.Input("pivot")])

def plan():
    sim = dojo.Simulator(actuated(), time_step=0.05)
    cost = [dojo.cost.Tracking(sim.neutral(), 1.0), dojo.cost.Effort(0.1)]
    return dojo.Problem(sim, [0.1, 0.0], 4, cost=cost)

def step(mechanism, **settings):
    sim = dojo.Simulator(mechanism, time_step=0.01, **settings)
    sim.step(sim.neutral())
    return sim

def hill():
    return dojo.Terrain.from_function(lambda x, y: 0.1 * np.sin(x), np.linspace(-2, 2, 9), [-1.0, 1.0])

box, capsule, cylinder = dojo.Box(0.1, 0.1, 0.1), dojo.Capsule(0.1, 0.1), dojo.Cylinder(0.1, 0.1)
ball, ellipsoid = dojo.Sphere(0.1), dojo.Ellipsoid(0.1, 0.12, 0.14)
corners = 0.1 * np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
polytope = dojo.Polytope(corners)
"""
_TAIL = """
from solvers.compiler import compiled
print(json.dumps([time.process_time() - begin, len(compiled())]))
"""


class ColdScene(NamedTuple):
    """A row: a scene with a feature."""

    name: str
    program: str
    base: str = ""  # the scene without the feature; "": nothing


class ColdStart(NamedTuple):
    """Processor time [s] and number of compiled functions."""

    without: float  # of the base
    functions_without: int
    adds: float  # of the feature
    functions: int

    @property
    def seconds(self) -> float:
        """Processor time with the feature [s]."""
        return self.without + self.adds


_PENDULUM = "step(swinging())"
SCENES = (
    ColdScene("pendulum", _PENDULUM),
    ColdScene("body on the ground", "step(falling())"),
    ColdScene("two balls that may touch", "step(touching())"),
    *(
        ColdScene(f"joint: {kind}", f"step(swinging({kind!r}))", "pendulum")
        for kind in ("prismatic", "cylindrical", "planar_axis", "orbital", "spherical", "floating")
    ),
    ColdScene("screw", "step(swinging('screw', pitch=0.1))", "pendulum"),
    ColdScene("joint limit", "step(swinging(limits=(-0.5, 0.5)))", "pendulum"),
    ColdScene("cone limit", "step(swinging('spherical', cone=0.5))", "joint limit"),
    ColdScene("spring", "step(swinging(spring=1.0))", "pendulum"),
    ColdScene("spring of a ball joint", "step(swinging('spherical', spring=1.0))", "joint: spherical"),
    ColdScene("damper", "step(swinging(damper=0.1))", "pendulum"),
    ColdScene("dry friction", "step(swinging(friction=0.1))", "pendulum"),
    ColdScene("gear", "step(geared())", "pendulum"),
    ColdScene("closed loop", "step(dojo.models.fourbar())", "pendulum"),
    ColdScene("order 4", "step(swinging(), order=4)", "pendulum"),
    ColdScene("order 8", "step(swinging(), order=8)", "pendulum"),
    ColdScene("accuracy", "step(swinging(), accuracy=1e-3)", "pendulum"),
    ColdScene("derivatives", "s = step(swinging()); s.linearize(s.neutral())", "pendulum"),
    ColdScene("parameters", "s = step(swinging()); s.linearize(s.neutral(), wrt=('mass',))", "derivatives"),
    ColdScene("derivatives of contacts", "s = step(falling()); s.linearize(s.neutral())", "body on the ground"),
    ColdScene("contact law: linear", "step(falling(law='linear'))", "body on the ground"),
    ColdScene("contact law: impact", "step(falling(law='impact', friction=0.0))", "body on the ground"),
    ColdScene("terrain", "step(falling(terrain=hill()))", "body on the ground"),
    ColdScene("restitution", "step(falling(restitution=0.5))", "body on the ground"),
    ColdScene("ground below balls that may touch", "step(touching(ground=True))", "two balls that may touch"),
    *(
        ColdScene(f"shapes: {name}", f"step(touching({arguments}))", "two balls that may touch")
        for name, arguments in (
            ("ball, capsule", "ball, capsule"),
            ("ball, box", "ball, box"),
            ("ball, cylinder", "ball, cylinder"),
            ("capsules", "capsule"),
            ("capsule, box", "capsule, box"),
            ("boxes", "box"),
            ("polytopes", "polytope"),
            ("cylinders", "cylinder"),
            ("ellipsoids", "ellipsoid"),
        )
    ),
    ColdScene(
        "shapes: level set, ball",
        "step(touching(dojo.SignedDistance.from_function(hollow, ((-0.2,) * 3, (0.2,) * 3), 0.05), ball))",
        "two balls that may touch",
    ),
    ColdScene("string", "step(touching(dojo.String(1.0)))", "two balls that may touch"),
    ColdScene("planner", "step(swinging()); dojo.ilqr(plan())", "pendulum"),
    ColdScene("MPC", "mpc = dojo.MPC(plan()); dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 0.05), 0.2)", "planner"),
    ColdScene("planner of contacts", "dojo.ilqr(dojo.problems.hop())", "derivatives of contacts"),
    ColdScene("learning", "step(swinging()); learn()", "pendulum"),
)


def chosen(names: Iterable[str]) -> list[ColdScene]:
    """The scenes of these names, and those that they build on, in the order of SCENES."""
    by_name, wanted = {scene.name: scene for scene in SCENES}, set()
    for name in names:
        while name:
            wanted.add(name)
            name = by_name[name].base
    return [scene for scene in SCENES if scene.name in wanted]


def _process(scene: ColdScene, cache: Path) -> tuple[float, int]:
    """(seconds of processor time, functions compiled) of a process that steps the scene once."""
    program = cache / "scene.py"  # a file: compiled functions of users need their source
    cache.mkdir(parents=True, exist_ok=True)
    program.write_text(_HEAD + scene.program + _TAIL, encoding="utf-8")
    settings = {"DOJO_OPT_SHIPPED": "0", "DOJO_OPT_JOBS": "1", "DOJO_OPT_CACHE": "1", "DOJO_OPT_QUIET": "1"}
    # bytecode is kept, as on most machines: where images of containers forbid it, each process parses all modules
    paths = {"NUMBA_CACHE_DIR": str(cache), "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    paths["PYTHONDONTWRITEBYTECODE"] = ""
    command = [sys.executable, str(program)]
    done = subprocess.run(command, env={**os.environ, **settings, **paths}, capture_output=True, text=True)
    if done.returncode != 0:
        raise RuntimeError(f"cold start {scene.name!r}: the measured process failed\n{done.stderr}")
    seconds, count = json.loads(done.stdout.splitlines()[-1])
    return seconds, count


def measure(scenes: list[ColdScene], progress: Progress) -> dict[str, ColdStart]:
    """Cold starts of scenes, those that others build on among them.

    Args:
        scenes: as from `chosen`.
        progress: display of the progress.

    Returns:
        The cold starts by name.

    Raises:
        RuntimeError: a process failed.
    """
    found: dict[str, ColdStart] = {}
    loaded: dict[str, float] = {}
    used = {scene.base for scene in scenes}
    with tempfile.TemporaryDirectory() as folder:
        for scene in progress([(s.name, s) for s in scenes], "cold starts"):
            cache, base = Path(folder, scene.name), found.get(scene.base)
            if base:
                shutil.copytree(Path(folder, scene.base), cache)
            seconds, count = _process(scene, cache)
            adds = seconds - loaded.get(scene.base, 0.0)
            functions = base.functions_without + base.functions if base else 0
            found[scene.name] = ColdStart(base.seconds if base else 0.0, functions, adds, count)
            if scene.name in used:
                loaded[scene.name] = _process(scene, cache)[0]
            else:
                shutil.rmtree(cache)
    return found


def add_cold_starts(report: Report, progress: Progress, *, quick: bool = False) -> dict[str, ColdStart]:
    """Measure cold starts, and add their table, the worst first, to a report.

    Args:
        report: the report.
        progress: display of the progress.
        quick: whether to measure one feature, as a check.

    Returns:
        The cold starts by name.

    Raises:
        RuntimeError: a process failed.
    """
    scenes = chosen(QUICK) if quick else list(SCENES)
    found = measure(scenes, progress)
    lines: list[list[Cell]] = []
    for scene in sorted(scenes, key=lambda scene: -found[scene.name].seconds):
        cold = found[scene.name]
        times = (round(t, 1) for t in (cold.without, cold.adds, cold.seconds))
        lines.append([scene.name, scene.base or "nothing", *times, cold.functions_without, cold.functions])
    header = ("", "beyond", "without [s]", "it adds [s]", "with [s]", "functions without", "it adds")
    report.tables.append(Table("Processor time to the first step, empty cache", header, lines))
    worst = str(lines[0][0])
    report.rows.append(Row("the worst cold start", found[worst].seconds, "s", note=worst))
    return found
