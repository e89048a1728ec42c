"""The terms that a step of a robot omits, and the cost of each of its features."""

from __future__ import annotations

from dojo_opt.report.lean.omitted_terms import OmittedTerms

__all__ = ["OmittedTerms"]
