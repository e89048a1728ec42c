"""A quadruped walks with twice its own weight on its back: MPC that estimates the payload and the friction as it goes.

python examples/adaptive_mpc.py            writes adaptive_mpc.png and adaptive_mpc.html
python examples/adaptive_mpc.py --quick    a shorter run

The model knows of no payload. With a fixed model the robot sinks down and falls within a second.
"""

import matplotlib.pyplot as plt
import numpy as np
from _common import QUICK, finish

import dojo_opt as dojo

PAYLOAD, FRICTION, TRUNK = 24.0, 0.3, 6.0  # [kg], of the ground, [kg] of the trunk that the model knows


def main():
    """Run both controllers on the same plant."""
    seconds = 1.5 if QUICK else 6.0
    adapt = dojo.Adaptation(("mass:trunk", "friction:*"))
    for settings in ({}, {"adapt": adapt}):
        mpc = dojo.tasks.quadruped_mpc(speed=0.2, **settings)
        plant = dojo.tasks.plant(mpc, 2e-3, payload=PAYLOAD, friction=FRICTION)
        rows = []

        def controller(time, x, mpc=mpc, rows=rows):
            u = mpc(time, x)
            if mpc.estimator is not None:
                rows.append((time, *mpc.estimator.values.values(), *sum(mpc.estimator.bounds.values(), ())))
            return u

        mpc.reset()
        loop = dojo.closed_loop(controller, plant, seconds)
        print(f"{'adaptive' if settings else 'fixed'} model: {loop.message}")
    time, mass, friction, *bounds = np.array(rows).T
    print(f"after {time[-1]:.1f} s: payload {mass[-1] - TRUNK:.2f} kg of {PAYLOAD:g}, friction {friction[-1]:.3f}")
    assert loop.survived, loop.message
    assert abs(mass[-1] - TRUNK - PAYLOAD) < 0.02 * PAYLOAD, mass[-1]

    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 5), layout="constrained")
    for ax, value, (low, high), shift, true, label in (
        (axes[0], mass, bounds[:2], TRUNK, PAYLOAD, "payload [kg]"),
        (axes[1], friction, bounds[2:], 0.0, FRICTION, "friction"),
    ):
        top = 1.5 * max(true, 0.8)
        ax.fill_between(time, low - shift, np.minimum(high - shift, top), alpha=0.25, label="bounds")
        ax.plot(time, value - shift, label="estimate")
        ax.axhline(true, color="black", linestyle="--", label="true value")
        ax.set_ylim(0.0, top)
        ax.set_ylabel(label)
    axes[0].legend(loc="lower right")
    axes[1].set_xlabel("time [s]")
    finish(figure, __file__)
    dojo.viewer.save_html(loop, "adaptive_mpc.html")


if __name__ == "__main__":
    main()
