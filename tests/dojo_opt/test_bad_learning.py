"""Learning and identification refuse wrong arguments by name, before any work."""

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
MOTION = SIM.rollout(SIM.neutral(), steps=3)
ONE = np.ones(1)


def still(time, x):
    return ONE


TASK = dojo.learn.Task(SIM, 1, still, 2, still, -ONE, ONE, still, still, steps=5)
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
    **{f"identify {key} {bad}": (lambda key=key, bad=bad: dojo.identify(SIM, [MOTION], ["mass"], **{key: bad}), key)
       for key, bad in (("bounds", 3), ("prior", 3), ("noise", [1, 2, 3, 4]), ("noise", None), ("kappas", 3.5 + 1j),
                        ("bounds", {"mass": 1}), ("bodies", 3), ("fits", 0), ("window", 0))},
    "no motions": (lambda: dojo.identify(SIM, None, ["mass"]), "identify(trajectories)", "None"),
    "one motion": (lambda: dojo.identify(SIM, MOTION, ["mass"]), "identify(trajectories)", "list"),
    "no names": (lambda: dojo.identify(SIM, [MOTION], None), "identify(parameters)", "None"),
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
    "command of a number": (lambda: POLICY.commanded(3)(0.0, np.zeros(2)), "commanded(command)"),
}
# fmt: on


@pytest.mark.parametrize("case", CALLS)
def test_it_is_refused_by_name(case):
    check_refused(*CALLS[case])


def test_a_run_is_resumed_from_its_own_state_only():
    end = (POLICY, False, Status.STOPPED, "", "ars", 0, 1.0, 1, 0, 0, 1.0)
    with pytest.raises(ValueError, match=r"ars\(resume=\.\.\.\): its 'epoch' is missing"):
        dojo.learn.ars(TASK, resume=Learned(*end, state={"weights": np.zeros(3)}))
