"""The kernels of collide.py for tests: called from Python, with a table of polytopes instead of a Model."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from sim.contact.collision import collide as kernels
from sim.contact.collision import cylinder_contacts as cylinder_kernels
from sim.contact.collision.edge_axes import Arrangement
from sim.contact.collision.pair_kernels import KERNELS
from sim.contact.collision.swapped_shapes import exchange_shapes
from sim.model.layout import Sizes, allocate_model, model_view, table
from sim.model.model import Model
from sim.model.shape_kinds import OUT, Pair
from solvers.compiler import Table, kernel, link
from solvers.types import Matrix, Vector


@cache
def _model(rows: int, numbers: bytes) -> tuple[Model, Table]:
    """A Model with this table of polytopes, and the kernels of all pairs."""
    model = allocate_model(Sizes(nbody=0, nq=0, nv=0, ncontact=0, nlimit=0, nu=0, nhull=rows))
    model.hull[:] = np.frombuffer(numbers).reshape(rows, 4)
    for needs in KERNELS.values():
        link(model.optional, *needs)
    link(model.optional, exchange_shapes)
    return model, table(model)


def _at(hull: Matrix) -> Table:
    return _model(len(hull), np.ascontiguousarray(hull).tobytes())[1]


@kernel
def _collide(at: Table, kind: int, feature: int, sizes: Vector, R: Vector, r: Vector, out: Vector) -> None:
    kernels.collide(model_view(at), kind, feature, sizes, R, r, out)


@kernel
def _collide_rows(at: Table, kind: int, feature: int, sizes: Vector, Rs: Matrix, rs: Matrix, out: Matrix) -> None:
    for row in range(out.shape[0]):
        kernels.collide(model_view(at), kind, feature, sizes, Rs[row], rs[row], out[row])


@kernel
def _open_sides(at: Table, kind: int, sizes: Vector, R: Vector, r: Vector) -> int:
    return kernels.open_sides(model_view(at), kind, sizes, R, r)


@kernel
def _apart_at_least(at: Table, kind: int, sizes: Vector, R: Vector, r: Vector) -> float:
    return kernels.apart_at_least(model_view(at), kind, sizes, R, r)


@kernel
def _apart_from_cylinder(at: Table, kind: int, sizes: Vector, R: Vector, r: Vector) -> float:
    return cylinder_kernels.apart_from_cylinder(kind, sizes, model_view(at).hull, R, r)


@kernel
def _arrange(at: Table, kind: int, sizes: Vector, R: Vector, r: Vector, sides: int) -> Arrangement:
    return kernels.arrange(model_view(at), kind, sizes, R, r, sides)


@kernel
def _choose(
    at: Table, kind: int, feature: int, arrangement: Arrangement, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> int:
    return kernels.choose(model_view(at), kind, feature, arrangement, sizes, R, r, out)


@kernel
def _collide_chosen(
    at: Table, kind: int, feature: int, code: int, sizes: Vector, R: Vector, r: Vector, out: Vector
) -> None:
    kernels.collide_chosen(model_view(at), kind, feature, code, sizes, R, r, out)


def collide(kind: int, feature: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> None:
    _collide(_at(hull), kind, feature, sizes, R, r, out)


def collide_rows(kind: int, feature: int, sizes: Vector, hull: Matrix, Rs: Matrix, rs: Matrix) -> Matrix:
    """The contacts (n, OUT) at poses: rotations Rs (n, 9) and positions rs (n, 3) of b in the frame of a."""
    out = np.empty((len(rs), OUT))
    _collide_rows(_at(hull), kind, feature, sizes, np.ascontiguousarray(Rs), np.ascontiguousarray(rs), out)
    return out


def open_sides(kind: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> int:
    return int(_open_sides(_at(hull), kind, sizes, R, r))


def apart_at_least(kind: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector) -> float:
    bound = _apart_from_cylinder if kind >= Pair.POLYTOPE_CYLINDER else _apart_at_least
    return float(bound(_at(hull), kind, sizes, R, r))


def arrange(kind: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, sides: int) -> Any:
    return _arrange(_at(hull), kind, sizes, R, r, sides)


def choose(kind: int, feature: int, faces: Any, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector) -> int:
    return int(_choose(_at(hull), kind, feature, faces, sizes, R, r, out))


def collide_chosen(
    kind: int, feature: int, code: int, sizes: Vector, hull: Matrix, R: Vector, r: Vector, out: Vector
) -> None:
    _collide_chosen(_at(hull), kind, feature, code, sizes, R, r, out)
