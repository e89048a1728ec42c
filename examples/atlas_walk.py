"""Atlas, 174 kg, walks where it is told to, and is pushed: its steps have a cadence, and no footholds.

python examples/atlas_walk.py            writes atlas_walk.png, with the forces of its feet, and atlas_walk.html
python examples/atlas_walk.py --quick    a shorter run, before the push

One standing pose moves on ahead of the robot and bends its legs in turn. Plans of 20 knots find where the feet go,
on a model with smooth contact; their gains act on a plant with hard contact, at a fortieth of the time step.
"""

import numpy as np
from _common import QUICK, finish

import dojo_opt as dojo

SPEED = 0.4  # [m/s]
mpc = dojo.tasks.humanoid_mpc((SPEED, 0.0, 0.0))
push = dojo.Push(3.0, (0.0, 30.0, 0.0), body="utorso")  # 30 N s from the right, within 20 ms
loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, pushes=[push]), 0.5 if QUICK else 8.0)
ticks = np.array([tick.cpu_milliseconds for tick in loop.log if not tick.first])
print(f"{loop.message} {loop.x[-1, 0] - loop.x[0, 0]:.2f} m on; tick {np.median(ticks):.1f} ms")
finish(dojo.plots.gait(loop), __file__)
assert loop.survived, loop.message

if not QUICK:
    half = len(loop.x) // 2
    speed = (loop.x[-1, 0] - loop.x[half, 0]) / 4.0
    print(f"{speed:.2f} m/s over the last 4 s")
    dojo.viewer.save_html(loop, "atlas_walk.html")
    assert abs(speed - SPEED) < 0.1, speed
