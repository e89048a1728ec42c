"""Mechanisms from URDF files: load.py, and what report.py and xml.py say about a file."""
