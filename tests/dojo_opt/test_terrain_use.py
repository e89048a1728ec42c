"""Terrain in code that builds on the simulator: figures, viewer, feet, ground learnt by MPC, plants, other engines."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks.engines.bullet_scene import check
from benchmarks.engines.mujoco_scene import mjcf
from dojo_opt.gaits.feet import Feet
from dojo_opt.mpc.ground_estimate import Ground
from dojo_opt.plant.perturbation import Perturbation
from support.hills import GRID, WAVES
from support.scenes import ball

SIM = dojo.Simulator(ball(radius=0.1).with_terrain(WAVES), time_step=0.02)


def test_figure_and_viewer_show_the_ground(tmp_path):
    """The profile below the path, and a surface of triangles that lies on the terrain."""
    pytest.importorskip("meshcat")
    t = SIM.rollout(SIM.neutral(), np.zeros((10, SIM.nu)))
    figure = dojo.plots.trajectory(t)
    lines = [line for ax in figure.axes for line in ax.lines if len(line.get_xdata()) == 400]
    assert lines
    np.testing.assert_allclose(lines[0].get_ydata(), WAVES.height(lines[0].get_xdata(), t.x[5, 1]), atol=1e-3)
    page = dojo.viewer.save_html(t, tmp_path / "ball.html").read_text()
    assert len(page) > 1e5

    from dojo_opt.viewer.animation import _surface
    from dojo_opt.viewer.motion import motion

    vertices, triangles = _surface(motion(t), WAVES, 0.1)
    np.testing.assert_allclose(vertices[:, 2], WAVES.height(vertices[:, 0], vertices[:, 1]) + 0.1)
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    assert np.cross(b - a, c - a)[:, 2].min() > 0.0  # all of them seen from above
    assert triangles.max() == len(vertices) - 1


def test_feet_and_learnt_ground_know_the_terrain():
    x = SIM.neutral()
    x[2] += 0.05
    up = WAVES.surface(0.1).normal(x[0], x[1])[2]
    assert Feet(SIM, ["ball"]).gaps(x)[0] == pytest.approx(0.05 * up, abs=1e-6)
    ground = Ground(SIM.replace())
    assert ground.gaps(ground.points(x))[0] == pytest.approx(0.05, abs=1e-6)
    ground.height[0] = 0.05
    assert ground.gaps(ground.points(x))[0] == pytest.approx(0.0, abs=1e-6)


def test_a_plant_stands_on_terrain_and_refuses_a_slope_of_its_own():
    mech = SIM.mechanism
    assert Perturbation(friction=0.1).mechanism(mech).contacts[0].terrain is WAVES
    with pytest.raises(ValueError, match="got contacts on terrain"):
        Perturbation(slope=0.1).mechanism(mech)
    with pytest.raises(ValueError, match="give either a terrain, or a slope"):
        Perturbation(slope=0.1, terrain=WAVES)
    hill = dojo.Terrain.slope(0.2, height=1.0)
    plant = dojo.Plant(dojo.Simulator(ball(radius=0.1), time_step=0.02), terrain=hill)
    assert plant.simulator.mechanism.contacts[0].height == pytest.approx(np.cos(0.2))
    assert plant.x[2] == pytest.approx(hill.height(*plant.start[:2]) + 0.1 / np.cos(0.2))  # it touches
    high = plant.start.copy()
    high[2] = 0.6  # and falls from half a metre, as on level ground
    assert dojo.Plant(plant.nominal, high, terrain=hill).x[2] == pytest.approx(plant.x[2] + 0.5)
    smooth = dataclasses.replace(ball(), contacts=())
    assert dojo.Plant(dojo.Simulator(smooth, time_step=0.02), high, terrain=hill).x[2] == high[2]
    far = plant.x.copy()
    far[[0, 2]] += 5.0, 5.0 * np.tan(0.2)
    assert not plant.fallen(far)
    far[2] = plant.x[2]  # below the ground there
    assert plant.fallen(far)


def test_other_engines_refuse_scenes_that_they_would_get_wrong():
    bouncing = dataclasses.replace(ball(), contacts=[dojo.Contact("ball", radius=0.1, restitution=0.5)])
    for model in (SIM.model, dojo.Simulator(bouncing).model):
        with pytest.raises(ValueError, match="terrain and restitution"):
            mjcf(model, 0.01)
        with pytest.raises(ValueError, match="terrain and restitution"):
            check(model)


def test_a_plan_can_be_made_on_terrain():
    """A ball is pushed up a hill to a place of rest on its side, which needs the slope to be known."""
    hill = dojo.Terrain.from_function(lambda X, Y: 0.1 * (1.0 - np.cos(np.pi * X)) + 0.0 * Y, GRID, [0.0])
    sim = dojo.Simulator(ball(radius=0.1, friction=0.0).with_terrain(hill), time_step=0.05)
    start = sim.neutral()
    goal = start.copy()
    goal[0] = 0.5
    goal[2] = float(hill.surface(0.1).height(0.5, 0.0))
    problem = dojo.Problem(
        sim,
        start,
        20,
        cost=[dojo.cost.Tracking(goal, 0.1), dojo.cost.Effort(1e-3)],
        constraints=[dojo.constraint.Goal(goal, components=np.r_[0, 2, 6, 8])],
    )
    plan = dojo.ilqr(problem)
    assert plan.success, plan.message
    assert abs(plan.x[-1, 0] - 0.5) < 1e-3
