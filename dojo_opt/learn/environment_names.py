"""Names of the environments in Gymnasium's registry, and the tasks behind them."""

from __future__ import annotations

__all__ = ["TASKS"]

TASKS = {  # name: module and function, steps of an episode
    "HalfCheetah": ("gymnasium_tasks", "half_cheetah", 1000),
    "Hopper": ("gymnasium_tasks", "hopper", 1000),
    "Walker2d": ("gymnasium_tasks", "walker2d", 1000),
    "Ant": ("gymnasium_tasks", "ant", 1000),
    "Humanoid": ("gymnasium_tasks", "humanoid", 1000),
    "Cartpole": ("gymnasium_tasks", "cartpole", 1000),
    "Pendulum": ("gymnasium_tasks", "pendulum", 200),
    "Swimmer": ("swimmer_task", "swimmer", 1000),
    "Quadruped": ("velocity_task", "quadruped", 500),
    "Go2": ("velocity_task", "go2", 500),
    "AntArs": ("dojo_tasks", "ant_ars", 150),
    "QuadrupedSampling": ("dojo_tasks", "quadruped_sampling", 200),
    "QuadrotorWaypoint": ("waypoint_tasks", "quadrotor", 500),
    "UuvWaypoint": ("waypoint_tasks", "uuv", 300),
    "YoubotWaypoint": ("waypoint_tasks", "youbot", 300),
}
