"""Derivatives by the sizes of shapes: every pair of shapes near, touching, deep and bouncing."""

from __future__ import annotations

import numpy as np
import pytest

import dojo_opt as dojo
from support.couplings import STONE, touching
from support.parameter_errors import error

SHAPES = {
    "sphere": dojo.Sphere(0.2),
    "capsule": dojo.Capsule(0.15, 0.4),
    "box": dojo.Box(0.4, 0.3, 0.5),
    "cylinder": dojo.Cylinder(0.2, 0.3),
    "ellipsoid": dojo.Ellipsoid(0.3, 0.2, 0.15),
    "stone": STONE,
    "plane": dojo.HalfSpace(),
    "string": dojo.String(0.5),
    "field": dojo.SignedDistance.from_function(
        lambda x: 2.0 * (np.linalg.norm(x / (0.3, 0.2, 0.25), axis=1) - 1.0), [[-0.5] * 3, [0.5] * 3], 0.05, offset=0.02
    ),
}
PAIRS = [
    "sphere sphere",
    "sphere capsule",
    "box sphere",
    "sphere cylinder",
    "sphere plane",
    "capsule capsule",
    "capsule box",
    "capsule plane",
    "box box",
    "box plane",
    "cylinder plane",
    "string string",
    "stone sphere",
    "capsule stone",
    "box stone",
    "stone stone",
    "stone plane",
    "ellipsoid plane",
    "ellipsoid ellipsoid",
    "ellipsoid sphere",
    "ellipsoid capsule",
    "box ellipsoid",
    "cylinder ellipsoid",
    "stone ellipsoid",
    "field sphere",
    "capsule field",
]
# gap [m], kappa, restitution, and the least impulse of a situation with this name [N s]
WHERE = {
    "near": (0.05, 1e-3, 0.0, 1e-3),
    "touching": (0.0, 1e-4, 0.0, 0.1),
    "deep": (-0.02, 1e-4, 0.0, 0.5),
    "bouncing": (0.003, 1e-5, 0.5, 0.5),
}


@pytest.mark.sweep(8)
@pytest.mark.parametrize("where", WHERE)
@pytest.mark.parametrize("pair", PAIRS)
def test_sizes_of_two_shapes(pair: str, where: str) -> None:
    gap, kappa, restitution, least = WHERE[where]
    a, b = pair.split()
    if pair == "string string" and where == "bouncing":
        pytest.skip("a string that is let go again is the case of a ball")
    case = touching(SHAPES[a], SHAPES[b], gap, kappa, restitution)
    assert np.linalg.norm(case.sim.step(case.x).contacts.impulse, axis=1).max() > least
    sides = "ab" if b not in ("plane", "string") else "a"  # of one kind both change at once
    groups = [[f"{kind}_{side}" for side in sides] for kind in ("size", "shape")]
    groups += [["friction"]] if pair == "stone plane" else []
    errors = {" ".join(kinds): error(case, *kinds) for kinds in groups}
    assert all(e < 1e-6 for e in errors.values()), errors


def test_names_values_and_their_places() -> None:
    case = touching(SHAPES["box"], SHAPES["capsule"], 0.0)
    sim = case.sim
    found = sim.parameters(("size_a", "size_b"))
    assert found.names == (
        "size_a:a-b[x]",
        "size_a:a-b[y]",
        "size_a:a-b[z]",
        "size_b:a-b[radius]",
        "size_b:a-b[length]",
    )
    np.testing.assert_array_equal(found.values, [0.4, 0.3, 0.5, 0.15, 0.4])
    larger = sim.with_parameters({"size_a:a-b[y]": 0.35, "size_b:a-b[length]": 0.6}).mechanism.collisions[0]
    assert (larger.shape_a.y, larger.shape_a.x, larger.shape_b.length) == (0.35, 0.4, 0.6)
    assert "size" not in " ".join(touching(SHAPES["sphere"], SHAPES["plane"], 0.0).sim.parameters(("shape_b",)).names)
    stone = touching(STONE, SHAPES["sphere"], 0.0).sim.with_parameters({"size_a:a-b[scale]": 2.0})
    np.testing.assert_allclose(stone.mechanism.collisions[0].shape_a.vertices, 2.0 * np.asarray(STONE.vertices))
    with pytest.raises(ValueError, match=r"Box\(x=...\)"):
        sim.with_parameters({"size_a:a-b[x]": 0.0})


def test_the_size_of_a_collision_leaves_the_body_alone() -> None:
    """A body that takes its inertia from its shape keeps it; other collisions keep the shape of the body."""
    body = dojo.Body("ball", 1.0, shape=dojo.Sphere(0.1))
    ground = dojo.Collision("ball", shape_b=dojo.HalfSpace())
    mech = dojo.Mechanism([body], [dojo.Joint("floating", None, "ball")], collisions=[ground])
    moved = dojo.Simulator(mech).with_parameters({"size_a": 0.2}).mechanism
    assert moved.collisions[0].shape_a.radius == 0.2
    assert moved.bodies[0].shape.radius == 0.1
    np.testing.assert_array_equal(moved.bodies[0].inertia, mech.bodies[0].inertia)


def test_the_pinch_of_a_larger_ball() -> None:
    """A ball between floor and ceiling: both push it, and by symmetry its size changes nothing but the forces."""
    planes = [dojo.HalfSpace(), dojo.HalfSpace(center=(0, 0, 0.2), orientation=(0.0, 1.0, 0.0, 0.0))]
    collisions = [dojo.Collision("ball", shape_b=p, friction=0.0, name=n) for p, n in zip(planes, "fc", strict=True)]
    body = dojo.Body("ball", 1.0, shape=dojo.Sphere(0.0999))
    mech = dojo.Mechanism([body], [dojo.Joint("prismatic", None, "ball")], collisions=collisions, gravity=(0, 0, 0))
    sim = dojo.Simulator(mech, time_step=0.01, kappa=1e-6)
    x = np.array([0.1, 0.0])
    blocks = sim.linearize(x, wrt=("size_a:f", "size_a:*"))
    assert blocks["size_a:f"][0, 0] > 0.1
    assert np.abs(blocks["size_a:*"]).max() < 1e-9
