"""Stiff and extreme scenes in every engine, each with its pass rule."""

from __future__ import annotations

from benchmarks.studies.stability.stability_study import StabilityStudy

__all__ = ["StabilityStudy"]
