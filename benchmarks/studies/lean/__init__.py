"""Omitted terms: what a pendulum saves by the features that it does not have."""

from __future__ import annotations

from benchmarks.studies.lean.lean_study import LeanStudy

__all__ = ["LeanStudy"]
