"""Heights of the terrains of a mechanism as parameters: their list, and gradients by them.

They stand in a row, terrain after terrain in the order of the contacts, each like heights.ravel(). Kernels know the
coefficients of one surface per terrain and radius (pack.py); their gradient is mapped to the heights here, all
heights at once, so the lists of residual_columns.py have no terms for them.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from sim.derivatives.parameters.directions import Effect
from sim.derivatives.parameters.parameter import Parameter
from sim.mechanism.mechanism import Mechanism
from sim.mechanism.pack import height_fields
from sim.mechanism.terrain import Terrain
from solvers.types import Floats


def terrains(mech: Mechanism) -> dict[str, Terrain]:
    """The terrains by their names; several of one name are numbered."""
    found = {id(c.terrain): c.terrain for c in mech.contacts if c.terrain is not None}
    named: dict[str, Terrain] = {}
    for terrain in found.values():
        name, k = terrain.name, 0
        while name in named:
            k += 1
            name = f"{terrain.name}_{k}"
        named[name] = terrain
    return named


def terrain_parameters(mech: Mechanism) -> Iterator[Parameter]:
    """terrain:name[i,j], or [i] where the ground is the same for all y."""
    first = 0
    for name, terrain in terrains(mech).items():
        heights = np.asarray(terrain.heights)
        for k, ((i, j), height) in enumerate(np.ndenumerate(heights)):
            label = f"{i},{j}" if heights.shape[1] > 1 else str(i)
            yield Parameter("terrain", name, label, float(height), ((Effect.TERRAIN, first + k, 0, 1.0),))
        first += heights.size


def height_gradients(mech: Mechanism, rows: Floats) -> Floats:
    """(n, nheight) gradients by the heights of all terrains, from those by the coefficients in the Model, (n, ...)."""
    known = list(terrains(mech).values())
    parts = [np.zeros((len(rows), *terrain.shape)) for terrain in known]
    ids = [id(terrain) for terrain in known]
    first = 0
    for (terrain, radius), surface in height_fields(mech).items():
        size = surface.coefficients.size
        k = ids.index(terrain)
        parts[k] += known[k].height_gradient(radius, rows[:, first : first + size])
        first += size
    return np.concatenate([part.reshape(len(rows), -1) for part in parts], axis=1)
