"""Panels: joints leg by leg, names at the lines, limits and stances; nothing covers anything else."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.plots.legs_over_time import branches


@pytest.fixture(scope="module")
def motion():
    """A quadruped that stands, and is lifted off its right front foot by an input."""
    sim = dojo.Simulator(dojo.models.quadruped(), time_step=0.02)
    us = np.zeros((20, sim.nu))
    us[10:, sim.mechanism.input_names.index("FR_calf")] = -20.0
    return sim.rollout(sim.neutral(), us)


def test_legs_and_arms_are_branches():
    found = {branch.name: branch for branch in branches(dojo.models.quadruped())}
    assert list(found) == ["FR", "FL", "RR", "RL"]
    assert found["FR"].labels == ("hip", "thigh", "calf") and len(found["FR"].contacts) == 1
    assert {"l_arm", "r_arm", "l_leg", "r_leg", "back"} <= {branch.name for branch in branches(dojo.models.atlas())}
    (arm,) = branches(dojo.models.panda(gripper=False))
    assert len(arm.dofs) == 7


def test_a_robot_with_legs_is_drawn_leg_by_leg(motion):
    figure = dojo.plots.trajectory(motion)
    titled = [ax for ax in figure.axes if ax.get_title()]
    assert [ax.get_title() for ax in titled] == ["FR", "FL", "RR", "RL"]
    for ax in titled:
        assert sorted(text.get_text() for text in ax.texts) == ["calf", "hip", "thigh"]
        curves = [line for line in ax.lines if len(line.get_xdata()) == len(motion.time)]
        assert len(curves) == 3 and len({line.get_color() for line in curves}) == 3
        assert any(np.ptp(line.get_ydata()) == 0.0 and line not in curves for line in ax.lines)  # limits
    assert any(len(ax.patches) for ax in titled)  # stances
    assert not any(ax.get_legend() for ax in titled)


def test_a_motion_without_a_step_is_drawn(motion):
    sim = motion.simulator
    still = sim.rollout(motion.x[0], np.zeros((0, sim.nu)))
    for drawn in (still, dojo.Simulator(dojo.models.npendulum(2)).rollout(np.zeros(4), np.zeros((0, 2)))):
        assert dojo.plots.trajectory(drawn).axes and dojo.plots.controls(drawn).axes
    assert dojo.plots.trajectory(sim.mechanism).axes


@pytest.mark.slow
def test_names_at_the_lines_do_not_touch(motion):
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.text import Text

    figure = dojo.plots.trajectory(motion)
    FigureCanvasAgg(figure).draw()
    for ax in figure.axes:
        boxes = sorted((Text.get_window_extent(text) for text in ax.texts), key=lambda box: box.y0)
        for lower, upper in zip(boxes, boxes[1:], strict=False):
            assert lower.y0 + 0.6 * lower.height < upper.y0
        for box in boxes:
            assert box.x0 >= ax.get_window_extent().x1  # beside the curves


@pytest.mark.slow
def test_no_text_of_a_figure_leaves_it():
    """Of a robot with many contacts, whose forces are named by body: the longest label."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    robot = dojo.Simulator(dojo.models.atlas(contacts="all"), time_step=0.02)
    figure = dojo.plots.trajectory(robot.rollout(robot.neutral(), np.zeros((80, robot.nu))))
    FigureCanvasAgg(figure).draw()
    labels = [label for ax in figure.axes for label in (ax.xaxis.label, ax.yaxis.label, ax.title) if label.get_text()]
    assert any("by body" in label.get_text() for label in labels)
    for label in labels:
        box = label.get_window_extent()
        assert figure.bbox.x0 <= box.x0 and figure.bbox.y0 <= box.y0, label
        assert box.x1 <= figure.bbox.x1 and box.y1 <= figure.bbox.y1, label
