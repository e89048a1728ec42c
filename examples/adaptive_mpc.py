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
                rows.append((time, *mpc.estimator.values.values(), *mpc.estimator.deviations.values()))
            return u

        mpc.reset()
        loop = dojo.closed_loop(controller, plant, seconds)
        print(f"{'adaptive' if settings else 'fixed'} model: {loop.message}")
    time, mass, friction, mass_deviation, friction_deviation = np.array(rows).T
    print(f"after {time[-1]:.1f} s: payload {mass[-1] - TRUNK:.2f} kg of {PAYLOAD:g}, friction {friction[-1]:.3f}")
    assert loop.survived, loop.message
    assert abs(mass[-1] - TRUNK - PAYLOAD) < 0.02 * PAYLOAD, mass[-1]

    figure, axes = plt.subplots(2, 1, sharex=True, figsize=(7, 5), layout="constrained")
    for ax, value, deviation, true, label in (
        (axes[0], mass - TRUNK, mass_deviation, PAYLOAD, "payload [kg]"),
        (axes[1], friction, friction_deviation, FRICTION, "friction"),
    ):
        ax.fill_between(time, value - 2.0 * deviation, value + 2.0 * deviation, alpha=0.25, label="two deviations")
        ax.plot(time, value, label="estimate")
        ax.axhline(true, color="black", linestyle="--", label="true value")
        ax.set_ylim(0.0, 1.5 * max(true, 0.8))
        ax.set_ylabel(label)
    axes[0].legend(loc="lower right")
    axes[1].set_xlabel("time [s]")
    finish(figure, __file__)
    dojo.viewer.save_html(loop, "adaptive_mpc.html")


if __name__ == "__main__":
    main()
