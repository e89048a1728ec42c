"""Closed loops through configurations where two branches of their motion meet: they go on along their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import dojo_opt as dojo
from sim.mechanism.mechanism import Mechanism
from solvers.status import Status
from support.linkage import plain_fourbar, worst_gap

SIDEWAYS = (9.81, 0.0, 0.0)  # gravity along the ground link: the lowest pose is the one with all links in line
GRASHOF = (0.5, 0.7, 0.8, 1.0)  # shortest + longest = the other two
PARALLELOGRAM = (0.5, 1.0, 0.5, 1.0)


def linkage(lengths: tuple[float, float, float, float], gravity: tuple[float, float, float]) -> Mechanism:
    return replace(plain_fourbar(*lengths), gravity=gravity)


def strength(x: np.ndarray, lengths: tuple[float, float, float, float]) -> float:
    """Least singular value of the two constraints of the loop, by angles of the links."""
    crank, coupler, rocker, _ = lengths
    a, b, c = x[0], x[0] + x[1], x[2]
    arms = np.array([crank, coupler, -rocker])
    J = arms * np.array([np.cos([a, b, c]), np.sin([a, b, c])])
    return float(np.linalg.svd(J, compute_uv=False)[1])


def passages(x: np.ndarray, lengths: tuple[float, float, float, float]) -> int:
    """Number of a motion's closest approaches to the meeting point of branches."""
    s = np.array([strength(y, lengths) for y in x])
    return int(np.sum((s[1:-1] < s[:-2]) & (s[1:-1] < s[2:]) & (s[1:-1] < 0.05)))


def spread(sim: dojo.Simulator, x: np.ndarray, steps: int) -> tuple[float, float, np.ndarray]:
    """Largest change of the energy over the largest kinetic one, largest gap, and the states."""
    t = sim.rollout(x, np.zeros((steps, sim.nu)), throw=True)
    energy, kinetic = sim.energy(t.x[1:]), sim.kinetic_energy(t.x[1:])
    gaps = max(worst_gap(sim, y) for y in t.x[:: max(1, steps // 500)])
    return float(np.abs(energy - energy[0]).max() / kinetic.max()), gaps, t.x


def whirling(sim: dojo.Simulator) -> np.ndarray:
    x = sim.neutral()
    x[sim.nq :] = 8.0 * np.random.default_rng(0).normal(size=sim.nv)
    return sim.close(x)


def test_a_parallelogram_stays_one() -> None:
    """It swings through the pose with its links in one line; the other branch is the antiparallelogram."""
    sim = dojo.Simulator(linkage(PARALLELOGRAM, SIDEWAYS), time_step=0.01, tolerance=1e-11)
    energy, gap, x = spread(sim, sim.state_from_velocity([-1.2, 1.2, -1.2], [1.0, -1.0, 1.0]), 5000)
    assert passages(x, PARALLELOGRAM) > 40
    assert energy < 2e-3 and gap < 1e-10
    np.testing.assert_allclose(x[:, 0], x[:, 2], atol=1e-6)


def test_a_step_that_is_solved_again_counts_the_iterations_of_all_its_solves() -> None:
    sim = dojo.Simulator(linkage(PARALLELOGRAM, SIDEWAYS), time_step=0.01, tolerance=1e-11)
    t = sim.rollout(sim.state_from_velocity([-1.2, 1.2, -1.2], [1.0, -1.0, 1.0]), np.zeros((60, sim.nu)), throw=True)
    assert np.median(t.iterations) == 2  # where links come into one line, a step is solved from its guess, and again
    assert t.iterations[np.argmin([strength(x, PARALLELOGRAM) for x in t.x[1:]])] >= 4


def test_both_branches_leave_the_pose_where_they_meet() -> None:
    """Configuration 2 is that pose itself, to the last digit; the velocity says where the motion goes."""
    sim = dojo.Simulator(linkage(PARALLELOGRAM, (0.0, 0.0, 0.0)), time_step=0.01)
    same = sim.rollout(np.array([0.0, 0.0, 0.0, 1.0, -1.0, 1.0]), np.zeros((50, 3)), throw=True)
    np.testing.assert_allclose(same.x[-1, 3:], [1.0, -1.0, 1.0], atol=1e-7)
    # small angles a of the crank, c of the rocker: (a - c) ((L + r) a + (L - r) c) = 0, with L = 2 r of the coupler
    cross = sim.rollout(np.array([0.0, 0.0, 0.0, 1.0, -3.0, -3.0]), np.zeros((30, 3)), throw=True)
    assert cross.x[-1, 0] > 0.1 and cross.x[-1, 2] < -0.5
    energy = sim.energy(cross.x[1:])
    assert np.ptp(energy) < 5e-3 * energy[0]


@pytest.mark.parametrize("tolerance", [1e-8, 1e-11])
def test_a_grashof_linkage_keeps_its_energy(tolerance: float) -> None:
    """Twice a turn its links lie in line, at up to .1 rad a step; the error is of the scheme's second order."""
    errors = []
    for h in (0.01, 0.005):
        sim = dojo.Simulator(linkage(GRASHOF, (0.0, 0.0, -9.81)), time_step=h, tolerance=tolerance)
        energy, gap, x = spread(sim, whirling(sim), 4000)
        assert gap < tolerance and passages(x, GRASHOF) > 15
        errors.append(energy)
    assert errors[0] < 0.04 and errors[1] < 0.4 * errors[0]


def test_the_short_way_of_a_rollout_is_the_long_way_of_single_steps() -> None:
    """The first step of a motion looks for branches wherever it is, those after it only where one may be near."""
    sim = dojo.Simulator(linkage(GRASHOF, (0.0, 0.0, -9.81)), time_step=0.01, tolerance=1e-11)
    t = sim.rollout(whirling(sim), np.zeros((150, 3)), throw=True)
    assert passages(t.x, GRASHOF) >= 1
    for k in range(150):
        np.testing.assert_allclose(sim.step(t.x[k], np.zeros(3), throw=True).x, t.x[k + 1], atol=1e-8)


@pytest.mark.slow
@pytest.mark.parametrize("lengths", [PARALLELOGRAM, GRASHOF], ids=["parallelogram", "grashof"])
def test_energy_is_bounded_over_1e5_steps(lengths: tuple[float, float, float, float]) -> None:
    """The motion is chaotic, so its mean energy wanders: the median of three nearly equal starts must not drift."""
    sim = dojo.Simulator(linkage(lengths, (0.0, 0.0, -9.81)), time_step=0.01, tolerance=1e-9)
    first = whirling(sim) if lengths == GRASHOF else sim.state_from_velocity([-1.2, 1.2, -1.2], [6.5, -6.5, 6.5])
    q, v, drifts = first[: sim.nq], sim.velocity(first), []
    for share in (0.0, 1e-9, 2e-9):
        x, kinetic, energies = sim.state_from_velocity(q, (1.0 + share) * v), 0.0, []
        for _ in range(20):
            t = sim.rollout(x, np.zeros((5000, 3)), throw=True)
            x = t.x[-1]
            energies.append(sim.energy(t.x[1:]))
            kinetic = max(kinetic, float(sim.kinetic_energy(t.x[1:]).max()))
        energy = np.concatenate(energies)
        assert np.abs(energy - energy[0]).max() < 0.04 * kinetic
        drifts.append(abs(energies[-1].mean() - energies[0].mean()) / kinetic)
        if len(drifts) == 2 and max(drifts) < 0.01:  # so is the median
            return
    assert np.median(drifts) < 0.01, drifts


def test_motions_too_fast_for_the_time_step_are_refused() -> None:
    """A rod of the delta robot swings past half a turn: it has to spin by more than a turn in a step, or less gains."""
    mech = dojo.models.delta()
    free = replace(mech, joints=[replace(j, limits=None, armature=0.0) for j in mech.joints])
    coarse = dojo.Simulator(free, time_step=0.005, tolerance=1e-11, divide=False)
    x = coarse.neutral()
    x[coarse.nq :] = 0.3 * np.random.default_rng(0).normal(size=coarse.nv)
    t = coarse.rollout(coarse.close(x), np.zeros((200, coarse.nu)))
    energy = coarse.energy(t.x[1 : t.solved_steps + 1])
    assert t.status == Status.LOOP_SINGULAR and 50 < t.solved_steps < 100
    assert np.abs(energy - energy[0]).max() < 0.1  # of 14 J; 39 J were gained


def test_singular_configurations_are_described() -> None:
    """At the pose in line, near it, and far from it."""
    sim = dojo.Simulator(linkage(PARALLELOGRAM, (0.0, 0.0, 0.0)), time_step=0.01)
    for a, singular, text in ((0.0, 1, "; singular: 1 of the"), (1e-3, 0, "close to a singular"), (1.0, 0, "")):
        rank = sim.loop_rank(np.array([a, -a, a, 0.0, 0.0, 0.0]))
        assert rank.singular == singular and text in str(rank)
        assert ("singular" in str(rank)) == (text != "")
    in_line = replace(sim.mechanism, neutral={"crank": 0.0, "coupler": 0.0, "rocker": 0.0})
    assert "branches of the motion may meet here" in dojo.Simulator(in_line, time_step=0.01).describe()


def test_velocity_and_energy_at_the_nodes_of_loops() -> None:
    """They equal those of the single coordinate, a steady turn, to second order. Without the half of the loop's impulse
    that acts at the node they were off to first order."""
    errors = []
    for h in (0.02, 0.01):
        sim = dojo.Simulator(linkage(PARALLELOGRAM, (0.0, 0.0, 0.0)), time_step=h, tolerance=1e-12)
        x = sim.state_from_velocity([0.7, -0.7, 0.7], [3.0, -3.0, 3.0])
        t = sim.rollout(x, np.zeros((round(0.2 / h), 3)), throw=True)
        v = sim.velocity(t.x)
        np.testing.assert_allclose(v[0], [3.0, -3.0, 3.0], atol=1e-9)
        np.testing.assert_allclose(v @ [1.0, 1.0, 0.0], 0.0, atol=1e-10)  # the coupler does not turn
        np.testing.assert_allclose(v[:, 0], v[:, 2], atol=1e-10)
        errors.append(abs(float(v[-1, 0]) - 3.0))
    assert errors[0] < 1e-6 and errors[1] <= 0.3 * errors[0] + 5e-9
