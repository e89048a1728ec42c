"""Mechanisms from MJCF files, read by MuJoCo's own parser: `load_mjcf`, and its report about a file."""

from sim.io.mjcf.load import load_mjcf
from sim.io.mjcf.report import MjcfMechanism, MjcfReport, MjcfWarning

__all__ = ["MjcfMechanism", "MjcfReport", "MjcfWarning", "load_mjcf"]
