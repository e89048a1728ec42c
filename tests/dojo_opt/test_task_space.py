"""Costs and constraints in task space: values against Kinematics and the simulator, derivatives against differences."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt import constraint, cost
from dojo_opt.planning.manifold import tangent_layout
from sim.simulator.simulator import Simulator

T = 3


def expansion_error(sim, term, xs, us):
    """Largest error of the gradient of a term against central differences of its value, relative to the gradient.

    Along random directions of all states and controls together, in which every component has its full weight.
    """
    n = sim.ndx
    g, H = np.zeros((T + 1, n + sim.nu)), np.zeros((T + 1, n + sim.nu, n + sim.nu))
    term.expand(xs, us, g, H)
    np.testing.assert_allclose(H, np.swapaxes(H, 1, 2), atol=1e-9 * np.abs(H).max())
    np.testing.assert_array_equal(g[T, n:], 0.0)
    worst, rng = 0.0, np.random.default_rng(1)
    for _ in range(12):
        along = rng.choice((-1.0, 1.0), g.shape)
        values = [
            term.value(sim.integrate(xs, step * along[:, :n]), us + step * along[:T, n:]) for step in (1e-6, -1e-6)
        ]
        worst = max(worst, abs((values[0] - values[1]) / 2e-6 - np.sum(g * along)))
    assert np.abs(g).max() > 0.0
    return worst / np.abs(g).max()


@pytest.fixture(scope="module")
def walker():
    """A quadruped in random motion near the ground, feet pressing and slipping."""
    sim = Simulator(dojo.models.quadruped(), time_step=0.02, kappa=1e-4, tolerance=1e-12)  # for differences
    rng = np.random.default_rng(0)
    start = sim.integrate(sim.neutral(), 0.05 * np.r_[np.zeros(sim.nv), rng.normal(size=sim.nv)])
    motion = sim.rollout(start, 0.5 * rng.normal(size=(T, sim.nu)), throw=True)
    return sim, motion.x.copy(), motion.u.copy()


def bound(spec, sim, xs):
    return spec.bind(sim, T, tangent_layout(sim, xs[0]))


FOOT, TRUNK = "FR_calf", "trunk"
TURN = np.array([0.5, 0.5, -0.5, 0.5])
TASKS = {
    "point": (
        cost.Point(FOOT, (0.1, 0.2, 0.3), offset=(0.05, -0.02, 0.1), weight={"x": 2.0, "z": np.arange(4.0)}),
        1e-6,
    ),
    "box": (cost.Point(FOOT, lower=0.2, upper=(0.25, np.inf, 0.3)), 1e-6),
    "frame": (cost.Frame(TRUNK, (0.1, 0.0, 0.3), TURN, weight={"place": 1.0, "orientation": 0.3}), 1e-6),
    "turn": (cost.Frame(TRUNK, orientation=TURN, knots=[1, -1]), 1e-6),
    "velocity": (cost.Velocity(FOOT, np.full(6, 0.3), offset=(0.1, 0.0, 0.0)), 1e-6),
    "centre": (cost.CenterOfMass((0.1, 0.0, 0.5)), 1e-6),
    "momentum": (cost.Momentum(np.full(6, 2.0)), 1e-6),
    "slip": (cost.Slip(knots=[1, 2]), 1e-6),
    "near": (cost.Slip(near=0.01, scale=2.0), 1e-6),
    "ground": (cost.Clearance(FOOT, lower=0.1), 1e-6),
    "bodies": (cost.Clearance(FOOT, "RL_calf", 0.1, dojo.Capsule(0.02, 0.2), dojo.Box(0.1, 0.2, 0.05)), 1e-6),
    "obstacle": (cost.Clearance(TRUNK, dojo.HalfSpace(), 0.1, dojo.Box(0.3, 0.2, 0.1)), 1e-6),
    "force": (cost.ContactForce(target=20.0, weight={"normal": 1.0, "first": 0.1}), 1e-6),
    "friction": (cost.FrictionUse(FOOT, share=0.01), 1e-6),
    "limits": (cost.JointLimits(margin=0.49), 1e-6),
    "rate": (cost.TorqueRate(0.3, before=np.zeros(12)), 1e-6),
    "change": (cost.TorqueRate(limit=0.1), 1e-6),
}


@pytest.mark.parametrize("name", TASKS)
def test_gradients_agree_with_differences(walker, name):
    sim, xs, us = walker
    spec, tolerance = TASKS[name]
    assert expansion_error(sim, bound(spec, sim, xs), xs, us) <= tolerance


def test_positions_and_velocities_agree_with_kinematics(walker):
    sim, xs, us = walker
    kin = dojo.Kinematics(sim)
    at, R = kin.pose(FOOT, xs[:, : sim.nq])
    point = bound(cost.Point(FOOT, offset=(0.1, 0.2, 0.3)), sim, xs)
    point.update(xs, us)
    np.testing.assert_allclose(point.residual, at + R @ [0.1, 0.2, 0.3], atol=1e-12)
    frame = bound(cost.Frame(FOOT, orientation=TURN), sim, xs)
    frame.update(xs, us)
    w, x, y, z = TURN
    from scipy.spatial.transform import Rotation

    error = (Rotation.from_quat([x, y, z, w]).inv() * Rotation.from_matrix(R)).as_rotvec()
    np.testing.assert_allclose(frame.residual, error, atol=1e-9)
    before = np.array([sim.integrate(x, np.r_[-sim.time_step * x[sim.nq :], np.zeros(sim.nv)]) for x in xs])
    speed = bound(cost.Velocity(FOOT), sim, xs)
    speed.update(xs, us)
    np.testing.assert_allclose(
        speed.residual[:, :3], (at - kin.pose(FOOT, before[:, : sim.nq])[0]) / sim.time_step, atol=1e-9
    )


def test_forces_and_slips_agree_with_the_rollout(walker):
    sim, xs, us = walker
    contacts = sim.rollout(xs[0], us, throw=True).contacts
    force = bound(cost.ContactForce(), sim, xs)
    force.update(xs, us)
    normal = force.residual.reshape(T, -1, 3)[..., 0]
    expected = np.einsum("tck,tck->tc", contacts.impulse, contacts.normals) / sim.time_step
    np.testing.assert_allclose(normal, expected, atol=1e-4 * np.abs(expected).max())
    slip = bound(cost.Slip(), sim, xs)
    slip.update(xs, us)
    size = np.linalg.norm(slip.residual.reshape(T + 1, -1, 2), axis=2)
    np.testing.assert_allclose(size[1:], contacts.slip, atol=1e-9)


def test_an_arm_reaches_a_pose_and_keeps_clear_of_a_ball():
    sim = Simulator(dojo.models.panda(gripper=False), time_step=0.05)
    kin, ball = dojo.Kinematics(sim), dojo.Sphere(0.1, center=(0.45, 0.0, 0.5))
    q = dojo.ik(sim, {"link7": (0.45, -0.2, 0.5)}, sim.neutral()[: sim.nq]).q
    start = np.r_[q, np.zeros(sim.nv)]
    problem = dojo.Problem(
        sim,
        start,
        20,
        cost=[cost.Effort(1e-4), cost.Tracking(start, {"v": 1e-2})],
        constraints=[
            constraint.Point("link7", (0.45, 0.2, 0.5), knots=-1),
            constraint.Clearance("link7", ball, shape_a=dojo.Sphere(0.02)),
        ],
        controls0=kin.gravity_torques(q),
    )
    plan = dojo.ilqr(problem)
    at, _ = kin.pose("link7", plan.x[:, : sim.nq])
    assert plan.success, plan.message
    assert np.linalg.norm(at[-1] - (0.45, 0.2, 0.5)) < 1e-3
    assert np.linalg.norm(at - ball.center, axis=1).min() > 0.119


def test_a_periodic_center_of_mass_is_a_constraint_of_a_free_start(walker):
    sim, xs, us = walker
    tie = constraint.CenterOfMass((0.1, 0.0, 0.0), periodic=True)
    term = bound(tie, sim, xs)
    end, start, _, _ = term.coupling(xs, us)
    for i, J in ((T, end), (0, start)):
        for d in range(sim.nv):
            values = []
            for step in (1e-6, -1e-6):
                x = xs.copy()
                x[i] = sim.integrate(xs[i], step * np.eye(sim.ndx)[d])
                term.update(x, us)
                values.append(term.residual[0].copy())
            np.testing.assert_allclose((values[0] - values[1]) / 2e-6, J[:, d], atol=1e-8)
    with pytest.raises(ValueError, match="has to be a constraint"):
        dojo.Problem(sim, xs[0], T, cost=tie)


@pytest.mark.parametrize(
    ("spec", "sentence"),
    [
        (cost.Point("nose"), "FR_calf"),
        (cost.Frame(TRUNK), "orientation"),
        (cost.Point(TRUNK, weight={"u": 1.0}), "x, y, z"),
        (cost.Point(TRUNK, lower=1.0, upper=0.0), "lower <= upper"),
        (cost.ContactForce(knots=T), "knots"),
        (cost.Slip("trunk"), "FR"),
        (cost.Clearance(FOOT, FOOT), "itself"),
        (cost.JointLimits(margin=9.0), "exceeds half the range"),
    ],
)
def test_mistakes_are_refused(walker, spec, sentence):
    sim, xs, _ = walker
    with pytest.raises(ValueError, match=sentence):
        bound(spec, sim, xs)
