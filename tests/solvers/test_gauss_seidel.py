"""Block Gauss-Seidel for contacts: its solutions satisfy the laws of contact."""

import numpy as np
import pytest

from solvers.gauss_seidel import gauss_seidel

H = 0.01
POINTS, STOPS = 3, 2
SIZE = 3 * POINTS + STOPS
ROOM = SIZE + 4  # the matrices of a step have room for more


def problem(seed, flat=False):
    """G of bodies with gaps that change by h times their speeds, and w of a motion that closes some of them.

    flat: contacts slip along one line only, the last one along its first tangent, as those of planar robots.
    """
    rng = np.random.default_rng(seed)
    J = rng.normal(size=(SIZE, 14))
    if flat:
        J[2], J[5], J[8] = 0.5 * J[1], -2.0 * J[4], 0.0
    scale = np.ones(SIZE)
    scale[0 : 3 * POINTS : 3] = scale[3 * POINTS :] = H
    G = scale[:, None] * (J @ J.T)  # impulses act along J, and normal rows are lengths
    w = scale * rng.normal(size=SIZE)
    if flat:
        w[2], w[5], w[8] = 0.5 * w[1], -2.0 * w[4], 0.0
    return G, w


def solution(seed, kappa, repeat=60, flat=False):
    G, w0 = problem(seed, flat)
    columns, friction = np.zeros((ROOM, ROOM)), np.zeros(ROOM)
    columns[:SIZE, :SIZE] = G.T
    friction[0 : 3 * POINTS : 3] = (0.0, 0.4, 2.0)
    w, l = np.zeros(ROOM), np.zeros(ROOM)
    w[:SIZE] = w0
    for _ in range(repeat):  # a call ends early
        gauss_seidel(columns, friction, H, kappa, (POINTS, SIZE), w, l, np.empty(SIZE))
    np.testing.assert_allclose(w[:SIZE], w0 + G @ l[:SIZE], atol=1e-12)
    return w, l, friction


@pytest.mark.parametrize("kappa", [1e-12, 1e-3])
@pytest.mark.parametrize("seed", range(6))
def test_gaps_times_impulses_are_kappa(seed, kappa):
    w, l, _ = solution(seed, kappa)
    normals = [*range(0, 3 * POINTS, 3), *range(3 * POINTS, SIZE)]
    assert (w[normals] > 0.0).all()
    assert (l[normals] > 0.0).all()
    np.testing.assert_allclose(w[normals] * l[normals], kappa, rtol=1e-6)


@pytest.mark.parametrize("flat", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_friction_sticks_or_acts_against_the_slip_at_its_bound(seed, flat):
    w, l, friction = solution(seed, 1e-12, flat=flat)
    for j in range(0, 3 * POINTS, 3):
        slip, force, bound = w[j + 1 : j + 3], l[j + 1 : j + 3], friction[j] * l[j]
        assert np.hypot(*force) <= bound * (1.0 + 1e-9) + 1e-15
        if np.hypot(*slip) > 1e-6:
            np.testing.assert_allclose(force, -bound * slip / np.hypot(*slip), atol=1e-6)


def test_some_stick_some_slide_and_some_are_apart():
    seen = set()
    for seed in range(6):
        w, l, friction = solution(seed, 1e-12)
        for j in range(3, 3 * POINTS, 3):
            stuck = np.hypot(*w[j + 1 : j + 3]) < 1e-6
            seen.add("apart" if l[j] < 1e-6 else "sticks" if stuck else "slides")
    assert seen == {"apart", "sticks", "slides"}


def test_a_good_guess_is_kept():
    w, l, friction = solution(0, 1e-12)
    G, _ = problem(0)
    columns = np.zeros((ROOM, ROOM))
    columns[:SIZE, :SIZE] = G.T
    before = l.copy()
    gauss_seidel(columns, friction, H, 1e-12, (POINTS, SIZE), w, l, np.empty(SIZE))
    np.testing.assert_allclose(l, before, atol=1e-9)


def test_the_load_leaps_from_corner_to_corner():
    """Of a foot that rocks: columns of its corners are nearly the same, and sweeps alone take hundreds to move the load."""
    J = np.array([[1.0, 0.02], [1.0, -0.02]])
    columns = H * J @ J.T
    w, l, friction = np.array([-2e-5, 1e-9]), np.array([1e-6, 0.6]), np.zeros(2)
    free = w - columns @ l
    assert gauss_seidel(columns, friction, H, 1e-9, (0, 2), w, l, np.empty(2))
    assert l[0] > 0.5 and l[1] < 1e-2
    np.testing.assert_allclose(w, free + columns @ l, atol=1e-12)
