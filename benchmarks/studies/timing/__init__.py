"""Microseconds per step, gradient and planner iteration, compared with other engines; and the cold start."""
