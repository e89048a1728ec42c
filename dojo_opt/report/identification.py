"""Report of a fit: parameters with their covariance, residuals by component, and the motions side by side."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from dojo_opt.identification.identify import Identified
from dojo_opt.plots.identification import identification
from dojo_opt.report.page import write_page
from dojo_opt.report.result import Cell, Report, Row, Table
from dojo_opt.viewer.animation import save_html
from sim.mechanism import checks

_MATCHING = 1.5  # root mean square over the noise up to which the model matches the measurements

__all__ = ["identification_report"]


def identification_report(found: Identified, folder: str | Path) -> list[Path]:
    """Write what a fit found, and how well it matches the measurements.

    report.html, report.md and report.json have the parameters with their standard deviations and correlations, the
    combinations that the data do not determine, and the residuals by component; identification.png is
    `dojo.plots.identification`, and motion.html shows the longest window, measured and predicted side by side.

    Args:
        found: the result of `dojo.identify`.
        folder: folder of the files, made if it is missing.

    Returns:
        Paths of the files.

    Raises:
        TypeError: `found` is no result of `identify`.
        OSError: the folder cannot be written.
    """
    if not isinstance(found, Identified):
        raise TypeError(f"identification_report(found): expected an Identified, got {checks.shown(found)}")
    target = checks.path("identification_report(folder)", folder)
    command = "dojo.identification_report(found, folder)"
    report = Report(f"Identification of {found.simulator.mechanism.name}", command, summary=found.closing_line())
    report.rows = [
        Row("residuals over their noise, root mean square", found.rms, "", _MATCHING),
        Row("states that count less than fully", 100.0 * found.outliers, "%"),
        Row("windows that could not be predicted", float(found.unsolved), "", 0.0),
        Row("combinations that the data do not determine", float(len(found.unseen)), "", 0.0),
    ]
    predictions = found.predictions()
    residuals = [each for *_, each in predictions]
    report.tables = [_parameters(found), *_residuals(found, residuals), *_unseen(found), _correlations(found)]
    report.figure = identification(found)
    report.details = {"values": found.values.tolist(), "covariance": found.covariance.tolist()}
    files = write_page({"identification": report}, target, command)
    if not predictions:
        return files
    window, predicted, _ = max(predictions, key=lambda each: len(each[1].u))
    motions = [replace(predicted, x=window.x), predicted]
    return [*files, save_html(motions, target / "motion.html", names=("measured", "predicted"))]


def _parameters(found: Identified) -> Table:
    rows: list[list[Cell]] = [
        [label, float(value), float(deviation), float(before)]
        for label, value, deviation, before in zip(
            found.labels, found.values, found.deviation, found.start, strict=True
        )
    ]
    return Table("Parameters", ("parameter", "value", "standard deviation", "before"), rows)


def _residuals(found: Identified, residuals: list[NDArray[np.float64]]) -> list[Table]:
    """Root mean square, mean and largest residual of every measured component."""
    if not residuals:
        return []
    sim, all_rows = found.simulator, np.concatenate(residuals)
    names = [*sim.mechanism.dof_names, *(f"v {name}" for name in sim.mechanism.dof_names)]
    rows: list[list[Cell]] = [
        [names[i], float(found.noise[i]), *(float(v) for v in (np.sqrt(np.mean(r**2)), r.mean(), np.abs(r).max()))]
        for i in np.flatnonzero(np.isfinite(found.noise))
        for r in (all_rows[:, i],)
    ]
    header = ("component", "noise", "root mean square", "mean", "largest")
    note = "Over the noise [m, rad, m/s, rad/s]. A mean far from 0 is a systematic error of the model."
    return [Table("Residuals", header, rows, note)]


def _unseen(found: Identified) -> list[Table]:
    if not found.unseen:
        return []
    rows: list[list[Cell]] = [[" ".join(f"{v:+.2g} {k}" for k, v in each.items())] for each in found.unseen]
    return [Table("Combinations that the data do not determine", ("direction",), rows)]


def _correlations(found: Identified) -> Table:
    rows: list[list[Cell]] = [
        [label, *(round(float(v), 3) for v in row)] for label, row in zip(found.labels, found.correlation, strict=True)
    ]
    return Table("Correlations", ("", *found.labels), rows)
