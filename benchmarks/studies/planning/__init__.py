"""Cost and violation of plans against run time, compared with a planner on MuJoCo."""

from __future__ import annotations

from benchmarks.studies.planning.planning_study import PlanningStudy

__all__ = ["PlanningStudy"]
