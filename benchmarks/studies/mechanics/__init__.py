"""Joint kinds, pairs of shapes and parameters, each against an independent answer."""

from __future__ import annotations

from benchmarks.studies.mechanics.mechanics_study import MechanicsStudy

__all__ = ["MechanicsStudy"]
