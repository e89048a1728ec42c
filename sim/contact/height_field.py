"""Height fields: ground z = F(x, y) as a uniform cubic B-spline, twice continuously differentiable.

Between the grid lines i and i + 1, at the fraction t, F is the sum of four coefficients times

    (1 - t)^3/6,   (3 t^3 - 6 t^2 + 4)/6,   (-3 t^3 + 3 t^2 + 3 t + 1)/6,   t^3/6

along either direction; one row of coefficients lies outside of the grid on every side. Beyond it all coefficients are
those of the edge: the ground becomes level within three cells.

Columns of terrain_place: Grid of sim/model/record_columns.py.
"""

from __future__ import annotations

from math import floor

from sim.model.model import Model
from sim.model.record_columns import Grid, TerrainSize
from solvers.compiler import kernel
from solvers.rotation import Vec3
from solvers.types import Vector


@kernel
def weight(r: int, t: float) -> Vec3:
    """Weight of coefficient r of four at the fraction t of a cell, and its first and second derivative."""
    u = 1.0 - t
    if r == 0:
        return u * u * u / 6.0, -0.5 * u * u, u
    if r == 1:
        return (4.0 + t * t * (3.0 * t - 6.0)) / 6.0, t * (1.5 * t - 2.0), 3.0 * t - 2.0
    if r == 2:
        return (4.0 + u * u * (3.0 * u - 6.0)) / 6.0, -u * (1.5 * u - 2.0), 3.0 * u - 2.0
    return t * t * t / 6.0, 0.5 * t * t, t


@kernel
def cell(s: float, count: int) -> tuple[int, float]:
    """First coefficient of four, and the fraction of the cell, at the grid coordinate s."""
    s = min(max(s, -4.0), count + 2.0)  # beyond, nothing changes
    i = floor(s)
    return int(i), s - i


@kernel
def height_field(model: Model, k: int, x: float, y: float) -> tuple[float, float, float, float, float, float]:
    """(F, F_x, F_y, F_xx, F_xy, F_yy) of field k at the place (x, y), world axes."""
    return field_values(model, model.terrain_heights, k, x, y)


@kernel
def field_values(
    model: Model, coefficients: Vector, k: int, x: float, y: float
) -> tuple[float, float, float, float, float, float]:
    """(F, F_x, F_y, F_xx, F_xy, F_yy) of field k at (x, y) with other coefficients on its grid."""
    p, size = model.terrain_place[k], model.terrain_size[k]
    first, nx, ny = size[TerrainSize.FIRST], size[TerrainSize.ALONG_X], size[TerrainSize.ALONG_Y]
    C, S = p[Grid.DIRECTION], p[Grid.DIRECTION + 1]
    i, a = cell(p[Grid.DENSITY] * (C * (x - p[Grid.ORIGIN]) + S * (y - p[Grid.ORIGIN + 1])), nx)
    j, b = cell(p[Grid.DENSITY + 1] * (C * (y - p[Grid.ORIGIN + 1]) - S * (x - p[Grid.ORIGIN])), ny)
    f, fs, ft, fss, fst, ftt = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for r in range(4):
        row = first + ny * min(max(i + r, 0), nx - 1)
        q, qt, qtt = 0.0, 0.0, 0.0
        for c in range(4):
            z = coefficients[row + min(max(j + c, 0), ny - 1)]
            w, dw, ddw = weight(c, b)
            q, qt, qtt = q + w * z, qt + dw * z, qtt + ddw * z
        w, dw, ddw = weight(r, a)
        f, ft, ftt = f + w * q, ft + w * qt, ftt + w * qtt
        fs, fst = fs + dw * q, fst + dw * qt
        fss += ddw * q
    fs, ft = p[Grid.DENSITY] * fs, p[Grid.DENSITY + 1] * ft
    a, b = p[Grid.DENSITY], p[Grid.DENSITY + 1]
    fss, fst, ftt = a * a * fss, a * b * fst, b * b * ftt
    return (
        f,
        C * fs - S * ft,
        S * fs + C * ft,
        C * C * fss - 2.0 * C * S * fst + S * S * ftt,
        C * S * (fss - ftt) + (C * C - S * S) * fst,
        S * S * fss + 2.0 * C * S * fst + C * C * ftt,
    )
