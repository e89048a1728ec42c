"""Random mechanisms in random states: count the failures of steps, motions and derivatives.

    python benchmarks/attacks.py             2000 steps, 10,000 motions, 4000 crowds, 300 derivatives, 60 steps with
                                             derivatives by parameters, 500 gradients, 1000 files
    python benchmarks/attacks.py --quick     40, 60, 40, 10, 2, 10 and 40
    python benchmarks/attacks.py --only motions --first 5000 --count 2000

steps          one step of any mechanism (random_mechanisms.py), kappa default or 1e-4: no exception, every number
               finite, no contact below the ground, no impulse outside its cone (the impulse of a divided step is a sum
               over cones that turn, and is not judged), and no change of momentum beyond that of the impulses and
               gravity
motions        passive trees of 2 to 8 bodies that fall on level ground, .3 s at 10, 20 and 50 ms: no accepted step
               gains more than a tenth of the kinetic energy. Refused motions are counted
crowds         the same of trees of any joints whose bodies collide with one another; steps that begin with an overlap
               are not judged
derivatives    d(next state)/d(state) of a step at kappa 1e-4 against central differences on the manifold, where those
               of two step sizes agree
parameters     the same by all parameters of a kind along a random direction, for every kind, also of torsional and
               rolling friction, and of bodies that collide
gradients      `linearize_trajectory` of a motion whose bodies collide, and the gradient of its end by `vjp`: next
               states, derivatives and gradient are those of its steps, one after the other
files          a URDF and an MJCF file, mutated at random (tests/support/robot_texts.py): refused by an error that names
               the call, or a robot that takes a step, with numbers that are finite. A step may be refused
"""

from __future__ import annotations

import argparse
import sys
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from command import deliver, number, parser, progress
from random_mechanisms import COMMON, Recipe, heights, random_mechanism, random_state

import dojo_opt as dojo
from dojo_opt.report.result import Report, Table
from solvers.types import Vector
from support.parameter_case import Case, kind_of
from support.parameter_errors import ONE_SIDED, random_direction
from support.robot_texts import MJCF, URDF, mutated

TIME_STEPS = (0.01, 0.02, 0.05)
SECONDS = 0.3
MOTION = 8  # steps of a motion that is linearized
GAIN = 0.1  # of the kinetic energy, or of LEAST
LEAST = 1e-3  # [J]
PASSIVE = Recipe(kinds=COMMON, passive=True, contacts=16)
CROWDED = Recipe(passive=True, crowded=True)
ANYTHING = Recipe(bodies=12)
BELOW = 1e-6  # [m]
APART = 1e-4  # next states of other solutions of a step
AGREE, WRONG = 1e-6, 1e-4  # of central differences of two step sizes; of a derivative, relative to the largest


def outside_cones(mech: dojo.Mechanism, contacts: Any) -> float:
    """Largest friction beyond the cone of its contact, over the largest impulse; pyramids lie inside sqrt(2) cones."""
    normal, friction = contacts.normal_force, contacts.friction_force
    parts = {c.name: c for c in (*mech.contacts, *mech.collisions)}
    known = [parts.get(name.split("[")[0]) for name in contacts.names]
    most = np.array([np.inf if part is None else part.friction for part in known])
    wide = np.array([np.sqrt(2.0) if getattr(parts.get(n), "law", "") == "linear" else 1.0 for n in contacts.names])
    excess = np.maximum(friction - most * wide * np.maximum(normal, 0.0), -normal)
    return float(np.max(excess, initial=0.0) / (1.0 + np.max(np.abs(normal), initial=0.0)))


def momentum_error(sim: dojo.Simulator, x: Vector, result: Any) -> float:
    """Linear momentum that gravity and the impulses of the ground do not explain, over the total."""
    mass = sum(b.mass for b in sim.mechanism.bodies)
    before, after = sim.momentum(x)[0], sim.momentum(result.x)[0]
    ground = result.contacts.impulse[: len(sim.mechanism.contacts)].sum(axis=0)
    given = ground + mass * np.asarray(sim.mechanism.gravity) * sim.time_step
    size = 1.0 + np.abs(before).max() + np.abs(after).max() + np.abs(result.contacts.impulse).sum()
    return float(np.abs(after - before - given).max() / size)


def judge_step(sim: dojo.Simulator, x: Vector) -> str:
    """Outcome of one step: the name of its status, or of its failure."""
    try:
        result = sim.step(x)
    except Exception as error:  # whatever it is, it is counted
        return f"exception {type(error).__name__}"
    arrays = (result.x, result.contacts.impulse, result.contacts.slip, result.contacts.point)
    if not all(np.isfinite(a).all() for a in arrays) or np.isnan(result.contacts.gap).any():
        return f"not finite, {result.status.name}"
    if not result.success:
        return str(result.status.name)
    if heights(sim, result.x).min() < -BELOW:
        return "below the ground"
    if result.parts == 1 and outside_cones(sim.mechanism, result.contacts) > 1e-6:
        return "outside its cone"
    if momentum_error(sim, x, result) > 1e-6:
        return "momentum"
    return "SOLVED"


def step_case(seed: int) -> str:
    """One step of a random mechanism."""
    rng = np.random.default_rng([seed, 1])
    mech = random_mechanism(rng, ANYTHING)
    kappa = None if rng.random() < 0.7 else 1e-4
    sim = dojo.Simulator(mech, time_step=float(rng.choice([0.001, 0.005, *TIME_STEPS])), kappa=kappa)
    return judge_step(sim, random_state(sim, rng))


def motion_case(seed: int) -> tuple[float, str, float]:
    """(time step, status, largest gain of an accepted step) of a passive fall."""
    rng = np.random.default_rng([seed, 2])
    h = TIME_STEPS[seed % len(TIME_STEPS)]
    sim = dojo.Simulator(random_mechanism(rng, PASSIVE), time_step=h)
    motion = sim.rollout(random_state(sim, rng), np.zeros((round(SECONDS / h), sim.nu)))
    energy, kinetic = np.asarray(sim.energy(motion.x)), np.asarray(sim.kinetic_energy(motion.x))
    gains = np.diff(energy) / np.maximum(kinetic[:-1], LEAST)
    return h, motion.status.name, float(gains.max(initial=-1.0))


def crowd_case(seed: int) -> tuple[float, str, float]:
    """(time step, status, largest gain of an accepted step) of a passive fall of bodies that collide.

    Steps that begin with an overlap may gain energy: those from random states, and from states that ended with one.
    """
    rng = np.random.default_rng([seed, 5])
    h = TIME_STEPS[seed % len(TIME_STEPS)]
    sim = dojo.Simulator(random_mechanism(rng, CROWDED), time_step=h)
    motion = sim.rollout(random_state(sim, rng), np.zeros((round(SECONDS / h), sim.nu)))
    energy, kinetic = np.asarray(sim.energy(motion.x)), np.asarray(sim.kinetic_energy(motion.x))
    gains = np.diff(energy)[1:] / np.maximum(kinetic[1:-1], LEAST)
    apart = motion.contacts.gap[: len(gains)].min(axis=1, initial=0.0) > -BELOW
    return h, motion.status.name, float(gains[apart].max(initial=-1.0))


def difference(sim: dojo.Simulator, x: Vector, direction: Vector, eps: float, parts: int) -> Vector | None:
    """Central difference of the next state along a direction, (ndx,); None where a step is not solved in as many parts.

    A division is kept, as the derivatives keep it: another one is another step.
    """
    ends = [sim.step(sim.integrate(x, s * eps * direction)) for s in (1.0, -1.0)]
    if not all(end.success and end.parts == parts for end in ends):
        return None
    return np.asarray(sim.difference(ends[0].x, ends[1].x) / (2.0 * eps))


def derivative_case(seed: int) -> tuple[str, float]:
    """("compared", largest relative error of a derivative along a random direction), or why there is none."""
    rng = np.random.default_rng([seed, 3])
    sim = dojo.Simulator(random_mechanism(rng, ANYTHING), time_step=0.01, kappa=1e-4, tolerance=1e-12)
    x, direction = random_state(sim, rng), rng.normal(size=sim.ndx)
    step = sim.step(x)
    if not step.success:
        return "step not solved", 0.0
    coarse, fine = (difference(sim, x, direction, eps, step.parts) for eps in (1e-6, 3e-7))
    if coarse is None or fine is None:
        return "no reference", 0.0
    size = 1.0 + np.abs(fine).max()
    if np.abs(coarse - fine).max() > AGREE * size:
        return "no reference", 0.0
    found = sim.linearize(x, np.zeros(sim.nu))
    if not found.success:
        return ("refused" if step.momentum_fraction == 1.0 else "momentum lost"), 0.0
    return "compared", float(np.abs(found.A @ direction - fine).max() / size)


def rubbing(mech: dojo.Mechanism, rng: Any) -> dojo.Mechanism:
    """The mechanism with torsional and rolling friction of some of its contacts."""
    parts = {
        field: [
            replace(c, torsional_friction=rng.uniform(0.0, 0.1), rolling_friction=rng.uniform(0.0, 0.05))
            if rng.random() < 0.5
            else c
            for c in getattr(mech, field)
        ]
        for field in ("contacts", "collisions")
    }
    return replace(mech, **parts)


def parameter_case(seed: int) -> dict[str, tuple[str, float]]:
    """(("compared", relative error of the derivative along a random direction), or why there is none) by kind."""
    rng = np.random.default_rng([seed, 7])
    mech = random_mechanism(rng, ANYTHING if seed % 2 else CROWDED)
    sim = dojo.Simulator(
        rubbing(mech, rng) if rng.random() < 0.5 else mech, time_step=0.01, kappa=1e-4, tolerance=1e-12
    )
    case = Case(sim, random_state(sim, rng), rng.normal(size=sim.nu))
    here = sim.step(case.x, case.u)
    if not here.success:
        return {}
    return {kind: compared(case, kind, here) for kind in case.kinds()}


def compared(case: Case, kind: str, here: dojo.StepResult) -> tuple[str, float]:
    """As parameter_case, of one kind; here: the step."""
    sim, names = case.sim, [name for name in case.sim.parameters().names if kind_of(name) == kind]
    values = sim.parameters(names).values
    direction = random_direction(kind, values, sim.time_step)
    found = sim.linearize(case.x, case.u, wrt=names)
    if not found.success:
        return "refused", 0.0
    rate = np.concatenate([found[name] for name in names], axis=1) @ direction
    slopes = []
    for size in (1e-5, 1e-6):
        ways = (1.0, 2.0) if kind in ONE_SIDED else (-1.0, 1.0)
        moved = [sim.with_parameters(dict(zip(names, values + w * size * direction, strict=True))) for w in ways]
        ends = [one.step(case.x, case.u) for one in moved]
        if not all(end.success and end.parts == here.parts for end in ends):
            return "no reference", 0.0
        near, far = (sim.difference(end.x, here.x) / size for end in ends)
        slopes.append(2.0 * near - 0.5 * far if kind in ONE_SIDED else 0.5 * (far - near))
        if size * np.abs(near).max() > APART:
            return "several solutions", 0.0
    scale = 1e-2 + np.abs(rate).max()
    if np.abs(slopes[0] - slopes[1]).max() > 10.0 * AGREE * scale:
        return "no reference", 0.0
    return "compared", float(np.abs(slopes[1] - rate).max() / scale)


def gradient_case(seed: int) -> tuple[str, float]:
    """("compared", largest relative error of the linearization of a motion), or why there is none."""
    rng = np.random.default_rng([seed, 6])
    kappa = float(rng.choice([1e-6, 1e-4, 1e-2]))
    sim = dojo.Simulator(random_mechanism(rng, CROWDED), time_step=0.01, kappa=kappa, tolerance=1e-10)
    motion = sim.rollout(random_state(sim, rng), np.zeros((MOTION, sim.nu)))
    if not motion.success:
        return "step not solved", 0.0
    steps = [sim.linearize(x, u) for x, u in zip(motion.x, motion.u, strict=False)]
    whole = sim.linearize_trajectory(motion.x, motion.u)
    cost = np.zeros((MOTION + 1, sim.ndx))
    cost[-1] = rng.normal(size=sim.ndx)
    adjoint, expected, error = sim.vjp(motion, cost, wrt=("state",)), cost[-1], 0.0
    if not (whole.success and adjoint.success and all(step.success for step in steps)):
        return "refused", 0.0
    apart = [np.abs(sim.difference(step.x_next, x)).max() for step, x in zip(steps, motion.x[1:], strict=True)]
    if max(apart) > APART:
        return "several solutions", 0.0
    for k, step in reversed(list(enumerate(steps))):
        expected = step.A.T @ expected
        error = max(error, float(np.abs(whole.A[k] - step.A).max() / (1.0 + np.abs(step.A).max())))
    error = max(error, float(np.abs(sim.difference(whole.x_next, motion.x[1:])).max()))
    return "compared", max(error, float(np.abs(adjoint["state"] - expected).max() / (1.0 + np.abs(expected).max())))


def attack(args: argparse.Namespace) -> Report:
    """Run all sections."""
    report = Report("Attacks with random mechanisms", "")
    for name, (section, whole, quick) in SECTIONS.items():
        if args.only in (None, name):
            section(report, range(args.first, args.first + (args.count or (quick if args.quick else whole))))
    return report


def shown(seeds: list[int]) -> str:
    """The first of the seeds, for a second look."""
    return f"seeds {seeds[:9]}" if seeds else ""


def steps(report: Report, seeds: range) -> None:
    """One step each."""
    named = [(f"step {seed}", (seed,)) for seed in seeds]
    ends = Counter(step_case(*case) for case in progress()(named, "steps"))
    allowed = {status.name for status in dojo.Status}
    wrong = {name: count for name, count in ends.items() if name not in allowed}
    report.rows += [
        number("steps: tried", len(seeds)),
        number("steps: wrong", sum(wrong.values()), 0, note=", ".join(wrong)),
        number("steps: refused", len(seeds) - ends["SOLVED"] - sum(wrong.values())),
    ]
    report.tables.append(Table("Steps", ("ended", "steps"), [list(end) for end in ends.most_common()]))


def motions(report: Report, seeds: range) -> None:
    """Passive falls."""
    falls(report, seeds, "motions", motion_case)


def crowds(report: Report, seeds: range) -> None:
    """Passive falls of bodies that collide."""
    falls(report, seeds, "crowds", crowd_case)


def falls(report: Report, seeds: range, name: str, case: Callable[[int], tuple[float, str, float]]) -> None:
    """Gains of energy and refusals, by time step."""
    named = [(f"{name} {seed}", (seed,)) for seed in seeds]
    cases = [case(*seed) for seed in progress()(named, name)]
    lines = []
    for h in TIME_STEPS:
        here = [case for case in cases if case[0] == h]
        refused = Counter(status for _, status, _ in here if status != "SOLVED")
        gained = sum(gain > GAIN for *_, gain in here)
        worst = max((gain for *_, gain in here), default=0.0)
        why = ", ".join(f"{status} {count}" for status, count in refused.items())
        lines.append([f"{1e3 * h:g} ms", len(here), gained, worst, refused.total(), why])
    gaining = [seed for seed, (*_, gain) in zip(seeds, cases, strict=True) if gain > GAIN]
    report.rows += [
        number(f"{name}: tried", len(seeds)),
        number(f"{name}: accepted steps that gain energy", len(gaining), 0, note=shown(gaining)),
        number(f"{name}: refused", sum(line[4] for line in lines)),
    ]
    header = ("time step", "motions", "gained more than a tenth", "largest gain", "refused", "by status")
    report.tables.append(Table(f"Passive falls: {name}", header, lines))


def derivatives(report: Report, seeds: range) -> None:
    """Against central differences."""
    named = [(f"derivative {seed}", (seed,)) for seed in seeds]
    cases = [derivative_case(*case) for case in progress()(named, "derivatives")]
    ends = Counter(end for end, _ in cases)
    known = [error for end, error in cases if end == "compared"]
    wrong = [seed for seed, (_, error) in zip(seeds, cases, strict=True) if error > WRONG]
    refused = [seed for seed, (end, _) in zip(seeds, cases, strict=True) if end == "refused"]
    report.rows += [
        number("derivatives: with a reference", len(known)),
        number("derivatives: refused of steps that conserve momentum", len(refused), 0, note=shown(refused)),
        number("derivatives: of steps that lose momentum, which have none", ends["momentum lost"]),
        number("derivatives: wrong", len(wrong), 0, note=shown(wrong)),
        number("derivatives: median error", float(np.median(known)) if known else 0.0),
        number("derivatives: largest error", max(known, default=0.0)),
    ]


def parameters(report: Report, seeds: range) -> None:
    """Derivatives of a step by parameters."""
    cases = [parameter_case(*case) for case in progress()([(f"step {seed}", (seed,)) for seed in seeds], "parameters")]
    found = [(seed, kind, *end) for seed, case in zip(seeds, cases, strict=True) for kind, end in case.items()]
    known = [error for *_, end, error in found if end == "compared"]
    wrong = [(seed, kind) for seed, kind, _, error in found if error > WRONG]
    report.rows += [
        number("parameters: kinds of steps with a reference", len(known)),
        number("parameters: refused", sum(end == "refused" for *_, end, _ in found)),
        number("parameters: wrong", len(wrong), 0, note=", ".join(f"seed {seed} {kind}" for seed, kind in wrong[:9])),
        number("parameters: median error", float(np.median(known)) if known else np.nan),
        number("parameters: largest error", max(known, default=0.0)),
    ]


def gradients(report: Report, seeds: range) -> None:
    """Of motions, against those of their steps."""
    named = [(f"gradient {seed}", (seed,)) for seed in seeds]
    cases = [gradient_case(*case) for case in progress()(named, "gradients")]
    known = [error for end, error in cases if end == "compared"]
    wrong = [seed for seed, (_, error) in zip(seeds, cases, strict=True) if error > WRONG]
    report.rows += [
        number("gradients: of motions of eight steps", len(known)),
        number("gradients: refused", sum(end == "refused" for end, _ in cases)),
        number(
            "gradients: not compared, a step has several solutions",
            sum(end == "several solutions" for end, _ in cases),
        ),
        number("gradients: wrong", len(wrong), 0, note=shown(wrong)),
        number("gradients: largest error", max(known, default=0.0)),
    ]


def file_case(seed: int) -> str:
    """Outcome of a mutated file: refused, the name of the status of a step, or of a failure."""
    rng = np.random.default_rng([seed, 4])
    urdf = seed % 2 == 0
    with TemporaryDirectory() as folder:
        path = Path(folder) / ("robot.urdf" if urdf else "robot.xml")
        path.write_text(mutated(URDF if urdf else MJCF, rng), encoding="utf-8")
        try:
            mech = dojo.load_urdf(path, repair=bool(rng.integers(2))) if urdf else dojo.load_mjcf(path, collisions=True)
        except ValueError as error:
            return "refused" if str(error).startswith(("load_urdf: robot.urdf", "load_mjcf")) else "unnamed error"
        except Exception as error:  # whatever it is, it is counted
            return f"exception {type(error).__name__}"
    try:
        sim = dojo.Simulator(mech, time_step=0.01)
        result = sim.step(sim.neutral())
    except Exception as error:
        return f"exception {type(error).__name__}"
    finite = np.isfinite(result.x).all() and np.isfinite(result.contacts.impulse).all()
    return str(result.status.name) if finite else "not finite"


def files(report: Report, seeds: range) -> None:
    """Mutated files of robots."""
    ends = Counter(file_case(*case) for case in progress()([(f"file {seed}", (seed,)) for seed in seeds], "files"))
    allowed = {"refused", *(status.name for status in dojo.Status)}
    wrong = {name: count for name, count in ends.items() if name not in allowed}
    report.rows += [
        number("files: tried", len(seeds)),
        number("files: wrong", sum(wrong.values()), 0, note=", ".join(wrong)),
        number("files: refused", ends["refused"]),
    ]
    report.tables.append(Table("Files", ("ended", "files"), [list(end) for end in ends.most_common()]))


SECTIONS = {  # with the numbers of cases, whole and quick
    "steps": (steps, 2000, 40),
    "motions": (motions, 10_000, 60),
    "crowds": (crowds, 4000, 40),
    "derivatives": (derivatives, 300, 10),
    "parameters": (parameters, 60, 2),
    "gradients": (gradients, 500, 10),
    "files": (files, 1000, 40),
}


def main(argv: list[str] | None = None) -> int:
    """Print or write the report; the exit status is 1 after any failure."""
    arguments = parser(__doc__)
    arguments.add_argument("--only", choices=tuple(SECTIONS), help="one section")
    arguments.add_argument("--first", type=int, default=0, help="first seed")
    arguments.add_argument("--count", type=int, help="cases of each section")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of strange inertias
        return deliver("attacks", attack, arguments, argv)


if __name__ == "__main__":
    sys.exit(main())
