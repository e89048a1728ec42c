"""Error against run time without contact, of every engine, against references in continuous time."""

from __future__ import annotations

from benchmarks.studies.accuracy.accuracy_study import AccuracyStudy

__all__ = ["AccuracyStudy"]
