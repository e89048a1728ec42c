"""URDF files of the package example-robot-data, which is not always installed."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, distribution

__all__ = ["has_robots"]


def has_robots() -> bool:
    """Whether the package is installed."""
    try:
        distribution("example-robot-data")
    except PackageNotFoundError:
        return False
    return True
