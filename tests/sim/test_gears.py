"""Gears: a coordinate follows another one to rounding; torques, momentum and derivatives as they should be."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.body import Body
from sim.mechanism.gear import Gear
from sim.mechanism.joint import Joint
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.shapes import Box
from support.jacobians import check_step
from support.linkage import fourbar
from support.urdf_files import joint, link, write

X, Y = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def wheels(ratio: float = -2.5) -> Mechanism:
    """Two wheels on the ground, the first turned by the second, and a third without a gear."""
    bodies = [Body(name, 1.0, (0.1 + k, 0.3 + k, 0.2 + k)) for k, name in enumerate("abc")]
    joints = [Joint("revolute", None, name, axis=Y) for name in "abc"]
    return Mechanism(bodies, joints, gears=[Gear("a", "b", ratio, 0.1)], neutral={"b": 0.2})


def test_a_torque_turns_both_wheels() -> None:
    """(J_b + ratio^2 J_a) q_b'' = u: with a constant torque, the discrete motion is exact."""
    ratio, u, h = -2.5, 3.0, 0.01
    sim = dojo.Simulator(wheels(ratio), time_step=h, tolerance=1e-13)
    x = sim.neutral()
    assert abs(x[0] - ratio * x[1] - 0.1) < 1e-11
    n = 40
    t = sim.rollout(x, np.tile([0.0, u, 0.0], (n, 1)), throw=True)
    moved = u / (1.3 + ratio**2 * 0.3) * h * h * n * (n + 1) / 2
    np.testing.assert_allclose(t.x[-1, :3] - x[:3], [ratio * moved, moved, 0.0], atol=1e-9)
    r = sim.reactions(t.x[-1], [0.0, u, 0.0])
    np.testing.assert_allclose(r["b"].active_torque[1], 1.3 * u / (1.3 + ratio**2 * 0.3), atol=1e-9)
    np.testing.assert_allclose(r["a"].active_torque[1], 0.3 * ratio * u / (1.3 + ratio**2 * 0.3), atol=1e-9)


def robot() -> Mechanism:
    """A floating body with two arms that mirror each other, and a slider on a rack."""
    shape = Box(0.4, 0.1, 0.2)
    bodies = [Body(name, 1.0 + 0.5 * k, shape=shape) for k, name in enumerate(("base", "left", "right", "rack"))]
    joints = [
        Joint("floating", None, "base"),
        Joint("revolute", "base", "left", "", (0.2, 0, 0), (-0.2, 0, 0), axis=Y),
        Joint("revolute", "base", "right", "", (-0.2, 0, 0), (0.2, 0, 0), axis=Y, limits=(-0.5, 0.8)),
        Joint("cylindrical", "right", "rack", "", (-0.2, 0, 0), axis=X, damper=(0.1, 0.0)),
    ]
    gears = [Gear("left", "right", -1.0), Gear("rack", "left", 0.15, 0.02)]
    return Mechanism(bodies, joints, gears=gears, gravity=(0, 0, 0))


def start(sim: dojo.Simulator) -> np.ndarray:
    x = sim.neutral()
    x[sim.nq :] = np.random.default_rng(5).normal(size=sim.nv)
    return sim.close(x)


def test_gears_of_a_floating_robot_keep_its_momentum() -> None:
    sim = dojo.Simulator(robot(), time_step=0.01, tolerance=1e-12)
    t = sim.rollout(start(sim), np.zeros((100, sim.nu)), throw=True)
    p, L = sim.momentum(t.x)
    assert np.ptp(p, axis=0).max() < 1e-10 and np.ptp(L, axis=0).max() < 1e-10
    assert np.ptp(t.x[:, 7]) > 0.2
    np.testing.assert_allclose(t.x[:, 7], -t.x[:, 8], atol=1e-10)
    np.testing.assert_allclose(t.x[:, 9], 0.15 * t.x[:, 7] + 0.02, atol=1e-10)


@pytest.mark.parametrize("name", ["robot", "loop"])
def test_derivatives(name: str) -> None:
    """With limits, and together with a loop: the crank of a four-bar turns a flywheel."""
    mech = robot()
    if name == "loop":
        plain = fourbar("pin", inputs=("crank",))
        wheel = Joint("revolute", None, "wheel", axis=Y)
        bodies = [*plain.bodies, Body("wheel", 1.0, (0.1, 0.2, 0.15))]
        mech = replace(
            plain,
            bodies=bodies,
            joints=[*plain.joints, wheel],
            gears=[Gear("wheel", "crank", 3.0)],
            neutral=(*plain.neutral, -3.0),
        )
    sim = dojo.Simulator(mech, time_step=0.02, tolerance=1e-12, kappa=1e-3)
    x = sim.rollout(start(sim), np.zeros((3, sim.nu)), throw=True).x[-1]
    u = np.random.default_rng(2).normal(size=sim.nu)
    check_step(sim, x, u)


def test_neutral_coordinates_follow_those_that_are_named() -> None:
    mech = replace(wheels(), gears=[Gear("c", "a", 2.0), Gear("a", "b", -2.5, 0.1)])
    for neutral in ({"b": 0.2}, {"c": -0.8}, {"a": -0.4, "b": 0.2}):
        np.testing.assert_allclose(replace(mech, neutral=neutral).neutral, (-0.4, 0.2, -0.8))
    assert replace(mech, neutral=(1.0, 2.0, 3.0)).neutral == (1.0, 2.0, 3.0)
    assert replace(mech, neutral=None).neutral == (0.0, 0.0, 0.0)


def test_wrong_gears_are_refused() -> None:
    mech = robot()
    for gear, message in (
        (Gear("left", "arm"), "joint of gear 'left': 'arm' is not one of"),
        (Gear("left", "left"), "couples joint 'left' with itself"),
        (Gear("left", "base", other_dof=3), "gear 'left': joint 'base' has 3 scalar coordinates, got 3"),
    ):
        with pytest.raises(ValueError, match=message):
            replace(mech, gears=[gear])
    with pytest.raises(ValueError, match=r"Gear\('left', ratio=\.\.\.\)"):
        Gear("left", "right", float("nan"))
    with pytest.raises(ValueError, match="has the gear 'left' and 1 more; steps of higher order are for trees"):
        dojo.Simulator(replace(mech, joints=[replace(j, limits=None) for j in mech.joints]), order=4)
    twice = replace(mech, gears=[Gear("left", "right", -1.0), Gear("right", "left", -1.0, name="again")])
    sim = dojo.Simulator(twice, time_step=0.01)
    assert sim.loop_rank().redundant == {"gear left": 0, "gear again": 1}
    assert "left              gear            left = -1 right + 0" in sim.describe()
    clash = [Gear("left", "right", -1.0), Gear("right", "left", -1.0, 0.3, name="again")]
    with pytest.raises(ValueError, match="gear again cannot be closed near this state|gear left cannot be closed"):
        dojo.Simulator(replace(mech, gears=clash), time_step=0.01).neutral()


def test_mimic_joints_of_urdf(tmp_path: Path) -> None:
    axis = "<axis xyz='0 1 0'/>"
    parts = (
        link("base"),
        link("one"),
        link("two"),
        joint("i", "base", "one", "continuous", axis),
        joint("j", "base", "two", "continuous", axis, '<mimic joint="i" multiplier="-0.5" offset="0.2"/>'),
    )
    mech = dojo.load_urdf(write(tmp_path, *parts), floating=False, mimic="gear")
    assert mech.gears == (Gear("j", "i", -0.5, 0.2),)
    assert mech.report is not None and "joints that follow another one, by a gear: j" in str(mech.report)
    for given, message in (("none", "line 6, <mimic>: 'none' is not a joint"), ("j", "joint 'j' follows itself")):
        broken = [part.replace('mimic joint="i"', f'mimic joint="{given}"') for part in parts]
        with pytest.raises(dojo.UrdfError, match=message):
            dojo.load_urdf(write(tmp_path, *broken), floating=False, mimic="gear")
    with pytest.raises(dojo.UrdfError, match="joint 'i' has no coordinate of its own"):
        dojo.load_urdf(write(tmp_path, *parts), floating=False, mimic="gear", locked=["i"])


def test_couplings_of_mjcf() -> None:
    """q1 - q1_0 = a0 + a1 (q2 - q2_0), as MuJoCo's own violation has it."""
    mujoco = pytest.importorskip("mujoco")
    text = """
    <mujoco><worldbody>
      <body name="a"><joint name="a" axis="0 1 0" ref="20"/><geom size="0.1" pos="1 0 0"/></body>
      <body name="b"><joint name="b" type="slide" ref="0.3"/><geom size="0.1" pos="0 1 0"/></body>
    </worldbody><equality><joint name="g" joint1="b" joint2="a" polycoef="0.1 0.4 0 0 0"/></equality></mujoco>"""
    mech, model = dojo.load_mjcf(text), mujoco.MjModel.from_xml_string(text)
    x = dojo.Simulator(mech, time_step=0.01).neutral()
    data = mujoco.MjData(model)
    data.qpos[:] = x[:2]
    mujoco.mj_forward(model, data)
    assert mech.gears[0].name == "g" and abs(data.efc_pos[0]) < 1e-10


def test_gears_and_acting_loops_come_along_when_mechanisms_are_added() -> None:
    """Two copies in one scene move like one alone."""
    alone, both = robot(), robot().add(robot(), (2.0, 0.0, 0.0), prefix="b/")
    assert [g.name for g in both.gears] == ["left", "rack", "b/left", "b/rack"]
    linkage = fourbar("pin", spring=3.0)
    loops = linkage.add(linkage, (3.0, 0.0, 0.0), prefix="b/")
    for mech, single in ((both, alone), (loops, linkage)):
        sim, one = (dojo.Simulator(m, time_step=0.01, tolerance=1e-11) for m in (mech, single))
        t, r = (s.rollout(s.neutral(), np.full((10, s.nu), 0.1), throw=True).x[-1] for s in (sim, one))
        assert sim.loop_rank().mobility == 2 * one.loop_rank().mobility
        joint = mech.joint_names[-1]
        at, own = mech.q_slice(joint), single.q_slice(single.joint_names[-1])
        assert one.nq * 2 == sim.nq
        np.testing.assert_allclose(t[at], r[own], atol=1e-8)
