"""Reports: studies that measure something and show it as a page, `python -m dojo_opt report NAME`."""

from __future__ import annotations

from dojo_opt.report.page import write_page
from dojo_opt.report.result import Report, Row, Table
from dojo_opt.report.study import STUDIES, Progress, Study, run_report, run_reports, study

__all__ = ["STUDIES", "Progress", "Report", "Row", "Study", "Table", "run_report", "run_reports", "study", "write_page"]
