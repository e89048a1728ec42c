"""The step against the slow reference: same next state and same impulses to 1e-8."""

import numpy as np
import pytest
from naive import lagrangian as lag
from naive import rotation as rot
from naive.maximal import solve
from naive.scene import from_mechanism, poses

import dojo_opt as dojo
from support.scenes import KINDS, LAWS, block, chain, free_body, gaps, limited, pendulum, random_state


def compare(sim, x, u):
    """Step both; returns the engine's result."""
    scene = from_mechanism(sim.mechanism)
    q, v = x[: sim.nq], x[sim.nq :]
    expected = solve(scene, q, v, u, sim.time_step, sim.kappa)
    result = sim.step(x, u)
    assert result.status == 0
    pos, quat = poses(scene, result.x[: sim.nq])
    np.testing.assert_allclose(pos, expected.pos, rtol=0, atol=1e-8)
    turned = rot.log(rot.mul(rot.conj(quat), expected.quat))
    np.testing.assert_allclose(turned, 0.0, atol=1e-8)
    np.testing.assert_allclose(result.x[sim.nq :], expected.v, rtol=0, atol=1e-8 / sim.time_step)
    if scene.contacts:
        np.testing.assert_allclose(result.contacts.impulse, expected.contact_impulse, rtol=0, atol=1e-8)
    z = sim.maximal(result.x)
    np.testing.assert_allclose(z[:, :3], expected.pos, rtol=0, atol=1e-8)
    return result


def make(mech, h, kappa=1e-6):
    return dojo.Simulator(mech, time_step=h, kappa=kappa, tolerance=1e-12)


def test_free_body_at_20_rad_per_second():
    sim = make(free_body(), 0.05)
    compare(sim, np.r_[1.0, 2.0, 3.0, rot.exp(np.array([0.3, 0.2, 0.1])), 1.0, 2.0, 3.0, 12.0, -12.0, 10.6], np.ones(3))


def test_double_pendulum(rng):
    sim = make(pendulum(2, spring=3.0, damper=0.1, rest=0.3), 0.02)
    for _ in range(3):
        compare(sim, 3.0 * rng.normal(size=4), rng.normal(size=2))


@pytest.mark.sweep(4)
@pytest.mark.parametrize("base", ["floating", None])
@pytest.mark.parametrize("kind", KINDS)
def test_every_joint(kind, base, rng):
    if kind == "fixed" and base is None:
        pytest.skip("nothing moves")
    sim = make(chain(kind, 2, gravity=(0.0, 1.0, -9.81), base=base, spring=3.0, damper=0.2), 0.02)
    for _ in range(2):
        compare(sim, random_state(sim, rng, 3.0), rng.normal(size=sim.nu))


@pytest.mark.parametrize("kind", ["spherical", "floating", "cylindrical_free"])
def test_spring_with_a_rotated_rest(kind, rng):
    rest = [0.1, -0.2, 0.3][: dojo.Joint(kind, None, "b").ntrans] + [0.5, -0.4, 0.3]
    sim = make(chain(kind, 2, spring=20.0, rest=rest), 0.02)
    for _ in range(2):
        compare(sim, random_state(sim, rng, 3.0), rng.normal(size=sim.nu))


KAPPAS = (1e-2, 1e-4, 1e-6, 1e-8)


@pytest.mark.sweep(6)
@pytest.mark.parametrize("kappa", KAPPAS)
@pytest.mark.parametrize("law", LAWS)
def test_block(law, kappa, rng):
    sim = make(block(law=law, friction=0.7, normal=(0.1, 0.2, 1.0), radius=0.01), 0.02, kappa)
    numbers = rng.normal(size=(12, 8))[4 * LAWS.index(law) + KAPPAS.index(kappa)]  # of each case others
    q = np.r_[0.0, 0.0, 0.45, rot.exp(numbers[:3])]
    compare(sim, np.r_[q, 2.0 * numbers[3:5], -2.0, 3.0 * numbers[5:]], np.zeros(0))


def hopper(law="nonlinear"):
    """Body and foot on a sliding leg with spring, damper and limits; a force at the body, torques in its axes."""
    bodies = [dojo.Body("body", 4.18, np.full(3, 0.017)), dojo.Body("foot", 0.52, np.full(3, 5e-4))]
    leg = dojo.Joint(
        "prismatic", "body", "foot", axis=(0, 0, -1), spring=200.0, damper=0.1, rest=0.5, limits=(0.2, 0.6)
    )
    contacts = [dojo.Contact("foot", radius=0.05, law=law), dojo.Contact("body", radius=0.1, law=law)]
    inputs = [
        dojo.Input("foot"),
        dojo.Input(body="body", torque=(1, 0, 0), frame="body"),
        dojo.Input(body="body", force=(0, 1, 0), torque=(0, 0, 0.3)),
    ]
    return dojo.Mechanism(bodies, [dojo.Joint("floating", None, "body"), leg], contacts, inputs)


@pytest.mark.sweep(3)
@pytest.mark.parametrize("time_step", [0.01, 0.05])
@pytest.mark.parametrize("height", [1.5, 0.56])
@pytest.mark.parametrize("law", LAWS)
def test_hopper_in_flight_and_landing(law, height, time_step, rng):
    sim = make(hopper(law), time_step)
    for _ in range(2):
        q = np.r_[0.0, 0.0, height, rot.exp(0.3 * rng.normal(size=3)), rng.uniform(0.3, 0.55)]
        v = np.r_[rng.normal(size=2), -3.0, rng.normal(size=3), 3.0 * rng.normal()]
        compare(sim, np.r_[q, v], rng.normal(size=3))


def biped(law="nonlinear", friction=0.8):
    """Trunk and two legs of three links: 7 bodies, 12 degrees of freedom, 12 limits, 2 feet."""
    bodies, contacts = [dojo.Body("trunk", 6.0, np.array([0.025, 0.07, 0.085]))], []
    joints = [dojo.Joint("floating", None, "trunk")]
    for name, sx, sy in (("fr", 1, -1), ("rl", -1, 1)):
        bodies += [
            dojo.Body(f"{name}_hip", 0.7, np.full(3, 7e-4)),
            dojo.Body(f"{name}_thigh", 1.0, (3.5e-3, 3.5e-3, 4e-4)),
            dojo.Body(f"{name}_calf", 0.17, (6e-4, 6e-4, 3e-5)),
        ]
        soft = {"spring": 3.0, "damper": 0.1}
        joints += [
            dojo.Joint(
                "revolute",
                "trunk",
                f"{name}_hip",
                axis=(1, 0, 0),
                parent_point=(0.18 * sx, 0.05 * sy, 0.0),
                limits=(-0.6, 0.6),
                **soft,
            ),
            dojo.Joint(
                "revolute",
                f"{name}_hip",
                f"{name}_thigh",
                axis=(0, 1, 0),
                parent_point=(0, 0.08 * sy, 0),
                child_point=(0, 0, 0.1),
                rest=0.8,
                limits=(-0.6, 1.6),
                **soft,
            ),
            dojo.Joint(
                "revolute",
                f"{name}_thigh",
                f"{name}_calf",
                axis=(0, 1, 0),
                parent_point=(0, 0, -0.1),
                child_point=(0, 0, 0.1),
                rest=-1.5,
                limits=(-2.6, -0.6),
                **soft,
            ),
        ]
        contacts.append(dojo.Contact(f"{name}_calf", point=(0, 0, -0.1), radius=0.02, friction=friction, law=law))
    return dojo.Mechanism(bodies, joints, contacts)


@pytest.mark.sweep(6)
@pytest.mark.parametrize(("height", "time_step"), [(1.0, 0.05), (0.01, 0.01)])
@pytest.mark.parametrize("law", LAWS)
def test_floating_tree_in_flight_and_in_contact(law, height, time_step, rng):
    """Twice: limits slack, and one joint thrown against its limit."""
    sim = make(biped(law), time_step)
    for speed in (1.0, 10.0):
        q = np.r_[0.0, 0.0, 0.0, rot.exp(0.1 * rng.normal(size=3)), np.tile([0.1, 0.7, -1.4], 2)]
        q[7:] += 0.05 * rng.normal(size=6)
        x = np.r_[q, rng.normal(size=2), -2.0, rng.normal(size=3), speed * rng.normal(size=6)]
        x[2] = height - gaps(sim, x).min()
        compare(sim, x, rng.normal(size=6))


@pytest.mark.sweep(4)
@pytest.mark.parametrize("kind", KINDS)
def test_energy_momentum_and_start(kind, rng):
    """Energy, momentum and start at the nodes follow from the discrete Legendre transform."""
    sim = make(chain(kind, 2, gravity=(0.0, 1.0, -9.81), spring=3.0), 0.02)
    scene, x = from_mechanism(sim.mechanism), random_state(sim, rng, 3.0)
    q, v = x[: sim.nq], x[sim.nq :]
    np.testing.assert_allclose(np.concatenate(sim.momentum(x)), lag.momentum(scene, q, v, sim.time_step), atol=1e-9)
    np.testing.assert_allclose(np.sum(sim.energy(x)), lag.energy(scene, q, v, sim.time_step), rtol=1e-9)
    np.testing.assert_allclose(
        sim.state_from_velocity(q, v)[sim.nq :], lag.start(scene, q, v, sim.time_step), atol=1e-8
    )


@pytest.mark.parametrize("kind", ["spherical", "cylindrical_free", "planar_free"])
def test_cone_limit(kind, rng):
    """Thrown at the cone, and pressed against it."""
    sim = make(chain(kind, 1, base=None, cone=0.6, damper=0.1), 0.02)
    axis = np.array(sim.mechanism.joints[-1].axis)
    across = np.cross(axis, [1.0, 0.0, 0.0]) / np.linalg.norm(np.cross(axis, [1.0, 0.0, 0.0]))
    for angle, speed in ((0.3, 8.0), (0.59, 20.0), (0.599, 0.0)):
        for spin in (0.0, 1.0):
            x = np.array(sim.neutral())
            x[sim.nq - 4 : sim.nq] = rot.mul(rot.exp(angle * across), rot.exp(spin * axis))
            x[-3:] = rot.rotate(rot.exp(-spin * axis), speed * across)
            u = np.zeros(sim.nu)
            u[-3:] = 5.0 * rot.rotate(rot.exp(-spin * axis), across)
            r = compare(sim, x, u)
            q = r.x[sim.nq - 4 : sim.nq]
            assert axis @ rot.rotate(q, axis) > np.cos(0.6) - 1e-9


@pytest.mark.sweep(5)
@pytest.mark.parametrize("base", ["floating", None])
@pytest.mark.parametrize("kind", ["revolute", "planar_axis", "orbital", "fixed_orientation", "screw"])
def test_armature(kind, base, rng):
    mech = chain(kind, 2, gravity=(0.0, 1.0, -9.81), base=base, spring=3.0, damper=0.2, armature=0.4)
    sim = make(mech, 0.02)
    scene = from_mechanism(sim.mechanism)
    for _ in range(2):
        x = random_state(sim, rng, 3.0)
        compare(sim, x, rng.normal(size=sim.nu))
        q, v = x[: sim.nq], x[sim.nq :]
        np.testing.assert_allclose(np.sum(sim.energy(x)), lag.energy(scene, q, v, sim.time_step), rtol=1e-9)
        np.testing.assert_allclose(
            sim.state_from_velocity(q, v)[sim.nq :], lag.start(scene, q, v, sim.time_step), atol=1e-8
        )


def plain_coordinates(mech, joint):
    """Indices in q of the coordinates of a joint that belong to no quaternion."""
    start = mech.q_slice(joint.name).start
    return range(start, start + joint.nv - 3 * (joint.nrot == 3))


@pytest.mark.sweep(2)
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "fixed"])
def test_limits_of_every_kind(kind, rng):
    """Every coordinate that is a plain number arrives at a bound in this very step; a quaternion is far from its cone."""
    sim = make(limited(kind), 0.02)
    q = np.array(sim.mechanism.neutral)
    v = rng.normal(size=sim.nv)
    for joint in sim.mechanism.joints:
        for d in range(joint.nv - 3 * (joint.nrot == 3)):
            q[sim.mechanism.q_slice(joint.name).start + d] = 0.28
            v[sim.mechanism.v_slice(joint.name).start + d] = 2.0 + d
    result = compare(sim, np.concatenate([q, v]), rng.normal(size=sim.nu))
    plain = [result.x[i] for j in sim.mechanism.joints for i in plain_coordinates(sim.mechanism, j)]
    assert np.all(np.array(plain) < 0.3 + 1e-9)
    assert not plain or max(plain) > 0.2999
