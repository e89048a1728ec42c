"""A, B of one step against central differences of the solver at the same kappa.

Figure of merit: the largest error over all entries relative to the largest entry, A and B apart, at most 1e-6.
Every mechanism is put so that without contact its gap after the step would be `GAP[regime]`: far away, exactly
touching (the middle of the smooth transition), or pressed, with much friction and little speed or the reverse.
"""

import dataclasses

import numpy as np
import pytest
from naive import rotation as rot

import dojo_opt as dojo
from support.jacobians import check_step
from support.scenes import KINDS, LAWS, ball, block, chain, gaps, limited, pendulum, random_state, slider

H = 0.02
KAPPAS = (1e-2, 1e-4, 1e-6)
GAP = {"flying": 0.3, "touching": 0.0, "sticking": -0.01, "sliding": -0.01}
FRICTION = {"flying": 0.5, "touching": 0.5, "sticking": 3.0, "sliding": 0.1}


def simulator(mech, kappa):
    """A Newton iterate that is off by e has a derivative that is off by sqrt(e): steps are solved near round-off."""
    hard = mech.contacts or any(np.isfinite(joint.limits).any() for joint in mech.joints)
    return dojo.Simulator(mech, time_step=H, kappa=kappa, tolerance=3e-14 if hard else 1e-12)


def check(mech, x, u, kappa):
    """Both Jacobians."""
    return check_step(simulator(mech, kappa), x, u)


def placed(mech, x, u, regime):
    """The mechanism with the ground where its lowest contact would be GAP[regime] above it after a free step."""
    far = dataclasses.replace(mech, contacts=[dataclasses.replace(c, height=-1e3) for c in mech.contacts])
    sim = simulator(far, 1e-12)
    lowest = gaps(sim, sim.step(x, u).x).min() - 1e3
    contacts = [dataclasses.replace(c, height=lowest - GAP[regime], friction=FRICTION[regime]) for c in mech.contacts]
    return dataclasses.replace(mech, contacts=contacts)


def assert_regime(mech, result, regime, law, kappa):
    """The contact with the largest impulse matches the name of its regime, within the limits of kappa."""
    impulse = np.asarray(result.contacts.impulse)
    impulse = impulse[np.argmax(impulse[:, 2])]
    if kappa > 1e-4 or law != "nonlinear":
        return
    ratio = np.linalg.norm(impulse[:2]) / (FRICTION[regime] * impulse[2])
    if regime == "flying":
        assert impulse[2] < 1e-3
    elif regime == "sticking":
        assert ratio < 0.9 and impulse[2] > 1e-2, ratio
    elif regime == "sliding":
        assert ratio > 0.99 and impulse[2] > 1e-2, ratio


@pytest.mark.sweep(4)
@pytest.mark.parametrize("links", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
def test_joints(kind, links, rng):
    """Every joint between free bodies: springs, dampers, gravity, inputs on every degree of freedom."""
    mech = chain(kind, links, gravity=(0.0, 0.0, -9.81), spring=3.0, damper=0.2)
    sim = simulator(mech, 1e-6)
    for speed in (0.5, 8.0):
        check(mech, random_state(sim, rng, speed), rng.normal(size=sim.nu), 1e-6)


@pytest.mark.parametrize("kind", [k for k in KINDS if k != "fixed"])
def test_joints_to_the_world(kind, rng):
    mech = chain(kind, 1, base=None, gravity=(0.0, 0.0, -9.81), spring=3.0, damper=0.2)
    sim = simulator(mech, 1e-6)
    check(mech, random_state(sim, rng, 2.0), rng.normal(size=sim.nu), 1e-6)


def test_armature(rng):
    for kind in ("revolute", "orbital", "planar_axis", "screw"):
        mech = chain(kind, 2, gravity=(0.0, 0.0, -9.81), spring=3.0, damper=0.2, armature=0.3)
        sim = simulator(mech, 1e-6)
        check(mech, random_state(sim, rng, 2.0), rng.normal(size=sim.nu), 1e-6)


@pytest.mark.parametrize("kind", ["spherical", "cylindrical_free", "planar_free"])
@pytest.mark.parametrize("angle", [0.3, 0.58])
def test_cone_limits(kind, angle, rng):
    """Away from the cone, and arriving at it in this very step."""
    mech = chain(kind, 1, base=None, cone=0.6, damper=0.1, gravity=(0.0, 0.0, -9.81))
    axis = np.array(mech.joints[-1].axis)
    across = np.cross(axis, [1.0, 0.0, 0.0]) / np.linalg.norm(np.cross(axis, [1.0, 0.0, 0.0]))
    sim = simulator(mech, 1e-6)
    x = np.array(sim.neutral())
    x[sim.nq - 4 : sim.nq] = rot.mul(rot.exp(angle * across), rot.exp(0.7 * axis))
    x[-3:] = rot.rotate(rot.exp(-0.7 * axis), 2.0 * across + axis)
    for kappa in KAPPAS:
        check(mech, x, rng.normal(size=sim.nu), kappa)


@pytest.mark.sweep(8)
@pytest.mark.parametrize("regime", GAP)
@pytest.mark.parametrize("kind", KINDS)
def test_contact_behind_every_joint(kind, regime, rng):
    mech = chain(kind, 1, gravity=(0.0, 0.0, -9.81), spring=3.0, damper=0.2)
    mech = dataclasses.replace(mech, contacts=[dojo.Contact("body1", point=(0.1, -0.05, -0.2), radius=0.05)])
    sim = simulator(mech, 1e-6)
    speed = 2.0 if regime == "sliding" else 0.02
    x, u = random_state(sim, rng, speed, spread=0.4), 0.1 * rng.normal(size=sim.nu)
    mech = placed(mech, x, u, regime)
    for kappa in KAPPAS if regime != "sticking" else KAPPAS[:2]:
        assert_regime(mech, check(mech, x, u, kappa), regime, "nonlinear", kappa)


@pytest.mark.sweep(3)
@pytest.mark.parametrize("kind", KINDS)
def test_hard_sticking_behind_every_joint(kind, rng):
    mech = chain(kind, 1, gravity=(0.0, 0.0, -9.81), spring=3.0, damper=0.2)
    mech = dataclasses.replace(mech, contacts=[dojo.Contact("body1", point=(0.1, -0.05, -0.2), radius=0.05)])
    sim = simulator(mech, 1e-6)
    x, u = random_state(sim, rng, 0.02, spread=0.4), 0.1 * rng.normal(size=sim.nu)
    mech = placed(mech, x, u, "sticking")
    check(mech, x, u, KAPPAS[2])


MECHANISMS = {
    "ball": lambda law: ball(law=law),
    "block": lambda law: block(law=law),
    "block on a slope": lambda law: block(law=law, normal=(0.3, -0.2, 0.9)),
}


@pytest.mark.sweep(6)
@pytest.mark.parametrize("regime", GAP)
@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("name", MECHANISMS)
def test_contact_laws(name, law, regime, rng):
    mech = MECHANISMS[name](law)
    speed = np.array([2.0, 1.0, -0.5, 0.5, -1.0, 2.0]) * (1.0 if regime == "sliding" else 0.02)
    u = 0.1 * rng.normal(size=simulator(mech, 1e-6).nu)
    x = np.r_[0.0, 0.0, 0.0, rot.exp(np.array([0.2, 0.1, -0.4])), speed]
    mech = placed(mech, x, u, regime)
    for kappa in KAPPAS:
        result = check(mech, x, u, kappa)
        if name != "block on a slope":
            assert_regime(mech, result, regime, law, kappa)


@pytest.mark.parametrize("fast", [False, True])
@pytest.mark.parametrize("push", [0.0, 1.0])
def test_limits(push, fast, rng):
    """Pressed against a limit, or arriving at it in this very step."""
    for mech in (
        slider(limits=(-0.5, 0.5), spring=2.0),
        pendulum(2, limits=(-0.5, 0.5), damper=0.1),
        chain("planar_axis", 1, base=None, limits=[(-0.5, 0.5), None, (-0.5, 0.5)]),
    ):
        nv = simulator(mech, 1e-6).nv
        speed = 5.0 if fast else 0.1
        x = np.r_[np.full(nv, 0.5 - H * speed * (1.0 - 0.3 * push)), np.full(nv, speed)]
        for kappa in KAPPAS:
            check(mech, x, push * rng.normal(size=nv), kappa)


@pytest.mark.sweep(5)
@pytest.mark.parametrize("kind", [kind for kind in KINDS if kind != "fixed"])
def test_limits_of_every_kind(kind, rng):
    """Every plain coordinate arrives at its bound in this very step."""
    mech = limited(kind)
    sim = simulator(mech, 1e-6)
    q, v = np.array(mech.neutral), rng.normal(size=sim.nv)
    for joint in mech.joints:
        for d in range(joint.nv - 3 * (joint.nrot == 3)):
            q[mech.q_slice(joint.name).start + d] = 0.28
            v[mech.v_slice(joint.name).start + d] = 1.0 + 0.2 * d
    for kappa in KAPPAS:
        check(mech, np.concatenate([q, v]), rng.normal(size=sim.nu), kappa)


def test_fast_spin():
    """A third of a turn in one step."""
    mech = ball()
    x = np.r_[0.0, 0.0, 0.3, rot.exp(np.array([0.3, 0.2, 0.1])), 1.0, 0.0, -3.0, 60.0, 50.0, -40.0]
    for kappa in KAPPAS:
        check(mech, x, np.zeros(6), kappa)


def test_trajectory_linearization_agrees_with_single_steps(rng):
    """linearize_trajectory gives the Jacobians of every knot, and chains them over substeps."""
    sim = dojo.Simulator(block(), time_step=H, kappa=1e-4, tolerance=1e-12)
    x0 = np.r_[0.0, 0.0, 0.4, rot.exp(np.array([0.2, 0.1, -0.4])), 1.0, 0.0, -1.0, 1.0, 2.0, 0.0]
    us = np.zeros((8, sim.nu))
    xs = sim.rollout(x0, us).x
    out = sim.linearize_trajectory(xs, us)
    assert np.all(np.asarray(out.status) == 0)
    for t in range(8):
        A, _ = sim.linearize(xs[t], us[t])
        np.testing.assert_allclose(out.A[t], A, rtol=0, atol=1e-8 * np.abs(A).max())
        np.testing.assert_allclose(sim.difference(x1=out.x_next[t], x0=xs[t + 1]), 0.0, atol=1e-9)
    chained = sim.linearize_trajectory(xs[::2], us[::2], substeps=2)
    for k in range(4):
        expected = out.A[2 * k + 1] @ out.A[2 * k]
        np.testing.assert_allclose(chained.A[k], expected, rtol=0, atol=1e-8 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("shape", "kappa", "seed"),
    [(dojo.Box(0.3, 0.2, 0.1), 1e-3, 2), (dojo.Capsule(0.08, 0.3), 0.03, 7)],
    ids=["box", "capsule"],
)
def test_the_next_state_as_a_guess_leads_to_the_same_step(shape, kappa, seed):
    """Features of shapes that are active depend on the state, and not on where the solver starts: with those at the
    next state a step of the box ended .2 m/s elsewhere, and the gradient of its motion was off by half.
    """
    obstacle = dojo.Collision("a", shape_b=dojo.Box(1, 1, 0.2))
    scene = dojo.Mechanism(
        [dojo.Body("a", 1.0, shape=shape)], [dojo.Joint("floating", None, "a")], collisions=[obstacle]
    )
    sim = dojo.Simulator(scene, time_step=0.02, kappa=kappa, tolerance=1e-10)
    draw = np.random.default_rng(seed)
    x0 = np.r_[0.0, 0.0, 0.4, 1.0, 0.0, 0.0, 0.0, np.zeros(6)]
    turned = 0.3 * draw.standard_normal(6) * [0.1, 0.1, 0.2, 1, 1, 1]
    motion = sim.rollout(sim.integrate(x0, np.r_[turned, 2.0 * draw.standard_normal(6)]), np.zeros((8, 0)))
    found = sim.linearize_trajectory(motion.x, motion.u)
    np.testing.assert_allclose(sim.difference(found.x_next, motion.x[1:]), 0.0, atol=1e-9)
    for t in range(8):
        A, _ = sim.linearize(motion.x[t])
        np.testing.assert_allclose(found.A[t], A, rtol=0, atol=1e-6 * np.abs(A).max())


def test_difference_takes_the_new_state_first(rng):
    """difference(x1, x0) is the dx with integrate(x0, dx) = x1."""
    sim = dojo.Simulator(chain("spherical", 2))
    x0, dx = random_state(sim, rng), 0.5 * rng.normal(size=sim.ndx)
    np.testing.assert_allclose(sim.difference(sim.integrate(x0, dx), x0), dx, atol=1e-12)
