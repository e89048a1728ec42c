"""Figures. Every function takes the figure or axes to draw on, returns it, and shows nothing.

matplotlib is imported when the first figure is made, without pyplot: no window, no global state.
"""

from dojo_opt.plots.gait import foot_paths, friction_use, gait, gait_diagram
from dojo_opt.plots.loop import base_path, closed_loop, study, survival, tick_times, tracking
from dojo_opt.plots.thumbnail import thumbnail
from dojo_opt.plots.trajectory import contact_forces, controls, paths, state, trajectory, velocities

__all__ = [
    "base_path",
    "closed_loop",
    "contact_forces",
    "controls",
    "foot_paths",
    "friction_use",
    "gait",
    "gait_diagram",
    "paths",
    "state",
    "study",
    "survival",
    "thumbnail",
    "tick_times",
    "tracking",
    "trajectory",
    "velocities",
]
