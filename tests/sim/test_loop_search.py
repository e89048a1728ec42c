"""Closed loops found from where Newton's method finds none: linkages in one line, far guesses, and those too short."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.mechanism import Mechanism
from support.linkage import COUPLER, CRANK, ROCKER, fourbar, plain_fourbar, worst_gap

BRANCHES = (-1.0, 1.0)


def at(mech: Mechanism, q: Sequence[float]) -> dojo.Simulator:
    joints = [joint.name for joint in mech.joints]
    return dojo.Simulator(replace(mech, neutral=dict(zip(joints, q, strict=True))), time_step=0.01)


def closed_fourbars(crank: float, coupler: float, rocker: float, ground: float) -> np.ndarray:
    """Coordinates (n, 3) of all closed poses at a fine row of angles of the crank, by the two circles of its ends."""
    a = np.linspace(-np.pi, np.pi, 20_001)
    bx, bz = crank * np.cos(a), -crank * np.sin(a)
    dx, dz = ground - bx, -bz
    r = np.hypot(dx, dz)
    along = (coupler**2 - rocker**2 + r**2) / (2.0 * r)
    high = coupler**2 - along**2
    poses = []
    for sign in BRANCHES:
        up = sign * np.sqrt(np.where(high >= 0.0, high, np.nan))
        cx, cz = bx + (along * dx - up * dz) / r, bz + (along * dz + up * dx) / r
        turned = np.arctan2(-(cz - bz), cx - bx) - a
        turned = (turned + np.pi) % (2.0 * np.pi) - np.pi
        poses.append(np.array([a, turned, np.arctan2(-cz, cx - ground)]).T)
    found = np.concatenate(poses)
    return found[np.isfinite(found).all(axis=1)]


@pytest.mark.parametrize("start", [(0.0, 0.0, 0.0), (np.pi, 0.0, 0.0), (0.0, np.pi, np.pi)])
def test_a_four_bar_in_one_line_closes_at_the_nearest_pose(start: tuple[float, float, float]) -> None:
    mech = plain_fourbar(CRANK, COUPLER, ROCKER)
    sim = at(mech, start)
    assert worst_gap(sim, np.concatenate([start, np.zeros(3)])) > 0.2
    x = sim.neutral()
    assert worst_gap(sim, x) < 1e-10 and not x[3:].any()
    turns = 2.0 * np.pi * np.array([-1.0, 0.0, 1.0])
    off = np.abs((closed_fourbars(CRANK, COUPLER, ROCKER, 1.0) - start)[:, :, None] + turns).min(axis=2)
    assert np.linalg.norm(x[:3] - start) < np.linalg.norm(off, axis=1).min() + 1e-3
    np.testing.assert_array_equal(x, sim.neutral())
    t = sim.rollout(x, np.zeros((50, sim.nu)), throw=True)
    assert worst_gap(sim, t.x[-1]) < 1e-7


def test_a_closing_joint_with_a_coordinate_of_its_own() -> None:
    x = at(fourbar("pin", spring=1.0), (0.0, 0.0, 0.0, 0.0)).neutral()
    assert worst_gap(at(fourbar("pin", spring=1.0), x[:4]), x) < 1e-10
    np.testing.assert_allclose(x[3], x[2] - x[0] - x[1], atol=1e-10)


def test_a_parallelogram() -> None:
    """Flat and closed it stays unchanged; with opposite cranks it has to move, and on either branch it is closed."""
    mech = plain_fourbar(0.5, 1.0, 0.5, 1.0)
    np.testing.assert_array_equal(at(mech, (0.0, 0.0, 0.0)).neutral(), np.zeros(6))
    sim = at(mech, (np.pi, 0.0, 0.0))
    x = sim.neutral()
    assert worst_gap(sim, x) < 1e-10
    a, b, c = x[:3]
    turned = abs(a + b) < 1e-9 and abs(a - c) < 1e-9
    assert (
        turned or abs(np.hypot(1.0 - 0.5 * np.cos(a) + 0.5 * np.cos(c), 0.5 * np.sin(a) - 0.5 * np.sin(c)) - 1.0) < 1e-9
    )


def test_a_five_bar_with_its_arms_stretched_outwards() -> None:
    mech = dojo.models.fivebar(limits=None)
    sim = at(mech, (0.5 * np.pi, -0.5 * np.pi, 0.0, 0.0))
    x = sim.neutral()
    assert worst_gap(sim, x) < 1e-10
    np.testing.assert_array_equal(x, sim.neutral())


def test_start_closes_as_neutral_does() -> None:
    sim = at(plain_fourbar(), (0.0, 0.0, 0.0))
    x = sim.state_from_velocity(np.zeros(3), np.array([1.0, 0.0, 0.0]))
    np.testing.assert_allclose(x[:3], sim.neutral()[:3], atol=1e-6)
    assert worst_gap(sim, x) < 1e-10 and np.abs(x[3:]).max() > 0.1


def test_links_that_are_too_short() -> None:
    """The pin of the second four-bar cannot close, the first one's can: the message names the second."""
    short = plain_fourbar(0.5, 0.3, 0.5, 2.0)
    with pytest.raises(ValueError, match=r"loop joint 'pin' cannot be closed .* off by 0\.[5-7].* links are too short"):
        at(short, (-0.3, 0.1, 0.2)).neutral()
    both = plain_fourbar().add(short, prefix="second/")
    with pytest.raises(ValueError, match="loop joint 'second/pin' cannot be closed .* links are too short"):
        dojo.Simulator(both, time_step=0.01).neutral()


def test_a_joint_that_acts_is_called_by_its_own_name() -> None:
    mech = fourbar("pin", spring=1.0)
    apart = [replace(j, parent_point=(9.0, 0.0, 0.0)) if j.name == "rocker" else j for j in mech.joints]
    with pytest.raises(ValueError, match="loop joint 'pin' cannot be closed near this state"):
        dojo.Simulator(replace(mech, joints=apart), time_step=0.01).neutral()


def test_loops_of_which_each_closes_alone() -> None:
    """A pin for the rocker's end half a metre away from the coupler's pin."""
    mech = plain_fourbar()
    other = replace(mech.loops[0], name="other", parent_point=(COUPLER / 2 - 0.5, 0.0, 0.0))
    with pytest.raises(
        ValueError, match="loop joint '(pin|other)' .* off by .* whether two loops contradict each other"
    ):
        at(replace(mech, loops=[*mech.loops, other]), (-1.0, 0.6, -1.2)).neutral()
