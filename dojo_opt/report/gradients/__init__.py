"""Study `gradients`: error and cost of derivatives, of one step and of whole motions."""

from __future__ import annotations

from dojo_opt.report.gradients.study import Gradients

__all__ = ["Gradients"]
