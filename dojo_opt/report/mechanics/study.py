"""Study `mechanics`: the table of everything a mechanism can be made of, each entry measured against its bar."""

from __future__ import annotations

from dataclasses import dataclass

from dojo_opt.report.mechanics import joints
from dojo_opt.report.result import Report, Row, Table
from dojo_opt.report.study import Progress
from sim.parts import KINDS


@dataclass(frozen=True)
class Mechanics:
    """Joint kinds; quick takes every fourth kind."""

    quick: bool = False

    def run(self, progress: Progress) -> Report:
        """Measure."""
        report = Report("Mechanics", "dojo-opt report mechanics" + (" --quick" if self.quick else ""))
        report.summary = "Every kind of joint against what it should do. Empty: the kind has no such thing."
        self._joints(report, progress)
        return report

    def _joints(self, report: Report, progress: Progress) -> None:
        """A line per kind, a row per measure with the worst of them."""
        kinds = list(KINDS)[:: 4 if self.quick else 1]
        found = {kind: joints.check(kind) for kind in progress([(kind, kind) for kind in kinds], "joints")}
        lines = [[kind, *values.values()] for kind, values in found.items()]
        note = (joints.__doc__ or "").partition("\n\n")[2]
        report.tables.append(Table("Joint kinds", ("", *joints.BARS), lines, note))
        report.details["joints"] = found
        for name, bar in joints.BARS.items():
            values = {kind: value for kind, v in found.items() if (value := v[name]) is not None}
            least = name == "energy"
            worst = (min if least else max)(values, key=lambda kind: values[kind])
            text = f"worst of {len(values)}: {worst}"
            report.rows.append(Row(f"joints: {name}", values[worst], "", bar, at_least=least, note=text))
