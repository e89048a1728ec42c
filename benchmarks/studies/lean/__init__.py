"""Omitted terms: time that a pendulum saves by its missing features."""

from __future__ import annotations

from benchmarks.studies.lean.lean_study import LeanStudy

__all__ = ["LeanStudy"]
