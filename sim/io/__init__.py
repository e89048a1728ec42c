"""Mechanisms from files."""
