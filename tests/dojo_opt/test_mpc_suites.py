"""Tasks of published suites, and the features of MPC that they use: servos, targets that go along, plans that come late."""

import json
from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.__main__ import main
from dojo_opt.cost import Effort, Tracking
from dojo_opt.mpc.moving_reference import AnchoredReference
from dojo_opt.mpc.servo import ModelServo, Servo
from dojo_opt.planning.iterate import Iteration
from dojo_opt.tasks.free_gait import Lead
from dojo_opt.tasks.idto.allegro_ball import squeezing
from dojo_opt.tasks.idto.mini_cheetah import with_cylinders
from dojo_opt.tasks.jin import palm_up
from dojo_opt.tasks.jin.palm_objects import OBJECTS
from dojo_opt.tasks.suite import servo_effort
from sim.mechanism.overlaps import overlaps
from solvers.status import Status


def arm(spring=0.0, damper=0.1):
    """A link of 1 kg and 1 m on a hinge, driven."""
    body = dojo.Body("link", 1.0, np.diag([0.1, 0.1, 0.01]))
    joint = dojo.Joint("revolute", None, "link", child_point=(0, 0, 0.5), axis=(0, 1, 0), spring=spring, damper=damper)
    return dojo.Mechanism([body], [joint], inputs=[dojo.Input("link")], name="arm")


def reaching(sim, **settings):
    goal = np.array([1.0, 0.0])
    u = 9.81 * 0.5 * np.sin(1.0) + sim.mechanism.joints[0].spring[0]
    problem = dojo.Problem(sim, [0.0, 0.0], 20, cost=[Tracking(goal, [10.0, 0.1]), Effort(1e-3, u)])
    return dojo.MPC(problem, **settings)


@pytest.mark.slow
def test_the_spinner_starts_to_turn():
    """Within 1.5 s, by contact alone."""
    task = dojo.tasks.idto.spinner()
    loop = task.run(seconds=1.5)
    assert loop.survived
    assert loop.x[-1, 2] > 0.5
    outcome = task.outcome(loop)
    assert outcome.penetration < 1e-4
    assert set(outcome.measures) == {"mean speed [rad/s]"} and not outcome.success
    assert replace(task, duration=1.5).outcome(loop).success == (0.8 < outcome.measures["mean speed [rad/s]"] < 1.2)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [None, 1, 5])
def test_an_arm_rolls_a_ball(seed):
    """Towards the goal within 1 s, the stub of the arm on it, also from starts that the last bit could turn to rest."""
    task = dojo.tasks.idto.jaco_ball()
    loop = task.run(seed=seed, seconds=1.0)
    assert loop.survived
    assert loop.x[-1, 8] < 0.22  # of .27
    assert loop.contacts.gap[-1].min() > -1e-5
    assert np.abs(loop.x[-1, 22]) > 0.05


@pytest.mark.slow
@pytest.mark.parametrize(("name", "seed", "seconds", "least"), [("jaco", None, 1.3, 45.0), ("dual_jaco", 1, 1.5, 30.0)])
def test_arms_turn_a_box(name, seed, seconds, least):
    """About x, which is towards the goal: one arm tips it over its edge, two tilt it between their stubs."""
    task = getattr(dojo.tasks.idto, name)()
    loop = task.run(seed, seconds=seconds)
    assert loop.survived
    w, x, *rest = loop.x[-1, task.model.nu + 3 : task.model.nu + 7]
    assert np.degrees(2.0 * np.arctan2(x, w)) > least
    assert np.linalg.norm(rest) < 0.1
    outcome = task.outcome(loop)
    assert outcome.penetration < 1e-4
    assert set(outcome.measures) == {"at the goal [s]", "angle off [deg]", "off [mm]"}


@pytest.mark.slow
def test_a_puck_is_pushed_towards_its_goal():
    """Over a gap of .3 m, which no contact reaches at first; its heading is hardly changed by the rim's friction."""
    task = dojo.tasks.idto.air_hockey()
    loop = task.run(seed=2, seconds=2.0)
    assert loop.survived
    outcome = task.outcome(loop)
    assert outcome.measures["off [mm]"] < 300.0  # of 583
    assert outcome.penetration < 1e-4


def test_two_arms_lift_a_ball():
    """In the first plan, by the friction of both, at less than half of the cost of its guess."""
    task = dojo.tasks.idto.punyo()
    problem, options = task.mpc.problem, task.mpc.settings.first
    assert not overlaps(task.model.mechanism, task.start[: task.model.nq])
    plan = dojo.ilqr(problem, options=options)
    assert plan.success and plan.x[-1, 16] > 0.7
    assert plan.fun < 0.5 * problem.cost(problem.sim.rollout(problem.start, problem.controls0).x, problem.controls0)


def test_plans_of_the_hand_know_the_friction_of_the_palm():
    """With more than it has, the ball slides off the palm within a second."""
    task = dojo.tasks.idto.allegro()
    palms = [
        next(c.friction for c in sim.mechanism.collisions if c.name == "palm") for sim in (task.mpc.sim, task.model)
    ]
    assert palms == [0.18, 0.18]


@pytest.mark.slow
def test_a_hand_turns_a_ball_below_its_palm():
    """Gravity pulls the ball to the fingertips, and a hand that stays as it starts drops it."""
    task = dojo.tasks.idto.allegro_upside_down()
    assert task.model.mechanism.gravity[2] > 0.0
    loose = dojo.closed_loop(lambda time, x: np.zeros(16), task.plant(), 0.4, fallen=task.lost)
    assert not loose.survived
    loop = task.run(seconds=1.0)
    assert loop.survived
    outcome = task.outcome(loop)
    assert outcome.measures["angle off [deg]"] < 70.0  # of 90
    assert outcome.penetration < 1e-4


def test_squeezing_torques_are_those_of_a_force_on_the_ball():
    """Their power is that of 2 N along the gaps that the simulator sees, which shrink by it; abduction included."""
    task = dojo.tasks.idto.allegro_upside_down()
    sim, q = task.model.replace(time_step=1e-6), task.start[:23]
    torques, step = squeezing(sim.mechanism, q, 2.0), 1e-5

    def gap(x):
        return sim.step(x).contacts.gap.ravel()

    for first in range(0, 16, 4):
        moved = task.start.copy()
        moved[first : first + 4] += step * torques[first : first + 4]
        before, after = gap(task.start), gap(moved)
        power = -np.sum(torques[first : first + 4] ** 2)
        nearest = np.flatnonzero(np.abs(before - after) > 1e-10)
        nearest = nearest[np.argmin(before[nearest])]  # of this finger: those of the others do not move
        assert 2.0 * (after - before)[nearest] / step == pytest.approx(power, rel=1e-3)


@pytest.mark.slow
def test_a_quadruped_finds_its_gait():
    """From a velocity and one pose: it is half a metre on after 2.5 s, and has lifted every foot."""
    task = dojo.tasks.idto.mini_cheetah()
    loop = task.run(seed=3, seconds=2.5)
    assert loop.survived
    assert loop.x[-1, 0] - loop.x[0, 0] > 0.5
    assert np.all(loop.contacts.gap[:, :4].max(axis=0) > 5e-3)
    assert task.outcome(loop).measures["tilt [rad]"] < 0.3


@pytest.mark.slow
def test_the_hopper_hops_to_its_goal():
    """It has to leave the ground: one that only leans forward ends .3 m short, and far from its pitch."""
    task = dojo.tasks.idto.hopper()
    loop = task.run(seed=40)
    outcome = task.outcome(loop)
    assert outcome.success, outcome
    assert outcome.penetration < 1e-4
    flights = loop.contacts.gap.min(axis=1) > 5e-3
    assert flights.sum() > 100  # of 5,000 steps of 1 ms


def test_a_lead_moves_on_and_waits():
    """At its velocity in its own axes, and no further from the robot than allowed; a new run begins anew."""
    pose = dojo.Simulator(dojo.models.quadruped(), time_step=0.025).neutral()
    lead = Lead(pose, (0.4, 0.1, 0.5), 0.3)
    lead.anchor(0.0, pose)
    lead.anchor(0.5, pose)
    np.testing.assert_allclose(lead([0.5, 0.7])[:, :2], [[0.2, 0.05]] * 2)
    assert 2.0 * np.arctan2(*lead([0.5])[0, [6, 3]]) == pytest.approx(0.25)
    lead.anchor(10.0, pose)
    assert np.hypot(*lead([10.0])[0, :2]) == pytest.approx(0.3)
    moved = pose.copy()
    moved[:2] = 1.0, 2.0
    lead.anchor(0.0, moved)
    np.testing.assert_allclose(lead([0.0])[0, :3], moved[:3])
    with pytest.raises(ValueError, match="12 driven joints"):
        dojo.tasks.free_gait_mpc(robot=dojo.models.raiberthopper())


def test_a_start_is_perturbed_and_lifted_out_of_the_ground():
    task = dojo.tasks.idto.hopper()
    given, other, same = (task.initial_state(seed) for seed in (None, 3, 3))
    assert np.array_equal(other, same)
    assert not np.array_equal(given, other)
    sim = task.model
    for x in (given, other):
        gaps = [c.gap(sim.maximal(x)[2, :3] + turned(sim.maximal(x)[2, 6:10], c.point)) for c in sim.mechanism.contacts]
        assert 0.0 <= min(gaps) < 1e-5


@pytest.mark.slow
def test_a_perturbed_start_does_not_overlap():
    """The hand holds its ball within millimetres: a change drawn without regard to it would throw the ball away."""
    task = dojo.tasks.idto.allegro()
    sim = task.model
    inside = 0
    for seed in range(2):
        dx = task.spread * np.random.default_rng(seed).uniform(-1.0, 1.0, task.spread.size)
        inside += bool(overlaps(sim.mechanism, sim.integrate(task.start, dx)[: sim.nq]))
        assert overlaps(sim.mechanism, task.initial_state(seed)[: sim.nq]) == ()
    assert inside == 2
    with pytest.raises(ValueError, match="shapes overlap in each"):
        replace(task, start=task.start - 0.02 * np.eye(sim.nx)[18], spread=1e-9 * task.spread).initial_state(0)


def test_overlaps_are_those_of_the_shapes():
    """Ball on box, ball on a half-space, and a string, beside distances by hand."""
    ball = dojo.Body("ball", 1.0, 0.1 * np.eye(3), shape=dojo.Sphere(0.5))
    walls = {
        "box": dojo.Box(2.0, 2.0, 1.0, center=(0.0, 0.0, -0.5)),
        "floor": dojo.HalfSpace(center=(0.0, 0.0, -0.1)),
    }
    collisions = [dojo.Collision("ball", None, shape_b=shape, name=name) for name, shape in walls.items()]
    ends = {"shape_a": dojo.String(0.55), "shape_b": dojo.String(0.55)}
    collisions.append(dojo.Collision("ball", None, name="string", **ends))
    mechanism = dojo.Mechanism([ball], [dojo.Joint("floating", None, "ball")], [], [], collisions=collisions)
    for height, wanted in ((0.53, ()), (0.49, ("box",)), (0.39, ("box", "floor")), (0.6, ("string",))):
        assert overlaps(mechanism, [0.0, 0.0, height, 1.0, 0.0, 0.0, 0.0]) == wanted


def test_a_rejected_step_does_not_make_a_plan_that_has_fallen(monkeypatch):
    """When no step is accepted, the solver hands back a rollout: far worse than the shifted plan, it is not taken."""
    sim = dojo.Simulator(arm(), time_step=0.05, kappa=1e-4)
    for factor, taken in ((100.0, False), (2.0, True)):
        mpc = reaching(sim)
        mpc(0.0, [0.0, 0.0])
        solver, first = mpc._solver, mpc.policy

        def iterate(guess, K, factor=factor, solver=solver, **_):
            far = solver.rollout(guess, K)._replace(merit=factor * guess.merit)
            return Iteration(Status.SOLVED, "", far, K, np.zeros((20, 1)), [{"alpha": 0.0}])

        monkeypatch.setattr(solver, "iterate", iterate)
        monkeypatch.setattr(mpc, "_rolled", lambda guess, K: None)
        mpc(0.05, mpc.policy.state(0.05))
        assert (mpc.policy is not first) == taken
        assert mpc.log[-1].fallback != taken


def test_mujoco_has_the_same_hills():
    """A ray from above meets MuJoCo's height field where the terrain is; a foot that falls on a hill rests there."""
    mujoco = pytest.importorskip("mujoco")
    from benchmarks.engines.mujoco_plant import MujocoPlant

    task = dojo.tasks.idto.mini_cheetah_hills(count=2)
    terrain = task.model.mechanism.contacts[0].terrain
    plant = MujocoPlant(task.model, task.initial_state())
    hit = np.zeros(1, np.int32)
    for x in (1.0, 1.7, 2.0, 2.25, 2.5, 3.1, 3.6):
        far = mujoco.mj_ray(plant._model, plant._data, np.array([x, 0.3, 1.0]), -np.eye(3)[2], None, 1, -1, hit)
        assert 1.0 - far == pytest.approx(float(terrain.height(x, 0.3)), abs=1e-6)
    ball = dojo.Body("ball", 1.0, 0.01 * np.eye(3))
    contacts = [dojo.Contact("ball", radius=0.1, terrain=terrain)]
    falling = dojo.Mechanism([ball], [dojo.Joint("floating", None, "ball")], contacts, [])
    sim = dojo.Simulator(falling, time_step=1e-3, kappa=1e-8)
    start = sim.neutral()
    start[:3] = 2.0, 0.0, 0.2
    plant = MujocoPlant(sim, start)
    for _ in range(500):
        _, result = plant.step(np.zeros(0))
    assert plant.x[2] == pytest.approx(0.15, abs=5e-3)
    assert -5e-3 < result.contacts.gap[0] < 0.0
    with pytest.raises(ValueError, match="rises from level ground"):
        MujocoPlant(dojo.Simulator(falling.with_terrain(dojo.Terrain.steps([0.1], 0.3)), time_step=1e-3), start)


def test_hills_as_cylinders_are_where_the_terrain_is():
    """The lowest gap of every foot above them, level ground and hills alike."""
    task = dojo.tasks.idto.mini_cheetah_hills()
    solid = task.model.replace(mechanism=with_cylinders(task.model.mechanism))
    for x in (1.2, 1.8, 2.1, 2.55, 4.0, 6.0):
        state = task.start.copy()
        state[[0, 2]] = x, 0.36
        rough = task.model.step(state).contacts.gap.ravel()[:4]
        gaps = solid.step(state).contacts.gap.ravel()
        names = [candidate.collision for candidate in solid.mechanism.contact_candidates]
        feet = [contact.name for contact in solid.mechanism.contacts]
        hills = np.array([min(g for g, n in zip(gaps[4:], names, strict=True) if n.startswith(foot)) for foot in feet])
        np.testing.assert_allclose(np.minimum(gaps[:4], hills), rough, atol=1e-3)
        assert (hills < gaps[:4]).any() == (x > 1.5)  # the first hill begins at 1.69


def turned(quaternion, vector):
    w, r = quaternion[0], quaternion[1:]
    return vector + 2.0 * np.cross(r, np.cross(r, vector) + w * np.asarray(vector))


def test_servos_follow_a_plan_that_does_not_know_them():
    """u = u_plan + kp (q_plan - q) + kd (v_plan - v), at every call; without feedforward the rest of it."""
    sim = dojo.Simulator(arm(), time_step=0.05, kappa=1e-4)
    full, bare = reaching(sim, servo=(30.0, 3.0)), reaching(sim, servo=(30.0, 3.0), feedforward=False)
    x = np.array([0.1, 0.7])
    for mpc in (full, bare):
        mpc(0.0, [0.0, 0.0])
    plan = full.policy
    wanted = 30.0 * (plan.state(0.02)[0] - 0.1) + 3.0 * (plan.state(0.045)[1] - 0.7)
    assert bare(0.02, x)[0] == pytest.approx(wanted, abs=1e-9)
    assert full(0.02, x)[0] == pytest.approx(wanted + plan.control(0.02)[0], abs=1e-9)
    now = 30.0 * (plan.state(0.02)[0] - 0.1) + 3.0 * (plan.state(0.02)[1] - 0.7)  # of a model with velocities at nodes
    assert Servo(sim.replace(order=4), (30.0, 3.0))(plan, 0.02, x)[0] == pytest.approx(now, abs=1e-9)


def test_servos_of_the_model_are_the_forces_of_its_springs():
    """A plant without springs, driven by them, moves as one that has them."""
    model, plain = (dojo.Simulator(arm(*gains), time_step=1e-3) for gains in ((40.0, 4.0), (0.0, 0.0)))
    servo = ModelServo(model, plain.mechanism)
    x = y = np.zeros(2)
    for _ in range(1000):
        u = np.array([40.0])  # a target of 1 rad
        x, y = model.step(x, u).x, plain.step(y, servo(u, y)).x
    assert x[0] == pytest.approx(y[0], abs=2e-3)
    assert abs(x[0] - 1.0) < 0.15  # gravity pulls at it
    mpc = reaching(model.replace(time_step=0.05), servo=plain.mechanism, gain_scale=0.0)
    force = mpc(0.0, [0.2, 0.5])[0]
    assert force == pytest.approx(mpc.policy.control(0.0)[0] - 40.0 * 0.2 - 4.0 * 0.5)


@pytest.mark.slow
def test_the_effort_of_servos_has_the_right_derivatives():
    sim = dojo.Simulator(arm(40.0, 4.0), time_step=0.05)
    problem = dojo.Problem(sim, [0.0, 0.0], 3, cost=[servo_effort(sim, arm(damper=0.0), 0.5, 3)])
    xs, us = np.random.default_rng(0).normal(size=(4, 2)), np.random.default_rng(1).normal(size=(3, 1))
    force = us[:, 0] - 40.0 * xs[:3, 0] - 4.0 * xs[:3, 1]
    assert problem.cost(xs, us) == pytest.approx(0.5 * np.sum(force**2))
    g, H = np.zeros((4, 3)), np.zeros((4, 3, 3))
    problem.costs[0].expand(xs, us, g, H)
    slope = np.array([-40.0, -4.0, 1.0])
    np.testing.assert_allclose(g[:3], force[:, None] * slope, rtol=1e-9)
    np.testing.assert_allclose(H[1], np.outer(slope, slope), rtol=1e-9)


def test_a_target_goes_along_with_the_robot():
    """The anchored coordinate begins where it is measured and never stops; the other one is where it was given."""
    sim = dojo.tasks.idto.spinner().mpc.sim
    begin = sim.neutral()
    end = begin.copy()
    end[1] += 0.4
    end[2] += 2.0
    target = AnchoredReference(sim, begin, end, 2.0, anchored=[2])
    x = begin.copy()
    x[:3] += 0.7
    target.anchor(10.0, x)
    rows = target([10.0, 11.0, 14.0])
    np.testing.assert_allclose(rows[:, 0], begin[0])
    np.testing.assert_allclose(rows[:, 1], begin[1] + np.array([0.0, 0.2, 0.4]))
    np.testing.assert_allclose(rows[:, 2], x[2] + np.array([0.0, 1.0, 4.0]))


def test_a_plan_that_takes_time_leaves_the_one_before_in_force():
    sim = dojo.Simulator(arm(), time_step=0.05, kappa=1e-4)
    mpc = reaching(sim, period=0.02, computation=0.02)
    mpc(0.0, [0.0, 0.0])
    first = mpc.policy
    mpc(0.02, [0.3, 0.0])  # a plan begins, from where the first one leads
    assert mpc.policy is first
    mpc(0.03, [0.3, 0.0])
    assert mpc.policy is first
    mpc(0.04, [0.3, 0.1])
    assert mpc.policy is not first
    assert mpc.policy.time == pytest.approx(0.04)
    assert len(mpc.log) == 3
    with pytest.raises(ValueError, match="expected at most the period between plans"):
        reaching(sim, period=0.02, computation=0.03)
    with pytest.raises(ValueError, match="give one of them"):
        reaching(sim, delay=0.01, computation=0.01)
    with pytest.raises(ValueError, match="nothing would drive"):
        reaching(sim, feedforward=False)
    with pytest.raises(ValueError, match="has not"):
        reaching(dojo.Simulator(arm(damper=0.0), time_step=0.05), servo=arm(damper=0.0))


def test_a_compensated_body_floats():
    """Beside one that falls; with half of its weight taken off, it falls half as fast. Energy and statics agree."""
    bodies = [
        dojo.Body(name, 2.0, np.eye(3), gravity_compensation=c) for name, c in (("a", 0.0), ("b", 0.5), ("c", 1.0))
    ]
    mechanism = dojo.Mechanism(bodies, [dojo.Joint("floating", None, name) for name in "abc"], inputs=[])
    sim = dojo.Simulator(mechanism, time_step=0.01)
    motion = sim.rollout(sim.neutral(), steps=100)
    z = motion.x[-1, [2, 9, 16]]
    np.testing.assert_allclose(z / z[0], [1.0, 0.5, 0.0], atol=1e-12)
    assert z[0] == pytest.approx(-0.5 * 9.81, rel=0.02)
    assert np.ptp(sim.energy(sim.state_from_velocity(sim.neutral()[: sim.nq], np.zeros(sim.nv)))) == 0.0
    torques = dojo.Kinematics(sim).gravity_torques(sim.neutral()[: sim.nq])
    np.testing.assert_allclose(torques[[2, 8, 14]], 9.81 * 2.0 * np.array([1.0, 0.5, 0.0]))


def test_the_step_of_a_compensated_arm_is_differentiated_by_mass_gravity_and_time_step():
    body = dojo.Body("link", 1.0, np.diag([0.1, 0.1, 0.01]), gravity_compensation=0.3)
    joint = dojo.Joint("revolute", None, "link", child_point=(0.0, 0.0, 0.5), axis=(0.0, 1.0, 0.0))
    sim = dojo.Simulator(dojo.Mechanism([body], [joint], gravity=(1.0, 0.0, -9.81)), time_step=0.02)
    x, u = np.array([0.7, 1.0]), np.array([0.3])
    for name, value in (("mass:link", 1.0), ("gravity[2]", -9.81), ("time_step", 0.02)):
        slope = sim.linearize(x, u, wrt=[name])[name]
        e = 1e-5
        ends = [sim.with_parameters({name: value + d}).step(x, u).x for d in (e, -e)]
        np.testing.assert_allclose(slope.ravel(), (ends[0] - ends[1]) / (2.0 * e), rtol=1e-5, atol=1e-7)


def test_a_run_of_another_robot_has_no_outcome_and_a_plant_its_own_seed():
    task, sim = dojo.tasks.idto.acrobot(), dojo.Simulator(arm(), time_step=0.01)
    loop = dojo.closed_loop(lambda t, x: [0.0], dojo.Plant(sim), 0.01)
    with pytest.raises(ValueError, match=r"expected a run of 'idto\.acrobot', with the coordinates of 'acrobot'"):
        task.outcome(loop)
    with pytest.raises(TypeError, match="expected a ClosedLoop"):
        task.outcome(sim)
    with pytest.raises(ValueError, match=r"SuiteTask\.run\(seed=\.\.\., plant=\.\.\.\): expected one"):
        task.run(1, plant=task.plant())


def test_a_task_runs_from_the_command_line(tmp_path, capsys):
    page = tmp_path / "spinner.html"
    command = ["run", "idto.spinner", "--set", "seed=1", "--seconds", "0.05", "--json", "--html", str(page)]
    assert main(command) == 1  # the disc does not turn yet
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["survived"] and not numbers["success"]
    assert numbers["ticks"] == 10 and numbers["rate_hz"] == 200.0
    assert page.stat().st_size > 1000
    assert main(["run", "idto.spiner"]) == 2
    assert "did you mean" in capsys.readouterr().err


def test_a_task_runs_on_the_plant_of_mujoco():
    """A finger pressed onto the disc turns it as far as here, and MuJoCo's soft contact lets it in, ours does not."""
    pytest.importorskip("mujoco")
    from benchmarks.engines.mujoco_plant import MujocoPlant

    task = dojo.tasks.idto.spinner()
    plants = [MujocoPlant(task.model, task.start), dojo.Plant(task.model, task.start)]
    theirs, ours = (dojo.closed_loop(lambda time, x: np.array([1.0, -2.0]), plant, 0.5) for plant in plants)
    np.testing.assert_allclose(theirs.x[100, :2], ours.x[100, :2], atol=1e-4)  # before they touch
    assert ours.x[-1, 2] < -0.2
    assert theirs.x[-1, 2] == pytest.approx(ours.x[-1, 2], rel=0.03)
    assert task.outcome(theirs).penetration > 1e-3
    assert task.outcome(ours).penetration < 1e-6
    with pytest.raises(ValueError, match="only the start"):
        plants[0].perturbed(dojo.Perturbation())


def test_mujoco_has_the_hull_of_a_polytope():
    """A torus 1 mm deep in the palm of a hand, which is level, and stands on an edge of its hull when it is turned."""
    pytest.importorskip("mujoco")
    from benchmarks.engines.mujoco_plant import MujocoPlant

    sim = dojo.Simulator(palm_up.mechanism("torus", OBJECTS["torus"]), time_step=2e-3)
    corners = np.asarray(OBJECTS["torus"].shape.vertices)
    for turn in ((1.0, 0.0, 0.0, 0.0), (0.8, 0.6, 0.0, 0.0)):
        start = np.zeros(sim.nx)
        start[3:7] = turn
        lowest = min(turned(np.asarray(turn), corner)[2] for corner in corners)
        start[2] = 0.0111 - lowest - 1e-3  # the palm is 11.1 mm above the middle of the hand
        start[0] = -0.01
        plant = MujocoPlant(sim, start)
        _, result = plant.step(np.zeros(sim.nu))
        assert result.contacts.gap.min() == pytest.approx(-1e-3, abs=1e-4)
