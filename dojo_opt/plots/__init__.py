"""Figures. Every function takes the figure or axes to draw on, or makes it, returns it, and shows nothing.

trajectory, gait, closed_loop, study and identification are whole figures; the others are single panels:
`dojo.plots.contact_forces(plan)`.

matplotlib is imported when the first figure is made, without pyplot: no window, no global state.
"""

from dojo_opt.plots.closed_loops import base_height, base_path, closed_loop, study, survival, tick_times, tracking
from dojo_opt.plots.gait import foot_paths, friction_use, gait, gait_diagram, normal_forces
from dojo_opt.plots.identification import identification
from dojo_opt.plots.thumbnail import thumbnail
from dojo_opt.plots.trajectory import contact_forces, controls, paths, state, trajectory, velocities

__all__ = [
    "base_height",
    "base_path",
    "closed_loop",
    "contact_forces",
    "controls",
    "foot_paths",
    "friction_use",
    "gait",
    "gait_diagram",
    "identification",
    "normal_forces",
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
