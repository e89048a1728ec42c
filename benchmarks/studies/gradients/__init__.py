"""Derivatives of one step and of whole motions: error and cost, for ours and for other engines."""

from __future__ import annotations

from benchmarks.studies.gradients.gradients_study import GradientsStudy

__all__ = ["GradientsStudy"]
