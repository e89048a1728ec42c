"""Mechanisms from URDF files: load.py, with reports (report.py) and errors (xml.py) about a file."""
