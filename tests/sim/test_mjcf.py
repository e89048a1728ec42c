"""load_mjcf: gymnasium's models move as in MuJoCo, everything else is reported or refused."""

from __future__ import annotations

import importlib.util
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sim.io.mjcf import MjcfMechanism, MjcfWarning, load_mjcf
from sim.simulator.simulator import Simulator

mujoco = pytest.importorskip("mujoco")

_GYM = importlib.util.find_spec("gymnasium")
ASSETS = Path(_GYM.submodule_search_locations[0]) / "envs" / "mujoco" / "assets" if _GYM else None
FILES = sorted(file.name for file in ASSETS.glob("*.xml")) if ASSETS else []
needs_gym = pytest.mark.skipif(not FILES, reason="gymnasium is not installed")


def quietly(source: object, **choices: object) -> MjcfMechanism:
    """The mechanism, without the warnings that other tests look at."""
    import warnings

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MjcfWarning)
        return load_mjcf(source, **choices)  # type: ignore[arg-type]


def unhindered(mech: MjcfMechanism, *, dampers: bool) -> MjcfMechanism:
    """Without contacts and limits, and without dampers where they are not wanted."""
    joints = [replace(j, limits=None, cone=None, damper=j.damper if dampers else 0.0) for j in mech.joints]
    return replace(mech, contacts=(), joints=joints)


def reference(model: object, q: np.ndarray, v: np.ndarray, u: np.ndarray, duration: float) -> np.ndarray:
    """qpos after free flight under actuators, by MuJoCo's Runge-Kutta method at a step that leaves no error to see."""
    model.opt.integrator = mujoco.mjtIntegrator.mjINT_RK4
    model.opt.timestep = 1e-4
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    model.opt.density = model.opt.viscosity = 0.0
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = q, v, u
    mujoco.mj_step(model, data, round(duration / model.opt.timestep))
    return np.array(data.qpos)


def start(mech: MjcfMechanism, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Coordinates near the neutral ones, velocities, controls."""
    rng = np.random.default_rng(seed)
    sim = Simulator(mech, time_step=0.01)
    dx = np.concatenate([0.2 * rng.normal(size=sim.nv), np.zeros(sim.nv)])
    q = sim.integrate(sim.neutral(), dx)[: sim.nq]
    return q, rng.normal(size=sim.nv), rng.uniform(-0.3, 0.3, sim.nu)


def flown(mech: MjcfMechanism, q: np.ndarray, v: np.ndarray, u: np.ndarray, h: float, duration: float) -> np.ndarray:
    """Coordinates after free flight under the inputs u."""
    sim = Simulator(mech, time_step=h, tolerance=1e-10)
    t = sim.rollout(sim.state_from_velocity(q, v), np.tile(u, (round(duration / h), 1)), throw=True)
    return np.asarray(t.x[-1, : sim.nq])


def difference(mech: MjcfMechanism, a: np.ndarray, b: np.ndarray) -> float:
    """Largest difference of coordinates, in tangent coordinates."""
    sim = Simulator(mech, time_step=0.01)
    x, y = (np.concatenate([q, np.zeros(sim.nv)]) for q in (a, b))
    return float(np.abs(sim.difference(x, y)).max())


@pytest.mark.sweep(3)
@needs_gym
@pytest.mark.parametrize("file", FILES)
def test_free_flight_agrees_with_mujoco(file: str) -> None:
    """1e-6 at h = 1e-4 over 0.1 s, of second order: bodies, joints, armature, springs, gravity."""
    mech = unhindered(quietly(ASSETS / file), dampers=False)
    model = mujoco.MjModel.from_xml_path(str(ASSETS / file))
    model.dof_damping[:] = 0.0
    q, v, _ = start(mech, 1)
    expected = reference(model, q, v, np.zeros(model.nu), 0.1)
    error = [difference(mech, flown(mech, q, v, np.zeros(model.nu), h, 0.1), expected) for h in (2e-3, 1e-3, 1e-4)]
    assert error[2] < 1e-6, error
    assert error[1] < 0.3 * error[0] or error[0] < 1e-8, error


@pytest.mark.sweep(4)
@needs_gym
@pytest.mark.parametrize("file", FILES)
def test_damped_and_driven_flight_agrees_with_mujoco(file: str) -> None:
    """Dampers and held inputs act at first order: the error that remains after extrapolation is of second order."""
    mech = unhindered(quietly(ASSETS / file), dampers=True)
    model = mujoco.MjModel.from_xml_path(str(ASSETS / file))
    q, v, control = start(mech, 2)
    u = quietly(ASSETS / file).report.gear * control
    expected = reference(model, q, v, control, 0.02)
    sim = Simulator(mech, time_step=0.01)
    coarse, fine = (flown(mech, q, v, u, h, 0.02) for h in (2e-4, 1e-4))
    x, y = (np.concatenate([a, np.zeros(sim.nv)]) for a in (coarse, fine))
    extrapolated = sim.integrate(y, sim.difference(y, x))[: sim.nq]
    assert difference(mech, extrapolated, expected) < 1e-5 * (1.0 + difference(mech, q, expected))


@pytest.mark.sweep(5)
@needs_gym
@pytest.mark.parametrize("file", FILES)
def test_merged_joints_move_like_chains(file: str) -> None:
    one, many = (unhindered(quietly(ASSETS / file, merge=merge), dampers=True) for merge in (True, False))
    q, v, _ = start(one, 3)
    u = np.zeros(len(one.inputs or ()))
    assert difference(one, flown(one, q, v, u, 5e-3, 0.1), flown(many, q, v, u, 5e-3, 0.1)) < 1e-8
    assert one.report is not None and many.report is not None
    assert list(one.report.joints) == list(many.report.joints)


@needs_gym
@pytest.mark.parametrize("file", FILES)
def test_it_stands_or_falls(file: str) -> None:
    """A second with contacts, limits and dampers: solved, and nothing enters the ground."""
    mech = quietly(ASSETS / file)
    sim = Simulator(mech, time_step=0.01)
    t = sim.rollout(sim.neutral(), np.zeros((100, sim.nu)), throw=True)
    if mech.contacts:
        assert t.contacts.gap.min() > -1e-6


CHAIN = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <geom type="plane" size="1 1 1" pos="0 0 -2" friction="0.4 0 0" condim="1"/>
    <body name="a" pos="0.1 0.2 0.3" quat="0.8 0.1 0.5 -0.3">
      <joint name="s" type="slide" axis="1 2 0" ref="0.2" stiffness="20" springref="0.1" damping="0.1"/>
      <joint name="h1" type="hinge" axis="0 1 1" pos="0.1 0 0" ref="0.3" armature="0.02" limited="true" range="-1 2"/>
      <joint name="h2" type="hinge" axis="1 0 0" pos="0 0.1 0.1" stiffness="3"/>
      <geom type="box" size="0.1 0.2 0.3" pos="0.05 0 0" density="500" friction="0.9 0 0"/>
      <body name="welded" pos="0 0 0.4" quat="0.9 0.1 0.2 0.3">
        <geom type="capsule" size="0.05 0.1" mass="0.4" condim="1"/>
        <body name="b" pos="0.2 0 0.1">
          <joint name="ball" type="ball" pos="0 0 -0.1" damping="0.05"/>
          <geom type="sphere" size="0.1" mass="1" pos="0 0.1 0"/>
          <geom type="ellipsoid" size="0.1 0.2 0.1" mass="0.1" contype="0" conaffinity="0"/>
          <site name="tip"/>
        </body>
      </body>
    </body>
  </worldbody>
  <actuator>
    <motor name="push" joint="h1" gear="3" ctrllimited="true" ctrlrange="-2 1"/>
    <position name="servo" joint="h2" kp="10"/>
    <motor name="thrust" site="tip" gear="0 0 1 0 0 0"/>
  </actuator>
</mujoco>
"""


def test_joints_in_a_row_with_references_springs_and_a_ball() -> None:
    mech = load_mjcf(CHAIN)
    servo = mech.inputs[1]
    assert (servo.servo, servo.stiffness, servo.damping) == ("position", 10.0, 0.0)
    assert [j.kind for j in mech.joints] == ["prismatic", "revolute", "revolute", "spherical"]
    assert [b.mass > 0.0 for b in mech.bodies] == [False, False, True, True]
    assert [c.law for c in mech.contacts].count("impact") == 2
    assert {c.friction for c in mech.contacts} == {0.9, 1.0}
    assert mech.report is not None
    np.testing.assert_allclose(mech.report.gear, [3.0, 1.0, 1.0])
    np.testing.assert_allclose((mech.report.low[0], mech.report.high[0]), (-6.0, 3.0))
    assert mech.report.joints["h2"] == ("h2", 0)

    model = mujoco.MjModel.from_xml_string(CHAIN)
    model.dof_damping[:] = 0.0
    flying = unhindered(mech, dampers=False)
    q, v, _ = start(flying, 4)
    u = np.zeros(3)  # the servo pulls to zero; a target is a jump of the force, which costs an order
    expected = reference(model, q, v, u, 0.1)
    error = [difference(flying, flown(flying, q, v, u, h, 0.1), expected) for h in (2e-3, 1e-3, 1e-4)]
    assert error[2] < 1e-6 and error[1] < 0.3 * error[0], error


SERVOS = """<mujoco><worldbody><body><joint name="j" axis="0 1 0"/><geom size="0.1"/></body></worldbody><actuator>
  <position joint="j" gear="2" kp="10" kv="0.5" ctrlrange="-1 2" ctrllimited="true"
   forcerange="-1 3" forcelimited="true"/><velocity joint="j" kv="3"/>
  <general joint="j" gear="3" gainprm="4" biastype="affine" biasprm="0 -4 -1"/>
  <pid joint="j" gear="2" kp="7" kv="0.2" input="pos"/>
  <general name="other" joint="j" gainprm="4" biastype="affine" biasprm="0 -5 -1"/></actuator></mujoco>"""


def test_actuators_that_are_servos_are_read_as_servos() -> None:
    """Their total force equals MuJoCo's, for the same controls at the same state."""
    with pytest.warns(MjcfWarning, match="other"):
        mech = load_mjcf(SERVOS)
    assert [part.servo for part in mech.inputs] == ["position", "velocity", "position", "position", None]
    np.testing.assert_allclose(mech.inputs[0].limits, (-0.5, 1.0))
    assert mech.inputs[0].force_limits == (-2.0, 6.0)
    model = mujoco.MjModel.from_xml_string(SERVOS)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = 0.3, -0.7, (0.4, 0.5, -0.6, 0.8, 0.0)
    mujoco.mj_forward(model, data)
    u = mech.report.gear * data.ctrl
    parts = mech.inputs[:4]
    forces = [p.gain * x - p.stiffness * 0.3 + p.damping * 0.7 for p, x in zip(parts, u, strict=False)]
    forces = [np.clip(force, *p.force_limits) for p, force in zip(parts, forces, strict=True)]
    assert forces[0] == -2.0
    np.testing.assert_allclose(forces, data.actuator_force[:4] * model.actuator_gear[:4, 0], atol=1e-12)


def test_poses_agree_with_mujoco() -> None:
    mech = quietly(CHAIN)
    model = mujoco.MjModel.from_xml_string(CHAIN)
    data = mujoco.MjData(model)
    sim = Simulator(mech, time_step=0.01)
    q, _, _ = start(mech, 5)
    data.qpos[:] = q
    mujoco.mj_forward(model, data)
    z = sim.maximal(np.concatenate([q, np.zeros(sim.nv)]))
    for name, frame in mech.report.bodies.items() if mech.report else ():
        if frame.body is None:
            continue
        w, *s = z[mech.body_names.index(frame.body), 6:10]
        side = np.cross(s, frame.point)
        point = z[mech.body_names.index(frame.body), :3] + frame.point + 2.0 * (w * side + np.cross(s, side))
        np.testing.assert_allclose(point, data.body(name).xpos, atol=1e-12)


def test_keyframe_and_choices() -> None:
    text = CHAIN.replace("</mujoco>", '<keyframe><key qpos="0.2 0.4 0.5 2 0 0 0"/></keyframe></mujoco>')
    mech = quietly(text, keyframe=0, friction=0.3, law="linear", gravity=(0, 0, -1.0))
    np.testing.assert_allclose(mech.neutral, [0.2, 0.4, 0.5, 1, 0, 0, 0])
    assert {c.friction for c in mech.contacts} == {0.3} and mech.gravity == (0.0, 0.0, -1.0)
    assert quietly(text, ground=False).contacts == ()
    with pytest.raises(ValueError, match=r"load_mjcf\(keyframe=\.\.\.\): the file has 1 keyframes, got 3"):
        quietly(text, keyframe=3)
