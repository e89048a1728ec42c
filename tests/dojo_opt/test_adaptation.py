"""Parameters estimated in closed loop, and parameters of a simulator set in place."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.mpc.adaptation import ParameterEstimator
from dojo_opt.mpc.ground_estimate import Ground
from dojo_opt.mpc.used_friction import UsedFriction
from sim.simulator.adjustable_simulator import AdjustableSimulator
from support.scenes import ball, block

NAMES = ("mass:ball", "friction:*")


def samples(sim, steps, noise=0.0, seed=0):
    """Nodes (steps + 1, nx) of a ball that is pushed to and fro, measured with noise, and its inputs."""
    rng = np.random.default_rng(seed)
    us = np.zeros((steps, sim.nu))
    us[:, 0] = 20.0 * np.sin(0.02 * np.arange(steps))
    us[:, 1] = 15.0 * np.cos(0.031 * np.arange(steps))
    x = sim.neutral()
    x[2] = 0.1
    xs = sim.rollout(x, us, throw=True).x
    deviation = noise * np.r_[np.ones(sim.nv), 10.0 * np.ones(sim.nv)]
    return np.array([sim.integrate(row, deviation * rng.standard_normal(sim.ndx)) for row in xs]), us


def estimate(settings, plant, steps=500, noise=0.0, seed=0):
    """The filter of a ball of 1 kg and friction .5 after some samples of a plant."""
    nominal = dojo.Simulator(ball(friction=0.5), time_step=0.02)
    made = ParameterEstimator(nominal, AdjustableSimulator.like(nominal), settings)
    xs, us = samples(plant, steps, noise, seed)
    for k in range(steps):
        made.observe(k * plant.time_step, xs[k], us[k], Ground(nominal))
    return made


@pytest.fixture(scope="module")
def plant():
    return dojo.Simulator(ball(), time_step=0.002).with_parameters({"mass:ball": 1.7, "friction:*": 0.2})


def test_mass_and_friction_are_found_from_exact_states(plant):
    found = estimate(dojo.Adaptation(NAMES, noise=(1e-6, 1e-5)), plant)
    assert found.values["mass:ball"] == pytest.approx(1.7, rel=2e-3)
    assert found.values["friction:*"] == pytest.approx(0.2, rel=2e-2)


@pytest.mark.slow
def test_the_estimate_is_as_far_off_as_its_deviation_says(plant):
    settings = dojo.Adaptation(NAMES, noise=(2e-4, 2e-3))
    off = []
    for seed in range(6):
        found = estimate(settings, plant, noise=2e-4, seed=seed)
        off += [(found.values[k] - true) / found.deviations[k] for k, true in zip(NAMES, (1.7, 0.2), strict=True)]
        assert found.deviations["mass:ball"] < 0.1
    assert 0.2 < np.sqrt(np.mean(np.square(off))) < 2.0


def test_friction_that_nothing_shows_stays_unknown():
    grip = dojo.Simulator(ball(), time_step=0.002).with_parameters({"mass:ball": 1.7, "friction:*": 5.0})  # rolls
    found = estimate(dojo.Adaptation(NAMES, noise=(1e-6, 1e-5)), grip, steps=200)
    assert found.deviations["mass:ball"] < 0.01 < 0.2 < found.deviations["friction:*"]
    assert found.values["friction:*"] == pytest.approx(0.5, rel=1e-3)
    low, high = found.bounds["friction:*"]
    assert 0.01 < low < 0.5  # what the ball needs to roll
    assert high == np.inf


def test_a_friction_that_is_found_has_two_bounds(plant):
    bounds = estimate(dojo.Adaptation(NAMES, noise=(1e-6, 1e-5)), plant).bounds
    for name, true in zip(NAMES, (1.7, 0.2), strict=True):
        low, high = bounds[name]
        assert low < true < high < low + 0.05


def test_only_frictions_have_the_bound_of_what_feet_used():
    used = UsedFriction(ball(), ("com:ball[0]", "friction:*"))
    assert used.frictions.tolist() == [False, True]
    assert used.least.tolist() == [-np.inf, 0.0]
    assert used.tells(np.array([False])).tolist() == [True, False]


def one_after_another(*plants, push=0.0):
    """The filter of exact samples of plants, 300 of each, and a push [m/s] before each but the first."""
    nominal = dojo.Simulator(ball(friction=0.5), time_step=0.02)
    made = ParameterEstimator(nominal, AdjustableSimulator.like(nominal), dojo.Adaptation(NAMES, noise=(1e-6, 1e-5)))
    us = samples(plants[0], 300)[1]
    x, now = plants[0].neutral(), 0.0
    x[2] = 0.1
    for k, each in enumerate(plants):
        x[7] += push * (k > 0)
        for u in us:
            made.observe(now, x, u, Ground(nominal))
            x, now = each.step(x, u, throw=True).x, now + each.time_step
    return made


def test_a_push_is_not_taken_for_a_parameter(plant):
    found = one_after_another(plant, plant, push=0.5)
    assert found.values["mass:ball"] == pytest.approx(1.7, rel=1e-3)
    assert found.values["friction:*"] == pytest.approx(0.2, rel=0.02)


def test_a_mass_that_changes_is_found_again(plant):
    heavy = plant.with_parameters({"mass:ball": 2.5, "friction:*": 0.2})
    assert one_after_another(plant, heavy).values["mass:ball"] == pytest.approx(2.5, rel=0.02)


def test_the_models_take_the_estimate_and_forget_it(plant):
    nominal = dojo.Simulator(ball(friction=0.5), time_step=0.02)
    planner = AdjustableSimulator.like(nominal.replace(friction=0.3))
    made = ParameterEstimator(nominal, planner, dojo.Adaptation(NAMES, noise=(1e-6, 1e-5)), friction=0.3)
    xs, us = samples(plant, 300)
    for k in range(300):
        made.observe(k * plant.time_step, xs[k], us[k], Ground(nominal))
    u = np.r_[2.0, np.zeros(5)]
    wanted = nominal.with_parameters({"mass:ball": 1.7, "friction:*": 0.2}).step(xs[0], u).x
    assert planner.step(xs[0], u).x == pytest.approx(wanted, abs=2e-3)
    made.forget()
    assert made.values == {"mass:ball": 1.0, "friction:*": 0.5}
    assert np.array_equal(planner.step(xs[0], u).x, nominal.replace(friction=0.3).step(xs[0], u).x)


def test_samples_at_uneven_times_are_not_used(plant):
    nominal = dojo.Simulator(ball(friction=0.5), time_step=0.02)
    made = ParameterEstimator(nominal, AdjustableSimulator.like(nominal), dojo.Adaptation(NAMES))
    xs, us = samples(plant, 40)
    for k in range(40):
        made.observe(k * plant.time_step + 5e-4 * (k % 2), xs[k], us[k], Ground(nominal))
    assert made.values == {"mass:ball": 1.0, "friction:*": 0.5}


@pytest.mark.slow
def test_a_quadruped_carries_what_the_fixed_model_does_not():
    adapt = dojo.Adaptation(("mass:trunk", "friction:*"))
    for settings, survives in (({}, False), ({"adapt": adapt}, True)):
        mpc = dojo.tasks.quadruped_mpc(**settings)
        loop = dojo.closed_loop(mpc, dojo.tasks.plant(mpc, 2e-3, payload=24.0), 1.0)
        assert loop.survived == survives, loop.message
    assert mpc.estimator is not None
    assert mpc.estimator.values["mass:trunk"] == pytest.approx(30.0, rel=0.01)


@pytest.mark.parametrize("order", [2, 4])
def test_parameters_are_set_in_place(order):
    values = {"mass:block": 3.0, "friction:*": 0.1, "com:block": (0.02, 0.0, 0.01)}
    own = AdjustableSimulator(block(), time_step=0.01, order=order)
    kept = own.replace()
    x = kept.neutral()
    x[2], x[7:] = 0.24, (1.0, 0.2, 0.0, 0.1, 0.2, 0.3)
    if order != 2:
        with pytest.raises(ValueError, match="order 2"):
            own.set_parameters(values)
        return
    before = own.step(x).x
    own.set_parameters(values)
    other = kept.with_parameters(values)
    for k in range(20):
        assert np.array_equal(own.step(x).x, other.step(x).x), k
        x = other.step(x).x
    own.set_parameters({})
    assert np.array_equal(own.step(kept.neutral()).x, kept.step(kept.neutral()).x)
    assert not np.array_equal(before, other.step(x).x)


def test_what_parameters_do_not_change_stays():
    sim = AdjustableSimulator(block(), time_step=0.01)
    sim.model.contact_height[:] = 0.3
    sim.turn_ground((0.1, 0.0, 1.0))
    frame = sim.model.contact_frame.copy()
    sim.set_parameters({"mass:block": 2.0})
    assert np.all(sim.model.contact_height == 0.3)
    assert np.array_equal(sim.model.contact_frame, frame)


def test_derivatives_are_those_of_the_values_written_last():
    mech, names = dojo.models.npendulum(3, damper=0.5), ("mass", "com", "child_point")
    sim = AdjustableSimulator(mech, time_step=0.01)
    other = dojo.Simulator(mech, time_step=0.01).with_parameters({"mass": (2.0, 0.4, 3.0)})
    x, u = sim.neutral() + 0.1, np.zeros(sim.nu)
    sim.linearize(x, u, wrt=names)
    sim.set_parameters({"mass": (2.0, 0.4, 3.0)})
    own, theirs = (s.linearize(x, u, wrt=names) for s in (sim, other))
    for name in names:
        assert np.array_equal(own[name], theirs[name]), name
    assert np.array_equal(sim.parameters(("mass",)).values, dojo.Simulator(mech).parameters(("mass",)).values)


def test_values_that_change_the_structure_are_refused():
    sim = AdjustableSimulator(dojo.models.npendulum(2), time_step=0.01)
    for values, words in (({"damper": np.ones(2)}, "structure"), ({"time_step": 0.1}, "time_step"), ({"x": 1.0}, "x")):
        with pytest.raises(ValueError, match=words):
            sim.set_parameters(values)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"parameters": ("nothing:*",)}, "nothing"),
        ({"noise": (1.0, 2.0, 3.0)}, "noise"),
        ({"noise": (-1.0, 1.0)}, "noise"),
        ({"spread": {"mass:trunk": 1.0}}, "friction"),
        ({"spread": 0.0}, "spread"),
        ({"interval": np.nan}, "interval"),
        ({"memory": -1.0}, "memory"),
    ],
)
def test_wrong_settings_are_refused_by_name(settings, words):
    given = {"parameters": ("mass:trunk", "friction:*"), **settings}
    with pytest.raises(ValueError, match=words):
        dojo.tasks.free_gait_mpc(adapt=dojo.Adaptation(**given))


@pytest.mark.parametrize(
    ("settings", "spread", "words"),
    [
        ({}, {"damper:hinge": 0.1}, "no new damper"),
        ({}, {"time_step": 0.1}, "time_step"),
        ({"order": 4}, {"mass:link": 0.1}, "order 2"),
        ({"accuracy": 1e-4}, {"mass:link": 0.1}, "accuracy"),
    ],
)
def test_parameters_that_cannot_change_are_refused_at_once(settings, spread, words):
    link = dojo.Body("link", 1.0, shape=dojo.Capsule(0.05, 0.4))
    hinge = dojo.Joint("revolute", "world", "link", "hinge", child_point=(0.0, 0.0, 0.2), axis=(0.0, 1.0, 0.0))
    sim = dojo.Simulator(dojo.Mechanism([link], [hinge]), time_step=0.05, **settings)
    problem = dojo.Problem(sim, np.zeros(2), 3, cost=[dojo.cost.Effort(1.0)])
    with pytest.raises(ValueError, match=rf"MPC\(adapt=...\).*{words}"):
        dojo.MPC(problem, adapt=dojo.Adaptation(tuple(spread), spread=spread))


def test_centers_of_mass_away_from_which_a_term_has_a_point_do_not_adapt():
    """The model moves, and the point of the term would stay where it was from its centre of mass."""
    link = dojo.Body("link", 1.0, shape=dojo.Capsule(0.05, 0.4))
    hinge = dojo.Joint("revolute", "world", "link", "hinge", child_point=(0.0, 0.0, 0.2), axis=(0.0, 1.0, 0.0))
    sim = dojo.Simulator(dojo.Mechanism([link], [hinge]), time_step=0.05)
    spread = {"com:link[2]": 0.02}
    adapt = dojo.Adaptation(tuple(spread), spread=spread)
    for offset, refused in ((0.0, False), (0.1, True)):
        terms = [dojo.cost.Effort(1.0), dojo.cost.Point("link", (0.0, 0.0, 0.0), (0.0, 0.0, offset))]
        problem = dojo.Problem(sim, np.zeros(2), 3, cost=terms)
        if refused:
            with pytest.raises(ValueError, match=r"MPC\(adapt=...\): 'com:link\[2\]' moves .* a Point measures"):
                dojo.MPC(problem, adapt=adapt)
        else:
            dojo.MPC(problem, adapt=adapt)


def test_only_an_adaptation_adapts():
    with pytest.raises(TypeError, match="Adaptation"):
        dojo.tasks.free_gait_mpc(adapt=("mass:trunk",))
