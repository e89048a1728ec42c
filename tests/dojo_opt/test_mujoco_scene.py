"""The MuJoCo twin that the timing report compares with is the same mechanism: same numbers, same motion."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.engines import mujoco_scene
from sim.mechanism.body import Body
from sim.mechanism.contact import Contact
from sim.mechanism.input import Input
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.model.model import Model

mujoco = pytest.importorskip("mujoco")


def numbers(sim: dojo.Simulator) -> Model:
    return sim.model


def twin(sim: dojo.Simulator, **options: str) -> object:
    return mujoco_scene.load(numbers(sim), sim.time_step, **options)


def in_the_air(mechanism: Mechanism) -> tuple[np.ndarray, np.ndarray]:
    """(q, v) away from the ground, every joint turned and moving."""
    rng = np.random.default_rng(3)
    q = np.array(mechanism.neutral)
    for joint in mechanism.joints:
        at = mechanism.q_slice(joint.name)
        if joint.kind == "floating":
            q[at.start + 2] += 3.0
        if joint.nrot == 3:
            turn = rng.normal(size=4)
            q[at.stop - 4 : at.stop] = turn / np.linalg.norm(turn)
        elif joint.kind == "revolute":
            q[at] += 0.3 * rng.normal()
    return q, rng.normal(size=mechanism.nv)


def ball_and_slider() -> Mechanism:
    """The kinds that the models lack: spherical with spring and damper, cylindrical, and turned joint frames."""
    half = np.sqrt(0.5)
    bodies = [Body(name, 1.0 + k, (0.02, 0.03, 0.04)) for k, name in enumerate(("a", "b", "c"))]
    joints = [
        Joint("spherical", None, "a", child_point=(0.1, 0, 0.3), orientation=(half, half, 0, 0), damper=0.2),
        Joint(
            "cylindrical", "a", "b", parent_point=(0, 0, -0.3), child_point=(0, 0.1, 0.2), axis=(0, 1, 0), spring=30.0
        ),
        Joint("planar_axis", "b", "c", parent_point=(0, 0.2, 0), axis=(1, 0, 0), spring=40.0, damper=1.0, rest=0.1),
    ]
    return Mechanism(bodies, joints, [Contact("c", radius=0.05, height=-100.0)])


MECHANISMS = {
    "cartpole": dojo.models.cartpole(),
    "chain": dojo.models.npendulum(4),
    "hopper": dojo.models.raiberthopper(spring=100.0),
    "quadruped": dojo.models.quadruped(spring=20.0, damper=0.5, limits=False),
    "ball and slider": ball_and_slider(),
}


def apart(mechanism: Mechanism, time_step: float, duration: float) -> np.ndarray:
    """How far our motion ends from MuJoCo's, (nv,), both driven by the same constant inputs."""
    sim = dojo.Simulator(mechanism, time_step=time_step, kappa=1e-12)
    q, v = in_the_air(mechanism)
    u = 0.5 * np.random.default_rng(5).normal(size=sim.nu)
    steps = round(duration / time_step)
    ours = sim.rollout(sim.state_from_velocity(q, v), np.tile(u, (steps, 1)), throw=True)
    model = twin(sim, integrator="RK4")
    data = mujoco_scene.state(model, np.concatenate([q, v]))
    data.ctrl[:] = u
    mujoco.mj_step(model, data, steps)
    assert np.abs(sim.difference(ours.x[0], ours.x[-1])[: sim.nv]).max() > 0.05
    return sim.difference(ours.x[-1], np.concatenate([data.qpos, np.zeros(sim.nv)]))[: sim.nv]


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_twin_moves_alike(name: str) -> None:
    """Inputs and dampers act from the first node on, a first-order difference; extrapolated to h = 0 it must vanish."""
    coarse, fine = (apart(MECHANISMS[name], h, 0.2) for h in (1e-3, 5e-4))
    np.testing.assert_allclose(coarse, 0.0, atol=2e-3)
    np.testing.assert_allclose(2.0 * fine - coarse, 0.0, atol=2e-5)


def test_masses_and_inertias_arrive() -> None:
    sim = dojo.Simulator(MECHANISMS["quadruped"], time_step=0.01)
    model = twin(sim)
    np.testing.assert_allclose(model.body_mass[1:], numbers(sim).body_mass, rtol=1e-12)
    for k, inertia in enumerate(numbers(sim).body_inertia, start=1):
        moments = np.linalg.eigvalsh(inertia.reshape(3, 3))
        np.testing.assert_allclose(np.sort(model.body_inertia[k]), moments, rtol=1e-9)


@pytest.mark.parametrize("frame", ["world", "body"])
def test_wrenches_on_a_body_act_in_their_frame(frame: str) -> None:
    body = Body("box", 2.0, (0.1, 0.2, 0.25))
    wrench = Input(body="box", force=(1.0, -2.0, 0.5), torque=(0.1, 0.2, -0.3), frame=frame)
    mechanism = Mechanism([body], [Joint("floating", None, "box")], inputs=[wrench])
    coarse, fine = (apart(mechanism, h, 0.1) for h in (1e-3, 5e-4))
    np.testing.assert_allclose(2.0 * fine - coarse, 0.0, atol=2e-5)


def test_it_stands_at_the_same_height() -> None:
    sim = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.01)
    model = twin(sim, integrator="discrete")
    data = mujoco_scene.state(model, sim.neutral())
    data.ctrl[2] = 4.18 * 9.81
    mujoco.mj_step(model, data, 50)
    assert abs(data.qpos[2] - 0.55) < 2e-3
    assert data.ncon == 1


def test_limits_and_friction_arrive() -> None:
    sim = dojo.Simulator(dojo.models.quadruped(friction=0.7), time_step=0.01)
    model = twin(sim)
    assert model.jnt_limited.sum() == 12
    np.testing.assert_allclose(sorted(set(model.jnt_range[1:].ravel())), [-2.5, -1.0, -0.5, 0.5, 1.5])
    np.testing.assert_allclose(model.pair_friction[:, 0], 0.7)
    assert set(model.pair_dim) == {3}


def test_a_spring_that_mujoco_cannot_have_is_refused() -> None:
    body = Body("ball", 1.0, (0.1, 0.1, 0.1))
    joint = Joint("spherical", None, "ball", spring=5.0, rest=(0.1, 0.0, 0.0))
    sim = dojo.Simulator(Mechanism([body], [joint]), time_step=0.01)
    with pytest.raises(ValueError, match="rest other than zero"):
        twin(sim)


def test_orbital_joints_become_hinges_when_asked() -> None:
    sim = dojo.Simulator(dojo.models.orbital(3), time_step=0.01)
    with pytest.raises(ValueError, match="no joint that turns across an axis"):
        twin(sim)
    model = mujoco_scene.load(numbers(sim), 0.01, hinges=True)
    assert (model.nq, model.nv, model.nu) == (4, 4, 4)
    # near zero they move alike
    x = 1e-4 * np.array([1.0, -2.0, 0.5, 1.5, 0, 0, 0, 0])
    data = mujoco_scene.state(model, x)
    mujoco.mj_step(model, data)
    step = sim.replace(time_step=0.01).step(sim.state_from_velocity(x[:4], x[4:]))
    np.testing.assert_allclose(data.qpos, step.x[:4], atol=5e-6)
