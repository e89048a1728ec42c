"""Scenes, checks and doubles that tests share with one another, and with benchmarks/."""
