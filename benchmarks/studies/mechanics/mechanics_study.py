"""Study `mechanics`: tables of all parts of mechanisms, each entry measured against its bar."""

from __future__ import annotations

from dataclasses import dataclass
from math import isnan

from benchmarks.studies.mechanics import joint_kinds as joints
from benchmarks.studies.mechanics.mechanics_figure import margins
from dojo_opt.report.result import Report, Row, Table
from dojo_opt.report.study import Progress
from sim.derivatives.parameters.parameters import KINDS as PARAMETERS
from sim.mechanism.joint import KINDS
from support import collision_checks as collisions
from support import parameter_errors as parameters
from support.situations import CASES
from support.solids import PAIRS

QUICK_PAIRS = ("sphere_capsule", "box_halfspace", "cylinder_halfspace")
QUICK_CASES = ("touching", "sliding")


@dataclass(frozen=True)
class MechanicsStudy:
    """Joint kinds, pairs of shapes, parameters; quick takes a few of each."""

    quick: bool = False

    def run(self, progress: Progress) -> Report:
        """Measure."""
        report = Report("Mechanics")
        report.summary = (
            "Every kind of joint, every pair of shapes that can collide and the derivatives with respect to every kind "
            "of parameter, against reference values. Empty: not applicable."
        )
        self._joints(report, progress)
        self._pairs(report, progress)
        self._parameters(report, progress)
        report.figure = margins(report.details)
        report.notes.append("Figure: error over bar, a dot per entry; at the left edge, exact ones and stops kept.")
        return report

    def _joints(self, report: Report, progress: Progress) -> None:
        """A line per kind, a row per measure with the worst of them."""
        kinds = list(KINDS)[:: 4 if self.quick else 1]
        found = {kind: joints.check(kind) for kind in progress([(kind, kind) for kind in kinds], "joints")}
        lines = [[kind, *values.values()] for kind, values in found.items()]
        report.tables.append(Table("Joint kinds", ("", *joints.BARS), lines, _note(joints.__doc__)))
        report.details["joints"] = found
        report.rows.append(Row("kinds of joints", len(found), ""))
        for name, bar in joints.BARS.items():
            values = {kind: value for kind, v in found.items() if (value := v[name]) is not None}
            least = name == "energy"
            lost = [kind for kind in values if isnan(values[kind])]
            worst = lost[0] if lost else (min if least else max)(values, key=lambda kind: values[kind])
            text = f"worst of {len(values)}: {worst}"
            report.rows.append(Row(f"joints: {name}", values[worst], "", bar, at_least=least, note=text))

    def _pairs(self, report: Report, progress: Progress) -> None:
        """A line per pair of shapes, a row per measure with the worst of them, rounded shapes apart."""
        names = QUICK_PAIRS if self.quick else PAIRS
        found = {name: collisions.check(name) for name in progress([(name, name) for name in names], "pairs")}
        columns = list(found[names[0]])
        lines = [[name, *(_short(values[c]) for c in columns)] for name, values in found.items()]
        report.tables.append(Table("Pairs of shapes", ("", *columns), lines, _note(collisions.__doc__)))
        report.details["pairs"] = found
        report.rows.append(Row("pairs of shapes", len(found), ""))
        groups: dict[tuple[str, float], dict[str, float]] = {}
        for name, values in found.items():
            for c, value in values.items():
                group = groups.setdefault((c.partition(" ")[0], collisions.bar(name, c)), {})
                group[f"{name}{c[c.index(' ') :]}"] = value
        for (measure, bar), values in sorted(groups.items()):
            title = f"pairs: {measure}" + (", rounded" if bar > collisions.BARS[measure] else "")
            report.rows.append(_worst(title, values, bar, "" if measure == "derivative" else "m"))

    def _parameters(self, report: Report, progress: Progress) -> None:
        """A line per kind of parameter, couplings of bodies apart; a row per situation with its worst value."""
        names = QUICK_CASES if self.quick else tuple(CASES)
        found = {name: parameters.check(name) for name in progress([(name, name) for name in names], "parameters")}
        coupled = [name for name in names if name.startswith(("in a loop", "geared", "colliding", "rolling", "tied"))]
        trees = [name for name in names if name not in coupled]
        for title, part in (("", trees), (", loops, gears and collisions", coupled)):
            kinds = [kind for kind in PARAMETERS if any(kind in found[name] for name in part)]
            lines = [[kind, *(_short(found[name].get(kind)) for name in part)] for kind in kinds]
            if part:
                title = f"Derivatives by parameters{title}"
                report.tables.append(Table(title, ("", *part), lines, _note(parameters.__doc__)))
        report.details["parameters"] = found
        every = {kind for values in found.values() for kind in values}
        right = [k for k in every if all(values.get(k, 0.0) <= parameters.BAR for values in found.values())]
        report.rows += [
            Row("kinds of parameters", len(every), ""),
            Row("situations of parameters", len(found), ""),
            Row("kinds of parameters whose derivatives are right", len(right), "", len(every), at_least=True),
        ]
        for name, values in found.items():
            report.rows.append(_worst(f"parameters: {name}", values, parameters.BAR, ""))


def _note(doc: str | None) -> str:
    """The docstring without its first line."""
    return (doc or "").partition("\n\n")[2]


def _short(value: float | None) -> str:
    """One digit: the tables are wide, and the report has all digits in its details."""
    return "" if value is None else f"{value:.0e}"


def _worst(name: str, values: dict[str, float], bar: float, unit: str) -> Row:
    """The largest value, with its name; NaN is larger than any."""
    worst = max(values, key=lambda key: (isnan(values[key]), values[key]))
    return Row(name, values[worst], unit, bar, note=f"worst of {len(values)}: {worst}")
