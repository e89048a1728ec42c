"""Plant and perturbation: pushes, payload, slope, friction, delay, noise, limits; closed loops."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dojo_opt as dojo
from dojo_opt.mpc.ground_estimate import Ground
from dojo_opt.mpc.policy import Policy
from dojo_opt.plant.perturbation import Perturbation, Push
from dojo_opt.plant.plant import Plant
from solvers.status import Status

HOPPER = dojo.Simulator(dojo.models.raiberthopper(), time_step=5e-3, kappa=1e-8)
BLOCK = dojo.Simulator(dojo.models.block(friction=0.5), time_step=5e-3, kappa=1e-8)


@cache
def still():
    """A closed loop of one step without forces."""
    return dojo.closed_loop(
        lambda t, x: np.zeros(3), Plant(HOPPER), 0.005, reference=lambda t: np.tile(HOPPER.neutral(), (len(t), 1))
    )


def gaps(sim, x):
    ground = Ground(sim)
    return ground.gaps(ground.points(x))


def high(sim):
    x = sim.neutral()
    x[2] += 5.0
    return x


def test_push_gives_its_impulse_whatever_the_steps():
    """Momentum at the node changes by the impulse, also when the push begins and ends between steps."""
    plant = Plant(HOPPER, high(HOPPER), pushes=[Push(0.0113, (1.0, -2.0, 0.5), duration=0.0171)])
    before = HOPPER.momentum(plant.x)[0]
    loop = dojo.closed_loop(lambda t, x: np.zeros(3), plant, 0.05, fallen=lambda x: False)
    change = HOPPER.momentum(loop.x[-1])[0] - before
    weight = 4.7 * 9.81 * 0.05
    np.testing.assert_allclose(change, [1.0, -2.0, 0.5 - weight], atol=1e-9)
    assert loop.u.shape == (10, 6)
    np.testing.assert_allclose(loop.u[:, 3:].sum(axis=0) * 5e-3, [1.0, -2.0, 0.5], atol=1e-12)


def test_payload_weighs_and_turns():
    body = Perturbation(payload=2.0, payload_inertia=(0.1, 0.2, 0.3), payload_body="foot").mechanism(HOPPER.mechanism)
    np.testing.assert_allclose([b.mass for b in body.bodies], [4.18, 2.52])
    added = np.asarray(body.bodies[1].inertia) - np.asarray(HOPPER.mechanism.bodies[1].inertia)
    np.testing.assert_allclose(added, np.diag([0.1, 0.2, 0.3]), atol=1e-12)
    assert HOPPER.mechanism.bodies[1].mass == 0.52


def test_friction_damping_and_inputs_of_the_plant():
    perturbation = Perturbation(friction=0.1, damping=3.0, pushes=[Push(0.0, (1, 0, 0)), Push(1.0, (0, 1, 0), "foot")])
    mech = perturbation.mechanism(HOPPER.mechanism)
    assert [c.friction for c in mech.contacts] == [0.1, 0.1]
    assert mech.joints[1].damper == (3 * 0.1,)
    assert mech.input_names[3:] == tuple(f"push {b} {a}" for b in ("body", "foot") for a in "xyz")


@pytest.mark.parametrize("heading", [0.0, 1.0, np.pi])
def test_block_on_a_slope_stays_or_slides_as_coulomb_says(heading):
    """It slides at angles above atan(friction), along the slope, at g (sin - mu cos)."""
    for angle, slides in ((0.4, False), (0.6, True)):
        plant = Plant(BLOCK, slope=angle, slope_heading=heading)
        loop = dojo.closed_loop(lambda t, x: np.zeros(BLOCK.nu), plant, 0.4, fallen=lambda x: False)
        moved = loop.x[-1, :3] - loop.x[0, :3]
        assert abs(plant.normal @ moved) < 1e-3
        expected = 0.5 * 9.81 * (np.sin(angle) - 0.5 * np.cos(angle)) * 0.4**2 if slides else 0.0
        downhill = -np.array([np.cos(heading) * np.cos(angle), np.sin(heading) * np.cos(angle), np.sin(angle)])
        np.testing.assert_allclose(moved @ downhill, expected, atol=5e-3)


def test_start_on_a_slope_touches_as_on_level_ground():
    sim = dojo.Simulator(dojo.models.quadruped(), time_step=5e-3, kappa=1e-8)
    plant = Plant(sim, slope=0.2, slope_heading=0.7, ground_height=0.3)
    flat = gaps(sim, sim.neutral())
    np.testing.assert_allclose(gaps(plant.simulator, plant.x), flat, atol=1e-12)


@pytest.mark.parametrize("about_z", [0.0, 1.2])
def test_obstacles_and_all_that_floats_move_with_the_ground(about_z):
    """Two balls roll on tilted obstacles as they do on level ones under gravity that is tilted the other way."""
    frame = (np.cos(0.5 * about_z), 0.0, 0.0, np.sin(0.5 * about_z))
    shelf = dojo.Box(2.0, 2.0, 0.4, center=(3.0, 0.0, 0.0))
    scene = dojo.Mechanism(
        [dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in "ab"],
        [dojo.Joint("floating", None, name, orientation=frame) for name in "ab"],
        collisions=[dojo.Collision("a", shape_b=dojo.HalfSpace()), dojo.Collision("b", shape_b=shelf)],
        scenery=[dojo.Visual(shelf)],
    )
    turn = Rotation.from_rotvec(0.3 * np.array([np.sin(0.5), -np.cos(0.5), 0.0])).as_matrix()
    axes = Rotation.from_rotvec([0.0, 0.0, about_z]).as_matrix()
    sim = dojo.Simulator(scene, time_step=5e-3, kappa=1e-6, tolerance=1e-12)
    level = sim.replace(mechanism=replace(scene, gravity=turn.T @ [0.0, 0.0, -9.81]))
    x = sim.neutral()
    x[:3], x[7:10] = axes.T @ [0.0, 0.0, 0.1], axes.T @ [3.0, 0.0, 0.3]
    x[14:17] = x[20:23] = axes.T @ [0.5, 0.2, 0.0]
    plant = Plant(sim, x, slope=0.3, slope_heading=0.5, ground_height=0.2)
    still = np.zeros((20, 0))
    flat, tilted = level.rollout(x, still, throw=True).x, plant.simulator.rollout(plant.x, still, throw=True).x
    for place, velocity in ((0, 14), (7, 20)):
        at, v = (axes @ flat[:, first : first + 3].T for first in (place, velocity))
        expected = turn @ at + (0.2 * turn[:, 2])[:, None]
        np.testing.assert_allclose(axes @ tilted[:, place : place + 3].T, expected, atol=1e-9)
        np.testing.assert_allclose(axes @ tilted[:, velocity : velocity + 3].T, turn @ v, atol=1e-8)
    assert np.abs(flat[-1, :2] - flat[0, :2]).max() > 0.02
    moved = plant.simulator.mechanism
    np.testing.assert_allclose(moved.scenery[0].shape.center, moved.collisions[1].shape_b.center)


def test_delay_holds_commands_back():
    plant = Plant(HOPPER, high(HOPPER), delay=0.01)
    loop = dojo.closed_loop(lambda t, x: np.array([0.0, 0.0, round(t / 5e-3)]), plant, 0.03, fallen=lambda x: False)
    np.testing.assert_array_equal(loop.u[:, 2], [0, 0, 0, 1, 2, 3])


def test_a_controller_may_write_into_the_array_it_returned():
    plant, command = Plant(HOPPER, high(HOPPER), delay=0.01), np.zeros(3)

    def controller(t, x):
        command[2] = round(t / 5e-3)
        return command

    loop = dojo.closed_loop(controller, plant, 0.03, fallen=lambda x: False)
    np.testing.assert_array_equal(loop.u[:, 2], [0, 0, 0, 1, 2, 3])


def test_actuators_saturate():
    plant = Plant(HOPPER, high(HOPPER), control_limits=(-1.0, [2.0, 2.0, 3.0]))
    loop = dojo.closed_loop(lambda t, x: np.array([-5.0, 5.0, 5.0]), plant, 0.01, fallen=lambda x: False)
    np.testing.assert_array_equal(loop.u, [[-1.0, 2.0, 3.0]] * 2)


def test_noise_is_of_the_measurement_and_repeats():
    plant = Plant(HOPPER, noise=np.r_[0.01 * np.ones(7), np.zeros(7)], seed=5)
    first = [plant.measure() for _ in range(200)]
    assert np.array_equal(plant.x, HOPPER.neutral())
    spread = HOPPER.difference(np.array(first), plant.x)
    np.testing.assert_allclose(spread[:, :7].std(axis=0), 0.01, rtol=0.3)
    np.testing.assert_array_equal(spread[:, 7:], 0.0)
    plant.reset()
    np.testing.assert_array_equal(plant.measure(), first[0])


def test_closed_loop_stops_at_a_fall_and_at_an_unsolved_step():
    tilted = HOPPER.integrate(HOPPER.neutral(), 0.3 * np.eye(14)[3])
    fall = dojo.closed_loop(lambda t, x: np.zeros(3), Plant(HOPPER, tilted), 3.0)
    assert not fall.survived and fall.message.startswith("Fell at") and fall.duration < 3.0
    assert len(fall.x) == len(fall.time) == len(fall.u) + 1 == len(fall.status) + 1
    wild = HOPPER.neutral()
    wild[11] = 1e4
    stop = dojo.closed_loop(lambda t, x: np.zeros(3), Plant(HOPPER.replace(divide=False), wild), 1.0)
    assert not stop.survived and stop.status[-1] != Status.SOLVED and "step 0" in stop.message
    assert len(stop.x) == 1 and stop.u.shape == (0, 3)


def test_a_step_that_cannot_be_solved_is_softened_and_counted():
    """With one iteration less than it needs, a block that lies on the ground is only solved with softer contact."""
    limited = BLOCK.replace(max_iterations=BLOCK.step(BLOCK.neutral()).iterations - 1, divide=False)
    assert not limited.step(BLOCK.neutral()).success
    assert limited.replace(kappa=1e3 * BLOCK.kappa).step(BLOCK.neutral()).success
    loop = dojo.closed_loop(lambda t, x: np.zeros(3), Plant(limited), 5e-3, fallen=lambda x: False)
    assert loop.survived and loop.softened == 1


def test_a_held_command_keeps_the_steps_before_one_that_is_not_solved():
    """A block falls freely, which takes few iterations, and cannot be solved as it lands."""
    sim = BLOCK.replace(max_iterations=4, divide=False)
    plant, one = Plant(sim, sim.neutral()), Plant(sim, sim.neutral())
    for each in (plant, one):
        each.x[2] += 0.02
        each._soften = lambda u, result: result
    message = plant.hold(np.zeros(3), 40)
    while one.step(np.zeros(3))[1].success:
        pass
    assert message and 0 < plant.steps < 40 and plant.steps == one.steps
    np.testing.assert_allclose(plant.x, one.x, atol=1e-9)


def test_functions_that_write_into_the_state_they_get_change_nothing():
    def controller(t, x):
        x[:] = 0.0
        return np.array([0.0, 0.0, 41.0])

    def fallen(x):
        x[:] = 0.0
        return False

    loop = dojo.closed_loop(controller, Plant(HOPPER), 0.05, fallen=fallen)
    kept = dojo.closed_loop(lambda t, x: np.array([0.0, 0.0, 41.0]), Plant(HOPPER), 0.05)
    np.testing.assert_array_equal(loop.x, kept.x)


def test_error_is_measured_from_the_reference():
    loop = dojo.closed_loop(
        lambda t, x: np.array([0.0, 0.0, 41.0]),
        Plant(HOPPER),
        0.05,
        reference=lambda t: np.tile(HOPPER.integrate(HOPPER.neutral(), 0.3 * np.eye(14)[0]), (len(t), 1)),
    )
    assert loop.rms() == pytest.approx(0.3, abs=1e-3)
    bare = dojo.closed_loop(lambda t, x: np.zeros(3), Plant(HOPPER), 0.01)
    with pytest.raises(ValueError, match="no reference"):
        bare.error()


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: Plant(HOPPER, delay=0.0123), "multiple of the time step"),
        (lambda: Plant(HOPPER, pushes=[Push(0.0, (1, 0, 0), body="arm")]), "'arm' is not one of"),
        (lambda: Plant(HOPPER, pushes=[(0.0, 1.0)]), "list of Push"),
        (lambda: Plant(HOPPER, payload=1.0, payload_body="arm"), "payload_body"),
        (lambda: Plant(HOPPER, slope=2.0), "less than a right angle"),
        (lambda: Plant(HOPPER, Perturbation(), payload=-1.0), r"expected shape|real numbers|payload"),
        (lambda: Plant(HOPPER, None, Perturbation(), payload=1.0), "either it or its fields"),
        (lambda: dojo.closed_loop(lambda t, x: np.zeros(2), Plant(HOPPER), 0.01), "controller's u"),
        (lambda: dojo.closed_loop(lambda t, x: np.zeros(3), Plant(HOPPER), 0.1, control_step=0.007), "multiple"),
        (lambda: dojo.closed_loop(lambda t, x: np.zeros(3), Plant(HOPPER), 0.002), r"a step of the plant, 0\.005 s"),
        (lambda: dojo.closed_loop(lambda t, x: 0, Plant(HOPPER), 0.1, reference=np.zeros(3)), "function of the times"),
        (lambda: dojo.closed_loop(lambda t, x: 0, Plant(HOPPER), 0.1, reference=lambda t: t), r"shape \(2, 15\)"),
        (lambda: still().rms("v"), "expected coordinates, got velocities among 'v'"),
        (lambda: dojo.monte_carlo(lambda t, x: 0, Plant(HOPPER), Perturbation, 0.1, components=[9]), "got velocities"),
        (lambda: Plant(HOPPER, payload_inertia=(1.0, 2.0)), r"a number, or three, got shape \(2,\)"),
        (lambda: dojo.Disturbances(1, velocity=0.1), "nv >= 2, got nv = 1"),
        (lambda: dojo.Disturbances(7, payload=(-1.0, 1.0)), r"payload=\.\.\.\): expected numbers >= 0"),
        (lambda: dojo.Disturbances(7, slope=(0.0, 2.0)), "less than a right angle"),
    ],
)
def test_mistakes_are_named(make, message):
    with pytest.raises((ValueError, TypeError), match=message):
        make()


def test_slope_needs_a_floating_base():
    sim = dojo.Simulator(dojo.models.cartpole(), time_step=0.01)
    with pytest.raises(ValueError, match="floating base"):
        Plant(sim, slope=0.1)


def test_a_body_pinned_to_the_world_stays_on_its_pin():
    """Ground that moves would leave the pin behind, and an offset would open the loop."""
    ends = {"parent_point": (0.5, 0.0, 0.1), "child_point": (0.1, 0.0, 0.0)}
    pin = dojo.Joint("spherical", None, "b", name="pin", close=True, **ends)
    body, base = dojo.Body("b", 1.0, (0.01, 0.01, 0.01)), dojo.Joint("floating", None, "b")
    sim = dojo.Simulator(dojo.Mechanism([body], [base, pin], neutral={"b": [0.4, 0, 0.1, 1, 0, 0, 0]}), 0.005)
    for ground in ({"slope": 0.3}, {"ground_height": 0.4}, {"terrain": dojo.Terrain(np.zeros((2, 2)))}):
        with pytest.raises(ValueError, match="floating base"):
            Plant(sim, **ground)
    moved = Plant(sim, offset=np.eye(12)[2] * 0.2)
    assert abs(moved.x[:3] - sim.neutral()[:3]).max() > 1e-3
    assert max(np.abs(gap).max() for gap in sim.loop_gaps(moved.x).values()) < 1e-9
    np.testing.assert_array_equal(Plant(sim, offset=np.zeros(12)).x, sim.neutral())


def test_ground_is_learnt_from_a_foot_that_stands():
    sim = HOPPER.replace()
    ground = Ground(sim)
    x = sim.neutral()
    policy = Policy(sim, 0.0, np.tile(x, (3, 1)), np.zeros((2, 3)), np.zeros((2, 3, 14)))
    higher = x.copy()
    higher[2] += 0.03
    ground.learn(policy, 0.0, higher, (-0.005, higher))
    assert ground.height[0] == pytest.approx(0.03, abs=1e-12)
    assert ground.rise == pytest.approx(0.015)  # foot and body; the body does not stand
    assert ground.touching(higher) == ("foot",)
    moving = higher.copy()
    moving[2] += 0.01
    ground.learn(policy, 0.0, moving, (-0.005, higher))
    assert ground.height[0] == pytest.approx(0.03, abs=1e-12)
    r = sim.step(higher, np.array([0.0, 0.0, 41.0]))  # this simulator's step knows it, the steps of others do not
    assert r.contacts.normal_force[0] > 10.0 and Ground(HOPPER).height[0] == 0.0
    ground.forget()
    np.testing.assert_array_equal(ground.height, 0.0)
