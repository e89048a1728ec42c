"""Hints: messages that say what to do instead."""

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism import checks
from sim.mechanism.mechanism import _OF_SIMULATORS
from support.refusals import check_refused

PENDULUM = dojo.Simulator(dojo.models.pendulum(), time_step=0.05)
MANY = [*(f"base_{k}" for k in range(600)), "FR_foot", "FL_foot"]
FINGERS = ["panda_joint1", "panda_finger_joint1", "panda_finger_joint2"]

MESSAGES = {
    "no number of steps": (lambda: PENDULUM.rollout(PENDULUM.neutral()),
                           "rollout(steps=...): expected a whole number", "give us=..., steps=...", "duration=..."),
    "joint of MJCF": (lambda: dojo.Joint("hinge", None, "leg"), "'hinge' is not one of: fixed", "mean 'revolute'?"),
    "joint of URDF": (lambda: dojo.Joint("continuous", None, "leg"), "mean 'revolute'?"),
    "joint that is mistyped": (lambda: dojo.Joint("prismatik", None, "leg"), "mean 'prismatic'?"),
    "part of a name": (lambda: checks.one_of("call", "finger1", FINGERS), "mean 'panda_finger_joint1'?"),
    "one of many names": (lambda: checks.one_of("call", "FR_fot", MANY),
                          "'FR_fot' is not one of: FR_foot, FL_foot, ... (602 in all); did you mean 'FR_foot'?"),
    "one of many, like none": (lambda: checks.one_of("call", "qqqq", MANY), "one of: base_0, base_1,", "(602 in all)"),
    "mass of another body": (lambda: PENDULUM.with_parameters({"mass:link0": 1.0}),
                             "no parameter 'mass:link0'", "did you mean 'mass:"),
    "one pair": (lambda: dojo.identify(PENDULUM, (np.zeros((3, 2)), np.zeros((2, 1))), ["mass"]),
                 "identify(trajectories)", "give a list: [(states, inputs)]"),
    "one array": (lambda: dojo.identify(PENDULUM, [np.zeros((3000, 2))], ["mass"]), "got array(", "..."),
}  # fmt: skip


@pytest.mark.parametrize("case", MESSAGES)
def test_a_message_says_what_to_do(case):
    check_refused(*MESSAGES[case])


def test_a_mechanism_tells_that_simulators_step():
    with pytest.raises(AttributeError, match=r"no attribute 'rollout'; a simulator has: dojo.Simulator\(mechanism"):
        PENDULUM.mechanism.rollout  # noqa: B018
    with pytest.raises(AttributeError, match="no attribute 'roll'$"):
        PENDULUM.mechanism.roll  # noqa: B018
    assert not [name for name in _OF_SIMULATORS if not hasattr(PENDULUM, name) or hasattr(dojo.Mechanism, name)]


def test_parameters_are_printed_by_kind():
    sim = dojo.Simulator(dojo.models.quadruped(), time_step=0.01)
    lines = str(sim.parameters()).splitlines()
    assert lines[0].startswith(f"{len(sim.parameters().names)} parameters")
    assert lines[1].split()[:3] == ["mass", "13", "mass:trunk,"] and lines[1].endswith("... (13 parts)")
    assert "  friction            4  friction:FR_foot, friction:FL_foot, friction:RR_foot, friction:RL_foot" in lines
    assert sum(int(line.split()[1]) for line in lines[1:]) == len(sim.parameters().names)


@pytest.mark.parametrize("constraint", [False, True])
def test_a_residual_that_is_no_number_is_named(constraint):
    def logarithm(x, u, out):
        out[0] = np.nan if x[0] < 9.0 else 0.0

    bad = dojo.constraint.ResidualConstraint if constraint else dojo.cost.ResidualCost
    term = bad(logarithm, 1) if constraint else bad(logarithm, 1, weight=1.0)
    costs = [dojo.cost.Effort(1.0), *(() if constraint else (term,))]
    problem = dojo.Problem(PENDULUM, [0.0, 0.0], 3, cost=costs, constraints=[term] if constraint else ())
    message = dojo.ilqr(problem).message
    place = "constraint 0, ResidualConstraint" if constraint else "cost 1, ResidualCost"
    assert message.startswith("A number is not finite. In the derivatives of the costs, at knot 0."), message
    assert f"It is {place} of 'logarithm'." in message


def test_a_push_beyond_the_reach_names_the_goal():
    arm, box = dojo.models.panda(gripper=False), dojo.Body("box", 0.5, shape=dojo.Box(0.1, 0.1, 0.1))
    words = "problems.push(goal, at=...): the hand cannot", "Give a nearer goal"
    check_refused(lambda: dojo.problems.push(arm, box, (2.0, 0.0)), *words)
