"""Two joints on one pair of bodies: their common constraints count once."""

import numpy as np

import dojo_opt as dojo


def test_a_second_hinge_on_the_same_axis_changes_nothing():
    """Two joints on one pair of bodies: the second one closes a loop, and all that it says is known already."""
    door = dojo.Body("door", 1.0, (0.1, 0.1, 0.1))
    hinge = {"axis": (0, 1, 0), "child_point": (0, 0, 0.5)}
    first = dojo.Joint("revolute", None, "door", name="upper", **hinge)
    second = dojo.Joint("revolute", None, "door", name="lower", close=True, axis=(0, 1, 0), parent_point=(0, 0.3, 0),
                        child_point=(0, 0.3, 0.5))  # fmt: skip
    runs = []
    for joints in ([first], [first, second]):
        sim = dojo.Simulator(dojo.Mechanism([door], joints), time_step=0.01)
        runs.append(sim.rollout(np.array([1.0, 0.0]), np.zeros((50, sim.nu)), throw=True).x)
    np.testing.assert_allclose(runs[0], runs[1], atol=1e-7)


def test_hinges_across_one_another_hold_the_body_still():
    """An over-constrained loop that fits together: nothing can move, and nothing does."""
    door = dojo.Body("door", 1.0, (0.1, 0.1, 0.1))
    joints = [
        dojo.Joint("revolute", None, "door", name="hinge", axis=(0, 1, 0), child_point=(0, 0, 0.5)),
        dojo.Joint("revolute", None, "door", name="cross", axis=(1, 0, 0), child_point=(0, 0, 0.5), close=True),
    ]
    sim = dojo.Simulator(dojo.Mechanism([door], joints), time_step=0.01)
    t = sim.rollout(sim.neutral(), np.zeros((20, sim.nu)), throw=True)
    np.testing.assert_allclose(t.x, 0.0, atol=1e-8)
