"""Names of degrees of freedom, and the components of dx that go by them."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo


def test_names_of_degrees_of_freedom() -> None:
    assert dojo.models.raiberthopper().dof_names == (*(f"body {a}" for a in ("x", "y", "z", "rx", "ry", "rz")), "leg")
    assert dojo.models.cartpole().dof_names == ("cart", "pole")
    body = dojo.Body("b", 1.0, (1, 1, 1))
    for kind, axis, names in (
        ("planar_axis", (0, 1, 0), ("b x", "b z", "b angle")),
        ("planar_axis", (1, 0, 0), ("b y", "b z", "b angle")),
        ("cylindrical", (0, 0, 1), ("b slide", "b angle")),
        ("orbital", (0, 0, 1), ("b r1", "b r2")),
        ("fixed_orientation", (0, 0, 1), ("b x", "b y", "b z")),
    ):
        mech = dojo.Mechanism([body], [dojo.Joint(kind, None, "b", axis=axis)])
        assert mech.dof_names == names


def test_directions_in_a_plane_have_the_names_of_their_axes() -> None:
    body = dojo.Body("b", 1.0, (1, 1, 1))
    mech = dojo.Mechanism([body], [dojo.Joint("planar_axis", None, "b", axis=(0, 1, 0))])
    sim = dojo.Simulator(mech, time_step=0.01)
    for name, direction in (("b x", (1, 0, 0)), ("b z", (0, 0, 1))):
        dx = np.zeros(sim.ndx)
        dx[mech.components(name)] = 0.3
        np.testing.assert_allclose(sim.maximal(sim.integrate(sim.neutral(), dx))[0, :3], 0.3 * np.array(direction))


def test_components_by_name() -> None:
    mech = dojo.models.raiberthopper()
    for names, numbers in (
        (["leg"], [6]),
        (["body"], range(6)),
        (["body z", "v leg"], [2, 13]),
        (["v body"], range(7, 13)),
        (["q"], range(7)),
        (["v"], range(7, 14)),
    ):
        assert mech.components(*names).tolist() == list(numbers)


def test_an_unknown_component_is_refused_with_the_known_ones() -> None:
    with pytest.raises(
        ValueError, match=r"components\(\.\.\.\): 'lge' is not one of: q, body x, .*leg.*did you mean 'leg'"
    ):
        dojo.models.raiberthopper().components("lge")
