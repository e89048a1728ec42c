"""Identify a real cube from films of its tosses: friction, restitution, eight corners, inertia and centre of mass.

python examples/identify.py        prints them, writes identify.png and a report in identify/
"""

from itertools import product
from pathlib import Path

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo

H, FRICTION, SIDE = 1.0 / 148.0, 0.18, 0.1048  # [s]; friction and side [m] as those who filmed it state them
NOISE = np.repeat((2e-3, 0.03, 0.1, 2.0), 3)  # of films: [m, rad], and of velocities from differences [m/s, rad/s]
NAMES = ("friction:*", "restitution:*", "contact_point", "inertia:cube", "com:cube")
AHEAD = 40  # frames that are predicted


def cube(friction, restitution, side):
    """The cube on the ground."""
    body, free = dojo.Body("cube", 0.37, (8.1e-4,) * 3), dojo.Joint("floating", None, "cube")
    points = 0.5 * side * np.array(list(product((-1.0, 1.0), repeat=3)))
    corners = [dojo.Contact("cube", tuple(p), friction=friction, restitution=restitution) for p in points]
    return dojo.Simulator(dojo.Mechanism([body], [free], corners), time_step=H, kappa=1e-6)


def tosses(sim):
    """(states (T + 1, 13), no inputs) of every filmed toss that is long enough."""
    film, motions = np.load(Path(__file__).parent / "data" / "tosses.npz"), []
    for poses in np.split(film["poses"].astype(np.float64), np.cumsum(film["lengths"])[:-1]):
        turns = poses[:, 3:] / np.linalg.norm(poses[:, 3:], axis=1)[:, None]
        xs = np.hstack([poses[:, :3], turns, np.zeros((len(poses), 6))])
        xs[1:, 7:] = sim.difference(xs[1:], xs[:-1])[:, :6] / H
        motions.append((xs[1:], np.zeros((len(xs) - 2, 0))))
    return [toss for toss in motions if len(toss[1]) >= AHEAD]


guess = cube(0.4, 0.05, 0.8 * SIDE)  # friction twice too large, sides 20 % too short
seen, unseen = (motions := tosses(guess))[: 12 if QUICK else 20], motions[20:]
options = {"window": AHEAD // 2, "every": 4, "kappas": (1e-5, 1e-6), "verbose": True}
found = dojo.identify(guess, seen, NAMES, noise=NOISE, **options)
side = 2.0 * np.abs(found.values[2:26]).mean()
print(f"{found.closing_line()}\nfriction {found.values[0]:.3f} +- {found.deviation[0]:.3f}, side {1e3 * side:.1f} mm")
mean, axes = {}, (figure := Figure(figsize=(7.0, 4.5), layout="constrained")).subplots()
for name, sim in {"guess": guess, "published": cube(FRICTION, 0.125, SIDE), "identified": found.simulator}.items():
    ends = [sim.rollout(xs[0], us[:AHEAD], throw=True).x[-1, :3] - xs[AHEAD, :3] for xs, us in unseen]
    off = 1e3 * np.linalg.norm(ends, axis=1)
    mean[name] = float(off.mean())
    axes.plot(np.sort(off), np.linspace(0, 100, len(off)), label=f"{name}: mean {mean[name]:.1f} mm")
axes.set(xlabel=f"error of the position after {AHEAD} frames [mm]", ylabel="share of tosses not used [%]")
figure.legend(loc="outside upper center", ncols=3)
assert abs(found.values[0] / FRICTION - 1) < 0.15 and abs(side / SIDE - 1) < 0.05, (found.values[0], side)
assert mean["identified"] < min(mean["published"], 0.4 * mean["guess"]), mean
finish(figure, __file__)
dojo.identification_report(found, "identify")
