"""Learning and identification refuse wrong arguments by name, before any work."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.learn.network import Network
from dojo_opt.learn.policy import LearnedPolicy
from dojo_opt.learn.training_result import Learned
from solvers.status import Status
from support.refusals import check_refused

NAN = np.nan
SIM = dojo.Simulator(dojo.models.pendulum(), time_step=0.05)
ONE = np.ones(1)


@cache
def motion():
    """A trajectory at rest."""
    return SIM.rollout(SIM.neutral(), steps=3)


def observation(x, out):
    out[0], out[1] = x[0], x[1]


def reward(x, a, after):
    return -(after[0] ** 2)


def never(x):
    return False


def start(rng):
    return np.zeros(2)


TASK = dojo.learn.Task(SIM, 1, observation, 2, reward, -ONE, ONE, start, never, steps=5)
POLICY = LearnedPolicy(Network((2, 1)), np.zeros(3), np.zeros(2), np.ones(2), TASK)
PLAN = (np.zeros((3, 2)), np.zeros((2, 1)), np.zeros((2, 1, 2)))

LEARNING = {
    "shac": (
        *[("hidden", bad) for bad in (3, (0,), (1.5,), "ab")],
        *[("betas", bad) for bad in (3, (2, 2), (1.0, 1.0))],
        *[("deviation", bad) for bad in (None, (NAN, 1), (-1, -1))],
        *[("time_limit", bad) for bad in (None, NAN, -1)],
        *[
            ("epochs", 0),
            ("callback", 3),
            ("stream", 3),
            ("kappa_grad", 0),
            ("evaluations", -1),
            ("randomization", None),
        ],
        *[("resume", 3), ("rate", 0), ("horizon", "x"), ("activation", "relu")],
    ),
    "ars": (
        *[("rate", bad) for bad in (0, NAN, "x")],
        *[("noise", bad) for bad in (NAN, -1, "x")],
        *[("horizon", bad) for bad in (0, -3, 1.5)],
        *[("shift", "x"), ("shift", NAN), ("evaluations", -1), ("hidden", 3), ("randomization", 3), ("callback", 3)],
    ),
    "gradient_search": (("rate", "x"), ("horizon", 0), ("horizon", 1.5), ("kappa_grad", -1), ("hidden", 3)),
}
# fmt: off
CALLS = {
    **{f"{name} {key} {bad}": (lambda name=name, key=key, bad=bad: getattr(dojo.learn, name)(TASK, **{key: bad}),
                               f"{name}({key}=...)")
       for name, cases in LEARNING.items() for key, bad in cases},
    **{f"identify {key} {bad}": (lambda key=key, bad=bad: dojo.identify(SIM, [motion()], ["mass"], **{key: bad}), key)
       for key, bad in (("bounds", 3), ("prior", 3), ("noise", [1, 2, 3, 4]), ("noise", None), ("kappas", 3.5 + 1j),
                        ("bounds", {"mass": 1}), ("bodies", 3), ("fits", 0), ("window", 0))},
    "no motions": (lambda: dojo.identify(SIM, None, ["mass"]), "identify(trajectories)", "None"),
    "one motion": (lambda: dojo.identify(SIM, motion(), ["mass"]), "identify(trajectories)", "list"),
    "no names": (lambda: dojo.identify(SIM, [motion()], None), "identify(parameters)", "None"),
    "space of nothing": (lambda: dojo.ParameterSpace(None, ["mass"]), "ParameterSpace(sim)"),
    "space of a number": (lambda: dojo.ParameterSpace(SIM, 3), "ParameterSpace(names)", "3"),
    "plans of nothing": (lambda: dojo.learn.imitate(TASK, None), "imitate(plans)", "None"),
    "spread below zero": (lambda: dojo.learn.imitate(TASK, [PLAN], spread=-1), "imitate(spread=...)"),
    "values of a number": (lambda: dojo.learn.Randomization(values=3), "Randomization(values=...)"),
    "range of a number": (lambda: dojo.learn.Randomization(factors={"mass": 3}), "Randomization(factors=...)", "mass"),
    "substeps of a number": (lambda: dojo.learn.Randomization(substeps=3), "Randomization(substeps=...)"),
    "delays of a number": (lambda: dojo.learn.Randomization(delays=3), "Randomization(delays=...)"),
    "kappa of a number": (lambda: dojo.learn.Randomization(kappa=3), "Randomization(kappa=...)"),
    "pushes of a number": (lambda: dojo.learn.Randomization(pushes=3), "Randomization(pushes=...)"),
    "evaluation of nothing": (lambda: dojo.learn.evaluate(None), "evaluate(policy)"),
    "seeds of a number": (lambda: dojo.learn.seeds(dojo.learn.shac, TASK, 3), "seeds(numbers)"),
    "weights that are too few": (lambda: LearnedPolicy(Network((2, 1)), np.zeros(2), np.zeros(2), np.ones(2)),
                                 "LearnedPolicy(weights=...)", "(3,)", "(2,)"),
    "policy of another task": (lambda: LearnedPolicy(Network((3, 1)), np.zeros(4), np.zeros(3), np.ones(3), TASK),
                               "LearnedPolicy(task=...)", "3"),
    "network without outputs": (lambda: Network((2,)), "Network(sizes)"),
    "half a layer": (lambda: Network((2, 1.5)), "Network(sizes)"),
    "policy as a controller": (lambda: dojo.closed_loop(POLICY, dojo.Plant(SIM), 1.0), "closed_loop(controller)", "policy.controller"),
    "command of a number": (lambda: POLICY.commanded(3)(0.0, np.zeros(2)), "commanded(command)"),
}
# fmt: on


def half(x, out):
    out[0] = x[0]


def too_wide(x, out):
    out[2] = x[0]


def returned(x, out):
    return x


def writes(x, out):
    x[0] = 1.0


FUNCTIONS = {
    "observation of less": ("observation", half, "'half' does not write out[1]", "2 entries"),
    "observation of more": ("observation", too_wide, "'too_wide': IndexError", "out (2,)"),
    "observation that is returned": ("observation", returned, "'returned' does not write out[0]"),
    "observation of a state alone": ("observation", lambda x: x, "TypeError", "x (2,), out (2,)"),
    "observation that writes": ("observation", writes, "'writes' writes into x"),
    "reward of two": ("reward", lambda x, a: 0.0, "TypeError", "x (2,), a (1,), after (2,)"),
    "reward of an array": ("reward", lambda x, a, after: -(after**2), "array of shape (2,)", "one number"),
    "reward of one entry": ("reward", lambda x, a, after: -(a**2), "array of shape (1,)", "one number"),
    "reward of nothing": ("reward", lambda x, a, after: None, "returns None", "one number"),
    "end of each": ("terminated", lambda x: x > 1.0, "array of shape (2,)", "True or False"),
    "end of two": ("terminated", lambda x, a: True, "TypeError", "x (2,)"),
    "survival of an array": ("survival_probability", lambda x: 0.0 * x, "array of shape (2,)", "one number"),
}


@pytest.mark.parametrize("case", FUNCTIONS)
def test_a_function_of_a_task_is_refused_by_name(case):
    name, function, *words = FUNCTIONS[case]
    check_refused(lambda: replace(TASK, **{name: function}), f"Task({name}=...)", *words)


@pytest.mark.slow
def test_what_cannot_be_compiled_names_the_argument():
    task = replace(TASK, reward=lambda x, a, after: float(str(after[0])[:3]))
    check_refused(
        lambda: task.rewards(np.zeros((1, 2)), np.zeros((1, 1)), np.zeros((1, 2))), "Task(reward=...)", "Numba"
    )


@pytest.mark.parametrize("case", CALLS)
def test_it_is_refused_by_name(case):
    check_refused(*CALLS[case])


def test_a_run_is_resumed_from_its_own_state_only():
    end = (POLICY, False, Status.STOPPED, "", "ars", 0, 1.0, 1, 0, 0, 1.0)
    with pytest.raises(ValueError, match=r"ars\(resume=\.\.\.\): its 'epoch' is missing"):
        dojo.learn.ars(TASK, resume=Learned(*end, state={"weights": np.zeros(3)}))


def test_a_run_that_is_resumed_for_fewer_epochs_has_done_them():
    options = {"directions": 2, "best": 1, "episodes": 1}
    longer = dojo.learn.ars(TASK, epochs=3, **options)
    again = dojo.learn.ars(TASK, epochs=2, **options, resume=longer)
    assert again.success and again.status == Status.SOLVED and again.message == longer.message
    assert len(again.history) == 3 and np.array_equal(again.policy.weights, longer.policy.weights)


def test_advice_is_that_of_the_algorithm():
    """An imitation of pushes has a smaller return than no action, which the policy begins with."""
    still = replace(TASK, reward=lambda x, a, after: -(a[0] ** 2))
    pushes = np.zeros((6, 2)), np.full((5, 1), 0.9), np.zeros((5, 1, 2))
    options = {"epochs": 3, "hidden": (), "rate": 0.3, "evaluations": 1, "episodes": 1}
    learned = dojo.learn.imitate(still, [pushes], **options)
    assert learned.success and "does not follow the plans" in learned.message and "limits" not in learned.message


SLIDER = dojo.Simulator(dojo.models.slider(), time_step=0.05)  # states and inputs of the same size
QUICK, OTHERS = {"directions": 2, "best": 1, "episodes": 1}, "got one with"


def _problem(sim=SIM):
    return dojo.Problem(sim, sim.neutral(), 4, cost=[dojo.cost.Tracking(sim.neutral(), 1.0), dojo.cost.Effort(0.1)])


def _trained(**changes):
    return dojo.learn.ars(replace(TASK, **changes), epochs=1, **QUICK)


SWAPPED = {
    "simulator of higher order": (
        lambda: dojo.identify(SIM.replace(order=4), [SIM.rollout(np.zeros(2), steps=3)], ["mass"]),
        r"identify\(sim\): expected steps of order 2.*got order 4; use sim.replace\(order=2\)",
    ),
    "simulator with an accuracy": (
        lambda: dojo.identify(SIM.replace(accuracy=1e-3), [SIM.rollout(np.zeros(2), steps=3)], ["mass"]),
        r"got an accuracy; use sim.replace\(accuracy=None\)",
    ),
    "prior of three numbers": (
        lambda: dojo.identify(SIM, [SIM.rollout(np.zeros(2), steps=3)], ["mass"], prior={"mass": (1.0, 0.1, 0.2)}),
        r"identify\(prior=...\): 'mass': expected a deviation, or \(mean, deviation\)",
    ),
    "plan to begin with": (lambda: dojo.MPC(_problem(), plan=dojo.ilqr(_problem(SLIDER))), "got one of 'slider'"),
    "plan with other knots": (
        lambda: dojo.MPC(_problem(), plan=dojo.ilqr(_problem(SIM.replace(time_step=0.1)))),
        "expected knots of 0.05 s, as those of the problem, got 0.1 s",
    ),
    "plan with other velocities": (
        lambda: dojo.MPC(_problem(), plan=dojo.ilqr(_problem(SIM.replace(order=4)))),
        "expected velocities that are means over the step before",
    ),
    "plan to imitate": (lambda: dojo.learn.imitate(TASK, [dojo.ilqr(_problem(SLIDER))]), "got one of 'slider'"),
    "warm start": (lambda: dojo.ilqr(_problem(), warm_start=dojo.ilqr(_problem(SLIDER))), "got one of 'slider'"),
    "reference": (lambda: dojo.MPC(_problem(), reference=SLIDER.rollout(np.zeros(2), steps=4)), "got one of 'slider'"),
    "plant": (lambda: dojo.closed_loop(dojo.MPC(_problem()), dojo.Plant(SLIDER), 0.1), OTHERS),
    "plant of a policy": (lambda: dojo.closed_loop(POLICY.controller, dojo.Plant(SLIDER), 0.1), OTHERS),
    "policy to begin with": (
        lambda: dojo.learn.shac(TASK, start=replace(POLICY, task=replace(TASK, sim=SLIDER)), epochs=1),
        OTHERS,
    ),
    "run to resume": (lambda: dojo.learn.ars(TASK, epochs=2, **QUICK, resume=_trained(sim=SLIDER)), OTHERS),
    "run with other velocities": (
        lambda: dojo.learn.ars(TASK, epochs=2, **QUICK, resume=_trained(sim=SIM.replace(order=4))),
        "expected velocities over time steps, got those at the nodes",
    ),
    "run with other control steps": (
        lambda: dojo.learn.ars(TASK, epochs=2, **QUICK, resume=_trained(substeps=2)),
        "expected control steps of 0.05 s, got 0.1 s",
    ),
}


@pytest.mark.parametrize("case", SWAPPED)
def test_objects_of_another_robot_or_time_are_refused(case):
    call, message = SWAPPED[case]
    with pytest.raises(ValueError, match=message):
        call()


def test_files_of_policies_know_their_robot(tmp_path):
    other = replace(TASK, sim=SLIDER)
    POLICY.save(tmp_path / "policy.npz")
    assert LearnedPolicy.load(tmp_path / "policy.npz", TASK).task is TASK
    with pytest.raises(ValueError, match="LearnedPolicy.load.task=.*expected a robot with the coordinates"):
        LearnedPolicy.load(tmp_path / "policy.npz", other)
    _trained().save(tmp_path / "run.npz")
    assert Learned.load(tmp_path / "run.npz", TASK).policy.task is TASK
    with pytest.raises(ValueError, match=OTHERS):
        Learned.load(tmp_path / "run.npz", other)
    with pytest.raises(ValueError, match=OTHERS):
        dojo.learn.ars(other, epochs=2, **QUICK, resume=Learned.load(tmp_path / "run.npz"))
    replace(POLICY, task=None).save(tmp_path / "bare.npz")  # as all files before
    assert LearnedPolicy.load(tmp_path / "bare.npz", other).task is other


def test_a_policy_acts_as_often_as_its_task_unless_told_otherwise():
    plant, calls = dojo.Plant(SIM.replace(time_step=0.01)), []
    policy = replace(POLICY, weights=np.array([1.0, 0.2, 0.3]))
    for given in (None, 0.05, 0.01):
        calls.append(dojo.closed_loop(policy.controller, plant, 0.2, control_step=given).u)
    np.testing.assert_array_equal(calls[0], calls[1])
    assert np.unique(calls[0]).size == 4 and np.unique(calls[2]).size == 20
    with pytest.raises(
        ValueError, match=r"control_step=...\): expected a multiple of the plant's step 0.03 s, got 0.05"
    ):
        dojo.closed_loop(policy.controller, dojo.Plant(SIM.replace(time_step=0.03)), 0.3)


def test_ctrl_c_before_the_first_policy_is_no_lack_of_seeds():
    def algorithm(task, **options):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        dojo.learn.best_of(algorithm, TASK, (1, 2), epochs=3)
    with pytest.raises(ValueError, match="expected at least one seed"):
        dojo.learn.best_of(algorithm, TASK, (), epochs=3)
