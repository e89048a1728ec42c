"""Mechanisms from URDF and MJCF files, with their meshes."""
