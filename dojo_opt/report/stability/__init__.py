"""Stability: stiff and extreme scenes, each with its pass rule."""

from dojo_opt.report.stability.study import Stability

__all__ = ["Stability"]
