"""Accuracy of a robot: error against run time, and the settings that it needs."""

from __future__ import annotations

from dojo_opt.report.accuracy.robot_accuracy import RobotAccuracy

__all__ = ["RobotAccuracy"]
