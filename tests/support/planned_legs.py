"""Requirements of a quadruped's plan: converged, upright, within its limits, and not only at its own time step."""

import numpy as np


def upright(x):
    """Cosine of the angle between the z axis of the base and the vertical."""
    return 1.0 - 2.0 * (x[:, 4] ** 2 + x[:, 5] ** 2)


def replayed(problem, plan):
    """The plan under its own gains, at a fifth of its time step."""
    fine = problem.sim.replace(time_step=problem.sim.time_step / 5)
    shot = fine.rollout_feedback(
        problem.start, plan.u, xs=plan.x, Ks=plan.K, substeps=5 * problem.substeps, limits=problem.control_limits
    )
    assert shot.status == 0
    return fine, shot


def check(problem, plan, iterations, tilt=0.99, off=0.02):
    """Converged, upright, within the torque limits, and not only at this time step."""
    assert plan.success, plan.summary()
    assert plan.nit <= iterations
    assert plan.violation <= 1e-3
    assert upright(plan.x).min() > tilt
    _, shot = replayed(problem, plan)
    assert np.abs(shot.u).max() <= 33.5
    assert upright(shot.x).min() > tilt - 0.01
    assert np.abs(shot.x[-1, :3] - plan.x[-1, :3]).max() < off


def lands(problem, plan, off=5e-3):
    """On its feet and near the plan's end, at 1 ms and with hard contacts."""
    hard = problem.sim.replace(time_step=1e-3, kappa=1e-8)
    shot = hard.rollout_feedback(plan.x[0], plan.u, xs=plan.x, Ks=plan.K, substeps=20, limits=problem.control_limits)
    assert shot.status == 0 and upright(shot.x).min() > 0.98
    assert np.abs(shot.x[-1, :3] - plan.x[-1, :3]).max() < off


def lowest_foot(problem, plan):
    """(N,) distance of the lowest foot from the ground at a fifth of the time step."""
    fine, shot = replayed(problem, plan)
    steps = [fine.rollout(x, np.tile(u, (5, 1))).contacts for x, u in zip(shot.x[:-1], shot.u, strict=True)]
    return np.concatenate([contacts.gap.min(axis=1) for contacts in steps])
