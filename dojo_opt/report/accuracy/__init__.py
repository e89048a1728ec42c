"""Study `accuracy`: error against run time of motion without contact, and what time step a robot needs."""

from __future__ import annotations

from dojo_opt.report.accuracy.study import Accuracy

__all__ = ["Accuracy"]
