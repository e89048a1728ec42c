"""Mechanisms from MJCF files, read by MuJoCo's own parser: `load_mjcf`, and what it says about a file."""

from sim.mjcf.load import load_mjcf
from sim.mjcf.report import MjcfMechanism, MjcfReport, MjcfWarning

__all__ = ["MjcfMechanism", "MjcfReport", "MjcfWarning", "load_mjcf"]
