"""load_mjcf: actuators on sites, and collisions of bodies with one another and with shapes fixed to the world."""

from __future__ import annotations

import warnings

import numpy as np
import pytest

from sim.io.mjcf import MjcfMechanism, MjcfWarning, load_mjcf
from sim.simulator.simulator import Simulator

mujoco = pytest.importorskip("mujoco")

DRONE = """<mujoco><option gravity="0 0 -9.81"/><worldbody><body pos="0 0 1" quat="0.9 0.1 0.2 0.3"><freejoint/>
  <geom type="box" size=".2 .1 .05" mass="1"/><geom type="sphere" size=".05" pos=".1 .1 .1" mass=".3"/>
  <body pos=".1 0 0" euler="20 0 0"><geom type="box" size=".01 .02 .03" mass=".1"/>
    <site name="rotor" pos=".2 -.1 .05" euler="0 30 10"/></body></body></worldbody>
<actuator><motor name="thrust" site="rotor" gear="0 0 2 0 .1 .02" ctrllimited="true" ctrlrange="-1 3"/>
  <general name="twist" site="rotor" gear="0 0 0 0 0 .5" gainprm="4"/></actuator></mujoco>"""

TABLE = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1"/>
  <geom name="table" type="box" size=".5 .5 .2" pos="0 0 .2" friction=".4"/>
  <body name="box" pos="0 0 .6"><freejoint/><geom name="cube" type="box" size=".1 .1 .1" friction=".7"/></body>
  <body name="ball" pos="0 0 .9"><freejoint/><geom name="ball" size=".1" condim="1"/></body>
  <body name="arm" pos="3 0 1"><joint axis="0 1 0"/><geom name="upper" type="capsule" fromto="0 0 0 .3 0 0" size=".05"/>
    <body name="hand" pos=".3 0 0"><joint axis="0 1 0"/><geom name="lower" type="capsule" fromto=".15 0 0 .3 0 0" size=".05"/>
      <body name="finger" pos=".3 0 0"><joint axis="0 0 1"/><geom name="tip" size=".05" pos=".1 0 0"/></body></body></body>
</worldbody>
<contact><exclude body1="arm" body2="box"/><pair geom1="upper" geom2="lower" friction=".3 .3 .005 .001 .001"/></contact>
</mujoco>"""


def quietly(text: str, **choices: object) -> MjcfMechanism:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", MjcfWarning)
        return load_mjcf(text, **choices)  # type: ignore[arg-type]


def test_an_actuator_on_a_site_moves_with_its_body() -> None:
    mech = quietly(DRONE)
    assert mech.report is not None
    np.testing.assert_allclose(mech.report.gear, [1.0, 4.0])
    np.testing.assert_allclose([mech.report.low, mech.report.high], [[-1.0, -np.inf], [3.0, np.inf]])
    model = mujoco.MjModel.from_xml_string(DRONE)
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, 1e-3
    data = mujoco.MjData(model)
    data.ctrl[:] = 2.0, -0.3
    mujoco.mj_step(model, data, 200)
    assert abs(data.qvel[3:]).max() > 10.0
    ends = []
    for h in (1e-3, 5e-4):  # inputs act at the beginning of a step: an error of first order, extrapolated
        steps = round(0.2 / h)
        sim = Simulator(mech, time_step=h)
        x = sim.state_from_velocity(sim.neutral()[: sim.nq], np.zeros(sim.nv))
        ends.append(sim.rollout(x, np.tile(mech.report.gear * data.ctrl, (steps, 1)), throw=True).x[-1, : sim.nq])
    np.testing.assert_allclose(2.0 * ends[1] - ends[0], data.qpos, atol=3e-5)


def test_geoms_meet_where_mujoco_lets_them() -> None:
    mech = quietly(TABLE, collisions=True)
    pairs = {c.name: c for c in mech.collisions}
    bodies = {"arm": "upper", "hand": "lower", "finger": "tip", "box": "cube", "ball": "ball"}
    expected = {f"table-{geom}" for geom in bodies.values()} | {"cube-ball"}
    expected |= {f"{a}-{b}" for a in ("cube", "ball") for b in ("upper", "lower", "tip")} - {"cube-upper"}
    expected |= {"upper-tip", "upper-lower"}  # neighbours do not meet, but where the file pairs them
    assert set(pairs) == expected
    assert (pairs["table-cube"].friction, pairs["upper-lower"].friction) == (0.7, 0.3)
    assert (pairs["table-ball"].law, pairs["cube-ball"].law) == ("nonlinear", "nonlinear")  # condim: the larger
    assert not quietly(TABLE).collisions
    notes = "\n".join(str(note) for note in (quietly(TABLE).report or mech.report).notes)  # type: ignore[union-attr]
    for words in ("omitted (collisions=True has them): pair_0", "no obstacles (collisions=True makes them): table"):
        assert words in notes
    assert not any(words in str(mech.report) for words in ("contact pairs", "no obstacles", "do not collide"))


@pytest.mark.parametrize(
    ("geom", "given", "friction"),
    [
        ('contype="0" conaffinity="0"', '<pair geom1="foot" geom2="floor" friction=".3 .3 .01 .01 .01"/>', 0.3),
        ("", '<exclude body1="world" body2="b"/>', None),
        ("", "", 1.0),
    ],
)
@pytest.mark.parametrize(
    ("kind", "part"), [('size=".1"', "contacts"), ('type="ellipsoid" size=".1 .1 .1"', "collisions")]
)
def test_pairs_and_excludes_hold_for_planes(
    geom: str, given: str, friction: float | None, kind: str, part: str
) -> None:
    text = f"""<mujoco><worldbody><geom name="floor" type="plane" size="1 1 1"/><body name="b" pos="0 0 .05"><freejoint/>
        <geom name="foot" {kind} {geom}/></body></worldbody><contact>{given}</contact></mujoco>"""
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    assert data.ncon == (friction is not None)
    for collisions in (False, True, "self"):
        mech = load_mjcf(text, collisions=collisions)
        assert [c.friction for c in getattr(mech, part)] == [friction] * data.ncon
        assert "contact pairs" not in str(mech.report)


def test_chosen_friction_is_that_of_self_collisions_but_for_slippery_geoms() -> None:
    text = "<mujoco><worldbody>{}</worldbody></mujoco>"
    body = '<body name="{}" pos="0 0 {}"><freejoint/><geom size=".1" condim="{}"/></body>'
    for condim, friction in ((3, 0.25), (1, 0.0)):
        bodies = [body.format(name, height, condim) for height, name in enumerate("ab", 1)]
        mech = load_mjcf(text.format("".join(bodies)), collisions="self", friction=0.25, law="linear")
        assert [(c.friction, c.law) for c in mech.collisions] == [(friction, "linear")]


def test_a_box_lies_on_a_table_and_carries_a_ball() -> None:
    sim = Simulator(quietly(TABLE, collisions=True), time_step=0.01)
    t = sim.rollout(sim.neutral(), np.zeros((100, sim.nu)), throw=True)
    q = sim.mechanism.q_slice
    names = [joint.name for joint in sim.mechanism.joints if joint.kind == "floating"]
    heights = [t.x[-1, q(name)][2] for name in names]
    np.testing.assert_allclose(heights, [0.5, 0.7], atol=1e-6)


def test_tendons_that_pull_are_warned_of() -> None:
    text = """<mujoco><worldbody><site name="a" pos="0 0 1"/><body><freejoint/><geom size=".1"/><site name="b"/></body>
    </worldbody><tendon><spatial name="rope" {}><site site="a"/><site site="b"/></spatial></tendon></mujoco>"""
    with pytest.warns(MjcfWarning, match="tendons are omitted: rope"):
        load_mjcf(text.format('range="0 2" limited="true"'))
    with warnings.catch_warnings():
        warnings.simplefilter("error", MjcfWarning)
        assert "tendons are omitted: rope" in str(load_mjcf(text.format("")).report)


STONES = """<mujoco><worldbody><geom name="floor" type="plane" size="5 5 .1" euler="10 -20 0" pos="0 0 .1"/>
  <geom name="post" type="capsule" size=".1 .3" pos="3 0 1"/>
  <body name="egg" pos="0 0 .1"><freejoint/><geom name="egg" type="ellipsoid" size=".3 .2 .1" friction=".6"/></body>
  <body name="lens" pos="3 0 2"><freejoint/><geom name="lens" type="ellipsoid" size=".2 .25 .05" euler="20 0 40"/></body>
  <body name="die" pos="0 3 2"><freejoint/><geom name="die" type="box" size=".1 .12 .2"/></body>
</worldbody></mujoco>"""


def test_ellipsoids_touch_planes_and_one_another_where_mujoco_says(rng: np.random.Generator) -> None:
    mech = quietly(STONES, collisions=True, gravity=(0.0, 0.0, 0.0))
    assert {c.name for c in mech.collisions} == {
        "egg", "lens", "post-egg", "post-lens", "post-die", "egg-lens", "egg-die", "lens-die"
    }  # fmt: skip
    assert {c.body for c in mech.contacts} == {"die"}
    assert (mech.collisions[0].shape_a.sizes(), mech.collisions[0].friction) == ((0.3, 0.2, 0.1), 1.0)
    sim = Simulator(mech, time_step=1e-3, kappa=1e-12)
    model = mujoco.MjModel.from_xml_string(STONES)
    model.geom_margin[0] = 9.0  # of the plane: distances from it are exact whatever the margin, of others they are not
    data = mujoco.MjData(model)
    seen = 0
    for _ in range(20):
        q = np.array(mech.neutral)
        for k in range(3):
            q[7 * k : 7 * k + 3] = np.array([0.0, 0.0, 1.6]) + rng.uniform(-0.9, 0.9, 3)
            q[7 * k + 3 : 7 * k + 7] = (turn := rng.normal(size=4)) / np.linalg.norm(turn)
        data.qpos[:] = q
        mujoco.mj_forward(model, data)
        theirs = {model.geom(int(c.geom[1])).name: c.dist for c in data.contact if c.geom[0] == 0}
        for pair in ("post-egg", "post-lens", "egg-lens", "egg-die", "lens-die"):
            a, b = (model.geom(name).id for name in pair.split("-"))
            theirs[pair] = mujoco.mj_geomDistance(model, data, a, b, 9.0, None)
        if min(theirs.values()) < 0.0:
            continue
        gaps = sim.step(np.r_[q, np.zeros(sim.nv)], throw=True).contacts.gap
        for name, gap in zip(mech.contact_names, gaps, strict=True):
            if name in theirs:
                assert gap == pytest.approx(theirs[name], abs=1e-5), name
                seen += 1
    assert seen > 60


def test_a_base_starts_with_its_ellipsoid_on_the_plane() -> None:
    """The file has it 8 cm deep in a plane."""
    mech = quietly(STONES.partition('  <body name="lens"')[0] + "</worldbody></mujoco>")
    gap = Simulator(mech, time_step=1e-9, kappa=1e-18).step(np.r_[mech.neutral, np.zeros(6)]).contacts.gap
    np.testing.assert_allclose(gap, [0.0], atol=1e-8)


MARGINS = """<mujoco><compiler angle="radian"/><option cone="elliptic" impratio="100"/><worldbody>
  <geom type="plane" size="5 5 .1" margin=".01"/>
  <body pos="0 0 .14"><freejoint/><geom name="ball" size=".1" mass="1" margin=".03" gap=".02"/></body>
  <body pos="0 2 1"><joint name="j" axis="0 1 0" limited="true" range="-1 .6" margin=".2" damping=".1"/>
    <geom size=".1" pos=".3 0 0" mass="1"/></body>
</worldbody><actuator><motor joint="j" gear="2" armature=".05" damping=".1"/></actuator></mujoco>"""


def test_margins_and_the_inertia_of_actuators_act_as_in_mujoco() -> None:
    """A ball that slides, then rolls on its margin, and an arm that falls to that of its range against its actuator."""
    model = mujoco.MjModel.from_xml_string(MARGINS)
    model.opt.integrator, model.opt.timestep = mujoco.mjtIntegrator.mjINT_RK4, 1e-3
    data = mujoco.MjData(model)
    data.qvel[0], data.ctrl[:] = 0.5, -0.2
    mech = quietly(MARGINS, collisions=True)
    arm = mech.joints[1]
    np.testing.assert_allclose([*arm.armature, *arm.damper, *arm.limits[0]], [0.2, 0.5, -0.8, 0.4])
    sim = Simulator(mech, time_step=1e-3)
    x = sim.state_from_velocity(sim.neutral()[: sim.nq], data.qvel)
    t = sim.rollout(x, np.tile(mech.report.gear * data.ctrl, (800, 1)), throw=True)
    for steps, error in ((200, 5e-4), (800, 2e-3)):  # MuJoCo's limit and contact give way
        mujoco.mj_step(model, data, steps - round(data.time / 1e-3))
        np.testing.assert_allclose(t.x[steps, 7], data.qpos[7], atol=error)
        np.testing.assert_allclose(t.x[steps, [0, 2]], data.qpos[[0, 2]], atol=2e-3)
    assert abs(data.qvel[0] / data.qvel[4] - 0.12) < 1e-3 and abs(t.x[-1, sim.nq] / t.x[-1, sim.nq + 4] - 0.12) < 1e-3


def test_margins_of_collisions_are_those_of_round_geoms() -> None:
    text = TABLE.replace('name="ball" size=".1"', 'name="ball" size=".1" margin=".02"')
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        mech = load_mjcf(text, collisions=True)
    assert not any("margin" in str(w.message) for w in caught)
    balls = {c.name: max(getattr(c.shape_a, "radius", 0), getattr(c.shape_b, "radius", 0)) for c in mech.collisions}
    assert balls["table-ball"] == pytest.approx(0.12)
    assert balls["ball-upper"] == pytest.approx(0.11)
    boxes = quietly(TABLE.replace('name="cube"', 'name="cube" margin=".01"'), collisions=True).report
    assert "margins between geoms that are neither spheres nor capsules are omitted: table-cube" in str(boxes)
    own = quietly(text, collisions="self").report
    assert "collisions=True has those of others: ball" in str(own)
