"""TriangleMesh: triangles of an STL, OBJ, DAE, PLY or glTF file and their colours; read by trimesh, an extra."""

from __future__ import annotations

import re
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from solvers.types import Floats

EXTRA = 'pip install "dojo-opt[meshes]"'


class MeshError(ValueError):
    """A file that holds no mesh."""


class TriangleMesh(NamedTuple):
    """Triangles in the frame of the file."""

    vertices: Floats  # (n, 3) [m]
    faces: NDArray[np.int64]  # (k, 3)
    colors: Floats | None  # (k, 3) red, green, blue from 0 to 1; None where the file has none


def read_mesh(path: Path) -> TriangleMesh:
    """The triangles of a file; kept until the file changes.

    The unit of a COLLADA file counts, its `up_axis` does not, as in RViz; glTF keeps its own axes. Degenerate triangles
    are left as they are.

    Raises:
        ImportError: trimesh is not installed.
        MeshError: the file cannot be read, or has no triangles.
    """
    return _read(str(path), path.stat().st_mtime_ns)


@lru_cache(maxsize=256)
def _read(path: str, changed: int) -> TriangleMesh:
    del changed  # of the file: part of the key
    try:
        import trimesh
    except ImportError as error:
        raise ImportError(f"meshes need trimesh: {EXTRA}") from error
    try:
        loaded: Any = trimesh.load(path, process=False)
    except Exception as error:  # the readers of trimesh raise whatever their parsers do
        raise MeshError(f"{Path(path).name}: {type(error).__name__}: {error}") from error
    parts = loaded.dump(concatenate=False) if isinstance(loaded, trimesh.Scene) else [loaded]
    parts = [part for part in parts if isinstance(part, trimesh.Trimesh) and len(part.faces)]
    if not parts:
        raise MeshError(f"{Path(path).name}: no triangles")
    starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
    unit = _unit(parts[0].metadata.get("units"))
    vertices = np.concatenate([np.asarray(part.vertices, dtype=np.float64) for part in parts])
    faces = np.concatenate([np.asarray(p.faces, dtype=np.int64) + s for p, s in zip(parts, starts, strict=False)])
    if not np.isfinite(vertices).all():
        raise MeshError(f"{Path(path).name}: a vertex is not finite")
    colors = [_colors(part) for part in parts]
    known = all(c is not None for c in colors)
    return TriangleMesh(unit * vertices, faces, np.concatenate([c for c in colors if c is not None]) if known else None)


def _unit(text: Any) -> float:
    """Metres per unit of a file, as trimesh writes it for COLLADA: "meters" or "0.01 * meters"."""
    found = re.fullmatch(r"([\d.eE+-]+) \* meters", str(text))
    return float(found[1]) if found else 1.0


def _colors(part: Any) -> Floats | None:
    """(k, 3) colours of the faces of one part; None where it has none."""
    kind = getattr(part.visual, "kind", None)
    if kind in ("face", "vertex"):
        return np.asarray(part.visual.face_colors, dtype=np.float64)[:, :3] / 255.0
    material = getattr(part.visual, "material", None)
    if material is None:
        return None
    image = getattr(material, "image", None) or getattr(material, "baseColorTexture", None)
    if image is not None and getattr(part.visual, "uv", None) is not None:
        corners = np.asarray(part.visual.to_color().vertex_colors, dtype=np.float64)[:, :3] / 255.0
        if len(corners) == len(part.vertices):
            return np.asarray(corners[part.faces].mean(axis=1))
    main = np.asarray(material.main_color, dtype=np.float64)[:3] / 255.0
    return np.tile(main, (len(part.faces), 1))
