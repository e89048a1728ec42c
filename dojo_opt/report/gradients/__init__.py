"""Derivatives of a robot: error and cost of (A, B) of one step."""

from __future__ import annotations

from dojo_opt.report.gradients.robot_gradients import RobotGradients

__all__ = ["RobotGradients"]
