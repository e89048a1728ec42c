"""Collision meshes of files: found as ROS does, convex hulls with their error, primitives, and contacts with ground."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial import ConvexHull

import dojo_opt as dojo
from sim.io.meshes.fitted_shapes import fit
from sim.io.meshes.paths import find_mesh
from sim.io.meshes.reduced_hull import CORNERS, distances, reduced_hull
from sim.io.meshes.triangles import read_mesh
from support.urdf_files import collision, inertial, joint, link, write

trimesh = pytest.importorskip("trimesh")


def mesh(name: str, scale: str = "1 1 1") -> str:
    return f'<mesh filename="{name}" scale="{scale}"/>'


def save(path: Path, part: object) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    part.export(str(path))  # type: ignore[attr-defined]
    return path


@pytest.mark.parametrize("ending", ["stl", "obj", "dae", "glb", "ply"])
def test_every_format_holds_the_same_box(tmp_path: Path, ending: str) -> None:
    found = read_mesh(save(tmp_path / f"box.{ending}", trimesh.creation.box((0.2, 0.3, 0.4))))
    assert len(found.faces) == 12
    assert np.ptp(found.vertices, axis=0) == pytest.approx((0.2, 0.3, 0.4), abs=1e-6)


# -- hulls -------------------------------------------------------------------------------------------------------------


@pytest.mark.slow
def test_a_reduced_hull_says_how_far_it_is(rng: np.random.Generator) -> None:
    """The error is the largest distance of a corner from the reduced hull, which a convex program finds, too."""
    points = rng.normal(size=(300, 3))
    points *= np.array((0.3, 0.1, 0.2)) / np.linalg.norm(points, axis=1)[:, None]  # on an ellipsoid
    few, error = reduced_hull(points)
    assert len(few) == CORNERS and 0.0 < error < 0.06
    corners = points[ConvexHull(points).vertices]
    found = distances(corners, few)

    def by_weights(p: np.ndarray) -> float:
        sums = {"type": "eq", "fun": lambda w: w.sum() - 1.0}
        w0 = np.full(len(few), 1.0 / len(few))
        best = minimize(
            lambda w: 1e3 * ((few.T @ w - p) ** 2).sum(),
            w0,
            jac=lambda w: 2e3 * few @ (few.T @ w - p),
            bounds=[(0.0, 1.0)] * len(few),
            constraints=sums,
            options={"ftol": 1e-14, "maxiter": 500},
        )
        return float(np.sqrt(best.fun / 1e3))

    for k in (int(found.argmax()), *rng.integers(0, len(corners), 4)):
        assert found[k] == pytest.approx(by_weights(corners[k]), abs=2e-5)
    assert error == found.max()
    assert reduced_hull(few)[1] == 0.0 and len(reduced_hull(few)[0]) == CORNERS


@pytest.mark.parametrize("flat", [1, 2])
def test_flat_and_thin_meshes_get_a_thickness(flat: int, rng: np.random.Generator) -> None:
    points = rng.normal(size=(60, 3))
    points[:, -flat:] = 0.25
    few, _ = reduced_hull(points)
    assert np.ptp(few, axis=0).min() == pytest.approx(2e-3) and ConvexHull(few).volume > 0.0


def test_fitted_primitives_agree_with_the_mesh() -> None:
    turned = trimesh.transformations.euler_matrix(0.3, -0.5, 0.8)
    turned[:3, 3] = 0.1, 0.2, -0.3
    ball = trimesh.creation.icosphere(subdivisions=3, radius=0.2).apply_transform(turned)
    box = trimesh.creation.box(extents=(0.1, 0.3, 0.2)).apply_transform(turned)
    rod = trimesh.creation.capsule(radius=0.05, height=0.4, count=(40, 40)).apply_transform(turned)
    for shape, kind, sizes, slack in ((ball, "sphere", (0.2,), 1e-3), (box, "box", (0.1, 0.2, 0.3), 1e-9)):
        found = fit(kind, np.asarray(shape.vertices))
        np.testing.assert_allclose(sorted(found.sizes), sizes, atol=slack)
        np.testing.assert_allclose(found.pose.point, turned[:3, 3], atol=slack)
        assert found.error < slack
    found = fit("capsule", np.asarray(rod.vertices))
    np.testing.assert_allclose(found.sizes, (0.05, 0.4), rtol=0.03)
    axis = found.pose.rotation[:, 2] @ turned[:3, 2]
    assert abs(axis) > 0.999 and found.error < 2e-3
    np.testing.assert_allclose(np.linalg.det(found.pose.rotation), 1.0)


@pytest.mark.parametrize(
    "points", [[(0, 0), (1, 0), (1, 1), (0, 1)], [(0, 0), (1, 0), (1, 1)], [(0, 0), (1, 0), (2, 0)]]
)
def test_flat_meshes_have_fitted_primitives(points: list[tuple[float, float]]) -> None:
    flat = np.array([(x, y, 0.5) for x, y in points], dtype=np.float64)
    thin = np.minimum(np.ptp(flat, axis=0), 1.0) > 0.0
    box = fit("box", flat)
    assert min(box.sizes) == pytest.approx(2e-3) and max(box.sizes) > 0.9
    assert (np.abs((flat - box.pose.point) @ box.pose.rotation) <= 0.5 * np.array(box.sizes) + 1e-9).all()
    assert thin.sum() == sum(size > 0.1 for size in box.sizes)
    rod, ball = fit("capsule", flat), fit("sphere", flat)
    assert sum(rod.sizes) > 0.9 and ball.sizes[0] > 0.1 and ball.error > 0.0


# -- paths -------------------------------------------------------------------------------------------------------------


def test_folders_of_meshes_may_be_below_the_home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("HOME", str(tmp_path))
    (tmp_path / "ws/kit").mkdir(parents=True)
    trimesh.creation.box((0.1, 0.1, 0.1)).export(tmp_path / "ws/kit/foot.stl")
    (tmp_path / "robot").mkdir()
    foot = collision('<mesh filename="package://kit/foot.stl"/>')
    path = write(tmp_path / "robot", link("foot", inertial(), foot))
    assert len(dojo.load_urdf(path, mesh_dirs=["~/ws"]).contacts) == 8


def test_names_are_resolved_as_ros_does(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for place in (
        "robot/meshes/a.stl",
        "robot/urdf/b.stl",
        "other/robot/meshes/c.stl",
        "ws/kit/d.stl",
        "pre/share/kit2/e.stl",
    ):
        (tmp_path / place).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / place).touch()
    file = tmp_path / "robot/urdf/robot.urdf"
    monkeypatch.setenv("ROS_PACKAGE_PATH", str(tmp_path / "ws"))
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path / "pre"))
    found = {
        "package://robot/meshes/a.stl": "robot/meshes/a.stl",  # of the folder around the file that has the name
        "package://kit/d.stl": "ws/kit/d.stl",
        "package://kit2/e.stl": "pre/share/kit2/e.stl",
        "package://renamed/meshes/a.stl": "robot/meshes/a.stl",
        "../meshes/a.stl": "robot/meshes/a.stl",
        "b.stl": "robot/urdf/b.stl",
        "meshes/a.stl": "robot/meshes/a.stl",
        f"file://{tmp_path}/robot/urdf/b.stl": "robot/urdf/b.stl",
        f"{tmp_path}/robot/urdf/b.stl": "robot/urdf/b.stl",
    }
    for name, place in found.items():
        path = find_mesh(name, file, [])
        assert path is not None and path.resolve() == (tmp_path / place).resolve(), name
    assert find_mesh("package://robot/meshes/c.stl", file, []) is None
    assert find_mesh("package://robot/meshes/c.stl", file, [tmp_path / "other"]) is not None


# -- robots ------------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("suffix", ["stl", "obj", "dae"])
def test_a_mesh_stands_on_the_ground(tmp_path: Path, suffix: str) -> None:
    """A wedge of a mesh, scaled and mirrored: the contacts are its corners, in the frame of the body."""
    if suffix == "dae":
        pytest.importorskip("collada")
    wedge = trimesh.convex.convex_hull(np.array([(0, 0, 0), (1, 0, 0), (1, 2, 0), (0, 2, 0), (0, 0, 1), (0, 2, 1.0)]))
    save(tmp_path / f"wedge.{suffix}", wedge)
    path = write(
        tmp_path, link("a", inertial(xyz="0.1 0 0"), collision(mesh(f"wedge.{suffix}", "0.1 -0.1 0.1"), "0.1 0 0"))
    )
    mech = dojo.load_urdf(path)
    expected = np.array(sorted(map(tuple, wedge.vertices * (0.1, -0.1, 0.1))))
    points = np.array(sorted(tuple(np.round(c.point, 6)) for c in mech.contacts))
    np.testing.assert_allclose(points, np.round(expected, 6), atol=1e-6)
    assert isinstance(mech.bodies[0].shape, dojo.Polytope)
    assert "at these largest distances from the hulls of the meshes: a (0 mm)" in str(mech.report)
    assert mech.neutral[2] == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize(("scale", "size"), [("2", 0.4), ("1 1 2", 0.4), ("1 1 2 1", 0.4), ("1 1 -1", 0.2)])
def test_scales_of_meshes(tmp_path: Path, scale: str, size: float) -> None:
    save(tmp_path / "box.stl", trimesh.creation.box(extents=(0.1, 0.1, 0.2)))
    mech = dojo.load_urdf(write(tmp_path, link("a", inertial(), collision(mesh("box.stl", scale)))))
    assert np.ptp([c.point[2] for c in mech.contacts]) == pytest.approx(size)
    with pytest.raises(dojo.UrdfError, match="scale='1 0 1': expected numbers other than zero"):
        dojo.load_urdf(write(tmp_path, link("a", inertial(), collision(mesh("box.stl", "1 0 1")))))


def test_choices_of_meshes(tmp_path: Path) -> None:
    save(tmp_path / "ball.stl", trimesh.creation.icosphere(subdivisions=3, radius=0.2))
    path = write(tmp_path, link("a", inertial(), collision(mesh("ball.stl"))))
    for choice, kind in (
        ("sphere", dojo.Sphere),
        ("box", dojo.Box),
        ("capsule", dojo.Capsule),
        ("hull", dojo.Polytope),
    ):
        mech = dojo.load_urdf(path, meshes={"a": choice})
        assert isinstance(mech.bodies[0].shape, kind) and mech.contacts
    assert len(dojo.load_urdf(path).contacts) == CORNERS and len(dojo.load_urdf(path, mesh_corners=8).contacts) == 8
    assert dojo.load_urdf(path, meshes="sphere").contacts[0].radius == pytest.approx(0.2, rel=0.01)
    with pytest.warns(dojo.UrdfWarning, match=r"falls through; contacts=\[dojo\.Contact\('a', radius=0\.02\)\]"):
        assert dojo.load_urdf(path, meshes="none").bodies[0].shapes == ()
    with pytest.raises(
        ValueError, match=r"load_urdf\(meshes=\.\.\.\): 'hulls' is not one of: hull, .*did you mean 'hull'"
    ):
        dojo.load_urdf(path, meshes="hulls")
    with pytest.raises(ValueError, match=r"load_urdf\(meshes=\.\.\.\): link: 'b' is not one of: \*, a"):
        dojo.load_urdf(path, meshes={"b": "hull"})
    limbs = (link("hip"), link("shank"), link("rotor", ""), link("foot", ""), joint("knee", "hip", "shank"))
    welds = (
        joint("r", "shank", "rotor", "fixed", "", at='xyz="0 0 0"'),
        joint("f", "shank", "foot", "fixed", "", at='xyz="0 0 -0.2"'),
    )
    with pytest.warns(dojo.UrdfWarning, match=r"contacts=\[dojo\.Contact\('foot', radius=0\.02\)\] puts"):
        dojo.load_urdf(write(tmp_path, *limbs, *welds))


def test_large_distances_from_a_mesh_have_whole_millimeters(tmp_path: Path) -> None:
    """Of a ball of a metre in a box: the corner of the box is .42 m from it, and "4.2e+02 mm" no length."""
    save(tmp_path / "ball.stl", trimesh.creation.icosphere(radius=1.0))
    path = write(tmp_path, link("ball", inertial(), collision(mesh("ball.stl"))))
    assert re.search(r"ball \(\d{3} mm\)", str(dojo.load_urdf(path, meshes="box").report))


def test_a_mesh_that_is_missing_or_broken_is_said(tmp_path: Path) -> None:
    (tmp_path / "broken.obj").write_text("v 0 0\nf 1 2")
    ball = collision('<sphere radius="0.1"/>')
    for name, message in (
        ("gone.stl", r"not found; mesh_dirs=.*a \(gone\.stl\)"),
        ("broken.obj", r"cannot be read: a \(broken\.obj"),
    ):
        path = write(tmp_path, link("a", inertial(), collision(mesh(name)), ball))
        with pytest.warns(dojo.UrdfWarning, match=message):
            assert len(dojo.load_urdf(path).contacts) == 1


def test_a_mesh_of_an_mjcf_file_stands_on_its_corners() -> None:
    """MuJoCo moves and turns meshes to their principal axes; the corners are where the file has them."""
    pytest.importorskip("mujoco")
    text = """<mujoco><asset><mesh name="wedge" vertex="0 0 0  1 0 0  1 2 0  0 2 0  0 0 1  0 2 1" scale=".1 .1 .1"/></asset>
      <worldbody><geom name="floor" type="plane" size="5 5 .1"/><body name="a" pos="0 0 .1"><freejoint/>
      <geom name="w" type="mesh" mesh="wedge" pos=".05 0 0" friction=".4"/></body></worldbody></mujoco>"""
    mech = dojo.load_mjcf(text)
    com = np.asarray(mech.report.bodies["a"].point)  # type: ignore[union-attr]
    points = np.array([c.point for c in mech.contacts]) - com - (0.05, 0.0, 0.0)
    expected = [(0, 0, 0), (0, 0, 0.1), (0, 0.2, 0), (0, 0.2, 0.1), (0.1, 0, 0), (0.1, 0.2, 0)]
    np.testing.assert_allclose(sorted(map(tuple, points.round(6) + 0.0)), expected, atol=1e-6)
    assert {c.friction for c in mech.contacts} == {1.0} and mech.bodies[0].shapes[0].friction == 0.4
    assert isinstance(mech.bodies[0].shape, dojo.Polytope) and "w (0 mm)" in str(mech.report)


@pytest.mark.slow
def test_an_l_is_decomposed_into_its_arms(tmp_path: Path) -> None:
    pytest.importorskip("coacd")
    arm = trimesh.creation.box(extents=(0.4, 0.1, 0.1))
    other = trimesh.creation.box(extents=(0.1, 0.1, 0.4)).apply_translation((0.15, 0.0, 0.25))
    save(tmp_path / "l.stl", trimesh.util.concatenate([arm, other]))
    path = write(tmp_path, link("a", inertial(), collision(mesh("l.stl"))))
    whole, parts = (dojo.load_urdf(path, meshes=m).bodies[0].shapes for m in ("hull", "decompose"))
    assert len(whole) == 1 and len(parts) >= 2
    volume = 0.4 * 0.1 * 0.1 + 0.1 * 0.1 * 0.4
    assert sum(p.volume() for p in parts) == pytest.approx(volume, rel=0.15) and whole[0].volume() > 1.5 * volume
