"""Identification: parameters of a simulated motion are found again, with the spread that its noise gives them."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import block_diag

import dojo_opt as dojo
from dojo_opt.identification.delayed_space import DelayedSpace
from dojo_opt.identification.identify import IdentifyOptions, _stopped
from dojo_opt.identification.normal_equations import NormalEquations
from dojo_opt.identification.prior import Prior
from dojo_opt.identification.shooting_fit import Expectation, ShootingFit
from dojo_opt.identification.windows import Predictor, WindowErrors, cut_windows, difference_slopes
from solvers.status import Status


def _arm(damper=0.3, mass=1.0):
    link = dojo.Body("link", mass, (0.02, 0.02, 0.001))
    joint = dojo.Joint("revolute", None, "link", child_point=(0, 0, 0.3), axis=(0, 1, 0), damper=damper, name="hinge")
    return dojo.Simulator(dojo.Mechanism([link], [joint], [], [dojo.Input("hinge")]), time_step=0.02)


def _motions(sim, rng, noise, count=3):
    out = []
    for _ in range(count):
        us = np.repeat(rng.uniform(-2, 2, (5, 1)), 8, axis=0)
        t = sim.rollout(np.array([rng.uniform(-1, 1), 0.0]), us)
        out.append((t.x + noise * rng.standard_normal(t.x.shape), us))
    return out


def test_estimates_scatter_as_their_covariance_says():
    truth, rng, sd = _arm(), np.random.default_rng(0), np.array([0.01, 0.05])
    errors = []
    for _ in range(5):
        found = dojo.identify(_arm(0.1, 1.6), _motions(truth, rng, sd), ("damper", "mass"), noise=sd)
        assert found.success, found
        errors.append((found.values - [0.3, 1.0]) / found.deviation)
    assert 0.8 < found.rms < 1.2
    spread = np.sqrt(np.mean(np.square(errors)))
    assert 0.5 < spread < 1.7, spread  # 10 numbers: within three deviations of 1


def test_outliers_are_resisted():
    truth, rng, sd = _arm(), np.random.default_rng(1), np.array([0.01, 0.05])
    motions = _motions(truth, rng, sd)
    motions[0][0][7::9, 0] += 0.8
    robust = dojo.identify(_arm(0.1), motions, ("damper",), noise=sd)
    plain = dojo.identify(_arm(0.1), motions, ("damper",), noise=sd, outlier=1e9)
    errors = [abs(found.values[0] - 0.3) for found in (robust, plain)]
    assert errors[0] < 3.0 * robust.deviation[0] and errors[0] < 0.5 * errors[1] and robust.outliers > 0.01


@pytest.mark.parametrize("prior", [None, {"damper": (0.25, 0.01)}])
def test_an_outlier_changes_neither_deviations_nor_the_weight_of_a_prior(prior):
    truth, sd = _arm(), np.array([0.01, 0.05])
    motions = _motions(truth, np.random.default_rng(2), sd)
    fits = []
    for far in (0.0, 50.0):
        motions[0][0][17, 0] += far
        fits.append(dojo.identify(_arm(0.1, 1.6), motions, ("damper", "mass"), noise=sd, prior=prior))
    clean, one = fits
    assert clean.success and one.success and one.outliers > 0.0
    np.testing.assert_allclose(one.deviation, clean.deviation, rtol=0.15)
    assert np.abs((one.values - clean.values) / clean.deviation).max() < 0.5


def test_a_model_that_does_not_explain_the_data_is_told():
    """A lighter arm with any damper moves otherwise than the measured one."""
    sd = np.array([1e-5, 1e-4])
    motions = _motions(_arm(mass=3.0), np.random.default_rng(1), sd)
    wrong, right = (dojo.identify(_arm(0.2, mass), motions, ("damper",), noise=sd) for mass in (1.0, 3.0))
    assert wrong.outliers > 0.5 and (wrong.success, wrong.status) == (False, Status.NOT_EXPLAINED)
    assert "do not trust the values" in wrong.message and wrong.message in wrong.closing_line()
    assert right.success and "do not trust" not in right.message


def test_parameters_within_a_tenth_of_their_deviation_are_found():
    """As at the end of a fit of friction: only the starts of windows beside changes of contacts want to move."""
    for deviations, status in ((0.03, Status.SOLVED), (0.3, Status.LINE_SEARCH)):
        assert _stopped(Expectation(2.25, deviations), 1121.2, IdentifyOptions()) == status


def test_a_fit_whose_steps_all_raise_the_cost_is_not_called_solved(monkeypatch):
    """The linear model predicts a decrease that no step brings, at the second smoothing as at the first."""
    errors = ShootingFit.errors

    def worse(fit, theta, starts, kappa, slopes):
        found = errors(fit, theta, starts, kappa, slopes)
        late = not slopes and kappa == 1e-6
        return [replace(w, errors=10.0 * w.errors) for w in found] if late else found

    monkeypatch.setattr(ShootingFit, "errors", worse)
    motions = _motions(_arm(), np.random.default_rng(4), np.array([0.01, 0.05]))
    found = dojo.identify(
        _arm(0.1), motions, ("damper",), noise=0.01, kappas=(1e-4, 1e-6), max_iterations=1, shortest=40
    )
    assert [record["kappa"] for record in found.history] == [1e-4]
    assert not found.success and found.status == Status.LINE_SEARCH and "cost" in found.message


@pytest.mark.parametrize("fits", [1, 2])
def test_ctrl_c_leaves_the_best_fit_so_far(monkeypatch, fits):
    """In the third step of a fit alone; in that of a second one, the first is left."""
    truth, sd, count, before = _arm(), np.array([0.01, 0.05]), iter(range(100)), ShootingFit.step
    motions = _motions(truth, np.random.default_rng(4), sd)
    whole = dojo.identify(_arm(0.1, 1.6), motions, ("damper", "mass"), noise=sd)
    late = len(whole.history) + 4 if fits == 2 else 2

    def step(self, *args):
        if next(count) == late:
            raise KeyboardInterrupt
        return before(self, *args)

    monkeypatch.setattr(ShootingFit, "step", step)
    with pytest.raises(dojo.Interrupted) as stop:
        dojo.identify(_arm(0.1, 1.6), motions, ("damper", "mass"), noise=sd, fits=fits)
    found = stop.value.result
    if fits == 2:
        assert found.success and np.array_equal(found.values, whole.values)
        return
    assert found.status == Status.INTERRUPTED and not found.success and "Ctrl-C" in found.message
    assert 0 < len(found.history) <= late and found.cost == pytest.approx(found.history[-1]["cost"], rel=0.1)
    assert np.isfinite(found.deviation).all() and found.summary() and len(found.predictions()) == len(found.windows)
    off, first = (np.abs((values - whole.values) / whole.deviation).max() for values in (found.values, whole.start))
    assert off < 0.5 * first


def test_a_fit_without_any_prediction_is_not_called_solved():
    motions = _motions(_arm(), np.random.default_rng(4), 0.0)
    found = dojo.identify(_arm(0.1).replace(max_iterations=1, divide=False), motions, ("damper",))
    assert found.unsolved == len(motions)
    assert (found.success, found.status) == (False, Status.SIMULATION_FAILED)


def test_predictions_are_those_of_the_last_smoothing():
    motions = _motions(_arm(), np.random.default_rng(4), 0.0)
    found = dojo.identify(_arm(0.1), motions, ("damper",), kappas=np.array([1e-3, 1e-4]))
    assert found.success and found.kappa == 1e-4 != found.simulator.kappa
    assert {path.simulator.kappa for _, path, _ in found.predictions()} == {1e-4}


def test_unidentifiable_parameters_are_named():
    """Of a body that hangs still on a hinge without gravity, mass and inertia about the hinge act as one."""
    sim = _arm().replace(gravity=(0.0, 0.0, 0.0))
    motions = _motions(sim, np.random.default_rng(2), np.zeros(2))
    found = dojo.identify(sim, motions, ("mass", "inertia:link[yy]"), noise=0.01)
    assert len(found.unseen) == 1 and set(found.unseen[0]) <= {"mass:link", "inertia:link[yy]"}
    assert np.isinf(np.diag(found.covariance)).any() and "not determined" in found.summary()


def test_parameters_that_begin_at_zero_are_determined_as_others():
    """A value says little about the size of a parameter, whose deviation is the same from anywhere."""
    truth = dojo.Simulator(dojo.models.pendulum(damper=0.3), time_step=0.05)
    motions = _motions(truth, np.random.default_rng(0), np.full(2, 0.01))
    names, found = ("gravity[1]", "gravity[2]"), []
    for start in (0.0, 0.1):
        found.append(dojo.identify(truth.with_parameters({"gravity[1]": start}), motions, names, noise=0.01))
    assert all(f.success and not f.unseen for f in found)
    np.testing.assert_allclose(found[0].deviation, found[1].deviation, rtol=1e-3)
    assert np.all(np.abs(found[0].values - [0.0, -9.81]) < 4.0 * found[0].deviation)


def test_bodies_stay_thick_where_the_data_do_not_determine_them():
    """Noise alone made a flat body of the pendulum, of which no further fit could begin."""
    truth = dojo.Simulator(dojo.models.pendulum(damper=0.3), time_step=0.05)
    motions = _motions(truth, np.random.default_rng(1), np.full(2, 0.01))
    found = dojo.identify(truth.with_parameters({"damper": 0.1}), motions, ("damper",), ("link_0",), noise=0.01)
    sizes, before = (dojo.ParameterSpace(s, bodies=("link_0",)).values[1:4] for s in (found.simulator, truth))
    assert found.success and np.abs(sizes - before).max() < 3.0
    told = {label for combination in found.unseen for label in combination}
    assert told == {label for label, sd in zip(found.labels, found.deviation, strict=True) if np.isinf(sd)}


def test_a_prior_decides_where_the_data_do_not():
    """Without gravity, the mass of a link and the inertia of the motor on its hinge act as one."""
    rng, sd, floating = np.random.default_rng(3), np.array([0.01, 0.05]), {"gravity": (0.0, 0.0, 0.0)}
    truth = _arm().replace(**floating).with_parameters({"armature": [0.03]})
    start = _arm(0.1, 1.3).replace(**floating).with_parameters({"armature": [0.05]})
    motions, names = _motions(truth, rng, sd), ("mass", "armature", "damper")
    prior = {"mass": (1.0, 0.01), "damper": (0.6, 0.5)}
    found = dojo.identify(start, motions, names, prior=prior, noise=sd)
    assert not found.unseen and abs(found.values[0] - 1.0) < 3e-3 and 0.008 < found.deviation[0] < 0.012
    errors = (found.values[1:] - [0.03, 0.3]) / found.deviation[1:]
    assert np.abs(errors).max() < 3.0, (found.values, found.deviation)
    assert found.deviation[2] < 0.05  # of a damper that the data tell, whatever its prior
    assert len(dojo.identify(start, motions, names, noise=sd).unseen) == 1
    with pytest.raises(ValueError, match=r"identify\(prior=\.\.\.\).*masses"):
        dojo.identify(start, motions, names, prior={"masses": 1.0})


@pytest.mark.slow
def test_several_starts_leave_a_local_minimum_and_need_not_be_fitted_here():
    """A pendulum that swings slower than it was measured to is a swing behind after a while: no small change helps."""
    name = "armature"
    truth = _arm(0.02).with_parameters({name: 0.02})
    motions = [(truth.rollout(np.array([1.0, 0.0]), steps=200).x, np.zeros((200, 1)))]
    wrong = truth.with_parameters({name: 0.3})
    known = {"prior": {name: (0.1, 0.1)}, "noise": 0.05, "bounds": {"armature:hinge": (1e-3, 1.0)}}
    alone = dojo.identify(wrong, motions, (name,), **known, shortest=200)
    assert abs(alone.values[0] - 0.02) > 0.05
    several = dojo.identify(wrong, motions, (name,), fits=6, seed=1, shortest=200, **known)
    assert several.success and abs(several.values[0] - 0.02) < 1e-3 and several.cost < 0.01 * alone.cost
    doubled = dojo.identify(wrong, motions, (name,), **known)  # from short windows on, one fit is enough
    assert doubled.success and abs(doubled.values[0] - 0.02) < 1e-3
    with ThreadPoolExecutor(2) as pool:
        elsewhere = dojo.identify(wrong, motions, (name,), fits=6, seed=1, shortest=200, executor=pool, **known)
    np.testing.assert_array_equal(elsewhere.values, several.values)
    with pytest.raises(TypeError, match=r"identify\(executor=\.\.\.\)"):
        dojo.identify(wrong, motions, (name,), executor=3, **known)


def test_a_start_that_is_far_off_is_drawn_again():
    sim, rng, sd = _arm(), np.random.default_rng(7), np.array([0.01, 0.05])
    space = DelayedSpace(dojo.ParameterSpace(sim, ("damper",)), 0.0, sim.time_step)
    windows = cut_windows(sim, _motions(sim, rng, 0.0), 10)
    fit = ShootingFit(space, windows, Predictor(space, sd, 1), 3.0, Prior(space, {}))
    assert not fit.redraw(sim.kappa, rng), "no window is missed"
    near = fit.starts[4].copy()
    fit.starts[4] = near + [0.2, 0.0]
    before = [start.copy() for start in fit.starts]
    assert fit.redraw(sim.kappa, rng)
    assert np.linalg.norm((fit.starts[4] - near) / sd) < 18.0  # of 20 before
    fit.starts[4] = near + [0.0, 0.2]
    fit.begin_again(sim.kappa)
    np.testing.assert_array_equal(fit.starts[4], near, "the measured start costs less")
    fit.starts[4] = before[4]
    np.testing.assert_array_equal(fit.starts, before)


def test_friction_is_found_through_contacts():
    def block(mu):
        return dojo.Simulator(dojo.models.block(friction=mu), time_step=0.02, kappa=1e-5)

    truth, motions = block(0.35), []
    for speed in (1.0, 1.6, 2.2):
        x = truth.neutral()
        x[truth.nq] = speed
        motions.append((truth.rollout(x, np.zeros((25, truth.nu))).x, np.zeros((25, truth.nu))))
    found = dojo.identify(block(0.6), motions, ("friction:*",), noise=0.01, kappas=(1e-3, 1e-5), window=12)
    np.testing.assert_allclose(found.values, 0.35, rtol=2e-3)


def test_derivatives_of_differences_agree_with_central_differences():
    sim = dojo.Simulator(dojo.models.sphere(), time_step=0.01)
    from dojo_opt.planning.manifold import tangent_layout

    rng = np.random.default_rng(4)
    a, b = (sim.integrate(sim.neutral(), rng.standard_normal(sim.ndx)) for _ in range(2))
    slope = difference_slopes(tangent_layout(sim, sim.neutral()), sim.difference(a, b)[None])[0]
    for j in range(sim.ndx):
        e = 1e-6 * np.eye(sim.ndx)[j]
        central = (sim.difference(sim.integrate(a, e), b) - sim.difference(sim.integrate(a, -e), b)) / 2e-6
        np.testing.assert_allclose(slope[:, j], central, atol=1e-8)


@pytest.mark.parametrize(("change", "message"), [({"noise": -1.0}, "noise"), ({"window": 0}, "window")])
def test_bad_arguments_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        dojo.identify(_arm(), _motions(_arm(), np.random.default_rng(0), 0.0), ("damper",), **change)


@pytest.mark.slow
def test_a_quadruped_finds_payload_friction_and_damping_in_its_own_log():
    plan = dojo.ilqr(dojo.problems.trot())
    sim = dojo.problems.trot().sim
    truth = {"mass:trunk": 7.5, "friction:*": 0.35, "damper:FL_thigh": 0.15}
    rng = np.random.default_rng(0)
    start = sim.integrate(plan.x[0], 0.01 * rng.standard_normal(sim.ndx))
    motion = sim.with_parameters(truth).rollout_feedback(start, plan.u, plan.x, Ks=plan.K)
    assert motion.success
    noise = np.repeat((1e-3, 3e-3, 2e-3, 0.02, 0.03, 0.05), (3, 3, 12) * 2)  # [m, rad, rad, and their rates]
    measured = sim.integrate(motion.x, noise * rng.standard_normal((len(motion.x), sim.ndx)))
    late = 1  # [steps] from what the log says to what acts
    log, limits = (measured[:-late], motion.u[late:]), (0.0, 4.0 * sim.time_step)
    found = dojo.identify(sim, [log], tuple(truth), noise=noise, window=5, delay=limits)
    assert found.success and found.labels == (*truth, "delay")
    values = np.array([*truth.values(), late * sim.time_step])
    assert np.all(np.abs(found.start - values) > 0.1 * values)
    np.testing.assert_array_less(np.abs(found.values - values), 4.0 * found.deviation)
    np.testing.assert_array_less(found.deviation, 0.1 * values)
    known = dojo.identify(sim, [log], tuple(truth), noise=noise, window=5, delay=late * sim.time_step)
    np.testing.assert_array_less(np.abs(known.values - values[:-1]), 4.0 * known.deviation)


def test_starts_are_eliminated_from_the_normal_equations():
    """The reduced step is that of least squares over parameters and starts together, and its change of the squares."""
    rng, n, ndx = np.random.default_rng(3), 3, 2
    found = [WindowErrors(*(rng.standard_normal((m, 2, *k)) for k in ((), (ndx,), (n,))), True) for m in (4, 6)]
    weights = [rng.uniform(0.5, 1.0, len(w.errors)) for w in found]
    unit = np.array([0.1, 1.0, 20.0])
    equations = NormalEquations(found, weights, unit)
    H, g, back = equations.reduced(0.0)
    d = -np.linalg.solve(H, g)
    moves = -(back[:, :, -1] + back[:, :, :-1] @ d)

    rows = [np.repeat(np.sqrt(weight), 2) for weight in weights]
    r = np.concatenate([row * w.errors.ravel() for row, w in zip(rows, found, strict=True)])
    P = np.vstack([row[:, None] * w.by_theta.reshape(-1, n) * unit for row, w in zip(rows, found, strict=True)])
    S = block_diag(*(row[:, None] * w.by_start.reshape(-1, ndx) for row, w in zip(rows, found, strict=True)))
    wanted = np.linalg.lstsq(np.hstack([P, S]), -r, rcond=None)[0]
    np.testing.assert_allclose(np.r_[d, moves.ravel()], wanted, atol=1e-9)
    after = np.sum((r + P @ d + S @ moves.ravel()) ** 2)
    assert equations.change(d, moves) == pytest.approx(after - r @ r)


def test_windows_of_all_lengths_are_predicted_in_batches():
    """As one by one; the errors come back in the order of the windows."""
    sim = _arm()
    space = dojo.ParameterSpace(sim, ("damper", "mass"))
    windows = cut_windows(sim, _motions(sim, np.random.default_rng(4), np.array([0.01, 0.05])), 15)
    assert {len(window.u) for window in windows} == {15, 10}
    predictor, starts = Predictor(space, np.array([0.01, 0.05]), 2), [window.x[0] for window in windows]
    chain = space.slopes(space.values)
    for window, start, one in zip(windows, starts, predictor.errors(sim, windows, starts), strict=True):
        slow = predictor.predict(sim, chain, window, start, sim.kappa)
        np.testing.assert_allclose(one.errors, slow.errors, atol=1e-9)
        assert one.solved and slow.solved


@pytest.mark.slow
def test_a_report_has_parameters_residuals_and_both_motions(tmp_path):
    truth = dojo.Simulator(dojo.models.pendulum(damper=0.3), time_step=0.05)
    rng, motions = np.random.default_rng(0), []
    for angle in (0.5, 1.5):
        path = truth.rollout([angle, 0.0], steps=30)
        motions.append((path.x + 0.01 * rng.standard_normal(path.x.shape), path.u))
    found = dojo.identify(truth.with_parameters({"damper": 0.1}), motions, ("damper", "mass:link_0"), noise=0.01)
    predictions = found.predictions()
    assert [window.trajectory for window, *_ in predictions] == [0, 1] and found.unsolved == 0
    assert found.predictions()[0][1] is predictions[0][1], "a report and its figure share them"
    values = np.concatenate([residuals.ravel() for *_, residuals in predictions])
    assert np.sqrt(np.mean(values**2)) == pytest.approx(found.rms, rel=1e-6)
    files = dojo.identification_report(found, tmp_path / "fit")
    names = {"identification.png", "report.html", "report.md", "report.json", "motion.html"}
    assert {file.name for file in files} == names
    page = (tmp_path / "fit" / "report.html").read_text()
    assert "damper" in page and "v joint_0" in page
    assert all(f"</b> {name}" in (tmp_path / "fit" / "motion.html").read_text() for name in ("measured", "predicted"))
    with pytest.raises(TypeError, match="Identified"):
        dojo.identification_report(motions, tmp_path)


def _late(us, steps):
    """Inputs (T, nu) as they act after so many steps: means over the steps."""
    k, f = int(steps), steps - int(steps)
    earlier = lambda n: np.concatenate([np.repeat(us[:1], n, axis=0), us])[: len(us)]  # noqa: E731
    return (1.0 - f) * earlier(k) + f * earlier(k + 1)


def test_the_delay_of_inputs_is_fitted_or_given():
    rng, noise, steps = np.random.default_rng(5), np.array([1e-3, 5e-3]), 2.6
    truth, guess = _arm(0.3), _arm(0.2)
    logs = []
    for _ in range(3):
        us = np.repeat(rng.uniform(-2, 2, (10, 1)), 4, axis=0)
        x = truth.rollout(np.array([rng.uniform(-1, 1), 0.0]), _late(us, steps)).x
        logs.append((x + noise * rng.standard_normal(x.shape), us))
    for window in (None, 7):
        found = dojo.identify(guess, logs, ("damper",), noise=noise, delay=(0.0, 0.1), window=window)
        assert found.success and found.labels[-1] == "delay" and found.start[-1] == 0.05
        errors = (found.values - [0.3, steps * truth.time_step]) / found.deviation
        assert np.abs(errors).max() < 3.0, (found.values, found.deviation)
        assert found.deviation[1] < 0.1 * truth.time_step
        assert found.rms == pytest.approx(1.0, abs=0.15)
    given = dojo.identify(guess, logs, ("damper",), noise=noise, delay=steps * truth.time_step)
    assert given.labels == ("damper:hinge",) and abs(given.values[0] - 0.3) < 3.0 * given.deviation[0]
    without = dojo.identify(guess, logs, ("damper",), noise=noise)
    assert without.rms > 5.0 * given.rms


def test_derivatives_by_a_delay_agree_with_central_differences():
    sim = _arm()
    us = np.random.default_rng(6).uniform(-2, 2, (12, 1))
    xs = sim.rollout(np.array([0.3, 0.0]), us).x
    space = DelayedSpace(dojo.ParameterSpace(sim, ("damper",)), (0.0, 0.1), sim.time_step)
    window = cut_windows(sim, [(xs, us)], 5, space.past)[1]
    np.testing.assert_array_equal(window.past, us[5 - space.past :][: space.past] if space.past <= 5 else window.past)
    predictor, theta, eps = Predictor(space, np.array([0.01, 0.1]), 1), np.array([0.3, 0.033]), 1e-6

    def errors(theta):
        (late,) = space.delayed([window], theta)
        return predictor.predict(space.simulator(theta), space.slopes(theta), late, xs[5], sim.kappa)

    slopes = errors(theta).by_theta
    for j in range(2):
        d = eps * np.eye(2)[j]
        numeric = (errors(theta + d).errors - errors(theta - d).errors) / (2 * eps)
        np.testing.assert_allclose(slopes[..., j], numeric, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("delay", [-0.1, (0.1, 0.0), (0.0, np.inf), (0.0, 0.1, 0.2), "late"])
def test_bad_delays_are_named(delay):
    with pytest.raises((ValueError, TypeError), match=r"identify\(delay=\.\.\.\)"):
        dojo.identify(_arm(), _motions(_arm(), np.random.default_rng(0), 0.01), ("damper",), delay=delay)


@pytest.mark.slow
def test_feet_that_stand_on_a_terrain_tell_its_heights():
    """From noisy states of a standing quadruped; heights that no foot is near stay as uncertain as before."""
    i, j = np.meshgrid(range(6), range(3), indexing="ij")
    heights = 0.015 * np.sin(1.7 * i + 2.3 * j)

    def terrain(values):
        return dojo.Terrain(values, origin=(-0.3, -0.2), spacing=(0.2, 0.2))

    def robot(values):
        mech = dojo.models.quadruped(damper=0.5)
        servos = [dojo.Input(j.name, servo="position", stiffness=60.0, damping=2.0) for j in mech.joints[1:]]
        return dojo.Simulator(replace(mech, inputs=servos).with_terrain(terrain(values)), time_step=0.01, kappa=1e-5)

    truth, rng = robot(heights), np.random.default_rng(0)
    x = truth.neutral()
    x[2] += 0.05
    path = truth.rollout(x, np.tile(x[7:19], (60, 1)), throw=True)
    noise = np.repeat((1e-3, 3e-3, 2e-3, 0.02, 0.03, 0.05), (3, 3, 12) * 2)  # [m, rad, rad, and their rates]
    measured = truth.integrate(path.x[30:], noise * rng.standard_normal((31, truth.ndx)))
    found = dojo.identify(
        robot(np.zeros_like(heights)), [(measured, path.u[30:])], ("terrain",), noise=noise, window=15,
        prior={"terrain": (0.0, 0.03)}, kappas=(1e-3, 1e-5),
    )  # fmt: skip
    assert found.success
    own = terrain(found.values.reshape(heights.shape))
    for x, y, _ in path.contacts.point[-1]:
        assert abs(own.height(x, y) - terrain(heights).height(x, y)) < 2e-3
    deviation = found.deviation.reshape(heights.shape)
    assert np.all(deviation[5] > 0.025) and np.all(deviation[1:3] < 0.02), deviation


@pytest.mark.parametrize(
    ("made", "wrenches", "message"),
    [
        ({}, {"link": (0.0, 0.1, 0.0, 0.2, 0.0, 0.0)}, "motion 0: expected no external wrenches"),
        ({"time_step": 0.01}, None, "motion 0: expected the time step 0.02 s, got 0.01 s"),
        ({"order": 4}, None, "expected velocities that are means over the step before, .*got those at the nodes"),
        ({"mechanism": dojo.models.slider()}, None, "coordinates of 'mechanism' .* got one of 'slider'"),
    ],
)
def test_motions_that_the_simulator_would_misread_are_refused(made, wrenches, message):
    sim = _arm()
    motion = sim.replace(**made).rollout(np.array([0.5, 0.0]), steps=5, wrenches=wrenches)
    with pytest.raises(ValueError, match=message):
        dojo.identify(sim, [motion], ("damper",), noise=0.05)
