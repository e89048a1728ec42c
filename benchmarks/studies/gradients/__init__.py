"""Derivatives of one step and of whole motions: error and cost, ours and those of other engines."""

from __future__ import annotations

from benchmarks.studies.gradients.gradients_study import GradientsStudy

__all__ = ["GradientsStudy"]
