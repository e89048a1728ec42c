"""Planner, plant and Monte Carlo check their arguments at the interface: messages name the call and the culprit."""

import numpy as np
import pytest

import dojo_opt as dojo
from support.refusals import check_refused

HOP = dojo.problems.hop()
SIM, START = HOP.sim, HOP.start
PLANT = dojo.Plant(SIM)
ATLAS = dojo.Simulator(dojo.models.atlas(), time_step=0.02)
QUADRUPED = dojo.Simulator(dojo.models.quadruped(), time_step=0.02)


def turned(length):
    """The start with a quaternion of another length."""
    x = START.copy()
    x[3] = length
    return x


def problem(**settings):
    return dojo.Problem(SIM, **{"start": START, "horizon": 20, **settings})


def study(**settings):
    given = {"controller": lambda time, x: np.zeros(3), "plant": PLANT, "sampler": lambda rng: dojo.Perturbation()}
    return dojo.monte_carlo(**{**given, "duration": 0.1, "runs": 1, **settings})


def reach(frame, **settings):
    return dojo.problems.reach(dojo.models.panda(), frame, (0.4, 0.0, 0.4), **settings)


def goal(x):
    return problem(constraints=dojo.constraint.Goal(x))


# fmt: off
CALLS = {
    "no simulator": (lambda: dojo.Problem(SIM.mechanism, START, 20), "Problem(sim)", "Simulator", "raiberthopper"),
    "no horizon": (lambda: problem(horizon=None), "Problem(horizon=...)", "whole number", "None"),
    "horizon zero": (lambda: problem(horizon=0), "Problem(horizon=...)", ">= 1", "0"),
    "half a step": (lambda: problem(substeps=1.5), "Problem(substeps=...)", "1.5"),
    "start as text": (lambda: problem(start="standing"), "Problem(start=...)", "numbers", "standing"),
    "start without a turn": (lambda: problem(start=turned(0.0)), "Problem(start=...)", "[3:7]", "got length 0"),
    "start that is stretched": (lambda: problem(start=turned(2.0)), "Problem(start=...)", "unit", "got length 2"),
    "goal of zeros": (lambda: goal(np.zeros(15)), "Goal(target=...)", "unit quaternion", "got length 0"),
    "reference of zeros": (lambda: problem(cost=dojo.cost.Tracking(np.vstack([START] * 20 + [turned(0.5)]), 1.0)),
                           "Tracking(reference=...)", "unit quaternion", "in row 20"),
    "limits as text": (lambda: problem(control_limits=("low", "high")), "Problem(control_limits=...)", "low"),
    "tolerance as text": (lambda: dojo.ilqr(HOP, tolerance="fine"), "ilqr(tolerance=...)", "fine"),
    "tolerance nan": (lambda: dojo.ilqr(HOP, tolerance=np.nan), "ilqr(tolerance=...)", "nan"),
    "half an iteration": (lambda: dojo.ilqr(HOP, max_iterations=2.5), "ilqr(max_iterations=...)", "whole", "2.5"),
    "callback": (lambda: dojo.ilqr(HOP, callback=3), "ilqr(callback=...)", "3"),
    "stages": (lambda: dojo.ilqr(HOP, stages=(1e-3,)), "ilqr(stages=...)", "0.001"),
    "options as a table": (lambda: dojo.ilqr(HOP, options={"verbose": True}), "ilqr(options=...)", "verbose"),
    "warm start from a file name": (lambda: dojo.ilqr(HOP, warm_start="plan.npz"), "ilqr(warm_start=...)", "plan.npz"),
    "options of mpc": (lambda: dojo.MPC(HOP, options=3), "MPC(options=...)", "3"),
    "target in space": (lambda: dojo.problems.hop(target=(0.5, 0.5, 0.5)), "problems.hop(target=...)", "(2,)", "(3,)"),
    "start as a word": (lambda: reach("link7", start="up"), "start=...", "up"),
    "foot of a number": (lambda: dojo.problems.trot(dojo.models.quadruped(), feet=3.0), "problems.trot(feet=...)", "3.0"),
    "goal of a block": (lambda: dojo.problems.block([1.0]), "problems.block(goal=...)", "[1.0]"),
    "edge without a length": (lambda: dojo.problems.block(edge=None), "models.block(edge=...)", "None"),
    "edge beyond floats": (lambda: dojo.problems.block(edge=1e300), "edge=1e+300): numbers", "overflow"),
    "swing of a number": (lambda: dojo.problems.swingup(np.zeros(3)), "problems.swingup(name)", "cartpole"),
    "leap of years": (lambda: dojo.problems.leap(duration=1e9), "problems.leap(duration=...)", "GiB"),
    "leap of a moment": (lambda: dojo.problems.leap(duration=0.01), "problems.leap(duration=...)", "5 knots of 0.02 s", "0.01"),
    "reach of a moment": (lambda: reach("link7", duration=0.01), "problems.reach(duration=...)", "2 knots", "0.01 s"),
    "rise of a moment": (lambda: dojo.problems.stand_up(dojo.models.quadruped(), duration=0.01),
                         "problems.stand_up(duration=...)", "2 knots", "0.01 s"),
    "rest of years": (lambda: dojo.problems.jump(after=1e9), "problems.jump(...)", "100,000 time steps", "5e+10"),
    "jump to the moon": (lambda: dojo.problems.jump(height=1e9), "problems.jump(height=..., crouch=...)", "1,000 times"),
    "crouch of a giant": (lambda: dojo.problems.jump(height=1e9, crouch=1e9), "problems.jump(...)", "time steps"),
    "trot of years": (lambda: dojo.problems.trot(cycles=10**7), "problems.trot(cycles=..., period=...)", "Plan.repeated"),
    "stand of years": (lambda: dojo.gaits.stand(QUADRUPED, duration=1e9), "gaits.stand(duration=...)", "time steps"),
    "step of years": (lambda: dojo.gaits.step(ATLAS, shift=1e300), "gaits.step(shift=..., swing=...", "time steps"),
    "rise of years": (
        lambda: dojo.problems.stand_up(dojo.models.quadruped(), duration=1e9),
        "problems.stand_up(duration=...)",
        "time steps",
    ),
    "gait of a number": (lambda: dojo.problems.follow(3.0), "problems.follow(gait)", "3.0"),
    "weight as a word": (lambda: dojo.problems.trot(place="near"), "problems.trot(place=...)", "near"),
    "effort below zero": (lambda: dojo.problems.trot(effort=-1.0), "problems.trot(effort=...)", "-1"),
    "limits of a number": (lambda: dojo.problems.trot(control_limits=3.0), "control_limits=...", "3.0"),
    "periodic as a table": (lambda: dojo.problems.trot(periodic={"a": 1}), "problems.trot(periodic=...)", "'a'"),
    "no substeps": (lambda: dojo.problems.hop(substeps=0), "problems.hop(substeps=...)", "0"),
    "trot of a block": (lambda: dojo.gaits.trot(dojo.problems.block().sim), "gaits.trot(sim)", "legs", "block"),
    "trot of a model": (lambda: dojo.gaits.trot("quadruped"), "gaits.trot(sim)", "'quadruped'"),
    "speed as a word": (lambda: dojo.problems.trot(speed="fast"), "problems.trot(speed=...)", "fast"),
    "speed nan": (lambda: dojo.problems.trot(speed=np.nan), "problems.trot(speed=...)", "nan"),
    "unknown keyword": (lambda: dojo.problems.trot(sped=0.1), "problems.trot(...)", "'sped'", "'speed'", "distance, ", "damping"),
    "unknown keyword of a robot": (lambda: dojo.problems.walk(dojo.models.quadruped(), frction=0.1),
                                   "problems.walk(...)", "'frction'", "periodic", "step_height"),
    "speed and distance": (lambda: dojo.problems.trot(speed=0.1, distance=0.5),
                           "problems.trot(speed=..., distance=...)", "0.1 m/s", "0.5 m"),
    "distance of a pace": (lambda: dojo.problems.pace(distance="far"), "problems.pace(distance=...)", "far"),
    "trot of a file": (lambda: dojo.problems.trot("go2.urdf"), "problems.trot(robot)", "'go2.urdf'", "load_urdf"),
    "foot of another name": (lambda: dojo.problems.trot(dojo.models.quadruped(), feet=["FR_fot"]),
                             "problems.trot(feet=...)", "did you mean 'FR_foot'"),
    "trot out of reach": (lambda: dojo.problems.trot(speed=8.0),
                          "problems.trot(...): foot", "comes no nearer", "less far or fast"),
    "period before zero": (lambda: dojo.problems.trot(dojo.models.quadruped(), period=-1.0), "problems.trot(period=...)", "-1"),
    "push before the start": (lambda: dojo.Push(-0.5, (1.0, 0.0, 0.0)), "Push(time=...)", "-0.5"),
    "plant of long steps": (lambda: dojo.tasks.plant(dojo.MPC(HOP), time_step=9.0), "tasks.plant(time_step=...)", "at most", "9"),
    "duty as a word": (lambda: dojo.problems.walk(duty="half"), "problems.walk(duty=...)", "half"),
    "tilt nan": (lambda: dojo.problems.bound(tilt=np.nan), "problems.bound(tilt=...)", "nan"),
    "height as a word": (lambda: dojo.problems.trot(height="high"), "problems.trot(height=...)", "high"),
    "stand at a word": (lambda: dojo.gaits.stand(QUADRUPED, height="low"), "gaits.stand(height=...)", "low"),
    "half a link": (lambda: dojo.models.npendulum(2.5), "npendulum(n", "whole number", "2.5"),
    "half a cycle": (lambda: dojo.problems.walk(cycles=0.5), "problems.walk(cycles=...)", "0.5"),
    "leap of a word": (lambda: dojo.problems.leap(distance="far"), "problems.leap(distance=...)", "far"),
    "height nan": (lambda: dojo.problems.leap(height=np.nan), "problems.leap(height=...)", "nan"),
    "distance as a word": (lambda: dojo.problems.jump(distance="far"), "problems.jump(distance=...)", "far"),
    "refinement of a jump": (lambda: dojo.problems.jump(refinement=0), "problems.jump(refinement=...)", ">= 1", "0"),
    "no substeps of a gait": (lambda: dojo.problems.trot(substeps=0), "problems.trot(substeps=...)", ">= 1", "0"),
    **{f"leap with {name}": (lambda name=name, bad=bad: dojo.problems.leap(**{name: bad}),
                             f"problems.leap({name}=...)", *words)
       for name, bad, *words in [
           ("distance", "far", "far"),
           ("height", np.nan, "nan"),
           ("duration", 0.0, "> 0", "0"),
           ("crouch", -0.1, ">= 0", "-0.1"),
           ("time_step", 0.0, "> 0", "0"),
           ("refinement", 2.5, "whole number", "2.5"),
       ]},
    "half a knot": (lambda: problem(cost=dojo.cost.Tracking(START, 1.0, knots=[1.5])), "Tracking(knots=...)", "[1.5]"),
    "bounds as text": (lambda: problem(constraints=dojo.constraint.StateBounds("low", 1.0, "body z")),
                       "StateBounds(lower=...)", "'low'"),
    "too many bounds": (lambda: problem(constraints=dojo.constraint.ControlBounds(0.0, np.ones(2))),
                        "ControlBounds(upper=...)", "(3,)", "(2,)"),
    "scale below zero": (lambda: problem(cost=dojo.cost.Effort(1.0, scale=-1.0)), "Effort(scale=...)", ">= 0", "-1"),
    "scale as text": (lambda: problem(cost=dojo.cost.Effort(1.0, scale="half")), "Effort(scale=...)", "half"),
    "iterations as text": (lambda: dojo.MPC(HOP, "two"), "MPC(iterations=...)", "whole number", "two"),
    "task without substeps": (lambda: dojo.tasks.hopper_mpc(substeps=0), "hopper_mpc(substeps=...)", ">= 1", "0"),
    "plant of a problem": (lambda: dojo.tasks.plant(HOP), "tasks.plant(mpc)", "MPC", "Problem"),
    "range reversed": (lambda: dojo.Disturbances(7, push=(8.0, 4.0)), "Disturbances(push=...)", "low <= high", "8.0"),
    "range of one number": (lambda: dojo.Disturbances(7, slope=0.1), "Disturbances(slope=...)", "(2,)"),
    "rest of a mechanism": (lambda: dojo.equilibrium(SIM.mechanism), "equilibrium(sim)", "Simulator"),
    "negative noise": (lambda: dojo.Plant(SIM, noise=-1.0), "Perturbation(noise=...)", "-1.0"),
    "noise nan": (lambda: dojo.Plant(SIM, noise=np.nan), "Perturbation(noise=...)", "nan"),
    "noise shape": (lambda: dojo.Plant(SIM, noise=np.ones(3)), "Plant(noise=...)", "(14,)", "(3,)"),
    "offset shape": (lambda: dojo.Plant(SIM, offset=np.ones(3)), "Plant(offset=...)", "(14,)", "(3,)"),
    "limits reversed": (lambda: dojo.Plant(SIM, control_limits=(1, -1)), "Perturbation(control_limits=...)", "(1, -1)"),
    "limits nan": (lambda: dojo.Plant(SIM, control_limits=(np.nan, 1)), "Perturbation(control_limits=...)", "nan"),
    "one limit": (lambda: dojo.Plant(SIM, control_limits=5.0), "Perturbation(control_limits=...)", "5.0"),
    "limits shape": (lambda: dojo.Plant(SIM, control_limits=(np.zeros(2), np.ones(2))), "control_limits", "(3,)", "(2,)"),
    "payload on a hand": (lambda: dojo.Plant(SIM, payload_body="hand"), "payload_body", "hand", "body, foot"),
    "inertia taken away": (lambda: dojo.Plant(SIM, payload_inertia=-1.0), "payload_inertia", "-1.0"),
    "heading nan": (lambda: dojo.Plant(SIM, slope_heading=np.nan), "Perturbation(slope_heading=...)", "nan"),
    "height as text": (lambda: dojo.Plant(SIM, ground_height="up"), "Perturbation(ground_height=...)", "up"),
    "terrain as a number": (lambda: dojo.Plant(SIM, terrain=0.1), "Perturbation(terrain=...)", "0.1"),
    "seed": (lambda: dojo.Plant(SIM, seed=-1), "Perturbation(seed=...)", "-1"),
    "perturbation": (lambda: dojo.Plant(SIM, perturbation=3.0), "Plant(perturbation=...)", "3.0"),
    "controller": (lambda: dojo.closed_loop("mpc", PLANT, 0.1), "closed_loop(controller)", "'mpc'"),
    "study without a sampler": (lambda: study(sampler=3), "monte_carlo(sampler)", "3"),
    "study without a plant": (lambda: study(plant=SIM), "monte_carlo(plant)", "Plant"),
    "sampler of numbers": (lambda: study(sampler=lambda rng: 0.5), "monte_carlo(sampler)", "Perturbation", "0.5"),
    "executor": (lambda: study(executor=4), "monte_carlo(executor=...)", "4"),
    "half a run": (lambda: study(runs=2.5), "monte_carlo(runs=...)", "2.5"),
    "study seed": (lambda: study(seed=-1), "monte_carlo(seed=...)", "-1"),
    "study duration": (lambda: study(duration=-1.0), "monte_carlo(duration)", "-1"),
}
# fmt: on


@pytest.mark.parametrize("case", CALLS)
def test_border(case):
    check_refused(*CALLS[case])


def test_quaternions_within_rounding_are_made_one():
    x = turned(1.0 + 5e-7)
    made = problem(start=x, cost=dojo.cost.Tracking(x, 1.0))
    assert np.linalg.norm(made.start[3:7]) == 1.0
    np.testing.assert_allclose(np.linalg.norm(made.costs[0].reference[:, 3:7], axis=1), 1.0, atol=1e-15)


def test_one_push_needs_no_list():
    push = dojo.Push(0.1, (0.0, 1.0, 0.0))
    assert dojo.Perturbation(pushes=push).pushes == (push,)


def test_a_problem_has_a_short_repr():
    assert repr(HOP) == "Problem(raiberthopper, 20 knots of 0.05 s, Tracking, Effort, Goal)"


def test_options_are_public():
    plan = dojo.ilqr(HOP, options=dojo.Options(max_iterations=2, stages=(dojo.Stage(1e-2, 1e-2),)))
    assert plan.status == dojo.Status.MAX_ITERATIONS and plan.nit == 2


# -- complex numbers, and horizons that fit no memory -------------------------------------------------------------------

HOPPER = dojo.Simulator(dojo.models.raiberthopper(), 0.02)
AT, INPUTS = HOPPER.neutral(), np.zeros((5, 3))
PATH = np.tile(AT, (6, 1))
SPUN = 1.0 + 1e-3j  # a factor


def plain(**settings):
    return dojo.Problem(HOPPER, AT, 5, **{"cost": dojo.cost.Effort(1.0), **settings})


COMPLEX = {
    "start": lambda: dojo.Problem(HOPPER, AT * SPUN, 5),
    "controls0": lambda: plain(controls0=INPUTS * SPUN),
    "states0": lambda: plain(states0=PATH * SPUN),
    "control_limits": lambda: plain(control_limits=(-np.ones(3) * SPUN, np.ones(3))),
    "free_start": lambda: plain(free_start=np.array([1j])),
    "Tracking(reference)": lambda: plain(cost=dojo.cost.Tracking(AT * SPUN, 1.0)),
    "Tracking(weight)": lambda: plain(cost=dojo.cost.Tracking(AT, np.ones(14) * SPUN)),
    "Effort(reference)": lambda: plain(cost=dojo.cost.Effort(1.0, reference=np.ones(3) * SPUN)),
    "Effort(scale)": lambda: plain(cost=dojo.cost.Effort(1.0, scale=np.complex128(SPUN))),
    "Goal(target)": lambda: plain(constraints=dojo.constraint.Goal(AT * SPUN)),
    "StateBounds(lower)": lambda: plain(constraints=dojo.constraint.StateBounds(np.array(SPUN), 2.0, components=[2])),
    "ControlBounds(upper)": lambda: plain(constraints=dojo.constraint.ControlBounds(-1.0, np.ones(3) * SPUN)),
    "ilqr(controls)": lambda: dojo.ilqr(plain(), controls=INPUTS * SPUN),
    "ilqr(states)": lambda: dojo.ilqr(plain(), states=PATH * SPUN),
    "ilqr(stages)": lambda: dojo.ilqr(plain(), stages=((np.complex128(SPUN), 1e-3),)),
    "step(x)": lambda: HOPPER.step(AT * SPUN, INPUTS[0]),
    "rollout(us)": lambda: HOPPER.rollout(AT, INPUTS * SPUN),
    "rollout(policy)": lambda: HOPPER.rollout(AT, lambda t, x: INPUTS[0] * SPUN, steps=3),
    "rollout_feedback(limits)": lambda: HOPPER.rollout_feedback(
        AT, INPUTS, PATH, limits=(-np.ones(3) * SPUN, np.ones(3))
    ),
    "rollout_feedback(Ks)": lambda: HOPPER.rollout_feedback(AT, INPUTS, PATH, Ks=np.ones((5, 3, 14)) * SPUN),
    "equilibrium(x)": lambda: dojo.equilibrium(HOPPER, AT * SPUN),
    "Plant(noise)": lambda: dojo.Plant(HOPPER, noise=np.ones(14) * SPUN),
    "Plant(payload_inertia)": lambda: dojo.Plant(HOPPER, payload=1.0, payload_inertia=np.ones(3) * SPUN),
    "MPC(reference)": lambda: dojo.MPC(
        plain(cost=dojo.cost.Tracking(AT, 1.0)), reference=lambda t: np.tile(AT, (len(t), 1)) * SPUN
    ),
    "MPC(x)": lambda: dojo.MPC(plain())(0.0, AT * SPUN),
    "loop's u": lambda: dojo.closed_loop(lambda t, x: INPUTS[0] * SPUN, dojo.Plant(HOPPER), 0.1),
    "Terrain": lambda: dojo.Terrain.from_function(lambda x, y: x * SPUN, [0.0, 1.0], [0.0]),
    "Hopping(start)": lambda: dojo.tasks.Hopping(AT * SPUN, (0.0, 0.0), 0.2, 0.2),
}


@pytest.mark.parametrize("call", COMPLEX.values(), ids=COMPLEX)
def test_complex_numbers_are_refused(call):
    with pytest.raises((ValueError, TypeError), match=r"expected|real"):
        call()


def test_a_horizon_that_exceeds_memory_is_refused_with_its_size():
    with pytest.raises(ValueError, match=r"Problem\(horizon=...\): .* need at least .* GiB of memory"):
        dojo.Problem(HOPPER, AT, 10**9)
    with pytest.raises(ValueError, match=r"GiB of memory"):
        dojo.Problem(HOPPER, AT, 10**12, states0=PATH)
