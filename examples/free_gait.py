"""A quadruped walks at .3 m/s with no gait given: nothing tells it which foot to lift, or when.

python examples/free_gait.py            writes free_gait.png, with the gait that appeared, and free_gait.html
python examples/free_gait.py --quick    a shorter run, before the first steps

One standing pose moves on ahead of the robot. Plans at a smoothing of a centimetre find that a foot may leave the
ground, and servos follow them on a plant with hard contact.
"""

import numpy as np
from _common import QUICK, finish

import dojo_opt as dojo

mpc = dojo.tasks.free_gait_mpc((0.3, 0.0, 0.0))
loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc), 0.4 if QUICK else 8.0)
ticks = np.array([tick.cpu_milliseconds for tick in loop.log if not tick.first])
print(f"{loop.message} {loop.x[-1, 0]:.2f} m on; tick {np.median(ticks):.1f} ms of 25 ms")
finish(dojo.plots.gait(loop), __file__)
assert loop.survived, loop.message

if not QUICK:
    half = len(loop.x) // 2
    speed = (loop.x[-1, 0] - loop.x[half, 0]) / 4.0
    print(f"{speed:.2f} m/s over the last 4 s")
    dojo.viewer.save_html(loop, "free_gait.html")
    assert abs(speed - 0.3) < 0.1, speed
