"""Quaternions of four digits are scaled to length one wherever a pose is given; others are refused."""

import numpy as np
import pytest

import dojo_opt as dojo

TYPED = (0.9239, 0.0, 0.3827, 0.0)  # 45 degrees about y, of length 1.00003
OFF = (0.93, 0.0, 0.39, 0.0)  # of length 1.0085
SIM = dojo.Simulator(dojo.models.sphere(), time_step=0.01)


def state(quaternion):
    return np.concatenate([[0.0, 0.0, 1.0], quaternion, np.zeros(6)])


def two(pose):
    return dojo.models.sphere().add(dojo.models.sphere(), pose=(2.0, 0.0, 0.0, *pose), prefix="b/").neutral[-4:]


def maximal(quaternion):
    return np.concatenate([[0.0, 0.0, 1.0], np.zeros(3), quaternion, np.zeros(3)])


GOAL = dojo.constraint.Goal
POSES = {
    "rollout": lambda q: SIM.rollout(state(q), steps=2).x[0, 3:7],
    "planner": lambda q: dojo.Problem(SIM, state(q), 2, cost=dojo.cost.Effort(1.0)).start[3:7],
    "goal": lambda q: (
        dojo.Problem(SIM, state((1, 0, 0, 0)), 2, constraints=[GOAL(state(q))]).constraints[0].reference[0, 3:7]
    ),
    "neutral": lambda q: dojo.Mechanism(
        [dojo.Body("b", 1.0, inertia=np.eye(3))], [dojo.Joint("floating", None, "b")], neutral={"b": (0, 0, 1, *q)}
    ).neutral[3:7],
    "joint": lambda q: dojo.Joint("revolute", None, "b", orientation=q).orientation,
    "shape": lambda q: dojo.Box(1.0, 1.0, 1.0, orientation=q).orientation,
    "scene": two,
    "minimal": lambda q: SIM.minimal(maximal(q)[None])[3:7],
}


@pytest.mark.parametrize("pose", POSES)
def test_four_digits_are_a_unit_quaternion(pose):
    found = np.asarray(POSES[pose](TYPED))
    np.testing.assert_allclose(found, np.array(TYPED) / np.linalg.norm(TYPED), rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("pose", POSES)
def test_another_length_is_refused(pose):
    with pytest.raises(ValueError, match="unit quaternion"):
        POSES[pose](OFF)
