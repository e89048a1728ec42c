"""Cold starts by feature: processor time and functions that a feature adds to the first step of a scene.

    python benchmarks/cold_starts.py             a quarter of an hour
    python benchmarks/cold_starts.py --quick     one feature

Each row is a process without shipped code. A base starts from an empty cache; the scene with the feature, from a cache
that holds all of the base, so that it compiles what the feature needs beyond that. Its seconds are those of the process
less those of the base with the same cache. With the feature, an empty cache costs the sum.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
import tempfile
from pathlib import Path
from typing import NamedTuple

from command import deliver, number, parser, progress

from dojo_opt.report.result import Cell, Report, Table
from support.programs import python

BARS = {"pendulum": 8.0, "joint limit": 13.0, "body on the ground": 17.0, "two balls that may touch": 16.0}  # [s]

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
    ColdScene("string", "step(touching(dojo.String(1.0)))", "two balls that may touch"),
)
QUICK = ("pendulum", "spring")


def process(scene: ColdScene, cache: Path) -> tuple[float, int]:
    """(seconds of processor time, functions compiled) of a process that steps the scene once."""
    settings = {"DOJO_OPT_SHIPPED": "0", "DOJO_OPT_JOBS": "1", "DOJO_OPT_CACHE": "1", "NUMBA_CACHE_DIR": str(cache)}
    seconds, count = json.loads(python(_HEAD + scene.program + _TAIL, **settings))
    return seconds, count


def measure(scenes: list[ColdScene], folder: Path) -> dict[str, tuple[float, int, float, int]]:
    """By name: seconds and functions of the base, and those that the feature adds."""
    found: dict[str, tuple[float, int, float, int]] = {}
    loaded: dict[str, float] = {}
    used = {scene.base for scene in scenes}
    for scene in progress()([(s.name, s) for s in scenes], "cold starts"):
        cache = folder / scene.name
        if scene.base:
            shutil.copytree(folder / scene.base, cache)
        seconds, count = process(scene, cache)
        before = found.get(scene.base, (0.0, 0, 0.0, 0))
        found[scene.name] = (before[0] + before[2], before[1] + before[3], seconds - loaded.get(scene.base, 0.0), count)
        if scene.name in used:
            loaded[scene.name] = process(scene, cache)[0]
        else:
            shutil.rmtree(cache)
    return found


def run(args: argparse.Namespace) -> Report:
    """The table, the worst first, and the bars."""
    report = Report("Cold starts by feature", "")
    scenes = [scene for scene in SCENES if not args.quick or scene.name in QUICK]
    with tempfile.TemporaryDirectory() as folder:
        found = measure(scenes, Path(folder))
    lines: list[list[Cell]] = []
    for scene in scenes:
        seconds, count, more, functions = found[scene.name]
        times = (round(t, 1) for t in (seconds, more, seconds + more))
        lines.append([scene.name, scene.base or "nothing", *times, count, functions])
    lines.sort(key=lambda line: -float(line[4]))  # type: ignore[arg-type]
    header = ("", "beyond", "without [s]", "it adds [s]", "with [s]", "functions without", "it adds")
    report.tables.append(Table("Processor time to the first step, empty cache", header, lines))
    report.rows += [
        number(f"{name}: processor time", found[name][0] + found[name][2], bar, unit="s")
        for name, bar in BARS.items()
        if name in found and not args.quick
    ]
    worst = max(found, key=lambda name: found[name][0] + found[name][2])
    report.rows.append(number("the worst", sum(found[worst][::2]), unit="s", note=worst))
    return report


if __name__ == "__main__":
    sys.exit(deliver("cold_starts", run, parser(__doc__)))
