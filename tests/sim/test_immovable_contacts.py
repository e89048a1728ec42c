"""Contacts that no motion can move, or lift out of the ground; and no number that is not finite without a status."""

from __future__ import annotations

import glob
import warnings

import numpy as np
import pytest
from naive import rotation as rot

import dojo_opt as dojo
from sim.integrators.rollout import is_finite_matrix
from sim.mechanism.immovable_contacts import IDLE, SUNK
from sim.mechanism.mechanism import Mechanism
from sim.simulator.engines.engine import REPORT, refuse
from solvers.compiler import local_kernel
from support.scenes import random_state

SUNKEN = dojo.Status.CONTACT_SUNK
CUBE = [(x, y, z) for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]


def hinged(height: float, axis=(0.0, 1.0, 0.0), points=CUBE, kind: str = "revolute", **contact) -> Mechanism:
    """A cube on an axis through its centre, at some height above the ground."""
    contacts = [dojo.Contact("cube", p, **contact) for p in points]
    joint = dojo.Joint(kind, None, "cube", parent_point=(0, 0, height), axis=axis)
    return Mechanism([dojo.Body("cube", 1.0, np.full(3, 1 / 6))], [joint], contacts)


def post(height: float) -> Mechanism:
    """A contact on a body that is fixed to the world, which carries an arm."""
    bodies = [dojo.Body("post", 1.0, (1, 1, 1)), dojo.Body("arm", 1.0, (1, 1, 1))]
    joints = [
        dojo.Joint("fixed", None, "post", parent_point=(0, 0, height)),
        dojo.Joint("revolute", "post", "arm", axis=(0, 1, 0), child_point=(0, 0, 0.5)),
    ]
    return Mechanism(bodies, joints, [dojo.Contact("post", name="foot")])


def held(mech: Mechanism) -> list[int]:
    return [int(k) for k in dojo.Simulator(mech).model.contact_hold]


@pytest.mark.parametrize("height", [0.1, 1e-9, 0.0, -1e-10])
def test_a_contact_of_a_body_that_cannot_move_is_no_part_of_a_step(height: float) -> None:
    sim = dojo.Simulator(post(height), 0.01)
    x = sim.integrate(sim.neutral(), np.array([0.3, 1.0]))
    t = sim.rollout(x, np.zeros((3, sim.nu)))
    assert t.success and t.iterations.max() < 10
    np.testing.assert_array_equal(t.contacts.impulse, 0.0)
    np.testing.assert_allclose(t.contacts.gap, height, atol=1e-15)
    A, _ = sim.linearize(x)
    free, _ = dojo.Simulator(Mechanism(post(1.0).bodies, post(1.0).joints), 0.01).linearize(x)
    np.testing.assert_allclose(A, free, atol=1e-7)  # Newton's method ends where it may


def test_below_the_ground_it_is_refused_by_name() -> None:
    sim = dojo.Simulator(post(-0.1), 0.01)
    r = sim.step(sim.neutral())
    assert (r.status, r.iterations) == (SUNKEN, 1)
    np.testing.assert_array_equal(r.x, sim.neutral())
    with pytest.raises(dojo.SimulationError, match=r"below the ground.*It is 'foot'\."):
        sim.step(sim.neutral(), throw=True)
    with pytest.raises(dojo.SimulationError, match="'foot'"):
        _ = sim.linearize(sim.neutral()).A
    assert "'foot'" in sim.linearize(sim.neutral()).message
    t = sim.rollout(sim.neutral(), np.zeros((2, sim.nu)))
    assert (t.status, t.solved_steps) == (SUNKEN, 0) and "'foot'" in t.message


@pytest.mark.parametrize(
    "height, axis, status",
    [
        (0.49, (0, 1, 0), "SUNK"),  # lying flat it needs half a side, and no angle needs less
        (0.51, (0, 1, 0), "MOVES"),  # at 45 degrees its edge would be below, but it can turn
        (0.3, (0, 0, 1), "SUNK"),
        (0.7, (0, 0, 1), "IDLE"),
        (0.49, (0, 1, 1), "SUNK"),
        (0.51, (0, 1, 1), "MOVES"),
    ],
)
def test_a_cube_on_an_axis(height: float, axis: tuple[float, ...], status: str) -> None:
    mech = hinged(height, np.array(axis) / np.linalg.norm(axis))
    found = held(mech)
    if status == "SUNK":
        assert found.count(SUNK) >= 1
        assert dojo.Simulator(mech).step(dojo.Simulator(mech).neutral()).status == SUNKEN
    else:
        assert set(found) == ({IDLE} if status == "IDLE" else {0})


@pytest.mark.slow
def test_the_angle_that_lifts_most_is_found(rng: np.random.Generator) -> None:
    """Random bodies on random axes, against a scan of all angles."""
    seen = set()
    for _ in range(30):
        axis = rng.normal(size=3)
        axis /= np.linalg.norm(axis)
        points = rng.normal(size=(rng.integers(1, 8), 3))
        angles = np.linspace(-np.pi, np.pi, 1001)
        z = np.array([rot.rotate(rot.exp(a * axis), points)[:, 2].min() for a in angles])
        for height in (-z.max() - 0.01, -z.max() + 0.01):
            found = held(hinged(height, axis, points))
            assert (SUNK in found) == (height < -z.max()), (height, z.max())
            seen.add(SUNK in found)
    assert seen == {True, False}


@pytest.mark.parametrize("seed", range(12))
def test_reach_bounds_the_motion_of_a_chain(seed: int) -> None:
    """Random arms: contacts called sunk never have a larger gap in any pose, and idle ones keep theirs."""
    rng = np.random.default_rng(seed)
    kinds = ("fixed", "revolute", "revolute", "spherical", "orbital", "prismatic", "planar", "screw")
    up = np.array([0.0, 0.0, 1.0])
    bodies, joints = [], []
    for i in range(3):
        kind = str(rng.choice(kinds)) if i else str(rng.choice(["fixed", "revolute", "prismatic", "planar", "screw"]))
        axis = up if rng.random() < 0.6 else np.array([1.0, 0.0, 0.0])
        bodies.append(dojo.Body(f"b{i}", 1.0, (0.1, 0.1, 0.1)))
        points = {"parent_point": rng.normal(size=3) * 0.3, "child_point": rng.normal(size=3) * 0.3}
        pitch = 3.0 if kind == "screw" else 0.0
        joints.append(dojo.Joint(kind, f"b{i - 1}" if i else None, f"b{i}", axis=axis, pitch=pitch, **points))
    bodies.append(dojo.Body("last", 1.0, (0.1, 0.1, 0.1)))
    joints.append(dojo.Joint("revolute", "b2", "last", axis=(0, 1, 0)))
    contacts = [dojo.Contact(f"b{i}", rng.normal(size=3) * 0.3, height=rng.normal()) for i in range(3)]
    mech = Mechanism(bodies, joints, contacts)
    loose = dojo.Simulator(Mechanism(bodies, joints))
    found = held(mech)
    gaps = []
    for _ in range(300):
        z = loose.maximal(random_state(loose, rng, spread=2.0))
        gaps.append(
            [z[i, 2] + rot.rotate(z[i, 6:10], np.asarray(c.point))[2] - c.height for i, c in enumerate(contacts)]
        )
    top, spread = np.max(gaps, axis=0), np.ptp(gaps, axis=0)
    for k, hold in enumerate(found):
        assert hold != SUNK or top[k] < 0.0
        assert (spread[k] < 1e-12) == (hold == IDLE or (hold == SUNK and spread[k] < 1e-12))


def test_a_turntable_keeps_its_height_and_turns() -> None:
    """Its gap is zero whatever it does: before, no impulse could be told, and the step ended at its iteration limit."""
    sim = dojo.Simulator(hinged(0.5, (0, 0, 1), friction=1.0), 0.01)
    x = np.array([0.0, 2.0])
    t = sim.rollout(x, np.zeros((5, 1)), throw=True)
    np.testing.assert_allclose(t.x[:, 1], 2.0, rtol=1e-9)


@pytest.mark.parametrize("name", ["cube_rotate.urdf", "diff_ring.urdf"])
def test_files_that_stand_in_the_ground(name: str) -> None:
    data = pytest.importorskip("pybullet_data").getDataPath()
    (file,) = glob.glob(f"{data}/**/{name}", recursive=True)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        sim = dojo.Simulator(dojo.load_urdf(file), 0.005)
    r = sim.step(sim.neutral())
    assert (r.status, r.iterations) == (SUNKEN, 1)


def test_parts_that_are_fixed_to_one_another_do_not_collide() -> None:
    """Far apart, touching or overlapping: nothing moves them."""
    for height in (1.5, 1.0, 0.5):
        box = dojo.Box(1, 1, 1)
        bodies = [dojo.Body(n, 1.0, shape=box) for n in "ab"] + [dojo.Body("c", 1.0, (1, 1, 1))]
        joints = [
            dojo.Joint("fixed", None, "a"),
            dojo.Joint("fixed", "a", "b", parent_point=(0, 0, height)),
            dojo.Joint("revolute", "b", "c", axis=(0, 1, 0), child_point=(0, 0, 0.5)),
        ]
        both = [dojo.Collision("a", "b"), dojo.Collision("b", shape_b=dojo.Box(1, 1, 1))]
        sim = dojo.Simulator(Mechanism(bodies, joints, collisions=both), 0.01)
        assert sim.step(sim.neutral(), throw=True).contacts.gap.shape == (0,)
        assert "fixed to one another, omitted" in sim.describe()
        assert not any(n.startswith("friction") for n in sim.parameters().names)


def _anything(rng: np.random.Generator) -> tuple[Mechanism, bool]:
    """A chain of parts of any mass on any joints, with contacts anywhere; whether it stands in the world."""
    fixed = bool(rng.random() < 0.6)
    kinds = ("fixed", "revolute", "spherical", "prismatic", "orbital", "planar_axis")
    bodies, joints, contacts = [], [], []
    for i in range(int(rng.integers(2, 6))):
        mass = 10.0 ** rng.uniform(-3, 3)
        bodies.append(dojo.Body(f"b{i}", mass, np.full(3, 10.0 ** rng.uniform(-3, 0) * mass)))
        kind = (str(rng.choice(kinds)) if fixed else "floating") if i == 0 else str(rng.choice(kinds))
        ends = {} if kind == "floating" else {"child_point": rng.normal(size=3) * 0.3}
        axis = np.eye(3)[rng.integers(3)]
        parent = {"parent_point": rng.normal(size=3) * 0.3} if i else {}
        joints.append(dojo.Joint(kind, f"b{i - 1}" if i else None, f"b{i}", axis=axis, **ends, **parent))
        for _ in range(int(rng.integers(0, 3))):
            law = {"law": str(rng.choice(["linear", "nonlinear", "impact"])), "friction": float(rng.choice([0.0, 0.8]))}
            height = float(rng.choice([-1.0, -0.2, 0.0, 0.1]))
            bounce = float(rng.choice([0.0, 0.0, 0.7]))
            contacts.append(dojo.Contact(f"b{i}", rng.normal(size=3) * 0.2, height=height, restitution=bounce, **law))
    if all(joint.nv == 0 for joint in joints):
        joints[-1] = dojo.Joint("revolute", joints[-1].parent, joints[-1].child, axis=(0, 1, 0))
    return Mechanism(bodies, joints, contacts), fixed


def _numbers(found: object) -> bool:
    """Whether all arrays of a result are finite."""
    values = vars(found).values() if hasattr(found, "__dict__") else (found,)
    return all(np.isfinite(v).all() for v in values if isinstance(v, np.ndarray) and v.dtype.kind == "f")


@pytest.mark.sweep(4)
@pytest.mark.parametrize("seed", range(40))
def test_numbers_are_finite_or_the_status_says_not(seed: int) -> None:
    rng = np.random.default_rng(seed)
    mech, fixed = _anything(rng)
    sim = dojo.Simulator(mech, 10.0 ** rng.uniform(-3, -1.5), max_iterations=60)
    x = random_state(sim, rng, speed=1.0, spread=0.5)
    if not fixed:
        x[2] += 1.0
    u = np.zeros(sim.nu)
    r = sim.step(x, u)
    assert _numbers(r) and _numbers(r.contacts)
    t = sim.rollout(x, np.zeros((5, sim.nu)))
    assert _numbers(t) and _numbers(t.contacts)
    linear = sim.linearize_trajectory(x[None], u[None])
    assert _numbers(linear)
    if not r.success or linear.status[0] != 0:
        with pytest.raises(dojo.SimulationError):
            _, _ = sim.linearize(x, u)
        return
    for block in sim.linearize(x, u, wrt=("state", "input", "mass", "com")).values():
        assert np.isfinite(block).all()
    assert _numbers(sim.reactions(x, u))
    path = sim.rollout(x, u[None], throw=True)
    pulled = sim.vjp(path, np.ones((2, sim.ndx)), wrt=("state", "input", "mass"))
    # it solves each step again, which may end elsewhere in the rounding of a step that took dozens of iterations
    for block in pulled.values() if pulled.success else ():
        assert np.isfinite(block).all()


def test_a_number_that_is_not_finite_is_seen() -> None:
    """At any step of the motion; the status of the step says so."""
    for wrong in (np.nan, np.inf, -np.inf):
        for count in (3, 3000):  # small ones and large ones are looked at in two ways
            reports, rows = np.zeros((count, REPORT)), np.ones((count, 4, 3))
            assert refuse(reports, count, rows) == count
            rows[1, 2, 0] = wrong
            assert refuse(reports, count, rows) == 1
            assert list(np.flatnonzero(reports[:, 0] == dojo.Status.NOT_FINITE)) == [1]


def test_a_matrix_that_is_not_finite_is_seen(rng: np.random.Generator) -> None:
    """In any place, whatever its size; large numbers are numbers."""
    seen = local_kernel(lambda M: is_finite_matrix(M))
    for shape in [(m, n) for m in (0, 1, 5) for n in (0, 1, 7, 8, 9, 36)]:
        M = rng.normal(size=shape) * 1e300
        assert seen(M) and is_finite_matrix(M)
        for place in range(M.size):
            spoilt = M.copy()
            spoilt.flat[place] = (np.nan, np.inf, -np.inf)[place % 3]
            assert not seen(spoilt), (shape, place)


def test_a_mechanism_spoilt_afterwards_gets_a_status() -> None:
    """A result that is not finite never counts as solved, whatever the kernels do."""
    for field in ("contact_friction", "contact_radius", "body_mass", "contact_point"):
        sim = dojo.Simulator(hinged(1.0), 0.01)
        getattr(sim._engine.model, field)[...] = np.nan
        t = sim.rollout(sim.neutral(), np.zeros((3, 1)))
        linear = sim.linearize_trajectory(np.tile(sim.neutral(), (3, 1)), np.zeros((3, 1)))
        assert np.isfinite(t.contacts.impulse).all() and np.isfinite(t.contacts.gap).all()
        assert np.isfinite(linear.A).all() and np.isfinite(linear.B).all()
        assert not t.success and linear.status.all()


def test_derivatives_beyond_all_numbers_end_a_rollout() -> None:
    """At the step whose derivatives they are, although the step itself is solved."""
    sim = dojo.Simulator(dojo.models.pendulum(mass=1e-3), 0.01)
    x, us = sim.neutral(), np.zeros((3, 1))
    sim._engine.model.input_wrench[...] = 1e308  # per kg m^2 of the link it is infinite
    assert sim.rollout(x, us).success
    _, linear = sim.linearize_rollout(x, us)
    assert list(linear.status) == 3 * [dojo.Status.NOT_FINITE]
    assert not linear.A.any() and not linear.B.any()
