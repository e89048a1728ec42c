"""Identify a real cube from films of its tosses: friction, restitution and eight corners, by least squares.

python examples/identify.py        prints them, writes identify.png
"""

from itertools import product
from pathlib import Path

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure
from scipy.optimize import least_squares

import dojo_opt as dojo

H, STEPS, FRICTION, SIDE = 1.0 / 148.0, 8, 0.18, 0.1048  # [s]; friction and side [m] as those who filmed it state them
WRT = ("friction:*", "restitution:*", "contact_point")  # one number each for all corners, and where they are
SIGNS = np.array(list(product((-1.0, 1.0), repeat=3)))
published = np.r_[FRICTION, 0.125, SIDE / 2 * SIGNS.ravel()]
guess = np.r_[0.4, 0.05, 0.4 * SIDE * SIGNS.ravel()]  # friction twice too large, sides 20 % too short
cube, free = dojo.Body("cube", 0.37, (8.1e-4,) * 3), dojo.Joint("floating", None, "cube")
contacts = [dojo.Contact("cube", point) for point in guess[2:].reshape(8, 3)]
base = dojo.Simulator(dojo.Mechanism([cube], [free], contacts), time_step=H)
film, windows = np.load(Path(__file__).parent / "data" / "tosses.npz"), []  # per toss, states and those STEPS later
for toss in np.split(film["poses"].astype(np.float64), np.cumsum(film["lengths"])[:-1]):
    xs = np.hstack([toss[:, :3], toss[:, 3:] / np.linalg.norm(toss[:, 3:], axis=1)[:, None], np.zeros((len(toss), 6))])
    xs[1:, 7:] = base.difference(xs[1:], xs[:-1])[:, :6] / H
    moving = [k for k in range(2, len(xs) - STEPS, 6) if np.linalg.norm(xs[k, 7:10]) > 0.15]
    windows.append([(xs[k], xs[k + STEPS]) for k in moving if xs[k : k + STEPS, 2].min() < 0.1])  # it may touch
seen, unseen = (sum(some, []) for some in (windows[: 12 if QUICK else 20], windows[20:]))


def errors(theta: np.ndarray, kappa: float, pairs: list, slopes: bool = False) -> np.ndarray:
    """Predicted minus filmed pose [m], rotations as the way of a face; or the derivatives of that."""
    sim = base.with_parameters(dict(zip(WRT, np.split(theta, (1, 2)), strict=True))).replace(kappa=kappa)
    arm, out = np.repeat((1.0, SIDE / 2), 3), []
    for start, end in pairs:
        x, J = sim.rollout(start, np.zeros((STEPS, 0)), throw=True).x, np.zeros((sim.ndx, len(theta)))
        for x_t in x[:-1] if slopes else ():
            A, *by_parameters = sim.linearize(x_t, wrt=("state", *WRT)).values()
            J = A @ J + np.hstack(by_parameters)
        out.append(arm[:, None] * J[:6] if slopes else arm * sim.difference(x[-1], end)[:6])
    return np.concatenate(out)


low, high, unit = (np.r_[a, b, np.full(24, c)] for a, b, c in ((0, 0, -0.08), (1, 0.9, 0.08), (0.1, 0.1, 0.01)))
theta, how = guess, {"bounds": (low, high), "x_scale": unit, "loss": "soft_l1", "f_scale": 1e-3, "max_nfev": 40}
for kappa in (1e-5, 1e-6):  # a soft contact is felt from afar; then a hard one
    theta = least_squares(errors, theta, lambda *given: errors(*given, slopes=True), args=(kappa, seen), **how).x
miss, axes = {}, (figure := Figure(figsize=(7.0, 4.5), layout="constrained")).subplots()
for name, p in {"guess": guess, "published": published, "identified": theta}.items():
    miss[name] = 1e3 * np.linalg.norm(errors(p, 1e-6, unseen).reshape(-1, 6)[:, :3], axis=1)
    text = f"{name}: friction {p[0]:.3f}, restitution {p[1]:.3f}, side {2e3 * np.abs(p[2:]).mean():.1f} mm"
    axes.plot(np.sort(miss[name]), np.linspace(0, 100, len(unseen)), label=text)
    print(f"{text}; median error on tosses not used {np.median(miss[name]):.2f} mm")
axes.set(xlabel=f"error of the position {STEPS} frames later [mm]", ylabel="share of tosses not used [%]", xlim=(0, 14))
figure.legend(loc="outside upper center")
assert abs(theta[0] / FRICTION - 1) < 0.15 and abs(2 * np.abs(theta[2:]).mean() / SIDE - 1) < 0.05, theta
assert np.median(miss["identified"]) < min(0.75 * np.median(miss["published"]), 0.2 * np.median(miss["guess"]))
finish(figure, __file__)
