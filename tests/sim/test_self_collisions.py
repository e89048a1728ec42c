"""A robot that collides with itself: which pairs of shapes, and that they keep apart."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import dojo_opt as dojo
from sim.mechanism.pose import HERE, Pose, turn
from sim.mechanism.self_collisions import separation
from sim.model.shape_kinds import Pair
from support.collide import apart_at_least
from support.scenes import pendulum
from support.solids import distance, random_case
from support.urdf_files import collision, inertial, joint, link, write


def test_gaps_of_shapes_are_those_of_geometry() -> None:
    box, ball, rod = dojo.Box(0.2, 0.2, 0.2), dojo.Sphere(0.1), dojo.Capsule(0.05, 0.4)
    aside = Pose(turn(np.array([0.0, 0.0, 1.0]), np.pi / 4), np.array([0.3, 0.0, 0.0]))
    assert separation(HERE, box, aside, box) == pytest.approx(
        0.3 - 0.1 - 0.1 * np.sqrt(2.0), abs=2e-5
    )  # an edge and a face
    above = Pose(np.eye(3), np.array([0.25, 0.25, 0.25]))
    assert separation(HERE, box, above, ball) == pytest.approx(
        0.15 * np.sqrt(3.0) - 0.1, abs=2e-5
    )  # a corner and a ball
    beside = Pose(turn(np.array([1.0, 0.0, 0.0]), np.pi / 2), np.array([0.2, 0.0, 0.1]))
    assert separation(HERE, rod, beside, rod) == pytest.approx(0.2 - 0.1, abs=2e-5)  # two rods that cross
    assert separation(HERE, box, Pose(np.eye(3), np.array([0.19, 0.19, 0.0])), box) < 0.0
    assert separation(HERE, box, Pose(np.eye(3), np.array([0.2, 0.0, 0.0])), box) < 0.0  # side by side


@pytest.mark.sweep(4)
@pytest.mark.parametrize("name", ["polytope_polytope", "polytope_cylinder", "box_cylinder", "cylinder_cylinder"])
def test_the_bound_of_a_distance_is_no_larger_and_often_equal(name: str, rng: np.random.Generator) -> None:
    equal = 0
    for _ in range(60):
        case = random_case(name, rng)
        R, r = Rotation.from_rotvec(2.0 * rng.normal(size=3)).as_matrix(), rng.normal(size=3)
        r *= rng.uniform(0.2, 1.5) / np.linalg.norm(r)
        bound = apart_at_least(case.kind, case.sizes, case.hull, R.ravel(), r)
        apart = distance(case, R, r, rng)
        assert bound <= apart + 1e-7
        equal += bound > apart - 1e-7
    assert equal >= 3


def test_other_pairs_have_no_bound(rng: np.random.Generator) -> None:
    case = random_case("box_box", rng)
    assert apart_at_least(Pair.BOX_BOX, case.sizes, case.hull, np.eye(3).ravel(), np.ones(3)) < -1e200


def test_a_file_collides_with_itself_where_it_can(tmp_path: Path) -> None:
    """Links a - b - c - d in a row, e on b and within d; a and its fixed tool are one body."""
    ball = collision('<sphere radius="0.1"/>')
    parts = [link(name, inertial(), ball) for name in "abcde"]
    tool = link("tool", inertial(), collision('<box size="0.1 0.1 0.1"/>'))
    along = 'xyz="0.3 0 0" rpy="0 0 0"'
    file = write(
        tmp_path,
        *parts,
        tool,
        *(joint(f"{p}{q}", p, q, at=along) for p, q in ("ab", "bc", "cd")),
        joint("be", "b", "e", at='xyz="0.55 0 0" rpy="0 0 0"'),
        joint("at", "a", "tool", "fixed", "", at='xyz="-0.2 0 0" rpy="0 0 0"'),
    )
    assert not dojo.load_urdf(file).collisions
    mech = dojo.load_urdf(file, collisions="self")
    found = {collision.name for collision in mech.collisions}
    assert found == {"a.a-c", "a.tool-c", "a.a-d", "a.tool-d", "a.a-e", "a.tool-e", "b-d", "c-e"}
    assert mech.report is not None
    listed = {name for note in mech.report.notes if "overlap" in note.text for name in note.names}
    assert listed == {"d-e"}
    again = replace(mech, collisions="self")
    assert {collision.name for collision in again.collisions} == found
    held = dojo.load_urdf(file, floating=False, position=(1.0, 0.0, 0.5), collisions="self")  # a is part of the world
    assert {(c.name, c.b == "world") for c in held.collisions} == {
        (name.removeprefix("a."), name.startswith("a.")) for name in found
    }
    tool = next(c.shape_b for c in held.collisions if c.name == "tool-c")
    assert tool is not None
    np.testing.assert_allclose(tool.center, (0.8, 0.0, 0.5), atol=1e-12)
    with pytest.raises(ValueError, match="all"):
        dojo.load_urdf(file, collisions="all")


@pytest.mark.parametrize(
    "options", [{}, {"damper": 0.1}, {"limits": [(-2.0, 2.0)]}, {"friction": 1.0}, {"spring": 2.0, "rest": 0.1}]
)
def test_closing_joints_make_neighbors_whatever_they_carry(options: dict[str, object]) -> None:
    bar, left, right = dojo.Box(0.3, 0.05, 0.05), (-0.25, 0, 0), (0.25, 0, 0)
    bodies = [dojo.Body(name, 1.0, shape=bar) for name in ("crank", "coupler", "rocker", "tip")]
    joints = [
        dojo.Joint("revolute", None, "crank", child_point=left, axis=(0, 1, 0)),
        dojo.Joint("revolute", "crank", "coupler", parent_point=right, child_point=left, axis=(0, 1, 0)),
        dojo.Joint("revolute", None, "rocker", parent_point=(0.5, 0, 0), child_point=left, axis=(0, 1, 0)),
        dojo.Joint("fixed", "rocker", "tip", parent_point=(0, 0, 0.5)),
        dojo.Joint("revolute", "coupler", "rocker", "pin", right, right, axis=(0, 1, 0), close=True, **options),  # type: ignore[arg-type]
    ]
    start = {"crank": 0.5, "coupler": -0.5, "rocker": 0.5}
    pairs = {c.name for c in dojo.Mechanism(bodies, joints, collisions="self", neutral=start).collisions}
    assert pairs == {"crank-rocker", "crank-tip"}
    driven = dojo.Mechanism(bodies, joints, inputs=[dojo.Input("pin")], collisions="self", neutral=start)
    assert {c.name for c in driven.collisions} == pairs


def test_a_chain_folds_onto_itself_and_no_further() -> None:
    chain = pendulum(3, damper=0.1)
    bodies = [replace(body, shape=dojo.Sphere(0.2)) for body in chain.bodies]
    mech = replace(chain, bodies=bodies, gravity=(0.0, 0.0, 0.0), collisions="self")
    assert [collision.name for collision in mech.collisions] == ["rod0-rod2"]
    sim = dojo.Simulator(mech, time_step=0.01)
    motion = sim.rollout(sim.neutral(), np.tile([0.0, 2.0, 2.0], (200, 1)))
    assert motion.success
    z = sim.maximal(motion.x)
    apart = np.linalg.norm(z[:, 0, :3] - z[:, 2, :3], axis=1)
    assert 0.4 - 1e-4 < apart.min() < 0.41
