"""The path of a mesh: package://, model://, file://, absolute and relative names, as ROS resolves them."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from pathlib import Path


def find_mesh(name: str, file: Path, mesh_dirs: Sequence[Path]) -> Path | None:
    """The first file that fits a mesh's name; None where there is none.

    Args:
        name: as the robot's file has it. "package://robot/foot.stl" is robot/foot.stl below one of `mesh_dirs`, of the
            folders of ROS_PACKAGE_PATH and AMENT_PREFIX_PATH/share, and of the folders around the file, or foot.stl in
            one of these that is called "robot" itself. Other names are relative to the file, to `mesh_dirs`, and to
            the folders around the file.
        file: that of the robot.
        mesh_dirs: folders that the caller names.

    Returns:
        The path of the mesh.
    """
    for candidate in _candidates(name.replace("\\", "/"), file.resolve(), mesh_dirs):
        if candidate.is_file():
            return candidate
    return None


def _candidates(name: str, file: Path, mesh_dirs: Sequence[Path]) -> Iterator[Path]:
    if name.startswith("file://"):
        yield Path(name.removeprefix("file://"))
        return
    scheme, found, rest = name.partition("://")
    if found and scheme in ("package", "model"):
        package, _, inside = rest.partition("/")
        folders = [*mesh_dirs, *_ros_folders(), *file.parents]
        for folder in folders:
            yield folder / package / inside
            if folder.name == package:
                yield folder / inside
        for folder in folders:  # of a package that was renamed or moved
            yield folder / inside
        return
    for folder in (file.parent, *mesh_dirs, *file.parent.parents):
        yield folder / name


def _ros_folders() -> list[Path]:
    """Folders of packages that the environment names."""
    split = {key: [p for p in os.environ.get(key, "").split(os.pathsep) if p] for key in _VARIABLES}
    return [Path(p) / below for key, below in _VARIABLES.items() for p in split[key]]


_VARIABLES = {"ROS_PACKAGE_PATH": "", "AMENT_PREFIX_PATH": "share"}
