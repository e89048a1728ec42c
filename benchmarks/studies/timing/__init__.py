"""Microseconds per step, gradient and planner iteration, beside other engines; and the cold start."""
