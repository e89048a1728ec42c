"""Mechanisms from URDF files: `load_urdf`, and what it says about a file."""

from sim.urdf.load import load_urdf
from sim.urdf.report import Frame, Note, UrdfMechanism, UrdfReport, UrdfWarning
from sim.urdf.xml import UrdfError

__all__ = ["Frame", "Note", "UrdfError", "UrdfMechanism", "UrdfReport", "UrdfWarning", "load_urdf"]
