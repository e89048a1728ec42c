"""decompose: a mesh as several convex pieces, by CoACD (the extra `meshes`)."""

from __future__ import annotations

import numpy as np

from sim.io.meshes.triangles import EXTRA, TriangleMesh
from solvers.types import Floats

CONCAVITY = 0.05  # of a piece, relative to the mesh, that CoACD leaves


def decompose(mesh: TriangleMesh) -> list[Floats]:
    """Points (n, 3) of convex pieces that together are close to the mesh (Wei et al. 2022) [m].

    Raises:
        ImportError: CoACD is not installed.
    """
    try:
        import coacd
    except ImportError as error:
        raise ImportError(f'meshes="decompose" needs CoACD: {EXTRA}') from error
    coacd.set_log_level("error")
    # one vertex per place: STL has three per triangle, between which CoACD sees gaps
    vertices, where = np.unique(mesh.vertices, axis=0, return_inverse=True)
    pieces = coacd.run_coacd(coacd.Mesh(vertices, where.ravel()[mesh.faces]), threshold=CONCAVITY, seed=0)
    return [np.asarray(points, dtype=np.float64) for points, _ in pieces]
