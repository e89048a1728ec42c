"""A quadruped trots in closed loop, one planner iteration per 40 ms, pushed, loaded, on slippery and on sloping ground.

python examples/quadruped_mpc.py            writes quadruped_mpc.png, quadruped_mpc.html and quadruped_survival.png
python examples/quadruped_mpc.py --quick    a shorter run of one of them, and no study

The plant has a twentieth of the model's time step and hard contact, and the model knows of none of the disturbances.
A study draws all of them at once; its runs are spread over processes.
"""

from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
from _common import QUICK, finish

import dojo_opt as dojo

CASES = {
    "push of 8 N s": {"pushes": [dojo.Push(0.4, (0.0, 8.0, 0.0))]},
    "payload of 3 kg": {"payload": 3.0, "payload_inertia": 0.03},
    "half the friction": {"friction": 0.4},
    "slope of 5 degrees": {"slope": np.radians(5.0)},
}
PUSHES = {"velocity": 0.15, "push": (0.0, 8.0), "payload": (0.0, 3.0), "friction": (0.4, 0.8), "slope": (0.0, 0.087)}


def main():
    """Run the cases one by one, then all disturbances at once."""
    seconds, cases = (2.0, list(CASES)[:1]) if QUICK else (6.0, list(CASES))
    mpc = dojo.tasks.quadruped_mpc(speed=0.2)
    for case in cases:
        loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, **CASES[case]), seconds)
        ticks = np.array([tick.milliseconds for tick in loop.log if not tick.first])
        print(f"{case}: {loop.message} {loop.rms((0, 1, 2)):.3f} m off its path; tick {np.median(ticks):.1f} ms")
        assert loop.survived, loop.message
        assert loop.rms((0, 1, 2)) < 0.08, loop.by_coordinate()
        if case == cases[0]:
            finish(dojo.plots.closed_loop(loop), __file__)
            dojo.viewer.save_html(loop, "quadruped_mpc.html")
    if not QUICK:
        with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
            sampler = dojo.Disturbances(mpc.sim.nv, **PUSHES)
            study = mpc.monte_carlo(dojo.tasks.plant(mpc, 2e-3), sampler, 4.0, runs=20, executor=executor)
        print(study.summary())
        dojo.plots.study(study).savefig("quadruped_survival.png", dpi=150)
        assert study.survived >= 17, study.summary()


if __name__ == "__main__":  # worker processes import this file
    main()
