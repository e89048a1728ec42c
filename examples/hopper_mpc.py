"""A Raibert hopper hops along in closed loop, one planner iteration per 50 ms, under three disturbances.

python examples/hopper_mpc.py            writes hopper_mpc.png and hopper_mpc.html
python examples/hopper_mpc.py --quick    a shorter run of one of them

The model plans with steps of 10 ms, the plant runs at 1 kHz with hard contact, and the model knows of none of this: a
push, half the mass as payload, ground with half the friction.
"""

import numpy as np
from _common import QUICK, finish

import dojo_opt as dojo

CASES = {
    "push of 4 N s": {"pushes": [dojo.Push(0.5, (0.0, 4.0, 0.0))]},
    "payload of 50 %": {"payload": 2.35},
    "half the friction": {"friction": 0.25},
}
seconds, cases = (1.2, list(CASES)[:1]) if QUICK else (4.0, list(CASES))

mpc = dojo.tasks.hopper_mpc(velocity=(0.2, 0.0), height=0.25)
loops = {}
for case in cases:
    loops[case] = loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, **CASES[case]), seconds)
    ticks = np.array([tick.milliseconds for tick in loop.log if not tick.first])
    foot = mpc.sim.maximal(loop.x)[:, 1, 2] - 0.05
    print(
        f"{case}: {loop.message} {loop.rms((0, 1, 2)):.3f} m off its path, the foot rises to {foot.max():.2f} m; "
        f"tick {np.median(ticks):.1f} ms, {sum(tick.fallback for tick in loop.log)} fell back"
    )
    assert loop.survived, loop.message
    print("    rms: " + ", ".join(f"{name} {value:.3f}" for name, value in loop.by_coordinate().items()))
    assert loop.rms((0, 1, 2)) < 0.08, loop.by_coordinate()
    assert foot.max() > 0.08, "it does not hop"

finish(dojo.plots.closed_loop(loops[cases[0]]), __file__)
dojo.viewer.save_html(loops[cases[0]], "hopper_mpc.html")
