"""Sliding, sticking, impact and rest in every engine, against analytic answers."""

from __future__ import annotations

from benchmarks.studies.contact.contact_study import ContactStudy

__all__ = ["ContactStudy"]
