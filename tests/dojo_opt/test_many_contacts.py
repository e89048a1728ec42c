"""Figures of robots with more contacts than a panel has room for."""

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt.plots.trajectory import contact_forces, paths
from dojo_opt.viewer.motion import motion

LEGS = 10


@pytest.fixture(scope="module")
def crawler():
    """A slab on balls: a body with 4 points in the middle, and 10 legs with 4 points each, without gravity's tilt."""
    slab = dojo.Body("slab", 5.0, shape=dojo.Box(2.0, 1.0, 0.1))
    feet = [dojo.Body(f"leg{k}", 0.1, shape=dojo.Box(0.1, 0.1, 0.1)) for k in range(LEGS)]
    joints = [dojo.Joint("floating", None, "slab")]
    joints += [dojo.Joint("fixed", "slab", f"leg{k}", parent_point=(0.2 * k - 0.9, 0, -0.1)) for k in range(LEGS)]
    corners = [(x, y, -0.05) for x in (-0.05, 0.05) for y in (-0.05, 0.05)]
    contacts = [dojo.Contact(f"leg{k}", corner) for k in range(LEGS) for corner in corners]
    sim = dojo.Simulator(dojo.Mechanism([slab, *feet], joints, contacts), time_step=0.01)
    x = sim.neutral()
    x[2] = 0.15
    return sim.rollout(x, steps=100, throw=True)


def test_forces_are_added_up_by_body(crawler):
    m = motion(crawler)
    ax = contact_forces(m)
    labels = [line.get_label() for line in ax.patches if line.get_label()]
    assert len(labels) == 8 and labels[-1] == "3 others" and all(name.startswith("leg") for name in labels[:-1])
    total = sum(patch.get_data()[0] for patch in ax.patches[::2])
    np.testing.assert_allclose(total, m.normal_force.sum(axis=1), rtol=1e-12)
    assert "by body" in ax.get_ylabel()


def test_few_paths_are_drawn_without_a_blot(crawler):
    ax = paths(motion(crawler))
    lines = [line for line in ax.get_lines() if len(line.get_xdata()) == 101]
    assert len(lines) == 9  # the slab, and 8 legs
    assert all(line.get_marker() in ("", "None", None) for line in lines)
