"""Feet: where they are, how they move, inverse kinematics; and the equilibrium of a robot on its feet."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial import ConvexHull

import dojo_opt as dojo
from dojo_opt import Terrain, models
from dojo_opt.gaits.equilibrium import equilibrium, potential_gradient
from dojo_opt.gaits.feet import Feet
from sim.simulator.simulator import Simulator
from support.hills import WAVES


@pytest.fixture(scope="module")
def sim():
    return Simulator(models.quadruped(damper=0.5), time_step=0.02)


def bent(sim, rng):
    """A state in the air, everything turned a little."""
    dx = np.zeros(sim.ndx)
    dx[: sim.nv] = 0.2 * rng.normal(size=sim.nv)
    dx[2] = 0.3
    return sim.integrate(sim.neutral(), dx)


def test_a_robot_without_weight_rests_where_it_is_or_is_refused():
    sim = dojo.Simulator(dojo.models.uuv(), time_step=0.01)
    np.testing.assert_array_equal(dojo.equilibrium(sim)[0], sim.neutral())
    block = dojo.Simulator(replace(dojo.models.block(), gravity=(0.0, 0.0, 0.0)), time_step=0.01)
    with pytest.raises(ValueError, match="nothing presses it onto its contacts"):
        dojo.equilibrium(block)
    aloft = block.neutral() + np.eye(13)[2]
    np.testing.assert_array_equal(dojo.equilibrium(block, aloft)[0], aloft)


def test_positions_agree_with_the_contacts(sim, rng):
    x = bent(sim, rng)
    step = sim.step(x)
    feet = Feet(sim)
    assert feet.names == sim.mechanism.contact_names
    np.testing.assert_allclose(feet.gaps(step.x), step.contacts.gap, atol=1e-12)
    under = feet.positions(step.x) - feet.radius[:, None] * feet.normal
    np.testing.assert_allclose(under, step.contacts.point, atol=1e-12)


def test_contacts_at_the_ends_of_the_tree_are_the_feet():
    robot = Simulator(models.quadruped(contacts="all"), time_step=0.02)
    assert Feet(robot).names == ("FR_foot", "FL_foot", "RR_foot", "RL_foot")
    with pytest.raises(ValueError, match="'paw' is not one of"):
        Feet(robot, ["paw"])
    with pytest.raises(ValueError, match="no body at the end of the tree has a contact"):
        Feet(Simulator(models.pendulum(), time_step=0.02))


def test_jacobian_is_the_velocity_of_the_feet(sim, rng):
    x, feet = bent(sim, rng), Feet(sim)
    J = feet.jacobian(x)
    dx = np.zeros(sim.ndx)
    dx[: sim.nv] = rng.normal(size=sim.nv)
    h = 1e-4
    slope = (feet.positions(sim.integrate(x, h * dx)) - feet.positions(sim.integrate(x, -h * dx))) / (2 * h)
    np.testing.assert_allclose(J @ dx[: sim.nv], slope, atol=1e-7)


def test_inverse_kinematics_reaches(sim, rng):
    feet, x = Feet(sim), sim.neutral()
    targets = feet.positions(x) + rng.uniform(-0.04, 0.04, size=(20, 4, 3))
    placed = feet.place(x, targets)
    np.testing.assert_allclose(feet.positions(placed), targets, atol=1e-9)
    np.testing.assert_array_equal(placed[:, :7], np.tile(x[:7], (20, 1)))
    assert np.all(placed[:, 9:19:3] < -1.0)  # knees stay bent to their side


def test_a_sole_lands_as_it_is():
    """Its balls keep their heights; all on the ground at once they would have asked for another sole."""
    mech = models.quadruped()
    bumps = [replace(c, point=np.asarray(c.point) + (0.02, 0.0, 0.004), name=f"{c.name} bump") for c in mech.contacts]
    robot = Simulator(replace(mech, contacts=[*mech.contacts, *bumps]), time_step=0.02)
    x, feet = robot.neutral(), Feet(robot)
    x[2] += 0.05
    fallen = feet.landed(x) - feet.positions(x)
    np.testing.assert_allclose(fallen[4:], fallen[:4], atol=1e-15)
    lowest = np.minimum(*feet.gaps(x).reshape(2, 4))
    np.testing.assert_allclose(fallen[:4, 2], -lowest, atol=1e-15)
    assert np.ptp(feet.gaps(x)) > 1e-3


def test_inverse_kinematics_names_the_foot_out_of_reach(sim):
    feet, x = Feet(sim), sim.neutral()
    far = feet.positions(x)[None]
    far[0, 2, 2] -= 0.5
    with pytest.raises(ValueError, match="'RR_foot' comes no nearer than 0.3"):
        feet.place(x, far)
    low = feet.positions(x)[None]
    low[0, 1, 2] -= 0.1  # within the length of the leg, not of its stops
    with pytest.raises(ValueError, match=r"joint 'FL_calf' would have to go .* rad beyond its limits \[-2.5, -1\]"):
        feet.place(x, low)


def test_potential_gradient_is_the_weight(sim):
    mass = sum(body.mass for body in sim.mechanism.bodies)
    np.testing.assert_allclose(potential_gradient(sim, sim.neutral())[:3], [0.0, 0.0, 9.81 * mass], atol=1e-6)


@pytest.mark.parametrize(
    "contacts, kappa", [("feet", 1e-6), ("feet", 1e-4), ("feet", 3e-2), ("all", 1e-6), ("all", 1e-4)]
)
def test_equilibrium_stays(contacts, kappa):
    robot = Simulator(models.quadruped(damper=0.5, spring=0.5, contacts=contacts), time_step=0.02, kappa=kappa)
    x, u = equilibrium(robot)
    step = robot.step(x, u)
    # stops and lifted contacts push with kappa over their distance, which the state counts to first order
    assert np.abs(step.x[robot.nq :]).max() < 1e-7 + 1e-2 * kappa
    mass = sum(body.mass for body in robot.mechanism.bodies)
    np.testing.assert_allclose(step.contacts.normal_force.sum(), 9.81 * mass, rtol=1e-4)
    assert step.contacts.friction_force.max() < 1e-3 + 100.0 * kappa
    assert np.abs(u).max() < 10.0


@pytest.mark.parametrize(
    "settings", [{"order": 4}, {"order": 8}, {"accuracy": 1e-4}, {"kappa": 1e-13}, {"kappa": 1e-16, "order": 4}]
)
@pytest.mark.parametrize("make", [models.quadruped, models.block, models.panda])
def test_equilibrium_stays_with_all_steps(make, settings):
    """As with order 2, whose inputs they are; the joints of the panda are damped, so its steps are of order 2."""
    plain = Simulator(make(), time_step=0.01)
    robot = plain.replace(**settings)
    (x0, u0), (x, u) = equilibrium(plain), equilibrium(robot)
    np.testing.assert_allclose(u, u0, atol=1e-4)
    np.testing.assert_allclose(x[: plain.nq], x0[: plain.nq], atol=1e-7)
    still, moved = plain.rollout(x0, np.tile(u0, (10, 1))), robot.rollout(x, np.tile(u, (10, 1)))
    drifts = [np.abs(robot.difference(path.x[-1], path.x[0])[: robot.nv]).max() for path in (still, moved)]
    exact = set(settings) == {"order"}
    assert drifts[1] < 1.1 * drifts[0] + (1e-14 if exact else 2e-6), drifts


def test_the_ground_carries_a_body_that_pushes_could_hold():
    """Forces along a planar base: a block on the ground needs none, and one in the air is held."""
    block = Simulator(models.block2d(), time_step=0.01)
    x, u = equilibrium(block)
    assert not u.any() and np.abs(block.step(x, u).x - x).max() < 1e-12
    assert block.step(x, u).contacts.normal_force.sum() == pytest.approx(9.81)
    aloft = block.neutral()
    aloft[1] += 0.5
    x, u = equilibrium(block, aloft)
    assert x[1] == aloft[1] and u == pytest.approx([0.0, 9.81, 0.0], abs=1e-6)


def test_arms_in_flight_have_no_velocity_at_rest():
    """An arm with stops takes steps of higher order, which begin with the true velocity, where it is not at one."""
    arm = Simulator(models.acrobot(), time_step=0.01, order=4)
    stops = replace(arm.mechanism, joints=[replace(j, limits=[(-2.0, 2.0)]) for j in arm.mechanism.joints])
    for robot in (arm, arm.replace(mechanism=stops)):
        x, u = equilibrium(robot)
        assert not x[robot.nq :].any() and np.abs(robot.step(x, u).x - x).max() < 1e-9


def test_equilibrium_of_another_stance(sim):
    x = sim.neutral()
    feet = Feet(sim)
    moved = x.copy()
    moved[0] += 0.05  # the trunk forward over its feet
    x = feet.place(moved, feet.positions(x)[None])[0]
    still, u = equilibrium(sim, x)
    step = sim.step(still, u)
    assert np.abs(step.x[sim.nq :]).max() < 1e-7
    assert step.contacts.normal_force[:2].sum() > step.contacts.normal_force[2:].sum()  # on its front feet


def test_no_equilibrium_is_said(sim):
    feet, x = Feet(sim), sim.neutral()
    lifted = feet.positions(x)[None]
    lifted[0, :2, 2] += 0.05  # both front feet off the ground
    with pytest.raises(ValueError, match="forces at 'FR_foot'.* cannot balance the weight.* m beside the contacts at"):
        equilibrium(sim, feet.place(x, lifted)[0])
    steep = Simulator(models.quadruped(friction=0.1).with_terrain(Terrain.slope(0.2)), time_step=0.02)
    x = steep.neutral()
    with pytest.raises(ValueError, match="stands on ground of slope 0.203 with friction 0.1, and would slide"):
        equilibrium(steep, on_its_feet(steep, x))


def on_its_feet(robot, x):
    """The neutral pose with every foot on the terrain below it."""
    feet = Feet(robot)
    targets = feet.positions(x)
    for k, contact in enumerate(feet.contacts):
        targets[k, 2] = (
            contact.terrain.surface(contact.radius).height(*targets[k, :2])
            if contact.terrain
            else (
                (contact.height + contact.radius - np.asarray(contact.normal)[:2] @ targets[k, :2]) / contact.normal[2]
            )
        )
    x = x.copy()
    x[2] += targets[:, 2].mean() - feet.positions(x)[:, 2].mean()
    return feet.place(x, targets[None])[0]


def test_a_joint_beyond_its_stop_is_named():
    """There the stop would pull."""
    robot = dojo.Simulator(dojo.models.atlas(), time_step=0.01)
    x = robot.neutral()
    x[robot.mechanism.q_slice("l_leg_kny")] = -0.1  # a knee bends from 0 to 2.36
    with pytest.raises(ValueError, match="'l_leg_kny' is beyond its stops"):
        equilibrium(robot, x)


def stays(sim, x, u, within=1e-6):
    """A state of rest does not move, and is near where the robot begins."""
    assert np.abs(sim.step(x, u, throw=True).x[sim.nq :]).max() < within
    return x, u


@pytest.mark.parametrize("kappa", [None, 1e-5])
def test_a_joint_at_its_stop_is_moved_off_it(kappa):
    """Files put joints there: zero is often the end of a range. The stop then takes a small part of the torque."""
    arm = replace(dojo.models.panda(gripper=False), contacts=())
    low = [dof.limits[0][0] for dof in arm.joints if dof.limits]
    sim = dojo.Simulator(arm, time_step=0.01, kappa=kappa)
    x = sim.neutral()
    x[: sim.nq] = low
    still, u = stays(sim, *equilibrium(sim, x))
    assert 0.0 < np.abs(still - x).max() < 1e-2
    held = dojo.Kinematics(sim).gravity_torques(still[: sim.nq])
    np.testing.assert_allclose(u, held, atol=0.05 * np.abs(held).max())


@pytest.mark.parametrize("model", ["fivebar", "delta", "stewart"])
def test_loops_pass_the_weight_on_to_the_inputs(model):
    sim = dojo.Simulator(getattr(dojo.models, model)(), time_step=0.01)
    x, u = stays(sim, *equilibrium(sim))
    assert np.abs(u).max() > 0.1 and np.abs(x - sim.neutral()).max() < 1e-3


def test_gears_pass_the_weight_on_to_the_inputs():
    """Two arms side by side, one of them driven by a gear of ratio -2 alone."""
    rod = dojo.Box(0.5, 0.05, 0.05)
    joints = [
        dojo.Joint("revolute", None, "a", child_point=(-0.25, 0, 0), axis=(0, 1, 0)),
        dojo.Joint("revolute", None, "b", "j", (0, 0.2, 0), (-0.25, 0, 0), axis=(0, 1, 0)),
    ]
    bodies = [dojo.Body("a", 1.0, shape=rod), dojo.Body("b", 2.0, shape=rod)]
    mech = dojo.Mechanism(bodies, joints, gears=[dojo.Gear("j", "a", -2.0)], inputs=[dojo.Input("a")])
    sim = dojo.Simulator(mech, time_step=0.01)
    x, u = stays(sim, *equilibrium(sim))
    np.testing.assert_allclose(u, -0.25 * 9.81 * (1.0 - 2.0 * 2.0), rtol=1e-9)


def test_a_robot_leans_over_a_single_foot():
    """Its weight is beside the foot: the hip moves it there."""
    bodies = [dojo.Body("trunk", 3.0, shape=dojo.Box(0.3, 0.2, 0.1)), dojo.Body("leg", 1.0, shape=dojo.Sphere(0.05))]
    joints = [
        dojo.Joint("floating", None, "trunk"),
        dojo.Joint("revolute", "trunk", "leg", "hip", (0.01, 0, 0), (0, 0, 0.3), axis=(0, 1, 0)),
    ]
    mech = dojo.Mechanism(bodies, joints, inputs=[dojo.Input("hip")], contacts=[dojo.Contact("leg", radius=0.05)])
    sim = dojo.Simulator(mech, time_step=0.01)
    x = sim.neutral()
    x[2] += 0.05 - sim.maximal(x)[1, 2]
    still, _ = stays(sim, *equilibrium(sim, x))
    assert 1e-3 < np.abs(still - x).max() < 0.1


def test_a_quadruped_leans_over_the_edge_of_its_feet(sim):
    """Its weight is 8 mm behind the hind feet; the front feet, which then carry little, stay out of the ground."""
    mech = sim.mechanism
    pose = {j.name: 0.0 if "thigh" in j.name else -1.78 for j in mech.joints if "thigh" in j.name or "calf" in j.name}
    kneeling = Simulator(replace(mech, neutral=pose), time_step=0.02)
    x = Feet(kneeling).put_down(kneeling.neutral())
    still, _ = stays(kneeling, *equilibrium(kneeling, x))
    assert 1e-3 < np.abs(kneeling.difference(still, x)).max() < 0.1


@pytest.mark.parametrize("seed", range(2))
def test_a_body_settles_on_its_nearest_face(seed):
    """A random hull a little beside the face next to its centre of mass, which is one to stand on."""
    rng = np.random.default_rng(seed)
    corners = rng.normal(size=(8, 3))
    corners *= 0.1 / np.linalg.norm(corners, axis=1)[:, None]
    corners = np.vstack([corners, -corners])
    faces = ConvexHull(corners).equations
    down = faces[faces[:, 3].argmax(), :3]
    mech = dojo.Mechanism(
        [dojo.Body("hull", 1.0, np.diag([4e-3] * 3), shape=dojo.Polytope(corners))],
        [dojo.Joint("floating", None, "hull")],
        contacts=[dojo.Contact("hull", corner) for corner in corners],
    )
    sim = dojo.Simulator(mech, time_step=0.01)
    x = sim.neutral()
    x[3:7] = [1.0 + down @ [0.0, 0.0, -1.0], *np.cross(down, [0.0, 0.0, -1.0])]
    x[3:7] /= np.linalg.norm(x[3:7])
    x = sim.integrate(x, [0, 0, 0, *(0.02 * rng.normal(size=3)), *np.zeros(6)])
    still, _ = stays(sim, *equilibrium(sim, Feet(sim, sim.mechanism.contact_names).put_down(x)))
    np.testing.assert_allclose(
        dojo.Kinematics(sim).pose("hull", still[: sim.nq])[1] @ down, [0.0, 0.0, -1.0], atol=1e-6
    )


def test_an_arm_stays_in_equilibrium_with_and_without_contacts():
    """Nothing touches: the inputs alone hold it; a contact a metre above the ground adds its kappa / gap."""
    bare = dojo.models.panda(gripper=False)
    for contacts in ((), (dojo.Contact(bare.body_names[-1], radius=0.02),)):
        sim = dojo.Simulator(replace(bare, contacts=contacts), time_step=0.01, kappa=1e-4)
        x, u = dojo.equilibrium(sim)
        np.testing.assert_allclose(sim.step(x, u, throw=True).x, x, atol=1e-9)
        assert np.abs(u).max() > 10.0
    low = dojo.Contact(bare.body_names[-1], (0.0, 0.0, 0.0), 2.0, name="hand")
    with pytest.raises(ValueError, match="'hand' is .* m deep in the ground near x"):
        dojo.equilibrium(dojo.Simulator(replace(bare, contacts=[low]), time_step=0.01))
    with pytest.raises(ValueError, match="the inputs cannot balance the weight"):
        dojo.equilibrium(dojo.Simulator(replace(bare, inputs=()), time_step=0.01))


@pytest.mark.parametrize("ground", [Terrain.slope(0.1, (1.0, 0.5)), WAVES])
def test_equilibrium_on_terrain(ground):
    """Contact forces carry the whole weight on a slope, upwards; the remaining motion creeps with kappa."""
    robot = Simulator(models.quadruped(damper=0.5).with_terrain(ground), time_step=0.02, kappa=1e-8)
    x, u = equilibrium(robot, on_its_feet(robot, robot.neutral()))
    step = robot.step(x, u)
    assert np.abs(step.x[robot.nq :]).max() < 1e-7
    mass = sum(body.mass for body in robot.mechanism.bodies)
    np.testing.assert_allclose(step.contacts.force.sum(axis=0), [0.0, 0.0, 9.81 * mass], atol=1e-3)


def test_pushes_are_zero_at_rest():
    block = Simulator(models.block(), time_step=0.02)
    x, u = equilibrium(block)
    assert np.all(u == 0.0)
    assert np.abs(block.step(x, u).x[block.nq :]).max() < 1e-7


@pytest.mark.slow
def test_round_hulls_stand_on_the_corners_that_are_lowest():
    """Feet of 24 random corners under legs that slide: at most a few corners of each can touch at once."""
    rng, places = np.random.default_rng(3), [(x, y) for x in (0.3, -0.3) for y in (0.2, -0.2)]
    bodies, joints = [dojo.Body("trunk", 4.0, np.diag([0.1, 0.1, 0.1]))], [dojo.Joint("floating", None, "trunk")]
    for k, (x, y) in enumerate(places):
        corners = rng.normal(size=(12, 3))
        corners *= 0.03 / np.linalg.norm(corners, axis=1)[:, None]
        bodies.append(dojo.Body(f"foot{k}", 0.2, shape=dojo.Polytope(np.vstack([corners, -corners]))))
        joints.append(dojo.Joint("prismatic", "trunk", f"foot{k}", parent_point=(x, y, -0.3), axis=(0.0, 0.0, 1.0)))
    mech = dojo.Mechanism(bodies, joints).with_terrain(dojo.Terrain(), bodies=[f"foot{k}" for k in range(4)])
    sim = dojo.Simulator(mech, time_step=0.01)
    state, u = dojo.equilibrium(sim)
    after = sim.rollout(state, np.tile(u, (5, 1)), throw=True).x[-1]
    assert np.abs(sim.difference(after, state)).max() < 1e-5


@pytest.mark.slow
def test_a_robot_whose_trunk_has_corners_too_stands_on_its_feet():
    """With all corners within 1 cm of the ground, Newton's method finds no balance; then fewer may carry."""
    rng = np.random.default_rng(5)

    def hull(radius: float) -> dojo.Polytope:
        corners = rng.normal(size=(16, 3))
        corners *= radius / np.linalg.norm(corners, axis=1)[:, None]
        return dojo.Polytope(np.vstack([corners, -corners]))

    bodies = [dojo.Body("trunk", 4.0, np.diag([0.1, 0.1, 0.1]), shape=hull(0.15))]
    joints = [dojo.Joint("floating", None, "trunk")]
    for k, (x, y) in enumerate([(0.3, 0.2), (0.3, -0.2), (-0.3, 0.2), (-0.3, -0.2)]):
        bodies.append(dojo.Body(f"foot{k}", 0.2, shape=hull(0.03)))
        hip, knee = (x, y, -0.05), (0.05, 0.0, 0.2)
        joints.append(
            dojo.Joint("revolute", "trunk", f"foot{k}", parent_point=hip, child_point=knee, axis=(0.0, 1.0, 0.0))
        )
    mech = dojo.Mechanism(bodies, joints).with_terrain(dojo.Terrain(), bodies=[body.name for body in bodies])
    sim = dojo.Simulator(mech, time_step=0.01)
    state, u = dojo.equilibrium(sim)
    after = sim.rollout(state, np.tile(u, (5, 1)), throw=True)
    assert np.abs(sim.difference(after.x[-1], state)).max() < 1e-9
    carrying = after.contacts.impulse[-1, :, 2] > 1e-3
    assert {contact.body for contact, on in zip(mech.contacts, carrying, strict=True) if on} <= {
        f"foot{k}" for k in range(4)
    }
