"""Drop, push and slide an object that is known as a density alone, and fit its friction to the measured motion.

python examples/signed_distance.py        prints the motion and the fit, writes signed_distance.png
"""

import numpy as np
from _common import QUICK, finish
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from scipy.spatial.transform import Rotation

import dojo_opt as dojo

H, FRICTION, GUESS = 0.01, 0.25, 0.6  # [s]; friction and its guess
LEVEL, BOX = 10.0, [[-0.24, -0.18, -0.18], [0.24, 0.18, 0.18]]  # density on the surface; where it is sampled [m]


def density(points: np.ndarray) -> np.ndarray:
    """Three clouds that merge into a solid with hollows, of points (n, 3), as a radiance field has them."""
    clouds = [((-0.07, -0.02, 0.0), 0.045), ((0.07, -0.02, 0.0), 0.045), ((0.0, 0.04, 0.0), 0.05)]
    return sum(30.0 * np.exp(-0.5 * ((points - at) ** 2).sum(axis=1) / width**2) for at, width in clouds)


solid = dojo.SignedDistance.from_density(density, LEVEL, 0.03 if QUICK else 0.02, bounds=BOX).about_centroid()
bodies = [dojo.Body("object", 0.5, shape=solid), dojo.Body("finger", 0.2, shape=dojo.Sphere(0.03))]
joints = [dojo.Joint("floating", None, "object"), dojo.Joint("prismatic", None, "finger", axis=(1.0, 0.0, 0.0))]
floor = dojo.Collision("object", shape_b=dojo.HalfSpace(), friction=FRICTION, name="floor")
touch, servo = dojo.Collision("finger", "object", friction=0.2), dojo.Input("finger", servo="velocity", damping=20.0)
sim = dojo.Simulator(dojo.Mechanism(bodies, joints, inputs=[servo], collisions=[floor, touch]), time_step=H)
x, t, pushed = sim.neutral(), np.arange(90 if QUICK else 120), 40  # steps before the push
x[2], x[7] = 0.15, -0.3  # above the floor, the finger behind
speed = np.select([t < 40, t < 60], [0.0, 1.2], -0.5)[:, None]  # wait, push, draw back [m/s]
motion = sim.rollout(x, speed, throw=True)
noise = np.r_[[5e-4] * 3, [5e-3] * 3, 5e-4, [1e-2] * 3, [1e-1] * 3, 1e-2]  # of places [m], turns, speeds
errors = noise * np.random.default_rng(0).normal(size=(len(motion.x), sim.ndx))
seen = np.array([sim.integrate(*row) for row in zip(motion.x, errors, strict=True)])
start = sim.with_parameters({"friction:floor": GUESS})
fit = dojo.identify(start, [(seen[pushed:], motion.u[pushed:])], ["friction:floor"], noise=noise, window=10)
(found,), (deviation,) = fit.values, fit.deviation
print(f"rests at {1e3 * motion.x[pushed, 2]:.1f} mm, is pushed by {1e3 * np.ptp(motion.x[pushed:, 0]):.1f} mm")
print(f"friction {found:.3f} +- {deviation:.3f}, guess {GUESS}, truth {FRICTION}")
figure = Figure(figsize=(9.0, 4.0), layout="constrained")
side, path = figure.subplots(1, 2, width_ratios=(3, 2))
vertices, faces = solid.level_set.surface
for k, place in ((0, -0.55), (pushed, -0.18), (len(t), 0.19)):
    world = Rotation.from_quat(motion.x[k, [4, 5, 6, 3]]).apply(vertices) + motion.x[k, :3]
    front = faces[np.argsort(-world[faces].mean(axis=1)[:, 1])]  # seen along y, the farthest first
    light = np.clip(0.4 + 3.0 * (world[front].mean(axis=1)[:, 2] - world[:, 2].mean()), 0.1, 0.9)
    view = world[front][:, :, [0, 2]] + (place, 0.0)
    side.add_collection(PolyCollection(view, facecolors=np.outer(light, (0.6, 0.8, 1.0))))
    side.text(place, 0.26, f"{k * H:.1f} s", ha="center")
side.set(xlim=(-0.75, 0.45), ylim=(0.0, 0.3), aspect="equal", xlabel="x, moments side by side [m]", ylabel="z [m]")
for label, simulator in (("truth", sim), (f"fit, friction {found:.3f}", fit.simulator), (f"guess, {GUESS}", start)):
    x = simulator.rollout(motion.x[pushed], speed[pushed:], throw=True).x
    path.plot(H * np.arange(pushed, len(seen)), 1e3 * x[:, 0], label=label)
path.plot(H * np.arange(pushed, len(seen)), 1e3 * seen[pushed:, 0], "k.", markersize=2, label="seen")
path.set(xlabel="time [s]", ylabel="x of the object [mm]")
figure.legend(loc="outside upper center", ncols=4)
assert fit.success and abs(found - FRICTION) < max(4.0 * deviation, 0.01), (found, deviation)
finish(figure, __file__)
