"""Strings: they hold, do not push, do not rub, and have one length."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from sim.collisions import Collision
from sim.mechanism import Mechanism
from sim.parts import Body, Joint
from sim.shapes import String


def test_a_string_holds_and_does_not_push() -> None:
    bodies = [Body(n, 1.0, (0.1, 0.1, 0.1)) for n in "ab"]
    joints = [Joint("floating", None, n) for n in "ab"]
    rope = Collision("a", "b", String(1.0), String(1.0), friction=0.0)
    sim = dojo.Simulator(Mechanism(bodies, joints, collisions=[rope], gravity=(0, 0, 0)), time_step=0.01)
    x = np.concatenate([[0, 0, 0, 1, 0, 0, 0, 0.5, 0, 0, 1, 0, 0, 0], [-1, 0.2, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0]])
    t = sim.rollout(x, np.zeros((200, sim.nu)))
    assert t.success, t.message
    apart = np.linalg.norm(t.x[:, :3] - t.x[:, 7:10], axis=1)
    assert 0.9 < apart.max() <= 1.0


def test_a_string_does_not_rub() -> None:
    body = Body("a", 1.0, (0.1, 0.1, 0.1))
    x = np.r_[np.sin(1.0), 0.0, -np.cos(1.0), 1, 0, 0, 0, np.zeros(6)]
    runs = []
    for friction in (0.0, 0.5):
        rope = Collision("a", None, String(1.0), String(1.0), friction=friction)
        mech = Mechanism([body], [Joint("floating", None, "a")], collisions=[rope])
        sim = dojo.Simulator(mech, time_step=0.01)
        runs.append(sim.rollout(x, np.zeros((100, 0)), throw=True).x)
        assert not any("friction" in n for n in sim.parameters().names)
    np.testing.assert_array_equal(*runs)
    with pytest.raises(ValueError, match="both ends of a string have its length, got 1 and 2"):
        dojo.Simulator(replace(mech, collisions=[replace(rope, shape_b=String(2.0))]))
