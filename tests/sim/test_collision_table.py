"""The table of the report: every pair of shapes near, touching and deep, against independent answers."""

from __future__ import annotations

import pytest

from sim.model.shape_kinds import Pair
from support.collision_checks import bar, check
from support.solids import PAIRS

POLYTOPES = ["sphere_polytope", "capsule_polytope", "box_polytope", "polytope_polytope"]
ON_CYLINDERS = ["capsule_cylinder", "box_cylinder", "polytope_cylinder"]
OTHERS = [p.name.lower() for p in Pair if not p.name.startswith("POLYTOPE") and not p.name.endswith("FIELD")]
ON_ELLIPSOIDS = ["sphere_ellipsoid", "capsule_ellipsoid", "box_ellipsoid", "polytope_ellipsoid"]
NAMES = [n for n in OTHERS if "ellipsoid" not in n] + POLYTOPES + ON_CYLINDERS
NAMES += [n for n in OTHERS if "ellipsoid" in n] + ON_ELLIPSOIDS
ROUNDED = ("cylinder_halfspace", "box_cylinder", "polytope_cylinder", "cylinder_cylinder")


@pytest.mark.sweep(4)
@pytest.mark.parametrize("name", NAMES)
def test_distance_frame_and_derivatives(name: str) -> None:
    errors = check(name)
    assert len(errors) == 9
    # the point of a rim that is nearest to a plane is rounded, by 1e-4 of its radius
    length = 1e-4 if name in ROUNDED else 1e-5
    for what, error in errors.items():
        assert error <= (1e-6 if what.startswith("derivative") else length), what
        assert bar(name, what) == (1e-6 if what.startswith("derivative") else length)


def test_all_pairs_are_in_the_table() -> None:
    assert list(PAIRS) == NAMES
