"""Viewer: an animation of a trajectory or a plan as one HTML file."""

from dojo_opt.viewer.animation import save_html

__all__ = ["save_html"]
