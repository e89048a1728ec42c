"""Tables of the study `gradients`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from dojo_opt.report.gradients.one_step import KAPPAS, TIGHTLY, Point
from dojo_opt.report.gradients.sliding import Derivative
from dojo_opt.report.gradients.smoothing import ALLOWED, STEPS
from dojo_opt.report.result import Cell, Table


def step_table(scene: str, points: Sequence[Point], bias: Sequence[float]) -> Table:
    """One line per way to get (A, B); differences at their best step size, and at 1e-6."""
    rows: list[list[Cell]] = []
    smoothed = dict(zip(KAPPAS, bias, strict=False))
    for p in points:
        if p.eps is None:
            of = smoothed.get(p.kappa or 0.0) if p.method == TIGHTLY else None
            name = f"{p.method}, kappa {p.kappa:g}" if p.kappa else p.method
            rows.append([name, p.microseconds, p.error, None, of])
    for method in dict.fromkeys(p.method for p in points if p.eps is not None):
        own = [p for p in points if p.method == method]
        best = min(own, key=lambda p: p.error if p.error == p.error else float("inf"))
        usual = next(p for p in own if p.eps == 1e-6)
        name = f"{method}, kappa {best.kappa:g}" if best.kappa else method
        rows.append([name, best.microseconds, usual.error, f"{best.error:.2g} ({best.eps:g})", None])
    note = "us: the step and its Jacobian. Errors are relative (Frobenius norm); the reference is good to "
    note += f"{max(p.doubt for p in points):.0e}. Steps are solved to 1e-8, "
    note += "those of differences of ours to 1e-13. "
    if any("Drake" in p.method for p in points):
        note += "Drake: in its own coordinates, called from Python. "
    note += f"Bias: from (A, B) at kappa {1e-2 * KAPPAS[-1]:g}, by our own step."
    header = ("", "us", "error", "best, at a step size of", "bias")
    return Table(f"(A, B) of one step: {scene}", header, rows, note)


def motion_table(found: Sequence[Derivative], time_step: float) -> Table:
    """One line per engine and way, a column per motion."""
    names = list(dict.fromkeys(d.motion for d in found))
    exact = {d.motion: d.exact for d in found}
    rows: list[list[Cell]] = [["Coulomb's law", *(exact[name] for name in names), 0.0, None]]
    ways = dict.fromkeys((d.engine, d.how, d.kappa) for d in found)
    for engine, how, kappa in ways:
        own = {d.motion: d for d in found if (d.engine, d.how, d.kappa, d.time_step) == (engine, how, kappa, time_step)}
        label = f"{engine}{f', kappa {kappa:g}' if kappa else ''}: {how}"
        milliseconds = 1e3 * sum(d.seconds for d in own.values()) / len(own)
        rows.append([label, *(own[name].value for name in names), worst(list(own.values())), milliseconds])
    note = "dx/dF in m/N, d(stop)/dv0 in s; error: the worst, relative to the derivative of the sliding block."
    return Table(
        f"Derivatives of whole motions, steps of {1e3 * time_step:g} ms", ("", *names, "error", "ms"), rows, note
    )


def worst(found: Sequence[Derivative]) -> float:
    """Largest error; NaN counts as infinite."""
    return max(d.error if d.error == d.error else float("inf") for d in found)


def smoothing_table(
    kappas: NDArray[np.float64], bias: Mapping[str, NDArray[np.float64]], reach: NDArray[np.float64]
) -> Table:
    """One line per decade of kappa."""
    rows: list[list[Cell]] = []
    for i in range(0, len(kappas), 2):
        rows.append([f"{kappas[i]:.0e}", *(float(errors[i]) for errors in bias.values()), 1e3 * float(reach[i])])
    note = "1 kg, steps of 20 ms: errors of d(next velocity)/d(position / h, velocity), whose entries are around 1. "
    note += "A contact is felt where the gradient of a free step that ends there is 1 % of that of a pressed one."
    return Table("What smoothing costs and brings", ("kappa", *bias, "felt from [mm]"), rows, note)


def resting_table(needed: NDArray[np.float64], usual: NDArray[np.float64]) -> Table:
    """The kappa that a resting contact needs, over time steps."""
    rows: list[list[Cell]] = [
        [1e3 * h, float(kappa), float(bias)] for h, kappa, bias in zip(STEPS, needed, usual, strict=True)
    ]
    header = ("time step [ms]", f"kappa for a bias of {100 * ALLOWED:g} %", "bias at kappa 1e-6")
    note = "Of the gradient of a contact that carries 1 kg: kappa / (m g^2 h^3), so scale kappa by the mass."
    return Table("The kappa that a resting contact needs", header, rows, note)
