"""The tasks of Jin: their trials are those of the publication, and fingertips bring an object to its goal."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.plant.closed_loop import closed_loop
from dojo_opt.tasks.idto.assembly import from_com
from dojo_opt.tasks.jin import allegro, palm_up, trifinger
from dojo_opt.tasks.jin.allegro import trial_of as allegro_trial
from dojo_opt.tasks.jin.fingertips import mechanism, trial_of
from dojo_opt.tasks.jin.fitted_ellipsoid import fitted_ellipsoid
from dojo_opt.tasks.jin.grasp import grasp, place_of_ball
from dojo_opt.tasks.jin.palm_objects import OBJECTS
from dojo_opt.tasks.jin.placing import Placing
from dojo_opt.tasks.jin.trifinger import mechanism as trifinger_mechanism
from dojo_opt.tasks.jin.trifinger import place_of_tip
from dojo_opt.tasks.jin.trifinger import trial_of as trifinger_trial
from sim.mechanism.shapes import rotation_matrix

# starts (x, y, yaw) and goals of the publication, drawn by its own code
GIVEN = [
    ("cube", "in-air", 0, (0.00217024709, -0.01108153075, -0.2349187542), (-0.09905622876, -0.07568617584, 0.09223880662)),
    ("cube", "rotation", 0, (0.00217024709, -0.01108153075, -0.2349187542), (0.06895522646, -0.09905622876, 0.03)),
    ("foam brick", "in-air", 1, (0.0008199313851, 0.003533379343, -0.9960016207), (0.03705539634, 0.06677937253, 0.04857608281)),
    ("stick", "flip", 1, (0.0008199313851, 0.003533379343, -0.9960016207), (-0.06569566875, 0.03705539634, 0.015)),
]  # fmt: skip
TURNS = {
    ("cube", "in-air", 0): (0.8595417078, -0.007920421717, 0.3486898099, 0.3735515171),
    ("cube", "rotation", 0): (0.3727034302, 0.0, 0.0, -0.9279505122),
    ("cube", "flip", 0): (0.192874106, 0.3904174859, -0.3521392237, -0.8284755477),
    ("stick", "flip", 0): (0.3593778894, 0.09876932455, -0.2459141448, -0.8947728128),
}


@pytest.mark.parametrize(("item", "motion", "number", "start", "goal"), GIVEN)
def test_places_of_trials_are_those_of_the_publication(item, motion, number, start, goal):
    trial = trial_of(item, motion, number)
    np.testing.assert_allclose(trial.start[[0, 1, 6]], start, atol=1e-9)
    np.testing.assert_allclose(trial.goal[:3], goal, atol=1e-9)


@pytest.mark.parametrize(("case", "quaternion"), TURNS.items())
def test_turns_of_trials_are_those_of_the_publication(case, quaternion):
    np.testing.assert_allclose(trial_of(*case).goal[3:], quaternion, atol=1e-9)


def test_unknown_trials_are_refused():
    with pytest.raises(ValueError, match="from 0 to 19"):
        dojo.tasks.jin.fingertips(trial=20)
    with pytest.raises(ValueError, match="flip"):
        dojo.tasks.jin.fingertips("stick", "in-air")
    with pytest.raises(ValueError, match="foam brick"):
        dojo.tasks.jin.fingertips("foam brik")


@pytest.mark.parametrize("item", ["cube", "foam brick", "stick"])
def test_an_object_rests_on_the_table(item):
    """Put down at the height of its trials it lies still, and the tips do not fall."""
    sim = dojo.Simulator(mechanism(item), time_step=2e-3, kappa=1e-8)
    start = sim.neutral()
    start[:7] = trial_of(item, "flip", 0).start
    x = sim.rollout(start, np.zeros((500, 9))).x[-1]
    lowest = {"cube": 0.03, "foam brick": 0.0258, "stick": 0.015}[item]
    assert x[2] == pytest.approx(lowest, abs=3e-4)  # kappa over the impulse of a weight of .1 N is .2 mm
    assert np.all(x[[9, 12, 15]] >= 0.01)
    assert np.abs(x[sim.nq :][:3]).max() < 1e-2


def test_an_object_is_placed_after_twenty_periods():
    """Leaving the goal begins the count anew, and so does a new run."""
    goal = np.array([0.0, 0.0, 0.03, 1.0, 0.0, 0.0, 0.0])
    placing = Placing(slice(0, 7), goal, 0.02, 0.015, 0.02)
    there, away = goal.copy(), goal + (0.03, 0, 0, 0, 0, 0, 0)
    turned = np.array([0.0, 0.0, 0.03, np.cos(0.15), 0.0, 0.0, np.sin(0.15)])  # .3 rad, of which .25 are allowed
    assert placing.error(turned).turn == pytest.approx(np.sin(0.15) ** 2)
    assert not placing.near(turned)
    assert placing.near(-goal * (-1, -1, -1, 1, 1, 1, 1))  # the same turn by the other quaternion
    assert not any(placing.finished(0.02 * k, there) for k in range(20))
    assert placing.finished(0.4, there)
    assert not placing.finished(0.42, away)
    assert not any(placing.finished(0.44 + 0.02 * k, there) for k in range(20))
    assert not placing.finished(0.02, there)  # of a new run
    assert placing.finished(0.42, there)


def test_a_loop_ends_when_its_aim_is_achieved():
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01)
    plant = dojo.Plant(sim, [0.3, 0.0])
    loop = closed_loop(lambda t, x: [0.0], plant, 1.0, finished=lambda t, x: t > 0.255)
    assert loop.survived
    assert loop.message == "Achieved its aim at 0.260 s."
    assert len(loop.x) == 27


def test_trials_of_the_trifinger_are_those_of_the_publication():
    first, second = (trifinger_trial("cube", k) for k in (0, 1))
    np.testing.assert_allclose(
        first.start, [0.004340494179, -0.02216306149, 0.03, 0.9929791059, 0, 0, 0.1182898778], atol=1e-9
    )
    np.testing.assert_allclose(
        first.goal, [0.03447761323, -0.04952811438, 0.03, 0.8284634664, 0, 0, -0.5600431099], atol=1e-9
    )
    np.testing.assert_allclose(second.goal[[0, 6]], [-0.03284783438, 0.5007664008], atol=1e-9)


def test_tips_of_the_trifinger_are_where_its_links_end():
    """The formula in the cost against the simulator's kinematics, and its derivatives against central differences."""
    sim = dojo.Simulator(trifinger_mechanism("cube"), time_step=2e-3)
    random = np.random.default_rng(3)
    x = sim.neutral()
    x[7:16] += random.uniform(-0.8, 0.8, 9)
    ends = [c.point for c in sim.mechanism.contacts[8:]]
    bodies = sim.maximal(x)
    for k in range(3):
        at = np.array(place_of_tip(x, k))
        lower = bodies[3 + 3 * k]
        w, r = lower[6], lower[7:10]
        end = lower[:3] + np.asarray(ends[k]) + 2.0 * np.cross(r, np.cross(r, ends[k]) + w * np.asarray(ends[k]))
        np.testing.assert_allclose(at[:3], end, atol=1e-12)
        for j in range(3):
            sides = []
            for step in (1e-6, -1e-6):
                moved = x.copy()
                moved[7 + 3 * k + j] += step
                sides.append(np.array(place_of_tip(moved, k))[:3])
            np.testing.assert_allclose(at[3 + j :: 3], (sides[0] - sides[1]) / 2e-6, atol=1e-8)


@pytest.mark.parametrize(
    ("item", "start", "goal"),
    [
        (
            "cube",
            (-0.03874882737, -0.008286597983, 0.04, 0.9929791059, -0.1182898778),
            (0.05, 0.6184986846, -0.7857858341),
        ),
        (
            "can",
            (-0.02874882737, 0.001713402017, 0.04, 0.9929791059, -0.1182898778),
            (0.06, 0.7857858341, 0.6184986846),
        ),
        (
            "torus",
            (-0.02874882737, 0.001713402017, 0.04, 0.9929791059, -0.1182898778),
            (0.04, 0.7857858341, 0.6184986846),
        ),
        (
            "stick",
            (-0.01874882737, 0.001713402017, 0.03, 0.7477599474, 0.6639691718),
            (0.03, 0.9982432334, -0.05924902562),
        ),
    ],
)
def test_trials_of_the_hand_are_those_of_the_publication(item, start, goal):
    trial = allegro_trial(item, 0)
    np.testing.assert_allclose(trial.start[[0, 1, 2, 3, 6]], start, atol=1e-9)
    sign = np.sign(trial.goal[3] * goal[1])
    np.testing.assert_allclose(trial.goal[[2, 3, 6]] * (1.0, sign, sign), goal, atol=1e-9)


def test_tips_of_the_hand_are_where_its_links_end():
    """The formula in the cost against the simulator's kinematics; its derivatives are those of the grasp, below."""
    sim = dojo.Simulator(palm_up.mechanism("cube", OBJECTS["cube"]), time_step=2e-3)
    kin, x = dojo.Kinematics(sim), sim.neutral()
    x[7:23] = np.random.default_rng(3).uniform(-0.4, 1.2, 16)
    for k, name in enumerate(("first", "middle", "ring", "thumb")):
        end = from_com(palm_up.links(), f"{name}_3", (0.0, 0.0, 0.054 if name == "thumb" else 0.0384))
        place, turn = kin.pose(f"{name}_3", x[: sim.nq])[:2]
        np.testing.assert_allclose(palm_up.place_of_tip(x, k)[:3], place + turn @ end, atol=1e-12)


def test_a_hull_takes_the_place_of_an_object_in_the_plant():
    """Its points are in the frame of the mesh, whose centre of mass is the origin of the body; plans keep theirs."""
    points = [[x, y, z] for x in (-0.02, 0.03) for y in (-0.02, 0.02) for z in (0.0, 0.05)]
    task, com = allegro("cup", trial=0, hull=points), np.asarray(OBJECTS["cup"].com)
    shape = task.model.mechanism.collisions[0].shape_a
    np.testing.assert_allclose(sorted(shape.vertices), sorted((np.asarray(points) - com).tolist()), atol=1e-12)
    given = allegro_trial("cup", 0).start
    np.testing.assert_allclose(task.start[:3], given[:3] + rotation_matrix(given[3:]) @ com, atol=1e-9)
    assert task.mpc.nominal.mechanism.collisions[0].shape_a == OBJECTS["cup"].shape
    with pytest.raises(ValueError, match="hull"):
        allegro("cup", hull=[[0.0, 0.0]])


def test_plans_see_the_ellipsoid_nearest_to_a_hull():
    """That on which its points lie, wherever it is and however turned, if they lie on one; not that of its size."""
    sphere = np.random.default_rng(5).normal(size=(600, 3))
    sphere /= np.linalg.norm(sphere, axis=1)[:, None]
    axes, middle, turned = np.array([0.05, 0.03, 0.02]), np.array([0.01, -0.02, 0.005]), (0.9, 0.3, 0.1, 0.2)
    turn = rotation_matrix(turned / np.linalg.norm(turned))
    found = fitted_ellipsoid(middle + (sphere * axes) @ turn.T)
    np.testing.assert_allclose([found.x, found.y, found.z], axes, rtol=0.03)
    np.testing.assert_allclose(found.center, middle, atol=5e-4)
    np.testing.assert_allclose(np.abs(rotation_matrix(found.orientation).T @ turn), np.eye(3), atol=0.05)
    cross = np.concatenate([np.diag([0.05, 0.05, 0.01]), -np.diag([0.05, 0.05, 0.01])])  # slender beside its middle
    seen = allegro("airplane", hull=cross).mpc.nominal.mechanism.collisions[0].shape_a
    assert seen.x < 0.045 and seen.y < 0.045 and OBJECTS["airplane"].simple.y > 0.055


def test_plans_see_a_bowl_on_the_palm_as_the_hull_of_few_of_its_corners():
    """An ellipsoid rolls back where a bowl lies still on its side; fingers touch the ellipsoid."""
    around = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    circles = [(0.044, 0.02), (0.02, -0.02)]
    rows = [[r * np.cos(a), r * np.sin(a), z] for r, z in circles for a in around]
    thing = OBJECTS["bowl"].hulled(rows)
    shapes = {c.name: c.shape_a for c in palm_up.mechanism("bowl", thing, planned=True).collisions}
    palm = np.asarray(shapes.pop("palm").vertices)
    assert len(palm) == 12 and set(shapes.values()) == {thing.simple}
    np.testing.assert_allclose(np.ptp(palm[:, 2]), 0.04, atol=1e-12)  # it stands as high
    own = {c.name: c.shape_a for c in palm_up.mechanism("bowl", thing).collisions}
    assert set(own.values()) == {thing.shape} and own.keys() == shapes.keys() | {"palm"}


@pytest.mark.slow
def test_a_hand_turns_a_cube():
    """By three quarters of a quarter turn on its palm, within .9 s; it stays there for 2 s in the benchmark."""
    task = allegro("cube", trial=3)
    outcome = task.outcome(task.run(seconds=0.9))
    assert outcome.measures["angle off [deg]"] < 23.1 and outcome.measures["off [mm]"] < 20.0
    assert outcome.penetration < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize(
    ("made", "tips", "joints", "place"),
    [
        (mechanism, 3, 3, place_of_ball),
        (trifinger_mechanism, 3, 3, place_of_tip),
        (lambda item: palm_up.mechanism(item, OBJECTS[item]), 4, 4, palm_up.place_of_tip),
    ],
)
def test_the_slope_of_a_grasp_is_that_of_its_residual(made, tips, joints, place):
    sim = dojo.Simulator(made("cube"), time_step=2e-3)
    cost = grasp(tips, joints, place, 1.0, 0.05, 5)
    x = sim.integrate(sim.neutral(), np.random.default_rng(1).uniform(-0.05, 0.05, sim.ndx))
    u, rows = np.zeros(sim.nu), 3 * tips + 3
    out, slope = np.zeros(rows), np.zeros((rows, sim.ndx + sim.nu))
    cost.jacobian(x, u, slope)
    for j in range(sim.ndx):
        sides = []
        for step in (1e-6, -1e-6):
            dx = np.zeros(sim.ndx)
            dx[j] = step
            cost.function(sim.integrate(x, dx), u, out)
            sides.append(out.copy())
        np.testing.assert_allclose(slope[:, j], (sides[0] - sides[1]) / 2e-6, atol=1e-6)


@pytest.mark.slow
def test_three_fingers_move_a_cube():
    """Over 36 mm, and by 25 degrees, within 3 s."""
    task = trifinger("cube", trial=1)
    outcome = task.outcome(task.run(seconds=3.0))
    assert outcome.success
    assert outcome.penetration < 1e-4
    assert outcome.measures["off [mm]"] < 20.0


@pytest.mark.slow
def test_fingertips_turn_a_cube_on_the_table():
    """By 70 degrees, and over 75 mm, within 5 s."""
    task = dojo.tasks.jin.fingertips("cube", "rotation", trial=1)
    loop = task.run(seconds=5.0)
    outcome = task.outcome(loop)
    assert outcome.success, loop.message
    assert outcome.penetration < 1e-4
    assert outcome.measures["angle off [deg]"] < 14.1
    assert outcome.measures["off [mm]"] < 20.0


@pytest.mark.slow
def test_fingertips_lift_a_cube():
    task = dojo.tasks.jin.fingertips("cube", "in-air", trial=1)
    loop = task.run(seconds=2.0)
    assert loop.survived
    assert loop.x[:, 2].max() > 0.04
