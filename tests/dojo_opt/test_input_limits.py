"""Limits of inputs and joints that a file gives: defaults of problems and plants, and a ready constraint."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from support.urdf_files import arm


def limited() -> dojo.Simulator:
    """A pendulum; its input is limited to 1.5 N m and 2 rad/s."""
    mech = dojo.models.pendulum()
    return dojo.Simulator(replace(mech, inputs=[replace(mech.inputs[0], limits=(-1.5, 1.5), speed=2.0)]), 0.05)


def test_efforts_of_a_file_are_limits_of_its_inputs(tmp_path: Path) -> None:
    inside = '<axis xyz="0 1 0"/>', '<limit lower="-1" upper="1" effort="30" velocity="4"/>'
    part = dojo.load_urdf(arm(tmp_path, inside=inside), floating=False).inputs[0]
    assert (part.limits, part.speed) == ((-30.0, 30.0), 4.0)
    zero = inside[0], inside[1].replace("30", "0").replace('"4"', '"0"')  # files in the wild leave them out so
    mech = dojo.load_urdf(arm(tmp_path, inside=zero), floating=False)
    assert (mech.inputs[0].limits, mech.inputs[0].speed) == ((-np.inf, np.inf), np.inf)
    assert "joints without a largest effort, because the file gives zero or less: elbow" in str(mech.report)


def test_problems_and_plants_have_the_limits_of_the_inputs() -> None:
    sim = limited()
    problem = dojo.Problem(sim, sim.neutral(), 10, cost=dojo.cost.Effort(1.0))
    np.testing.assert_array_equal(problem.control_limits, [[-1.5], [1.5]])
    free = dojo.Problem(sim, sim.neutral(), 10, cost=dojo.cost.Effort(1.0), control_limits=(-np.inf, np.inf))
    np.testing.assert_array_equal(free.control_limits, [[-np.inf], [np.inf]])
    plain = dojo.Simulator(dojo.models.pendulum(), 0.05)
    assert dojo.Problem(plain, plain.neutral(), 10, cost=dojo.cost.Effort(1.0)).control_limits is None
    pushed = [dojo.closed_loop(lambda t, x, u=u: np.array([u]), dojo.Plant(sim), 0.1).x[-1] for u in (1.5, 9.0)]
    np.testing.assert_array_equal(pushed[0], pushed[1])
    strong = dojo.Plant(sim, control_limits=(-9.0, 9.0))
    assert dojo.closed_loop(lambda t, x: np.array([9.0]), strong, 0.1).x[-1, 0] > pushed[0][0]


def test_speed_limits_hold_in_a_plan() -> None:
    """A swing of 1 rad in 1 s would be faster than 1 rad/s in the middle without them."""
    sim = limited()
    goal = sim.neutral() + (1.0, 0.0)
    terms = {"cost": dojo.cost.Effort(0.1), "control_limits": (-50.0, 50.0)}
    plans = [
        dojo.ilqr(dojo.Problem(sim, sim.neutral(), 20, constraints=[dojo.constraint.Goal(goal), *more], **terms))
        for more in ([], [dojo.constraint.SpeedLimits(0.6)])
    ]
    fastest = [float(np.abs(plan.x[1:, 1]).max()) for plan in plans]
    assert all(plan.success for plan in plans)
    assert fastest[0] > 1.25 and fastest[1] < 1.2 + 1e-3  # .6 of 2 rad/s
    plain = dojo.Simulator(dojo.models.pendulum(), 0.05)
    with pytest.raises(ValueError, match=r"SpeedLimits\(\): no input of 'pendulum' has a largest speed"):
        dojo.Problem(plain, plain.neutral(), 20, cost=dojo.cost.Effort(1.0), constraints=dojo.constraint.SpeedLimits())


def test_the_slowest_input_of_a_joint_limits_its_speed() -> None:
    mech = dojo.models.pendulum()
    joint = mech.joint_names[0]
    inputs = [dojo.Input(joint, speed=speed, name=f"drive {speed:g}") for speed in (1.0, 5.0)]
    sim = dojo.Simulator(replace(mech, inputs=inputs), time_step=0.05)

    def problem(share: object) -> dojo.Problem:
        return dojo.Problem(sim, sim.neutral(), 3, constraints=dojo.constraint.SpeedLimits(share))  # type: ignore[arg-type]

    x = np.tile([*sim.neutral()[:1], 3.0], (4, 1))
    assert problem(0.5).violation(x, np.zeros((3, 2))) == pytest.approx(2.5)
    for share in (-1.0, 0.0, np.nan, "1"):
        with pytest.raises(ValueError, match=r"SpeedLimits\(share=...\)"):
            problem(share)
    for limits in ((np.inf, np.inf), (-np.inf, -np.inf)):
        with pytest.raises(ValueError, match=r"control_limits=...\): (lower|upper): expected a number"):
            dojo.Problem(sim, sim.neutral(), 3, control_limits=limits)
