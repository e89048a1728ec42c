"""Tables of the study `gradients`."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from benchmarks.studies.gradients.sliding import Derivative
from dojo_opt.report.gradients.resting import ALLOWED, STEPS
from dojo_opt.report.result import Cell, Table


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
    note = "1 kg, steps of 20 ms: errors of d(next velocity)/d(position / h, velocity), with entries around 1. "
    note += "A contact is felt where the gradient of a free step that ends there is 1 % of a pressed step's."
    return Table("Cost and benefit of smoothing", ("kappa", *bias, "felt from [mm]"), rows, note)


def resting_table(needed: NDArray[np.float64], usual: NDArray[np.float64]) -> Table:
    """The kappa that a resting contact needs, over time steps."""
    rows: list[list[Cell]] = [
        [1e3 * h, float(kappa), float(bias)] for h, kappa, bias in zip(STEPS, needed, usual, strict=True)
    ]
    header = ("time step [ms]", f"kappa for a bias of {100 * ALLOWED:g} %", "bias at kappa 1e-6")
    note = "Of the gradient of a contact that carries 1 kg: kappa / (m g^2 h^3), so scale kappa by the mass."
    return Table("The kappa that a resting contact needs", header, rows, note)
