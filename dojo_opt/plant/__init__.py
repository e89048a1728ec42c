"""Plants: simulators that differ from a controller's model, closed loops with them, and Monte Carlo runs.

The environment for reinforcement learning is dojo_opt/learn/environment.py.
"""
