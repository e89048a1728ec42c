"""Identify a real cube from films of its tosses: friction and corners, by least squares with parameter derivatives.

python examples/identify.py        prints friction and width, writes identify.png

Three poses in a row are one step: the first two give the state, the third is what the step should predict.
"""

from itertools import product
from pathlib import Path

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure
from scipy.optimize import least_squares

import dojo_opt as dojo

H, WIDTH, FRICTION = 1.0 / 148.0, 0.1048, 0.18  # [s], [m] and coefficient as ContactNets has them
GUESS = np.concatenate([[0.4], 1.5 * 0.5 * WIDTH * np.array(list(product((-1.0, 1.0), repeat=3))).ravel()])
names = [f"corner_{k}" for k in range(8)]
wrt = ("friction:*", *(f"contact_point:{name}" for name in names))
cube = dojo.Mechanism(
    [dojo.Body("cube", 0.37, (8.1e-4,) * 3)],
    [dojo.Joint("floating", None, "cube")],
    [dojo.Contact("cube", point, name=name) for name, point in zip(names, GUESS[1:].reshape(8, 3), strict=True)],
)
base = dojo.Simulator(cube, time_step=H, kappa=1e-6)

film = np.load(Path(__file__).parent / "data" / "tosses.npz")
tosses = np.split(film["poses"].astype(np.float64), np.cumsum(film["lengths"])[:-1])
rng = np.random.default_rng(0)
triplets = []
for toss in tosses[: 10 if QUICK else 40]:
    low = np.flatnonzero(toss[1:-1, 2] < 0.1) + 1  # where a corner may touch
    triplets += [toss[k - 1 : k + 2] for k in rng.choice(low, 10, replace=False)]


def state(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The state at the second pose: its velocity is the mean one since the first."""
    rest = np.zeros(6)
    return np.concatenate([second, base.difference(np.r_[second, rest], np.r_[first, rest])[:6] / H])


steps = [(state(a, b), c / np.r_[1, 1, 1, np.full(4, np.linalg.norm(c[3:]))]) for a, b, c in triplets]
arm = np.r_[np.ones(3), np.full(3, 0.5 * WIDTH)]  # rotations as the way of a face [m]


def errors(theta: np.ndarray) -> np.ndarray:
    """Predicted minus filmed third pose of every triplet [m]."""
    sim = base.with_parameters(dict(zip(wrt, np.split(theta, (1, *range(4, 25, 3))), strict=True)))
    return np.concatenate(
        [arm * sim.difference(sim.step(x, throw=True).x, np.r_[y, np.zeros(6)])[:6] for x, y in steps]
    )


def slopes(theta: np.ndarray) -> np.ndarray:
    """Derivatives of the errors, through the contact."""
    sim = base.with_parameters(dict(zip(wrt, np.split(theta, (1, *range(4, 25, 3))), strict=True)))
    return np.concatenate([arm[:, None] * np.hstack(list(sim.linearize(x, wrt=wrt).values()))[:6] for x, _ in steps])


history = [GUESS]
fit = least_squares(
    errors, GUESS, lambda theta: (history.append(theta), slopes(theta))[1], loss="soft_l1", f_scale=1e-3
)  # most of a film is right to a millimetre; some poses are not
