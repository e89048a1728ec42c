"""Viewer: a motion as one HTML file, as a video or a picture, or as it happens."""

from dojo_opt.viewer.animation import save_html
from dojo_opt.viewer.live import Live, live
from dojo_opt.viewer.video import save_picture, save_video

__all__ = ["Live", "live", "save_html", "save_picture", "save_video"]
