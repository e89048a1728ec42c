"""The kernels that a scene links: those of its own features."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from sim.model.shape_kinds import SWAPPED
from sim.model.slots import Slot

GROUND = (
    Slot.CHOOSE_ACTIVE,
    Slot.HAS_ACTIVATED,
    Slot.SUNK_CONTACT,
    Slot.CONTACTS_KINEMATICS,
    Slot.APPLY_CONTACTS,
    Slot.CONDENSE_CONTACTS,
    Slot.REPORT_CONTACTS,
    Slot.CHOOSE_CONTACTS,
    Slot.CONTACT_RATES,
    Slot.CHOOSE_REACHED,
    Slot.DELASSUS,
    Slot.REACHED_RATES,
    Slot.REACHED_IMPULSES,
    Slot.ADD_SLIP_JACOBIANS,
    Slot.ALL_STIFF,
)
PAIRS = (Slot.PAIR_KINEMATICS, Slot.CONDENSE_PAIRS, Slot.CHOOSE_SHAPES, Slot.OPEN_PAIRS, Slot.ALL_NEAR)


def linked(shape: dojo.Shape | None, *, ground: bool) -> np.ndarray:
    """Which slots a step and a derivative of two bodies fill: with this shape each, above the ground."""
    bodies = [dojo.Body(name, 1.0, (0.1, 0.1, 0.1)) for name in "ab"]
    sim = dojo.Simulator(
        dojo.Mechanism(
            bodies,
            [dojo.Joint("floating", None, name) for name in "ab"],
            [dojo.Contact(name, radius=0.1) for name in "ab"] if ground else [],
            collisions=[dojo.Collision("a", "b", shape, shape)] if shape else [],
            neutral={"a": (0.0, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0), "b": (0.3, 0.0, 2.0, 1.0, 0.0, 0.0, 0.0)},
        ),
        time_step=0.01,
    )
    sim.linearize(sim.neutral())
    return np.flatnonzero(sim.model.optional)


@pytest.mark.parametrize("ground", [False, True])
def test_a_scene_links_kernels_of_the_ground_only_if_it_has_one(ground: bool) -> None:
    slots = linked(dojo.Sphere(0.1), ground=ground)
    assert set(PAIRS) <= set(slots)
    assert {slot for slot in GROUND if slot in slots} == (set(GROUND) if ground else set())


def test_a_scene_without_pairs_links_none_of_their_kernels() -> None:
    slots = linked(None, ground=True)
    assert set(GROUND) <= set(slots)
    assert not set(PAIRS) & set(slots)


def test_shapes_of_one_contact_link_no_choice_of_elements() -> None:
    choices = {Slot.OVERLAPPING, Slot.SUBSTITUTE_ELEMENTS, Slot.REMEMBER_ELEMENTS, Slot.KEEP_ELEMENTS}
    assert not choices & set(linked(dojo.Sphere(0.1), ground=False))
    assert choices <= set(linked(dojo.Box(0.1, 0.1, 0.1), ground=False))


@pytest.mark.parametrize(
    "shapes", [(dojo.Sphere(0.1), dojo.Capsule(0.1, 0.1)), (dojo.Capsule(0.1, 0.1), dojo.Sphere(0.1))]
)
def test_shapes_are_exchanged_only_where_the_second_one_comes_first(shapes: tuple[dojo.Shape, dojo.Shape]) -> None:
    bodies, joints = [dojo.Body("a", 1.0, (0.1, 0.1, 0.1))], [dojo.Joint("floating", None, "a")]
    mech = dojo.Mechanism(bodies, joints, collisions=[dojo.Collision("a", None, *shapes)])
    sim = dojo.Simulator(mech, time_step=0.01)
    x = sim.neutral()
    x[2] = 1.0
    sim.step(x)
    assert bool(sim.model.optional[Slot.EXCHANGE_SHAPES]) == bool(np.any(sim.model.pair_kind >= SWAPPED))


@pytest.mark.parametrize("features", [{}, {"limits": (-0.5, 0.5)}, {"friction": 0.1, "limits": (-0.5, 0.5)}])
def test_a_joint_links_the_prediction_only_if_it_has_limits_that_the_prediction_covers(features: dict) -> None:
    joint = dojo.Joint("revolute", None, "a", child_point=(0.0, 0.0, -0.1), **features)
    sim = dojo.Simulator(dojo.Mechanism([dojo.Body("a", 1.0, (0.1, 0.2, 0.3))], [joint]), time_step=0.01)
    sim.step(sim.neutral())
    filled = set(np.flatnonzero(sim.model.optional))
    assert ({Slot.CHOOSE_REACHED, Slot.DELASSUS} <= filled) == ([*features] == ["limits"])
    assert Slot.CHOOSE_CONTACTS not in filled
