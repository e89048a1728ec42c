"""Gaits of the quadruped with the default settings, held to the numbers that they are published with."""

import numpy as np
import pytest

from dojo_opt import gaits, models, plots, problems
from dojo_opt.gaits.feet import Feet
from dojo_opt.planning.ilqr import ilqr
from dojo_opt.viewer.motion import motion
from sim.simulator.simulator import Simulator
from support.planned_legs import check, lands, lowest_foot, upright


@pytest.mark.parametrize("damping, iterations", [(5.0, 8), (0.5, 30)])
def test_trot_from_its_reference(damping, iterations):
    problem = problems.trot(damping=damping)
    plan = ilqr(problem)
    check(problem, plan, iterations)
    reference = problem.costs[0].reference
    assert np.abs(problem.sim.difference(plan.x[-1], reference[-1])[:6]).max() <= 5e-3
    assert plan.fun < 0.0192  # MuJoCo and the same weights: .016 at damping 5


@pytest.mark.slow
@pytest.mark.parametrize("speed", [0.0, 0.1, 0.4])
def test_trot_at_several_speeds(speed):
    problem = problems.trot(speed=speed)
    plan = ilqr(problem)
    check(problem, plan, 30)
    assert plan.x[-1, 0] - plan.x[0, 0] == pytest.approx(2.0 * speed, abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize("damping", [5.0, 0.5])
@pytest.mark.parametrize("speed", [0.0, 0.2, 0.3])
def test_trot_from_standing_still(damping, speed):
    problem = problems.trot(damping=damping, speed=speed, guess="standing")
    plan = ilqr(problem)
    check(problem, plan, 60)
    assert np.ptp(problem.states0[1:], axis=0).max() == 0.0


@pytest.mark.slow
@pytest.mark.parametrize("damping, speed", [(0.3, 0.39), (0.5, 0.39), (0.8, 0.35)])
def test_trot_from_standing_still_keeps_its_gains_while_gaps_are_open(damping, speed):
    """Of 28 such trots two, .3 at .38 m/s and .4 at .40 m/s, take the long way: 128 and 221 iterations."""
    problem = problems.trot(damping=damping, speed=speed, guess="standing")
    plan = ilqr(problem)
    check(problem, plan, 60)
    assert max(record["mu"] for record in plan.history if record["gap"] > 0.0) < 100.0


@pytest.mark.slow
@pytest.mark.parametrize("speed, damping", [(0.35, 0.05), (0.4, 0.05), (0.35, 0.03)])
def test_a_plan_with_more_damping_is_a_guess_for_less(speed, damping):
    """Directly they take 84 to 196 iterations, and whether they get there at all is a matter of rounding."""
    easy, hard = (problems.trot(speed=speed, damping=d, guess="standing") for d in (0.5, damping))
    damped = ilqr(easy)
    plan = ilqr(hard, warm_start=damped)
    check(hard, plan, 40)
    assert damped.nit + plan.nit <= 75
    assert plan.x[-1, 0] - plan.x[0, 0] == pytest.approx(2.0 * speed, abs=5e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    "name, settings",
    [("trot", {"damping": 0.1}), ("walk", {}), ("pace", {}), ("bound", {"speed": 0.8}), ("turn", {}), ("jump", {})],
)
def test_weakly_damped_gaits_from_standing_still(name, settings):
    plan = ilqr(getattr(problems, name)(guess="standing", **{"damping": 0.05, **settings}))
    assert plan.success and plan.nit <= 90, plan.summary()
    assert upright(plan.x).min() > 0.9


@pytest.mark.parametrize("name, iterations", [("pace", 40), ("walk", 20), ("turn", 30)])
def test_other_gaits(name, iterations):
    problem = getattr(problems, name)()
    check(problem, ilqr(problem), iterations, tilt=0.96)


@pytest.mark.parametrize("guess, iterations", [("reference", 30), ("standing", 60)])
def test_bound_leaves_the_ground(guess, iterations):
    problem = problems.bound(guess=guess)
    plan = ilqr(problem)
    check(problem, plan, iterations, tilt=0.9, off=0.06)
    if guess == "reference":  # from standing, a plan that drags a foot through costs no more
        assert Feet(problem.sim).gaps(plan.x).min(axis=1).max() > 2e-3  # between the two feet of the reference: 4 mm
        assert lowest_foot(problem, plan).max() > 0.008  # and twice that in short steps
    loaded = motion(plan).normal_force > 2.0
    front, hind = loaded[:, 0] | loaded[:, 1], loaded[:, 2] | loaded[:, 3]
    assert (front & ~hind).any() and (hind & ~front).any()


@pytest.mark.parametrize("guess, iterations", [("reference", 16), ("standing", 60)])
def test_jump_leaves_the_ground(guess, iterations):
    problem = problems.jump(distance=0.3, height=0.2, guess=guess)
    plan = ilqr(problem)
    check(problem, plan, iterations)
    lands(problem, plan)
    assert lowest_foot(problem, plan).max() > 0.15
    assert plan.x[:, 2].max() - plan.x[0, 2] == pytest.approx(0.2, abs=0.01)
    assert plan.x[-1, 0] - plan.x[0, 0] == pytest.approx(0.3, abs=2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("distance, height", [(0.0, 0.3), (-0.1, 0.2), (-0.2, 0.2)])
def test_jumps_up_and_back_land_in_short_steps(distance, height):
    """With steps of 20 ms alone they are 40 to 72 mm off."""
    problem = problems.jump(distance=distance, height=height, crouch=0.12)
    plan = ilqr(problem)
    check(problem, plan, 30)
    lands(problem, plan)
    assert ilqr(problem, warm_start=plan).success  # which has a constraint less than its refined form
    assert plan.x[:, 2].max() - plan.x[0, 2] == pytest.approx(height, abs=0.01)


@pytest.mark.sweep(2)
@pytest.mark.parametrize(
    "name, settings", [("trot", {"damping": 5.0}), ("trot", {}), ("trot", {"cycles": 4}), ("walk", {})]
)
def test_periodic_gaits_choose_their_start(name, settings):
    problem = getattr(problems, name)(periodic=True, **settings)
    plan = ilqr(problem)
    assert plan.success, plan.summary()
    assert plan.nit <= 40 and upright(plan.x).min() > 0.96
    moved = problem.sim.difference(plan.x[-1], plan.x[0])
    assert np.abs(moved[1:]).max() <= 1e-3
    reference = problem.costs[0].reference
    assert moved[0] == pytest.approx(reference[-1, 0] - reference[0, 0], abs=1e-3)
    start = problem.sim.difference(plan.x[0], problem.start)
    assert np.abs(start).max() > 1e-3 and np.abs(start[[0, 1, 5]]).max() < 1e-4  # 5: its rotation is not small


@pytest.mark.sweep(2)
@pytest.mark.parametrize("name, settings", [("trot", {"speed": 0.4}), ("trot", {"damping": 0.05}), ("walk", {})])
def test_periodic_gaits_go_on(name, settings):
    problem = getattr(problems, name)(periodic=True, cycles=1, **settings)
    plan = ilqr(problem).repeated(5)
    assert len(plan.u) == len(plan.K) == 5 * problem.horizon
    shot = plan.replay(time_step=plan.time_step / 5)
    assert shot.status == 0 and upright(shot.x).min() > 0.97
    assert np.abs(shot.x[-1, :3] - plan.x[-1, :3]).max() < 0.05


@pytest.mark.parametrize("robot", [None, "any"])
@pytest.mark.parametrize(
    "name, settings",
    [("trot", {}), ("trot", {"cycles": 3, "period": 0.8}), ("walk", {"periodic": True}), ("walk", {"speed": None})],
)
def test_the_distance_of_a_gait(name, settings, robot):
    given = () if robot is None else (models.quadruped(),)
    path = getattr(problems, name)(*given, distance=0.23, **settings).specs[0][0].reference
    assert path[-1, 0] - path[0, 0] == pytest.approx(0.23, abs=1e-12)


@pytest.mark.parametrize("gait", [gaits.pace, gaits.bound, gaits.hop, gaits.turn])
def test_the_distance_of_other_gaits(gait):
    sim = Simulator(models.quadruped(), time_step=0.02)
    made = gait(sim, distance=0.1, cycles=1, **({"heading_rate": 0.0} if gait is gaits.turn else {}))
    assert made.x[-1, 0] - made.x[0, 0] == pytest.approx(0.1, abs=1e-12)
    with pytest.raises(ValueError, match="expected one of them"):
        gait(sim, distance=0.1, speed=0.1)


def test_a_gait_that_turns_is_not_periodic():
    with pytest.raises(ValueError, match="ends as it began, apart from its place"):
        problems.turn(periodic=True)


def test_substeps_take_the_gait_at_the_time_step_of_the_simulator():
    problem = problems.trot(substeps=5, cycles=1)
    assert problem.horizon == 20 and problem.sim.time_step == 0.01
    assert ilqr(problem).success
    gait = gaits.stand(Simulator(models.quadruped(), time_step=0.02), duration=0.1)
    with pytest.raises(ValueError, match="5 time steps are not a multiple of 2"):
        problems.follow(gait, substeps=2)
    with pytest.raises(ValueError, match="'flying' is not one of"):
        problems.follow(gait, guess="flying")


def test_figure_of_a_gait_shows_its_contacts():
    plan = ilqr(problems.trot(damping=5.0, cycles=1))
    figure = plots.gait(plan)
    diagram, forces, paths, friction = figure.axes
    m = motion(plan)
    filled = sum(path.get_extents().width for bars in diagram.collections for path in bars.get_paths())
    loaded = (m.normal_force > 0.02 * m.normal_force.max()).sum() * problems.trot().knot_time
    assert filled == pytest.approx(loaded, rel=1e-9)
    assert [label.get_text() for label in diagram.get_yticklabels()] == list(m.mechanism.contact_names)
    np.testing.assert_allclose(forces.patches[1].get_data().values, m.normal_force[:, 1])
    shares = np.array([line.get_ydata() for line in friction.lines[:4]])
    assert np.nanmax(shares) <= 1.0 + 1e-3 and np.nanmin(shares) >= 0.0
    lowest = min(line.get_ydata().min() for line in paths.lines)
    assert lowest == pytest.approx(0.0, abs=2e-3)
