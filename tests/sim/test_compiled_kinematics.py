"""Kinematics that compiled functions call: beside `Kinematics`, the planner's own quantities, and central differences."""

from __future__ import annotations

import pickle
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import dojo_opt as dojo
from support.mechanisms import chain_with, random_state

JOINTS = ["floating", "free_orbital", "screw"]


def scene(kind, rng):
    """A chain with a joint of this kind, a frame on its last body, and a state."""
    mech = chain_with(kind, False)
    sim = dojo.Simulator(mech, time_step=0.02)
    kin = dojo.Kinematics(sim)
    kin.add("tip", mech.body_names[-1], (0.1, -0.2, 0.3), (0.6, 0.0, 0.8, 0.0))
    return sim, kin, np.concatenate(random_state(rng, mech))


def filled(function, x, shape):
    out = np.full(shape, np.nan)
    function(x, out)
    return out


@pytest.mark.slow
@pytest.mark.parametrize("kind", JOINTS)
def test_quantities_agree_with_kinematics(kind, rng):
    sim, kin, x = scene(kind, rng)
    q = x[: sim.nq]
    pose = filled(kin.compiled("pose", "tip"), x, 7)
    place, turn = kin.pose("tip", q)
    np.testing.assert_allclose(pose[:3], place, atol=1e-13)
    w, v = pose[3], pose[4:]
    cross = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    np.testing.assert_allclose(np.eye(3) + 2 * w * cross + 2 * cross @ cross, turn, atol=1e-13)
    J = filled(kin.compiled("jacobian", "tip"), x, (6, sim.nv))
    np.testing.assert_allclose(J, kin.jacobian("tip", q), atol=1e-12)
    np.testing.assert_allclose(filled(kin.compiled("center_of_mass"), x, 3), kin.center_of_mass(q), atol=1e-13)
    np.testing.assert_allclose(filled(kin.compiled("com_jacobian"), x, (3, sim.nv)), kin.com_jacobian(q), atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("kind", JOINTS)
def test_velocities_are_those_of_the_last_step_and_their_derivatives_exact(kind, rng):
    sim, kin, x = scene(kind, rng)
    h, body = sim.time_step, sim.mechanism.body_names[-1]
    center = filled(kin.compiled("velocity", body), x, 6)
    z = sim.maximal(x)[-1]
    np.testing.assert_allclose(center[:3], z[3:6], atol=1e-11)
    np.testing.assert_allclose(center[3:], kin.pose(body, x[: sim.nq])[1] @ z[10:], atol=1e-9)
    velocity = kin.compiled("velocity", "tip")
    J = filled(kin.compiled("velocity_jacobian", "tip"), x, (6, sim.ndx))
    eps = 1e-6
    for d, dx in enumerate(eps * np.eye(sim.ndx)):
        ahead, behind = (filled(velocity, sim.integrate(x, s * dx), 6) for s in (1.0, -1.0))
        np.testing.assert_allclose(J[:, d], (ahead - behind) / (2 * eps), atol=1e-6 / h * eps + 1e-6)


def hand_of(kin, goal):
    """A residual of a user and its derivative, with two compiled quantities."""
    pose, rows = kin.compiled("pose", "link7"), kin.compiled("jacobian", "link7")
    nv = kin.sim.nv

    def residual(x, u, out):
        place = np.empty(7)
        pose(x, place)
        for k in range(3):
            out[k] = place[k] - goal[k]

    def jacobian(x, u, out):
        J = np.empty((6, nv))
        rows(x, J)
        for k in range(3):  # loops: NumPy's assignments of slices take seconds to compile
            for d in range(out.shape[1]):
                out[k, d] = J[k, d] if d < nv else 0.0

    return residual, jacobian


@pytest.fixture(scope="module")
def arm():
    return dojo.Simulator(dojo.models.panda(gripper=False), time_step=0.05)


def problem(sim, goal, **settings):
    residual, jacobian = hand_of(dojo.Kinematics(sim), goal)
    cost = [
        dojo.cost.Tracking(sim.neutral(), {"v": 0.1}),
        dojo.cost.ResidualCost(residual, 3, weight=100.0, jacobian=jacobian, **settings),
    ]
    return dojo.Problem(sim, sim.neutral(), 8, cost=cost, control_limits=None)


@pytest.mark.slow
def test_a_residual_of_the_user_has_the_terms_of_the_planner(arm):
    """Value, gradient and Hessian are those of `cost.Point`, which moves the hand to the same place."""
    goal = dojo.Kinematics(arm).pose("link7", arm.neutral()[: arm.nq])[0] + (0.1, 0.05, -0.1)
    ours = problem(arm, goal)
    theirs = dojo.Problem(arm, arm.neutral(), 8, cost=[dojo.cost.Point("link7", goal, weight=100.0)])
    x, us = np.tile(arm.neutral(), (9, 1)), np.zeros((8, arm.nu))
    n = arm.ndx + arm.nu
    g, H = np.zeros((2, 9, n)), np.zeros((2, 9, n, n))
    terms = ours.costs[1], theirs.costs[0]
    values = [term.value(x, us) for term in terms]
    for k, term in enumerate(terms):
        term.expand(x, us, g[k], H[k])
    np.testing.assert_allclose(values[0], values[1], rtol=1e-12)
    np.testing.assert_allclose(g[0], g[1], atol=1e-9)
    np.testing.assert_allclose(H[0], H[1], atol=1e-9)


@pytest.mark.slow
def test_functions_run_in_threads_and_other_processes(arm):
    kin = dojo.Kinematics(arm)
    function = kin.compiled("pose", "link7")
    rng = np.random.default_rng(4)
    states = arm.integrate(arm.neutral(), np.concatenate([rng.normal(size=(400, arm.nv)), np.zeros((400, arm.nv))], 1))
    exact = kin.pose("link7", states[:, : arm.nq])[0]
    with ThreadPoolExecutor(4) as pool:
        found = np.array(list(pool.map(lambda x: filled(function, x, 7), states)))
    np.testing.assert_allclose(found[:, :3], exact, atol=1e-12)
    again = pickle.loads(pickle.dumps(function))
    np.testing.assert_array_equal(filled(again, states[0], 7), found[0])


@pytest.mark.parametrize("settings", [{"order": 4}, {"accuracy": 1e-4}], ids=["order", "accuracy"])
def test_velocities_at_nodes_are_refused(arm, settings):
    """Their mean over the last step, which is what the function gives, cannot be had from the state."""
    kin = dojo.Kinematics(arm.replace(**settings))
    with pytest.raises(ValueError, match=r"compiled\('velocity'\): expected a Simulator of order 2, .* at the node"):
        kin.compiled("velocity", kin.frames[0])


def test_unknown_quantities_and_frames_are_refused(arm):
    kin = dojo.Kinematics(arm)
    with pytest.raises(ValueError, match="'place' is not one of"):
        kin.compiled("place", "link7")
    with pytest.raises(ValueError, match="did you mean 'link7'"):
        kin.compiled("pose", "link77")
    with pytest.raises(ValueError, match="expected the name of a frame"):
        kin.compiled("pose")
    with pytest.raises(ValueError, match="expected no frame"):
        kin.compiled("center_of_mass", "link7")


@pytest.mark.slow
def test_the_world_is_a_frame_that_does_not_move(arm):
    kin = dojo.Kinematics(arm)
    at = filled(kin.compiled("pose", "world"), arm.neutral(), 7)
    np.testing.assert_array_equal(at, [0, 0, 0, 1, 0, 0, 0])
    assert not filled(kin.compiled("velocity_jacobian", "world"), arm.neutral(), (6, arm.ndx)).any()
