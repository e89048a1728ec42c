"""Study `planning`: cost and violation of plans against run time."""

from __future__ import annotations

from dojo_opt.report.planning.study import Planning

__all__ = ["Planning"]
