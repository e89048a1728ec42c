"""Inertias against integration over the solid."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from sim.mechanism.polytope import Polytope
from sim.mechanism.shapes import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere, rotation_matrix


def inside(shape: Shape, p: np.ndarray) -> np.ndarray:
    x, y, z = p.T
    if isinstance(shape, Sphere):
        return x**2 + y**2 + z**2 < shape.radius**2
    if isinstance(shape, Box):
        return (abs(x) < shape.x / 2) & (abs(y) < shape.y / 2) & (abs(z) < shape.z / 2)
    if isinstance(shape, Cylinder):
        return (x**2 + y**2 < shape.radius**2) & (abs(z) < shape.length / 2)
    if isinstance(shape, Ellipsoid):
        return (x / shape.x) ** 2 + (y / shape.y) ** 2 + (z / shape.z) ** 2 < 1.0
    beyond = np.maximum(abs(z) - shape.length / 2, 0.0)
    return x**2 + y**2 + beyond**2 < shape.radius**2


@pytest.mark.parametrize(
    "shape",
    [
        Sphere(0.3),
        Box(0.2, 0.4, 0.6),
        Cylinder(0.2, 0.5),
        Capsule(0.2, 0.3),
        Capsule(0.3, 0.01),
        Ellipsoid(0.4, 0.3, 0.2),
    ],
)
def test_inertia_is_the_integral(shape: Shape) -> None:
    axis = np.linspace(-0.5, 0.5, 101)[:-1] + 0.005
    p = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    p = p[inside(shape, p)]
    mass = 2.5
    second = mass * p.T @ p / len(p)
    np.testing.assert_allclose(shape.inertia(mass), np.trace(second) * np.eye(3) - second, rtol=0.01, atol=1e-4)


def test_orientation_turns_the_inertia() -> None:
    q = (0.5, 0.5, 0.5, 0.5)
    R = rotation_matrix(q)
    np.testing.assert_allclose(
        Box(1, 2, 3, orientation=q).inertia(1.0), R @ Box(1, 2, 3).inertia(1.0) @ R.T, atol=1e-15
    )


@pytest.mark.parametrize("make", [lambda: Sphere(0.0), lambda: Box(1, -1, 1), lambda: Capsule(0.1, float("nan"))])
def test_sizes_are_positive(make: object) -> None:
    with pytest.raises(ValueError, match=r"(Sphere|Box|Capsule)\((radius|y|length)=\.\.\.\)"):
        make()  # type: ignore[operator]


def test_a_polytope_of_the_corners_of_a_box_is_the_box() -> None:
    corners = 0.5 * np.array(list(product((-0.4, 0.4), (-0.3, 0.3), (-0.2, 0.2))))
    turn = np.array([0.8, 0.4, -0.2, 0.4]) / np.sqrt(1.0)
    turn /= np.linalg.norm(turn)
    inside = np.vstack([corners, 0.1 * corners])  # points that are no corners are omitted
    polytope = Polytope(inside, orientation=turn)
    assert len(np.asarray(polytope.vertices)) == 8
    np.testing.assert_allclose(polytope.inertia(2.0), Box(0.4, 0.3, 0.2, orientation=turn).inertia(2.0), atol=1e-14)


def test_a_tetrahedron_about_its_centroid() -> None:
    """Corner at the origin, legs 1: centroid at a quarter, moments of a known integral."""
    raw = np.vstack([np.zeros(3), np.eye(3)])
    solid = Polytope.about_centroid(raw)
    np.testing.assert_allclose(np.asarray(solid.vertices).mean(axis=0), 0.0, atol=1e-15)
    # integrals over the tetrahedron of density 6: <x x> = 1/10, <x y> = 1/20, about the centroid less 1/16
    diagonal, across = 1 / 10 - 1 / 16, 1 / 20 - 1 / 16
    expected = 2.0 * diagonal * np.eye(3) - across * (np.ones((3, 3)) - np.eye(3))
    np.testing.assert_allclose(solid.inertia(1.0), expected, atol=1e-14)
    np.testing.assert_allclose(np.sort(np.linalg.eigvalsh(expected)), solid.principal(1.0), atol=1e-14)


@pytest.mark.parametrize(
    "shape", [Sphere(0.3), Box(0.2, 0.4, 0.6), Cylinder(0.2, 0.5), Capsule(0.2, 0.3), Ellipsoid(0.4, 0.3, 0.2)]
)
def test_outline_support_volume_and_radius_are_of_one_solid(shape: Shape, rng: np.random.Generator) -> None:
    axis = np.linspace(-0.5, 0.5, 101)[:-1] + 0.005
    p = np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), axis=-1).reshape(-1, 3)
    p = p[inside(shape, p)]
    assert len(p) * 1e-6 == pytest.approx(shape.volume(), rel=0.02)
    assert shape.bounding_radius() == pytest.approx(np.linalg.norm(p, axis=1).max(), abs=0.02)
    for n in rng.normal(size=(20, 3)):
        n /= np.linalg.norm(n)
        assert shape.support(n) == pytest.approx((p @ n).max(), abs=0.02)
        low, high = (shape.outline() @ n).max(), shape.support(n)
        assert high - 0.05 * shape.bounding_radius() < low <= high + 1e-12
