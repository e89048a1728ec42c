"""The ready-made mechanisms: sizes, masses, and that they stand on the ground."""

from __future__ import annotations

import inspect

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg

from dojo_opt import models
from dojo_opt.plots import thumbnail
from sim.dynamics.kinematics import tree_poses
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import mechanism_sizes, pack
from sim.model.layout import allocate_data, data_view, model_view, sizes_of, table
from solvers.compiler import Table, kernel
from solvers.types import Vector

# nbody, nq, nv, ncontact, nlimit, nu
SIZES = {
    "pendulum": (1, 1, 1, 0, 0, 1),
    "double_pendulum": (2, 2, 2, 0, 0, 2),
    "npendulum": (5, 5, 5, 0, 0, 5),
    "cartpole": (2, 2, 2, 0, 0, 1),
    "acrobot": (2, 2, 2, 0, 0, 1),
    "block": (1, 7, 6, 8, 0, 3),
    "sphere": (1, 7, 6, 1, 0, 3),
    "raiberthopper": (2, 8, 7, 2, 0, 3),
    "quadruped": (13, 19, 18, 4, 24, 12),
    "ant": (9, 15, 14, 9, 16, 8),
    "atlas": (31, 37, 36, 8, 60, 30),
    "block2d": (1, 3, 3, 4, 0, 3),
    "delta": (10, 19, 18, 0, 6, 3),
    "dzhanibekov": (2, 7, 6, 0, 0, 0),
    "exoskeleton": (4, 4, 4, 0, 8, 4),
    "fivebar": (4, 4, 4, 0, 4, 2),
    "fourbar": (5, 5, 5, 0, 0, 5),
    "halfcheetah": (7, 9, 9, 9, 12, 6),
    "hopper": (4, 6, 6, 5, 6, 3),
    "humanoid": (13, 28, 25, 4, 0, 19),
    "minitaur_leg": (5, 7, 7, 2, 4, 2),
    "nslider": (5, 5, 5, 0, 0, 5),
    "orbital": (5, 8, 8, 0, 0, 8),
    "panda": (9, 9, 9, 0, 18, 9),
    "quadrotor": (1, 7, 6, 8, 0, 4),
    "rexhopper": (8, 14, 13, 5, 4, 5),
    "slider": (1, 1, 1, 0, 0, 1),
    "snake": (2, 11, 9, 4, 0, 3),
    "stewart": (13, 22, 21, 0, 0, 6),
    "tennisracket": (1, 7, 6, 0, 0, 0),
    "tippetop": (2, 7, 6, 2, 0, 0),
    "twister": (5, 11, 10, 6, 0, 4),
    "uuv": (1, 7, 6, 2, 0, 6),
    "walker": (7, 9, 9, 9, 12, 6),
    "youbot": (12, 14, 14, 0, 14, 14),
}
# total masses [kg] that the makers, gym or Dojo state
MASSES = {
    "ant": 0.8788,
    "atlas": 174.05,
    "halfcheetah": 14.0,
    "humanoid": 40.844,
    "quadrotor": 1.04,
    "quadruped": 13.5,
    "rexhopper": 8.13845,
    "uuv": 19.243,
}


@kernel
def _poses(model_at: Table, data_at: Table, q: Vector) -> None:
    w = data_view(data_at)
    tree_poses(model_view(model_at), w, q)


def poses(mech: Mechanism, q: object = None) -> tuple[np.ndarray, np.ndarray]:
    """Positions and rotation matrices of the bodies."""
    model = pack(mech)
    w = allocate_data(sizes_of(model))
    _poses(table(model), table(w), np.array(mech.neutral if q is None else q, dtype=np.float64))
    return w.pos2, w.rot2.reshape(-1, 3, 3)


def clearances(mech: Mechanism) -> dict[str, float]:
    """Distance of every contact from the ground in the neutral configuration."""
    pos, rot = poses(mech)
    model = pack(mech)
    points = [pos[b] + rot[b] @ p for b, p in zip(model.contact_body, model.contact_point, strict=True)]
    return {n: float(p[2] - r) for n, p, r in zip(mech.contact_names, points, model.contact_radius, strict=True)}


def test_every_model_is_listed() -> None:
    assert set(models.__all__) == set(SIZES)


@pytest.mark.parametrize("name", models.__all__)
def test_sizes_and_documentation(name: str) -> None:
    build = getattr(models, name)
    assert tuple(mechanism_sizes(build()))[:6] == SIZES[name]
    assert build().name == name
    for p in inspect.signature(build).parameters.values():
        assert p.default is not inspect.Parameter.empty
    for word in ("q  (", "u  ("):
        assert word in build.__doc__


@pytest.mark.parametrize("name", MASSES)
def test_masses(name: str) -> None:
    assert sum(b.mass for b in getattr(models, name)().bodies) == pytest.approx(MASSES[name], rel=1e-4)


@pytest.mark.parametrize("name", [name for name, size in SIZES.items() if size[3] and name != "uuv"])
def test_neutral_touches_the_ground(name: str) -> None:
    gaps = clearances(getattr(models, name)())
    assert min(gaps.values()) == pytest.approx(0.0, abs=1e-8)


@pytest.mark.parametrize("name", models.__all__)
def test_neutral_is_within_the_limits(name: str) -> None:
    mech = getattr(models, name)()
    for joint in mech.joints:
        q = np.array(mech.neutral)[mech.q_slice(joint.name)]
        for value, (low, high) in zip(q, joint.limits, strict=False):
            assert low <= value <= high, joint.name


def test_left_and_right_of_the_robots_are_mirror_images() -> None:
    for name, mirror in (("atlas", "lr"), ("humanoid", ("left", "right")), ("ant", None)):
        mech = getattr(models, name)()
        pos, _ = poses(mech)
        if mirror is None:
            np.testing.assert_allclose(pos.sum(axis=0)[:2], 0.0, atol=1e-12)
            continue
        for body in [b for b in mech.body_names if b.startswith(f"{mirror[0]}_")]:
            other = body.replace(mirror[0], mirror[1], 1)
            left, right = (pos[mech.body_names.index(b)] for b in (body, other))
            np.testing.assert_allclose(left, right * (1, -1, 1), atol=5e-3, err_msg=body)


def test_quadruped_stands_on_four_feet() -> None:
    for stance in ((0.7853981633974483, -1.5707963267948966), (0.9, -1.425)):
        gaps = clearances(models.quadruped(contacts="all", stance=stance))
        feet = [gap for name, gap in gaps.items() if name.endswith("foot")]
        np.testing.assert_allclose(feet, 0.0, atol=1e-15)
        assert min(gap for name, gap in gaps.items() if not name.endswith("foot")) > 0.05
    mech = models.quadruped()
    assert sum(b.mass for b in mech.bodies) == pytest.approx(13.5)
    pos, _ = poses(mech)
    feet = pos[[mech.body_names.index(f"{leg}_calf") for leg in ("FR", "FL", "RR", "RL")]]
    np.testing.assert_allclose(feet[:, 1] > 0, [False, True, False, True])
    np.testing.assert_allclose(feet[:, 0] > 0, [True, True, False, False])


def test_quadruped_is_symmetric_left_and_right() -> None:
    mech = models.quadruped(contacts="all")
    model = pack(mech)
    mirror = np.array([1.0, -1.0, 1.0])
    J = model.body_inertia.reshape(-1, 3, 3)
    for part in ("hip", "thigh", "calf"):
        for end in "FR":
            r, left = (mech.body_names.index(f"{end}{side}_{part}") for side in "RL")
            np.testing.assert_allclose(J[left], J[r] * np.outer(mirror, mirror))
            np.testing.assert_allclose(model.joint_child_point[left], model.joint_child_point[r] * mirror)
    np.testing.assert_allclose(model.contact_point[3:6], model.contact_point[:3] * mirror)


def test_pendulums_hang() -> None:
    pos, _ = poses(models.npendulum(3, length=0.5))
    np.testing.assert_allclose(pos, [[0, 0, 1.65 - 0.25 - 0.5 * i] for i in range(3)], atol=1e-15)
    pos, _ = poses(models.pendulum(), [np.pi])
    np.testing.assert_allclose(pos, [[0, 0, 1.6]], atol=1e-15)


def test_cartpole_hangs_at_zero_and_stands_at_pi() -> None:
    np.testing.assert_allclose(poses(models.cartpole(), [0.3, 0.0])[0], [[0, 0.3, 0], [0, 0.3, -0.5]], atol=1e-15)
    np.testing.assert_allclose(poses(models.cartpole(), [0.3, np.pi])[0][1], [0, 0.3, 0.5], atol=1e-15)
    # a small positive angle turns about x: the hanging pole swings towards +y
    assert poses(models.cartpole(), [0.0, 0.1])[0][1, 1] > 0


def test_hopper_stands_at_its_leg_length() -> None:
    pos, _ = poses(models.raiberthopper())
    np.testing.assert_allclose(pos, [[0, 0, 0.55], [0, 0, 0.05]], atol=1e-15)


def test_older_names() -> None:
    assert models.box is models.block
    assert models.box2d is models.block2d


def test_catalog() -> None:
    entries = {entry.name: entry for entry in models.catalog()}
    assert set(entries) == set(models.__all__)
    atlas = entries["atlas"]
    assert (atlas.bodies, atlas.nv, atlas.contacts) == (31, 36, 8)
    assert atlas.build().nbody == 31
    assert atlas.what.startswith("Thirty-one links")


@pytest.mark.parametrize("name", ["atlas", "quadrotor", "cartpole", "tippetop"])
def test_thumbnail(name: str) -> None:
    canvas = FigureCanvasAgg(thumbnail(getattr(models, name)()))
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3]
    assert 0.01 < np.mean(np.any(pixels < 250, axis=-1)) < 0.9


def test_wrong_parameters_are_named() -> None:
    with pytest.raises(ValueError, match=r"orbital\(n\): expected a whole number >= 2, got 1"):
        models.orbital(1)
    with pytest.raises(ValueError, match=r"npendulum\(n\): expected a whole number >= 1, got 0"):
        models.npendulum(0)
    with pytest.raises(ValueError, match=r"quadruped\(contacts=\.\.\.\): 'paws' is not one of: feet, all"):
        models.quadruped(contacts="paws")
    with pytest.raises(ValueError, match=r"Contact\('corner_0', friction=\.\.\.\)"):
        models.block(friction=-1.0)
