"""Parameters of terrain: the heights of its grid, by the coefficients of its spline (contact/height_field.py).

A contact feels the ground by three numbers, F, F_x and F_y at its place: dphi = -dF/w - (phi/w^2) grad F.dgrad F, and
the frame turns. Each has a column of dR; the coefficients around the place have shares in the three, so that a step
costs the same for any number of heights. An impact (contact/restitution.py) feels F also where the contact was before:

    dgap = -(e dphi1 + (1 - e) dphi2), which stands in the column of F as dF = w (e dphi1 + (1 - e) dphi2)

From coefficients to heights, outside of kernels: terrain_parameters.py.
"""

from __future__ import annotations

from math import sqrt

from sim.contact.height_field import cell, height_field, weight
from sim.contact.terrain_contact import center
from sim.derivatives.parameters.directions import At
from sim.derivatives.parameters.parameter_jacobian import coordinate_rows
from sim.derivatives.parameters.surface import add_ground_place, is_on_terrain
from sim.dynamics.elimination_panel import clear_columns, column_count, solve_panel
from sim.dynamics.loops.coupling_system import solve_coupling_panel
from sim.model.data import Data
from sim.model.layout import data_view, model_view
from sim.model.model import Model
from sim.model.record_columns import Bounce, Grid, TerrainSize
from sim.model.slots import Slot
from solvers.compiler import Table, kernel, optional
from solvers.rotation import Vec3
from solvers.types import Matrix, Vector


@kernel
def spread(model: Model, k: int, at: Vec3, s: Vec3, X: Matrix, first: int, out: Matrix) -> None:
    """out += the columns of X from `first` on times their derivatives by the coefficients of terrain k.

    Columns F, F_x, F_y of the ground below `at`; where s is not zero, s.(F, F_x, F_y) in that of F only.
    """
    p, size = model.terrain_place[k], model.terrain_size[k]
    start, nx, ny = size[TerrainSize.FIRST], size[TerrainSize.ALONG_X], size[TerrainSize.ALONG_Y]
    C, S = p[Grid.DIRECTION], p[Grid.DIRECTION + 1]
    i, a = cell(p[Grid.DENSITY] * (C * (at[0] - p[Grid.ORIGIN]) + S * (at[1] - p[Grid.ORIGIN + 1])), nx)
    j, b = cell(p[Grid.DENSITY + 1] * (C * (at[1] - p[Grid.ORIGIN + 1]) - S * (at[0] - p[Grid.ORIGIN])), ny)
    for r in range(4):
        u, du, _ = weight(r, a)
        for c in range(4):
            v, dv, _ = weight(c, b)
            f, fs, ft = u * v, p[Grid.DENSITY] * du * v, p[Grid.DENSITY + 1] * u * dv
            fx, fy = C * fs - S * ft, S * fs + C * ft
            if s[0] != 0.0:
                f, fx, fy = s[0] * f + s[1] * fx + s[2] * fy, 0.0, 0.0
            m = start + ny * min(max(i + r, 0), nx - 1) + min(max(j + c, 0), ny - 1)
            for d in range(out.shape[0]):
                out[d, m] += f * X[d, first] + fx * X[d, first + 1] + fy * X[d, first + 2]


@kernel
def spread_earlier(model: Model, data: Data, c: int, configuration: int, X: Matrix, out: Matrix) -> None:
    """The effect of the ground below configuration 1 or 2 on the offset of an impact."""
    k = model.contact_terrain[c] - 1
    b = data.bounce[c]
    weight, phi = (
        (b[Bounce.RESTITUTION], b[Bounce.GAP1]) if configuration == 1 else (1.0 - b[Bounce.RESTITUTION], b[Bounce.GAP2])
    )
    pos, rot = (data.pos1, data.rot1) if configuration == 1 else (data.pos2, data.rot2)
    at = center(model, c, pos, rot)
    _, Fx, Fy, _, _, _ = height_field(model, k, at[0], at[1])
    i = 1.0 / sqrt(1.0 + Fx * Fx + Fy * Fy)
    t = -weight * i / data.contact_frame[c, 2]
    if weight != 0.0:
        spread(model, k, at, (t, t * phi * i * Fx, t * phi * i * Fy), X, 3 * c, out)


@kernel
def spread_contacts(model: Model, data: Data, X: Matrix, out: Matrix) -> None:
    """out (n, ncoefficient) += d/d(coefficients) from the columns X (n, 3 nground) by F, F_x and F_y."""
    for c in range(model.contact_terrain.shape[0]):
        if is_on_terrain(model, data, c):
            at = center(model, c, data.pos3, data.rot3)
            spread(model, model.contact_terrain[c] - 1, at, (0.0, 0.0, 0.0), X, 3 * c, out)
            if data.bounce[c, Bounce.RESTITUTION] > 0.0:
                spread_earlier(model, data, c, 1, X, out)
                spread_earlier(model, data, c, 2, X, out)


@kernel
def height_jacobian(model_at: Table, data_at: Table, at: At, places: Matrix, out: Matrix) -> None:
    """out (2 nv, ncoefficient) += d(next state)/d(coefficients), of the step that `linearize` left in the Data.

    places: (2 nv, 3 nground), the same by F, F_x, F_y of every contact; overwritten.
    """
    model = model_view(model_at)
    data = data_view(data_at)
    width = column_count(model, data)
    first = 0
    while first < places.shape[1]:
        count = min(width, places.shape[1] - first)
        clear_columns(data)
        for m in range(count):
            add_ground_place(model, data, at.h, (first + m) // 3, (first + m) % 3, m)
        solve_panel(model, data)
        solve_coupling_panel(model, data)
        coordinate_rows(model, data, at.h, first, count, places)
        first += width
    spread_contacts(model, data, places, out)


@optional(Slot.ADD_HEIGHT_GRADIENT)
def add_height_gradient(model: Model, data: Data, h: float, y: Vector, places: Matrix, out: Matrix) -> None:
    """out (1, ncoefficient) += y.(-dR/d(coefficients)); places: (1, 3 nground), overwritten."""
    for m in range(places.shape[1]):
        for d in range(data.columns.shape[0]):
            data.columns[d, 0] = 0.0
        add_ground_place(model, data, h, m // 3, m % 3, 0)
        s = 0.0
        for d in range(data.columns.shape[0]):
            s += y[d] * data.columns[d, 0]
        places[0, m] = s
    spread_contacts(model, data, places, out)
