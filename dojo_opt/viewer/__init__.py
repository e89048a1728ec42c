"""Viewer: a motion as one HTML file, or as it happens."""

from dojo_opt.viewer.animation import save_html
from dojo_opt.viewer.live import Live, live

__all__ = ["Live", "live", "save_html"]
