"""Three tests of SimBenchmark (leggedrobotics/SimBenchmark), which show the effect of contact on whole motions.

rolling    a box of 10 kg with 25 balls of 1 kg on it is pulled over the ground by 150 N for 4 s, along y or askew
bouncing   balls of 10 kg fall from 5 m on an elastic floor without friction, for 20 s
momentum   a ball of 10 kg at 5 m/s hits a floating quadruped, inelastically, without gravity, for 10 s
"""

from __future__ import annotations

from dataclasses import replace
from importlib.util import find_spec
from typing import Any

import numpy as np

from benchmarks.engines.mujoco_scene import without_reset
from dojo_opt.models.quadruped import quadruped
from dojo_opt.report.result import Cell, Row, Table
from sim.mechanism.body import Body
from sim.mechanism.collision import Collision
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box, Sphere
from sim.simulator.simulator import Simulator
from solvers.types import Floats

G, FORCE = 9.81, 150.0  # [m/s^2], [N]
BOX, BALL, RADIUS, COUNT = 10.0, 1.0, 0.1, 25  # masses [kg], radius of the balls [m], their number
GROUND, GRIP = 0.4, 0.8  # friction of the box on the ground, of the balls on the box
SIZE, HEIGHT = 20.0, 0.1  # of the box [m]
DIRECTIONS = {"y": (0.0, 1.0), "askew": (0.5, 0.75**0.5)}
KAPPA = 1e-10
_FIRST_ORDER = "of first order in the time step"


def accelerations() -> tuple[float, float]:
    """Of the box and of the balls that roll on it: F - mu (M + n m) g = M a + n f, f = m b, a = 7/2 b. [m/s^2]"""
    pulled = FORCE - GROUND * (BOX + COUNT * BALL) * G
    balls = pulled / (3.5 * BOX + COUNT * BALL)
    return 3.5 * balls, balls


def _places() -> Floats:
    """(25, 2) of the balls on the box [m]."""
    line = 2.0 * np.arange(-2.0, 3.0)
    return np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)


def _rolling() -> Mechanism:
    bodies = [Body("box", BOX, shape=Box(SIZE, SIZE, HEIGHT))]
    bodies += [Body(f"ball{k}", BALL, shape=Sphere(RADIUS)) for k in range(COUNT)]
    neutral = {"box": (0.0, 0.0, 0.5 * HEIGHT, 1.0, 0.0, 0.0, 0.0)}
    neutral |= {f"ball{k}": (x, y, HEIGHT + RADIUS, 1.0, 0.0, 0.0, 0.0) for k, (x, y) in enumerate(_places())}
    corners = [(0.5 * SIZE * x, 0.5 * SIZE * y, -0.5 * HEIGHT) for x in (-1, 1) for y in (-1, 1)]
    return Mechanism(
        bodies,
        [Joint("floating", None, body.name) for body in bodies],
        contacts=[Contact("box", corner, friction=GROUND) for corner in corners],
        collisions=[Collision(f"ball{k}", "box", friction=GRIP) for k in range(COUNT)],
        inputs=[Input(body="box", force=(1.0, 0.0, 0.0)), Input(body="box", force=(0.0, 1.0, 0.0))],
        neutral=neutral,
    )


def _errors(position: Floats, direction: Floats, time_step: float) -> dict[str, float]:
    """Of the mean velocity over every step, root mean square over the motion, from positions (T + 1, 26, 3) [m/s].

    box, balls   against the analytic one        askew   part of the box's across the direction
    """
    velocity = np.diff(position, axis=0) / time_step
    middle = time_step * (np.arange(len(velocity)) + 0.5)
    along = np.append(direction, 0.0)
    exact = np.array([accelerations()[0], *[accelerations()[1]] * COUNT])
    off = velocity - middle[:, None, None] * exact[None, :, None] * along
    across = velocity[:, 0, :2] @ np.array([-direction[1], direction[0]])
    size = np.sqrt(np.mean(np.sum(off**2, axis=2), axis=0))
    return {"box": float(size[0]), "balls": float(size[1:].max()), "askew": float(np.sqrt(np.mean(across**2)))}


def rolling(time_step: float, direction: tuple[float, float], duration: float = 4.0) -> dict[str, float]:
    """Errors of ours [m/s]."""
    sim = Simulator(_rolling(), time_step=time_step, kappa=KAPPA)
    us = np.tile(FORCE * np.asarray(direction), (round(duration / time_step), 1))
    t = sim.rollout(sim.neutral(), us, throw=True)
    return _errors(sim.maximal(t.x)[:, :, :3], np.asarray(direction), time_step)


def rolling_mujoco(time_step: float, direction: tuple[float, float], duration: float = 4.0) -> dict[str, float]:
    """The same of MuJoCo, elliptic cones, its defaults otherwise."""
    import mujoco

    balls = "".join(
        f'<body pos="{x} {y} {HEIGHT + RADIUS}"><freejoint/><geom size="{RADIUS}" mass="{BALL}" contype="0" '
        f'conaffinity="2" friction="{GRIP}" priority="1"/></body>'
        for x, y in _places()
    )
    text = f"""<mujoco><option timestep="{time_step}" cone="elliptic" gravity="0 0 {-G}"/><worldbody>
      <geom type="plane" size="0 0 1" friction="{GROUND}"/>
      <body pos="0 0 {0.5 * HEIGHT}"><freejoint/><geom type="box" size="{0.5 * SIZE} {0.5 * SIZE} {0.5 * HEIGHT}"
        mass="{BOX}" friction="{GROUND}" contype="2"/></body>{balls}</worldbody></mujoco>"""
    model: Any = without_reset(mujoco.MjModel.from_xml_string(text))
    data = mujoco.MjData(model)
    data.xfrc_applied[1, :2] = FORCE * np.asarray(direction)
    position = np.empty((round(duration / time_step) + 1, COUNT + 1, 3))
    for row in position:
        row[:] = data.qpos.reshape(-1, 7)[:, :3]
        mujoco.mj_step(model, data)
    return _errors(position, np.asarray(direction), time_step)


def bouncing(time_step: float, side: int = 7, duration: float = 20.0) -> float:
    """Largest error of the energy of side x side balls, relative to their initial energy above the floor."""
    names = [f"ball{k}" for k in range(side**2)]
    places = np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    mech = Mechanism(
        [Body(name, 10.0, shape=Sphere(RADIUS)) for name in names],
        [Joint("floating", None, name) for name in names],
        contacts=[Contact(name, radius=RADIUS, friction=0.0, restitution=1.0) for name in names],
        neutral={n: (x, y, 5.0 + RADIUS, 1.0, 0.0, 0.0, 0.0) for n, (x, y) in zip(names, places, strict=True)},
    )
    sim = Simulator(mech, time_step=time_step, kappa=KAPPA)
    x = sim.state_from_velocity(sim.neutral()[: sim.nq], np.zeros(sim.nv))
    t = sim.rollout(x, np.zeros((round(duration / time_step), sim.nu)), throw=True)
    energy = sim.energy(t.x)
    return float(np.abs(energy - energy[0]).max() / (len(names) * 10.0 * G * 5.0))


def momentum(time_step: float, duration: float = 10.0) -> float:
    """Largest change of the momentum of ball and robot, relative to the ball's, after they have met."""
    robot = replace(quadruped(gravity=(0.0, 0.0, 0.0)), contacts=())
    ball = Mechanism([Body("ball", 10.0, shape=Sphere(RADIUS))], [Joint("floating", None, "ball")], gravity=(0, 0, 0))
    both = robot.add(ball, pose=(-1.0, 0.02, 0.02 + float(np.asarray(robot.neutral)[2])))
    sim = Simulator(both.with_collisions(Collision("ball", "trunk")), time_step=time_step, kappa=KAPPA)
    x = sim.neutral()
    x[sim.nq + both.v_slice("ball").start] = 5.0
    t = sim.rollout(x, np.zeros((round(duration / time_step), sim.nu)), throw=True)
    linear, _ = sim.momentum(t.x)
    assert t.contacts.normal_force.max() > 1.0, "they have not met"
    return float(np.abs(linear - linear[0]).max() / 50.0)


def measured(quick: bool) -> tuple[list[Row], Table, dict[str, Any]]:
    """Rows with their bars, the table of all engines, and every number; quick takes shorter motions and one step."""
    steps = (1e-2,) if quick else (1e-3, 1e-2)
    engines = {"dojo-opt": rolling} | ({"MuJoCo Euler": rolling_mujoco} if find_spec("mujoco") else {})
    length = 1.0 if quick else 4.0
    found = {
        name: {f"{h:g} {where}": run(h, along, length) for h in steps for where, along in DIRECTIONS.items()}
        for name, run in engines.items()
    }
    kept = {f"{h:g}": bouncing(h, 2 if quick else 7, 2.0 if quick else 20.0) for h in steps}
    carried = {f"{h:g}": momentum(h, 1.0 if quick else 10.0) for h in steps}
    ours = found["dojo-opt"]
    worst = {h: max(e["box"] for case, e in ours.items() if float(case.split()[0]) == h) for h in steps}
    rows = [
        Row("SimBenchmark, rolling: box faster or slower, at 10 ms", worst[1e-2], "m/s", note=_FIRST_ORDER),
        Row("SimBenchmark, rolling: velocity off the line", max(e["askew"] for e in ours.values()), "m/s", 1e-6),
        Row("SimBenchmark, bouncing: error of the energy", max(kept.values()), "", 1e-6, note="of m g 5 m"),
        Row("SimBenchmark, momentum: change of it", max(carried.values()), "", 1e-9),
    ]
    if len(steps) > 1:
        shrunk = worst[1e-3] / worst[1e-2]
        rows.insert(1, Row("SimBenchmark, rolling: that at 1 ms over that at 10 ms", shrunk, "", 0.2))
    body: list[list[Cell]] = [
        [engine, case, *(f"{numbers[key]:.2g}" for key in ("box", "balls", "askew"))]
        for engine, cases in found.items()
        for case, numbers in cases.items()
    ]
    title = "SimBenchmark's rolling: 25 balls on a box that is pulled, root mean square errors of velocity [m/s]"
    table = Table(title, ("", "time step [s], along", "box", "balls", "box, across"), body)
    return rows, table, {"rolling": found, "bouncing": kept, "momentum": carried}
