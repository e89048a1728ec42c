"""Screws against closed forms, and against a hinge and a slide that a gear couples."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo

G, M, INERTIA, PITCH = 9.81, 2.0, 0.03, 0.4
LEAD = PITCH / (2.0 * np.pi)  # [m/rad]


def nut(pitch: float = PITCH, **joint) -> dojo.Mechanism:
    """A nut on an upright spindle, without friction."""
    body = dojo.Body("nut", M, (INERTIA, INERTIA, INERTIA))
    return dojo.Mechanism([body], [dojo.Joint("screw", None, "nut", pitch=pitch, **joint)])


@pytest.mark.parametrize("pitch", [PITCH, -PITCH])
def test_a_nut_runs_down_its_spindle(pitch: float) -> None:
    """(I + m lead^2) q'' = -m g lead: a heavier body; its angle counts turns."""
    lead = pitch / (2.0 * np.pi)
    rate = -M * G * lead / (INERTIA + M * lead**2)
    errors = []
    for h in (2e-3, 1e-3):
        sim = dojo.Simulator(nut(pitch), time_step=h, tolerance=1e-13)
        x = sim.rollout(sim.state_from_velocity(np.zeros(1), np.zeros(1)), np.zeros((round(1.0 / h), 1)), throw=True).x[
            -1
        ]
        errors.append(abs(x[0] - 0.5 * rate))
    assert abs(0.5 * rate) > 2.0 * np.pi
    assert errors[0] < 1e-4 and (errors[1] < 1e-9 or errors[0] / errors[1] > 3.5), errors
    z = sim.maximal(x)[0]
    np.testing.assert_allclose(z[:3], (0.0, 0.0, lead * x[0]), atol=1e-12)
    np.testing.assert_allclose(z[3:6], (0.0, 0.0, lead * x[1]), atol=1e-9)


def test_a_motor_holds_the_nut() -> None:
    """u = m g lead; the spindle carries the weight with the rest of the constraint force, which does no work."""
    sim = dojo.Simulator(nut(), time_step=0.01, tolerance=1e-13)
    u = M * G * LEAD
    np.testing.assert_allclose(sim.step(sim.neutral(), [u], throw=True).x, 0.0, atol=1e-12)
    r = sim.reactions(sim.neutral(), [u])["nut"]
    np.testing.assert_allclose(r.force, (0.0, 0.0, M * G), atol=1e-10)
    np.testing.assert_allclose(r.torque, 0.0, atol=1e-10)
    np.testing.assert_allclose(LEAD * r.active_force[2] + r.active_torque[2], u, atol=1e-10)
    np.testing.assert_allclose(LEAD * r.constraint_force[2] + r.constraint_torque[2], 0.0, atol=1e-10)


def test_a_stop_and_a_spring_act_on_the_angle() -> None:
    stopped = dojo.Simulator(nut(limits=(-8.0, 1.0)), time_step=0.01, kappa=1e-8)
    q = stopped.rollout(stopped.neutral(), np.zeros((300, 1)), throw=True).x[:, 0]
    assert -8.0 - 1e-9 < q.min() < -7.99 and abs(q[-1] + 8.0) < 1e-3
    sprung = dojo.Simulator(nut(spring=0.2, damper=0.5), time_step=0.05)
    q = sprung.rollout(sprung.neutral(), np.zeros((2000, 1)), throw=True).x[-1, 0]
    np.testing.assert_allclose(q, -M * G * LEAD / 0.2, rtol=1e-7)


def test_a_carriage_in_gear_with_the_screw() -> None:
    """It moves as far as the nut: (I + 2 m lead^2) q'' = -2 m g lead."""
    bodies = [dojo.Body(name, M, (INERTIA, INERTIA, INERTIA)) for name in ("nut", "carriage")]
    joints = [
        dojo.Joint("screw", None, "nut", pitch=PITCH),
        dojo.Joint("prismatic", None, "carriage", parent_point=(1.0, 0.0, 0.0)),
    ]
    mech = dojo.Mechanism(bodies, joints, gears=[dojo.Gear("carriage", "nut", LEAD)])
    sim = dojo.Simulator(mech, time_step=1e-3, tolerance=1e-13)
    x = sim.rollout(sim.state_from_velocity(np.zeros(2), np.zeros(2)), np.zeros((500, 2)), throw=True).x[-1]
    rate = -2.0 * M * G * LEAD / (INERTIA + 2.0 * M * LEAD**2)
    np.testing.assert_allclose(x[:2], 0.125 * rate * np.array([1.0, LEAD]), rtol=1e-6)


def test_a_screw_is_a_hinge_on_a_slide_in_gear(rng) -> None:
    """On a floating base, with a spring, a damper, an armature, an input and a stop: the same steps."""
    place = {
        "parent_point": rng.normal(size=3) / 4,
        "orientation": (0.5, 0.5, -0.5, 0.5),
        "axis": np.array([0.48, 0.6, 0.64]),
    }
    inertia = np.array([[0.11, 0.01, 0.0], [0.01, 0.17, 0.02], [0.0, 0.02, 0.23]])
    bodies = [dojo.Body("base", 1.0, inertia), dojo.Body("tip", 1.5, 1.3 * inertia)]
    acts = {"spring": 3.0, "damper": 0.2, "armature": 0.1, "limits": (-0.4, 2.0), "child_point": rng.normal(size=3) / 4}
    screw = dojo.Joint("screw", "base", "tip", "turn", pitch=PITCH, **place, **acts)
    slide = dojo.Joint("prismatic", "base", "between", "slide", **place)
    hinge = dojo.Joint("revolute", "between", "tip", "turn", axis=place["axis"], **acts)
    floating = dojo.Joint("floating", None, "base")
    settings = {"time_step": 0.01, "kappa": 1e-6, "tolerance": 1e-12}
    ours = dojo.Simulator(dojo.Mechanism(bodies, [floating, screw], inputs=[dojo.Input("turn")]), **settings)
    geared = dojo.Mechanism(
        [bodies[0], dojo.Body("between", 0.0), bodies[1]],
        [floating, slide, hinge],
        inputs=[dojo.Input("turn")],
        gears=[dojo.Gear("slide", "turn", LEAD)],
    )
    theirs = dojo.Simulator(geared, **settings)
    us = rng.normal(size=(100, 1))
    x = np.r_[ours.neutral()[:7], 0.3, rng.normal(size=6), -2.0]
    y = np.r_[x[:7], LEAD * x[7], x[7], x[8:14], LEAD * x[14], x[14]]
    a, b = ours.rollout(x, us, throw=True).x, theirs.rollout(y, us, throw=True).x
    # a damper is judged stiff by the inertia of the tree, and the gear is not part of the tree
    np.testing.assert_allclose(a[:, :7], b[:, :7], atol=1e-6)
    np.testing.assert_allclose(a[:, 7], b[:, 8], atol=1e-6)
    assert a[:, 7].min() < -0.39, "it meets the stop"


def test_a_hinge_and_a_slide_that_an_mjcf_file_couples_are_a_screw(tmp_path: Path) -> None:
    """MJCF has no screw, but a linear <joint> equality, which becomes a gear."""
    pytest.importorskip("mujoco")
    path = tmp_path / "nut.xml"
    path.write_text(f"""
    <mujoco><worldbody><body name="nut">
      <joint name="slide" type="slide" axis="0 0 1"/><joint name="turn" type="hinge" axis="0 0 1"/>
      <geom type="box" contype="0" conaffinity="0" size="0.1 0.12 0.05" mass="2"/>
    </body></worldbody>
    <equality><joint joint1="slide" joint2="turn" polycoef="0 {LEAD} 0 0 0"/></equality></mujoco>
    """)
    loaded = dojo.load_mjcf(path)
    screw = dojo.Mechanism(loaded.bodies, [dojo.Joint("screw", None, "nut", pitch=PITCH)])
    a, b = (
        sim.rollout(sim.neutral(), steps=200, throw=True).x[-1]
        for sim in (dojo.Simulator(mech, time_step=1e-3, tolerance=1e-12) for mech in (loaded, screw))
    )
    np.testing.assert_allclose(a, [LEAD * b[0], b[0], LEAD * b[1], b[1]], rtol=1e-9)
