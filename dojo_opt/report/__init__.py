"""Reports: studies of a robot, shown as tables or as a page; `dojo-opt report NAME ROBOT.urdf`.

Studies of reference scenes, and of other engines, are in benchmarks/studies.
"""

from __future__ import annotations

from dojo_opt.report.page import write_page
from dojo_opt.report.result import Report, Row, Table
from dojo_opt.report.study import STUDIES, Progress, ReportStudy, run_report, run_reports, study

__all__ = [
    "STUDIES",
    "Progress",
    "Report",
    "Row",
    "ReportStudy",
    "Table",
    "run_report",
    "run_reports",
    "study",
    "write_page",
]
