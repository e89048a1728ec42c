"""Atlas is dropped on its feet at 20 to 500 Hz: how deep do they get into the ground?

python examples/atlas_drop.py        prints a table, writes atlas_drop.png

With MuJoCo installed, the same robot beside it, from the same numbers, at the same rates.
"""

from importlib.util import find_spec

import numpy as np
from _common import QUICK, finish
from matplotlib.figure import Figure

import dojo_opt as dojo
from benchmarks.engines import mujoco_scene

MUJOCO = find_spec("mujoco") is not None
HEIGHT, DURATION = 0.1, 0.8  # [m], [s]
RATES = (20, 100, 500) if QUICK else (20, 50, 100, 200, 500)
atlas = dojo.models.atlas(spring=2000.0, damper=80.0, crouch=0.0)  # springs hold it upright


def sunk_in_mujoco(sim: dojo.Simulator, start: np.ndarray) -> float:
    """Deepest penetration [m], infinite when MuJoCo gives up."""
    import mujoco

    model = mujoco_scene.load(sim.model, sim.time_step, integrator="implicitfast")
    data, deepest = mujoco_scene.state(model, start), 0.0
    for _ in range(round(DURATION / sim.time_step)):
        mujoco.mj_step(model, data)
        if data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number:
            return np.inf
        deepest = max([deepest, *(-contact.dist for contact in data.contact)])
    return deepest


ours, theirs = [], []
for rate in RATES:
    sim = dojo.Simulator(atlas, time_step=1.0 / rate, kappa=1e-8)
    start = sim.neutral()
    start[2] += HEIGHT
    t = sim.rollout(start, np.zeros((round(DURATION * rate), sim.nu)), throw=True)
    ours.append(max(0.0, -float(t.contacts.gap.min())))
    theirs.append(sunk_in_mujoco(sim, start) if MUJOCO else np.nan)
    beside = f"MuJoCo {1e3 * theirs[-1]:.2g} mm" if MUJOCO else "MuJoCo is not installed"
    print(f"{rate:4d} Hz: {1e3 * ours[-1]:.1e} mm, {beside}")
    assert ours[-1] < 1e-6, ours[-1]

figure = Figure(figsize=(7, 4.5), layout="constrained")
ax = figure.subplots()
ax.loglog(RATES, np.maximum(1e3 * np.array(ours), 1e-9), "o-", label="dojo-opt (1e-9 where there is none)")
if MUJOCO:
    ax.loglog(RATES, 1e3 * np.array(theirs), "s-", label="MuJoCo")
ax.set_xticks(RATES, [str(rate) for rate in RATES])
ax.minorticks_off()
ax.set_xlabel("steps per second")
ax.set_ylabel("deepest penetration [mm]")
ax.legend()
assert not np.any(np.array(theirs) < np.array(ours)), (ours, theirs)
finish(figure, __file__)
