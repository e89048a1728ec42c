"""benchmarks/collision_pairs.py: every pair of shapes near, touching and deep, against independent answers."""

from __future__ import annotations

from collections.abc import Iterator
from types import ModuleType

import pytest
from benchmark import loaded

from sim.collision.kinds import Pair

POLYTOPES = ["sphere_polytope", "capsule_polytope", "box_polytope", "polytope_polytope"]
NAMES = [*(p.name.lower() for p in Pair if p != Pair.POLYTOPE_POLYTOPE), *POLYTOPES]


@pytest.fixture(scope="module")
def table() -> Iterator[ModuleType]:
    yield from loaded("collision_pairs")


@pytest.mark.parametrize("name", NAMES)
def test_distance_frame_and_derivatives(table: ModuleType, name: str) -> None:
    errors = table.check(name)
    assert len(errors) == 9
    # the lowest point of a rim is rounded, by 1e-4 of its radius
    length = 1e-4 if name == "cylinder_halfspace" else 1e-5
    if name == "polytope_polytope":
        # every corner inside goes to its own nearest face, which need not be the face of least penetration of the whole
        assert errors.pop("distance deep") < 1e-3
    for what, error in errors.items():
        assert error <= (1e-6 if what.startswith("derivative") else length), what


def test_all_pairs_are_in_the_table(table: ModuleType) -> None:
    assert table.PAIRS == NAMES
