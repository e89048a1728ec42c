"""Study `mechanics`: every joint kind, pair of shapes and parameter against what it should do."""

from __future__ import annotations

from dojo_opt.report.mechanics.study import Mechanics

__all__ = ["Mechanics"]
