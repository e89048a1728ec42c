"""Drake and PyBullet do the same motion: converted mechanisms agree with ours to the order of their integrators."""

from __future__ import annotations

from importlib.util import find_spec
from typing import Any

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.engines import Ours, Run, mujoco_scene
from support.scenes import chain

drake = pytest.mark.skipif(find_spec("pydrake") is None, reason="needs drake")
bullet = pytest.mark.skipif(find_spec("pybullet") is None, reason="needs pybullet")


def make(name: str) -> Any:
    if name == "bullet":
        from benchmarks.engines.bullet import Bullet

        return Bullet(rounds=1)
    from benchmarks.engines.drake import Drake

    return Drake({"lagged": "Lagged", "rk3": ""}[name])


def motion(engine: Any, mechanism: dojo.Mechanism, time_step: float, **inputs: Any) -> Run:
    sim, rng = dojo.Simulator(mechanism), np.random.default_rng(3)
    dx = np.r_[0.3 * rng.normal(size=sim.nv), np.zeros(sim.nv)]
    q = sim.integrate(sim.neutral(), dx)[: sim.nq]
    return engine.simulate(
        mechanism, time_step=time_step, q=q, v=rng.normal(size=sim.nv), duration=0.1, samples=5, **inputs
    )


def distance(a: Run, b: Run) -> float:
    return float(np.abs(a.position - b.position).max())


KINDS = ("revolute", "prismatic", "spherical", "planar_axis")


@drake
@pytest.mark.parametrize("kind", KINDS)
def test_drake_by_rk3_is_the_limit_of_ours(kind: str) -> None:
    """Ours approaches it with the second order of its step."""
    mechanism = chain(kind, 2, gravity=(0.0, 0.0, -9.81))
    exact = motion(make("rk3"), mechanism, 1e-3)
    errors = [distance(motion(Ours(rounds=1, tolerance=1e-12), mechanism, h), exact) for h in (2e-3, 1e-3)]
    assert errors[1] < 1e-4 and 3.5 < errors[0] / errors[1] < 4.5, errors


@pytest.mark.parametrize("engine", [pytest.param("lagged", marks=drake), pytest.param("bullet", marks=bullet)])
@pytest.mark.parametrize("scene", ["chain", "spring", "driven", "pushed"])
def test_first_order_peers_approach_ours(engine: str, scene: str) -> None:
    inputs: dict[str, Any] = {}
    if scene == "chain":
        mechanism = chain("revolute", 2, gravity=(0.0, 0.0, -9.81))
    elif scene == "spring":
        mechanism = chain("revolute", 2, base=None, spring=10.0, damper=0.1)
    elif scene == "driven":
        mechanism = chain("revolute", 1, base=None)
        inputs["inputs"] = [0.5, -0.3]
    else:
        wrench = dojo.Input(body="body", force=(1.0, 2.0, 3.0), torque=(0.0, 0.1, 0.0), frame="body")
        body = dojo.Body("body", 1.0, (0.1, 0.2, 0.25))
        mechanism = dojo.Mechanism([body], [dojo.Joint("floating", None, "body")], inputs=[wrench])
        inputs["inputs"] = [1.0]
    exact = motion(Ours(rounds=1, tolerance=1e-12), mechanism, 1e-4, **inputs)
    errors = [distance(motion(make(engine), mechanism, h, **inputs), exact) for h in (2e-3, 1e-3)]
    assert errors[1] < 2e-3 and 1.6 < errors[0] / errors[1] < 2.4, errors


@pytest.mark.parametrize("engine", [pytest.param("lagged", marks=drake), pytest.param("bullet", marks=bullet)])
def test_a_robot_lands_on_its_feet(engine: str) -> None:
    """Contacts are where ours are: the quadruped comes to rest at the same height."""
    mechanism = dojo.models.quadruped(spring=60.0, damper=2.0, limits=False)
    q = np.asarray(mechanism.neutral) + np.r_[0.0, 0.0, 0.05, np.zeros(16)]
    scene = {"time_step": 1e-3, "q": q, "v": np.zeros(18), "duration": 1.0, "samples": 10}
    ours, peer = Ours(kappa=1e-10, rounds=1).simulate(mechanism, **scene), make(engine).simulate(mechanism, **scene)
    assert peer.message == ""
    np.testing.assert_allclose(peer.position[-1, 0], ours.position[-1, 0], atol=5e-3)


@bullet
def test_bullet_prints_nothing(capfd: pytest.CaptureFixture[str]) -> None:
    """Its banner would end up in reports as JSON."""
    motion(make("bullet"), chain("revolute", 1, base=None), 1e-2)
    assert capfd.readouterr().out == ""


@pytest.mark.parametrize("engine", [pytest.param("lagged", marks=drake), pytest.param("bullet", marks=bullet)])
def test_scenes_that_a_peer_cannot_represent_are_refused(engine: str) -> None:
    with pytest.raises(ValueError, match="not represented|has no spring"):
        motion(make(engine), chain("spherical", 1, base=None, spring=3.0), 1e-2)


@pytest.mark.parametrize("engine", [pytest.param("lagged", marks=drake), pytest.param("bullet", marks=bullet)])
def test_screws_are_refused(engine: str) -> None:
    with pytest.raises(ValueError, match="joints that turn and slide in one are not represented"):
        motion(make(engine), chain("screw", 1, base=None), 1e-2)


def test_mujoco_has_no_screw() -> None:
    pytest.importorskip("mujoco")
    with pytest.raises(ValueError, match="no joint that turns and slides in one \\(body 1\\)"):
        mujoco_scene.load(dojo.Simulator(chain("screw", 1)).model, 0.01)


@bullet
def test_a_cube_slides_to_rest_in_bullet():
    from benchmarks.engines.bullet_cube import BulletCube

    half, friction, speed, frame = 0.05, 0.2, 1.0, 1.0 / 148.0
    body, free = dojo.Body("cube", 0.37, (8.1e-4,) * 3), dojo.Joint("floating", None, "cube")
    sim = dojo.Simulator(dojo.Mechanism([body], [free]), time_step=frame)
    world = BulletCube(friction, 0.0, half, frame, sim)
    start = sim.neutral()
    start[2], start[7] = half, speed
    motion = world.rollout(start, np.zeros((100, 0)))
    world.close()
    assert motion.success
    gap = world.difference(motion.x[-1], start)
    assert gap[0] == pytest.approx(speed**2 / (2.0 * friction * 9.81), rel=0.03)
    assert np.abs(gap[1:6]).max() < 2e-3
    assert np.abs(motion.x[-1, 7:]).max() < 1e-2
