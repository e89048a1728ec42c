"""Falls and figures of robots with a planar base, and of robots without a base that can fall."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo


def labels(axes):
    """Names of the curves, in the legend or at the lines."""
    return [text.get_text() for text in (axes.get_legend().get_texts() if axes.get_legend() else axes.texts)]


@pytest.fixture(scope="module")
def walker():
    """A planar robot that nobody holds up."""
    sim = dojo.Simulator(dojo.models.hopper(), time_step=0.01)
    x = sim.neutral()
    x[2] = 0.3  # leaning
    return dojo.closed_loop(lambda t, x: np.zeros(3), dojo.Plant(sim, start=x), 2.0)


def test_a_planar_robot_that_lies_has_fallen(walker):
    assert not walker.survived
    assert walker.message.startswith("Fell at") and 0.1 < walker.duration < 1.9


def test_a_pendulum_that_hangs_has_not():
    sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01)
    start = np.array([np.pi - 0.1, 0.0])
    loop = dojo.closed_loop(lambda t, x: np.zeros(1), dojo.Plant(sim, start=start), 2.0)
    assert loop.survived and np.ptp(loop.x[:, 0]) > 3.0
    figure = dojo.plots.closed_loop(loop)
    assert [ax.get_ylabel() for ax in figure.axes] == [
        "coordinates [rad]", "velocities [rad/s]", "inputs [N m]", "velocities [rad/s]"
    ]  # fmt: skip


def test_the_figure_of_a_planar_robot_shows_height_and_path_from_the_side(walker):
    figure = dojo.plots.closed_loop(walker)
    height, _, path, _ = figure.axes
    assert (height.get_ylabel(), path.get_xlabel(), path.get_ylabel()) == ("height of the base [m]", "x [m]", "z [m]")
    z = walker.simulator.maximal(walker.x)[:, 0, 2]
    np.testing.assert_allclose(height.lines[0].get_ydata(), z)
    np.testing.assert_allclose(path.lines[0].get_ydata(), z)
    assert z[-1] < 0.6 * z[0]


def test_coordinates_have_the_names_of_their_directions(walker):
    figure = dojo.plots.trajectory(walker)
    names = labels(figure.axes[0])
    assert {"base x", "base z", "base angle"} <= set(names) and "base y" not in names
    assert figure.axes[0].get_ylabel() == "coordinates [m, rad]\n(dashed: limits, grey of several)"
    assert figure.axes[1].get_ylabel() == "inputs [N m]"


def test_the_error_of_a_loop_goes_by_name(walker):
    loop = dojo.closed_loop(
        lambda t, x: np.zeros(3),
        dojo.Plant(walker.simulator),
        0.05,
        reference=lambda t: np.tile(walker.x[0], (len(t), 1)),
    )
    np.testing.assert_allclose(loop.rms("base angle"), np.sqrt(np.mean(loop.error()[:, 2] ** 2)))
    assert labels(dojo.plots.closed_loop(loop).axes[1]) == ["base x", "base z"]


def test_time_goes_on_in_a_controller():
    mpc = dojo.MPC(dojo.problems.swingup("pendulum"))
    mpc(1.0, np.zeros(2))
    with pytest.raises(ValueError, match=r"MPC\(time\): expected a time after 1 s, got 0 s; call reset\(\)"):
        mpc(0.0, np.zeros(2))
    with pytest.raises(
        ValueError, match=r"MPC\(time\): expected at most 100,000 knots after 1 s, got 1e\+09 s; call res"
    ):
        mpc(1e9, np.zeros(2))
    mpc.reset()
    mpc(0.0, np.zeros(2))


def test_impossible_figures_are_refused():
    with pytest.raises(TypeError, match="expected a Trajectory, a Plan or a ClosedLoop to show, got a ndarray"):
        dojo.plots.trajectory(np.zeros(3))


def test_a_panel_takes_a_result_and_makes_its_axes():
    sim = dojo.Simulator(dojo.models.raiberthopper(), time_step=0.02)
    t = sim.rollout(sim.neutral(), np.tile([0.0, 0.0, 41.0], (20, 1)))
    for draw, lines in ((dojo.plots.state, 2), (dojo.plots.paths, 3), (dojo.plots.velocities, 7)):
        ax = draw(t)
        assert len(ax.lines) >= lines and ax.get_xlabel()
    given = ax.figure.add_subplot()
    assert dojo.plots.controls(t, given) is given
