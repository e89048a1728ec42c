"""The time step, kappa and tolerance that a robot needs: errors of its own motion, with contacts and without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np

from dojo_opt.plots.axes import plain_ticks
from dojo_opt.report.accuracy import error_curves as curves
from dojo_opt.report.accuracy import error_figure as drawing
from dojo_opt.report.accuracy import smooth_scene as scenes
from dojo_opt.report.accuracy.advice import hints, recommendation
from dojo_opt.report.accuracy.setting_trial import DURATION, PIECE, PIECES, SettingTrial
from dojo_opt.report.accuracy.starting_pose import start
from dojo_opt.report.dojo_engine import Ours
from dojo_opt.report.engine import PhysicsEngine
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.report.study import Progress
from sim.mechanism.mechanism import Mechanism
from sim.simulator.simulator import Simulator
from solvers.compiler import threads
from solvers.types import Floats

_TARGET = 1e-3  # [m] target of the error after a piece
_CONVERGED = 1e-2  # [m] beyond which there is no motion to compare with
_STEPS = (0.05, 0.025, 0.02, 0.01, 0.005, 0.0025, 0.001, 5e-4)
_KAPPAS = (1e-3, 1e-4, 1e-5, 1e-6, 1e-8)
_SHARP = ((1e-4, 1e-10), (2e-4, 1e-10), (5e-4, 1e-10), (5e-4, 1e-9), (1e-3, 1e-8))  # steps, kappas to converge with
_TOLERANCES = (1e-4, 1e-6, 1e-8)


@dataclass(frozen=True)
class RobotAccuracy:
    """Errors of a robot against run time, and the time step, kappa and tolerance that it needs.

    quick: fewer settings; peers: engines that run the smooth motion beside ours.
    """

    mechanism: Mechanism
    quick: bool = False
    peers: Sequence[PhysicsEngine] = ()

    def run(self, progress: Progress) -> Report:
        """Measure.

        Raises:
            ValueError: The robot cannot be simulated even with small steps.
        """
        with threads(1):
            return _recommend(self.mechanism, self.quick, progress, self.peers)


def _recommend(mechanism: Mechanism, quick: bool, progress: Progress, peers: Sequence[PhysicsEngine]) -> Report:
    report = Report(f"Accuracy of {mechanism.name}")
    report.summary = (
        f"{DURATION:g} s of motion from a random start that is always the same, joints without torques, with contacts "
        f"and limits, cut into {PIECES} pieces that each start on the converged motion (Erez, Tassa, Todorov, 2015). "
        "Errors are the largest distance of a body's centre of mass from it at the end of a piece, means over the "
        "pieces. The converged motion is the same simulator with a much smaller step and kappa; for the motion without "
        "contacts and limits, uncut, it is an independent ODE."
    )
    q, v = start(mechanism)
    smooth = scenes.without_contact(mechanism)
    hard = bool(mechanism.contacts or mechanism.collisions) or smooth.joints != mechanism.joints
    unknown = scenes.not_in_reference(mechanism)
    parts: list[tuple[str, Any]] = []
    if hard or unknown:
        parts.append(("time steps, kappas", lambda: _hard(report, mechanism, q, v, quick)))
    if hard and not (mechanism.contacts or mechanism.collisions):
        report.notes.append("nothing of it makes contact: the kappa found is that of its limits, not of the ground")
    if unknown:
        report.notes.append(f"not compared with an independent ODE: that has no {unknown}")
    else:
        scene = replace(scenes.smooth(mechanism, q, v, DURATION), name="without contact")
        parts.append(("smooth motion", lambda: _smooth(report, scene, peers, quick)))
    for part in progress(parts, "accuracy"):
        part()
    return report


class Converged(NamedTuple):
    """The motion with a very small step, where pieces start and end."""

    q: Floats  # (PIECES + 1, nq)
    v: Floats  # (PIECES + 1, nv) at the node
    position: Floats  # (PIECES + 1, nbody, 3) [m]
    time_step: float
    kappa: float


def _converged(mechanism: Mechanism, q: Floats, v: Floats, quick: bool) -> Converged:
    """With the smallest time step whose steps are all solved.  ValueError: none is."""
    message = ""
    for fine, kappa in _SHARP[1:] if quick else _SHARP:
        sim = Simulator(mechanism, time_step=fine, kappa=kappa)
        every = round(PIECE / fine)
        motion = sim.rollout(sim.state_from_velocity(q, v), np.zeros((PIECES * every, sim.nu)))
        if motion.success:
            x = motion.x[::every]
            return Converged(x[:, : sim.nq], sim.velocity(x), sim.maximal(x)[..., :3], fine, kappa)
        message = motion.message
    raise ValueError(f"report accuracy: {mechanism.name} cannot be simulated with 1 ms either: {message}")


def _trial(mechanism: Mechanism, exact: Converged, settings: tuple[float, float, float], rounds: int) -> SettingTrial:
    """The pieces with one setting."""
    h, kappa, tolerance = settings
    engine = Ours(kappa=kappa, tolerance=tolerance, rounds=rounds)
    errors, seconds = [], 0.0
    for k in range(PIECES):
        q, v = exact.q[k], exact.v[k]
        run = engine.simulate(mechanism, time_step=h, q=q, v=v, duration=PIECE, samples=1)
        if run.message:
            return SettingTrial(h, kappa, tolerance, np.inf, 0.0, run.message)
        errors.append(float(np.linalg.norm(run.position[-1] - exact.position[k + 1], axis=-1).max()))
        seconds += run.seconds
    return SettingTrial(h, kappa, tolerance, float(np.mean(errors)), seconds, "")


class Advice(NamedTuple):
    """The settings for a mechanism, and the trials behind them."""

    best: SettingTrial
    trials: list[SettingTrial]
    target: float  # [m]
    own: float  # [m] error of the converged motion, against twice its step
    exact: Converged


def advise(mechanism: Mechanism, q: Floats, v: Floats, quick: bool) -> Advice:
    """Trials of time steps and kappas from (q, v), with contacts and limits.   ValueError: none can be simulated."""
    exact = _converged(mechanism, q, v, quick)
    own = _trial(mechanism, exact, (2.0 * exact.time_step, exact.kappa, 1e-8), 0).error
    target = max(_TARGET, 2.0 * own) if np.isfinite(own) else _TARGET
    rounds = 1 if quick else 3
    steps = _STEPS[1::2] if quick else _STEPS
    kappas = (1e-5, 1e-8) if quick else _KAPPAS
    trials = [_trial(mechanism, exact, (h, kappa, 1e-8), rounds) for h in steps for kappa in kappas]
    return Advice(choose(trials, target), trials, target, own, exact)


def _hard(report: Report, mechanism: Mechanism, q: Floats, v: Floats, quick: bool) -> None:
    """Trials with contacts and limits, and the recommendation."""
    best, trials, target, own, exact = advise(mechanism, q, v, quick)
    tolerances = [
        _trial(mechanism, exact, (best.time_step, best.kappa, tolerance), 1 if quick else 3)
        for tolerance in _TOLERANCES
    ]
    report.rows += [
        Row("recommended time step", 1e3 * best.time_step, "ms", note=str(best)),
        Row("recommended kappa", best.kappa, "N s m"),
        Row(f"its error after {PIECE:g} s", 1e3 * best.error, "mm", 1e3 * target),
        Row("its speed", best.realtime, "times real time"),
        Row(
            "the converged motion, against twice its step",
            1e3 * own,
            "mm",
            1e3 * _CONVERGED,
            note=f"h = {1e3 * exact.time_step:g} ms, kappa {exact.kappa:g}; the target is at least twice this",
        ),
    ]
    rows: list[list[Cell]] = [
        [1e3 * t.time_step, t.kappa, t.tolerance, 1e3 * t.error, t.realtime, t.message] for t in (*trials, *tolerances)
    ]
    header = ["step, ms", "kappa", "tolerance", "error, mm", "times real time", "ended early"]
    report.tables.append(Table("With contacts and limits", header, rows, note="the last rows vary the tolerance"))
    report.details["trials"] = [{**vars(t), "realtime": t.realtime} for t in (*trials, *tolerances)]
    report.summary = f"{recommendation(best, target, own)} {report.summary}"
    report.notes += hints(mechanism, best, trials, choose)
    report.figure = _figure(mechanism.name, best, trials, own, target)


def choose(trials: Sequence[SettingTrial], target: float = _TARGET) -> SettingTrial:
    """The largest time step, then the largest kappa, that meets the target; the most exact trial when none does.

    A larger kappa makes smoother derivatives.
    """
    good = [t for t in trials if t.error <= target]
    if good:
        return max(good, key=lambda t: (t.time_step, t.kappa))
    return min(trials, key=lambda t: t.error)


def _smooth(report: Report, scene: scenes.SmoothScene, peers: Sequence[PhysicsEngine], quick: bool) -> None:
    """Errors from the same start without contacts and limits, against the ODE, for all orders and peers."""
    everyone = curves.engines(1 if quick else 3, peers)
    steps = (0.05, 0.01, 0.002) if quick else (0.05, 0.025, 0.01, 0.005, 0.0025, 0.001)
    measured = curves.measure(scene, everyone, steps, 0.05 if quick else 0.3)
    rows: list[list[Cell]] = [
        [
            name,
            1e3 * p.time_step,
            1e3 * p.errors["position"],
            DURATION / p.seconds if p.seconds else None,
            p.errors["energy"],
            p.message,
        ]
        for name, points in measured.items()
        for p in points
    ]
    header = ["engine", "step, ms", "error, mm", "times real time", "energy error, relative", "ended early"]
    report.tables.append(Table("Without contacts and limits, against the ODE", header, rows))
    report.details["smooth"] = {name: [p._asdict() for p in points] for name, points in measured.items()}
    ours = [(p, name) for name, points in measured.items() if name.startswith("dojo-opt") for p in points]
    good = [(p, name) for p, name in ours if p.errors["position"] <= _TARGET]
    if good:
        p, name = min(good, key=lambda pair: pair[0].seconds)
        note = f"{name}, h = {1e3 * p.time_step:g} ms, {DURATION / p.seconds:.3g} times real time"
        report.rows.append(Row("smooth motion: cheapest to the target", 1e3 * p.errors["position"], "mm", note=note))
    if report.figure is None:
        panels = [("", "position", f"{scene.mechanism.name}: position [m]"), ("", "energy", "energy, relative")]
        report.figure = drawing.figure({"": measured}, panels)


def _figure(name: str, best: SettingTrial, trials: Sequence[SettingTrial], own: float, target: float) -> Any:
    """Error against processor time, one line per kappa."""
    from matplotlib.figure import Figure

    out = Figure(figsize=(7.6, 4.4), layout="constrained")
    axis = out.subplots()
    for kappa in dict.fromkeys(t.kappa for t in trials):
        line = [t for t in trials if t.kappa == kappa and np.isfinite(t.error)]
        axis.loglog([1e3 * t.seconds for t in line], [1e3 * t.error for t in line], "o-", label=f"kappa {kappa:g}")
        for t in line:
            axis.annotate(
                f"{1e3 * t.time_step:g}",
                (1e3 * t.seconds, 1e3 * t.error),
                (3, 4),
                textcoords="offset points",
                fontsize=7,
                alpha=0.6,
            )
    label = f"recommended: {1e3 * best.time_step:g} ms, kappa {best.kappa:g}"
    axis.plot(1e3 * best.seconds, 1e3 * best.error, "o", ms=13, mfc="none", mec="k", mew=1.5, label=label)
    axis.axhline(1e3 * target, color="k", lw=0.8, ls=":", label="target")
    if np.isfinite(own) and own > 0.0:
        axis.axhline(1e3 * own, color="k", lw=0.8, ls="--", label="the converged motion itself")
    axis.set(xlabel=f"processor time of {DURATION:g} s [ms]", ylabel="position error [mm]")
    axis.set_title(f"{name}: error against run time (numbers: time step in ms)", fontsize=10)
    axis.legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0))
    axis.grid(alpha=0.3)
    plain_ticks(axis)
    return out
