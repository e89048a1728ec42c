"""Stability of a robot: trials with a pass rule, at time steps of 1 to 50 ms."""

from __future__ import annotations

from dojo_opt.report.stability.robot_stability import RobotStability

__all__ = ["RobotStability"]
