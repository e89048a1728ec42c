"""The flat buffers match the declarations of the NamedTuples, for compiled code and for Python alike."""

from __future__ import annotations

import inspect
import re
from pathlib import Path

import numpy as np
import pytest

from sim.integrators.rollout import begin
from sim.model.data import Carry, Data
from sim.model.layout import (
    CARRY_FIELDS,
    DATA_FIELDS,
    INTEGERS,
    MODEL_FIELDS,
    Sizes,
    allocate_data,
    allocate_model,
    allocate_tables,
    data_view,
    model_view,
    sizes_of,
    table,
)
from sim.model.model import Model
from sim.solve.globalization import ATTEMPTS
from solvers.compiler import Table, kernel
from support.records import arrays_of

ALL = Sizes(nbody=3, nq=8, nv=7, ncontact=2, nlimit=4, nu=5, nstage=4)
BARE = Sizes(nbody=1, nq=1, nv=1, ncontact=0, nlimit=0, nu=0)


def declared_shapes(cls: type) -> dict[str, list[str] | None]:
    """Shapes as the comments of model.py and work.py state them; None where there is no comment."""
    text = Path(inspect.getfile(cls)).read_text().split(f"class {cls.__name__}(NamedTuple)")[1].split("\nclass ")[0]
    shapes: dict[str, list[str] | None] = {}
    for name, comment in re.findall(r"^    (\w+): \w+(.*)$", text, re.MULTILINE):
        stated = re.search(r"# \(([^)]*)\)", comment)
        shapes[name] = [re.sub(r"[ *]", "", n) for n in stated[1].split(",") if n.strip()] if stated else None
    return shapes


@pytest.mark.parametrize(("cls", "table"), [(Model, MODEL_FIELDS), (Carry, CARRY_FIELDS), (Data, DATA_FIELDS)])
def test_table_matches_declaration(cls: type, table: dict[str, tuple[int | str, ...]]) -> None:
    stated = declared_shapes(cls)
    assert set(table) == set(stated) - {"carry"}
    for name, shape in table.items():
        written = stated[name]
        assert written is None or written == [str(n).replace("nx", "nq+nv") for n in shape], name


@pytest.mark.parametrize(("cls", "table"), [(Model, MODEL_FIELDS), (Carry, CARRY_FIELDS), (Data, DATA_FIELDS)])
def test_kind_matches_annotation(cls: type, table: dict[str, tuple[int | str, ...]]) -> None:
    kinds = {(True, 1): "Integers", (True, 2): "IntegerMatrix", (False, 1): "Vector", (False, 2): "Matrix"}
    for name, shape in table.items():
        integer = name in INTEGERS
        assert cls.__annotations__[name].__forward_arg__ == kinds[integer, len(shape)], name


@pytest.mark.parametrize("sizes", [ALL, BARE])
def test_fields_do_not_overlap(sizes: Sizes) -> None:
    model, work = allocate_model(sizes), allocate_data(sizes)
    assert sizes_of(allocate_model(sizes))._replace(nq=sizes.nq) == sizes
    for record in (model, work):
        for name, value in arrays_of(record).items():
            value[...] += 1
            assert np.all(value == 1), f"{name} overlaps another field"


@kernel
def _mark_model(model_at: Table) -> None:
    m = model_view(model_at)
    for i in range(m.body_parent.shape[0]):
        m.body_parent[i] = 10 + i
        for k in range(9):
            m.body_inertia[i, k] = 100 * i + k
    for d in range(m.dof_rest.shape[0]):
        m.dof_rest[d] = -1.0 - d
    for c in range(m.contact_frame.shape[0]):
        m.contact_law[c] = 2
        m.contact_frame[c, 8] = 3.0
    m.gravity[2] = -9.81


@kernel
def _mark_work(data_at: Table) -> int:
    w = data_view(data_at)
    for i in range(w.pos3.shape[0]):
        w.pos3[i, 2] = 5.0 + i
    for k in range(6):
        w.carry.external[0, k] = 7.0 + k
    for r in range(w.panel.shape[0]):
        for k in range(w.panel.shape[1]):
            w.panel[r, k] = r + 0.5 * k
    return int(w.columns.shape[1]) * 1000 + int(w.A3.shape[0])


@pytest.mark.parametrize("sizes", [ALL, BARE])
def test_compiled_views_agree_with_python(sizes: Sizes) -> None:
    model = allocate_model(sizes)
    _mark_model(table(model))
    assert model.body_parent.tolist() == [10 + i for i in range(sizes.nbody)]
    np.testing.assert_array_equal(model.body_inertia, 100 * np.arange(sizes.nbody)[:, None] + np.arange(9))
    np.testing.assert_array_equal(model.dof_rest, -1.0 - np.arange(sizes.nv))
    assert model.contact_law.tolist() == [2] * sizes.ncontact and model.gravity[2] == -9.81

    work = allocate_data(sizes)
    assert _mark_work(table(work)) == 1000 * work.columns.shape[1] + sizes.nbody
    np.testing.assert_array_equal(work.carry.external[0], 7.0 + np.arange(6))
    np.testing.assert_array_equal(work.pos3[:, 2], 5.0 + np.arange(sizes.nbody))
    np.testing.assert_array_equal(
        work.panel, np.arange(6 * sizes.nbody)[:, None] + 0.5 * np.arange(work.panel.shape[1])
    )


@pytest.mark.parametrize("sizes", [ALL, BARE])
def test_python_reads_the_same_arrays(sizes: Sizes) -> None:
    work = allocate_data(sizes)
    for k, array in enumerate(arrays_of(work).values()):
        array[...] = k
    seen = data_view(table(work))
    assert isinstance(seen.carry, Carry)
    for mine, theirs in zip(arrays_of(work).values(), arrays_of(seen).values(), strict=True):
        assert theirs.shape == mine.shape and theirs.dtype == mine.dtype
        np.testing.assert_array_equal(theirs, mine)


@kernel
def _begin(data_at: Table) -> None:
    begin(data_view(data_at))


def test_a_motion_begins_without_the_state_of_the_one_before() -> None:
    work = allocate_data(ALL._replace(nrow=3, ndry=2))
    for array in arrays_of(work).values():
        array[...] = 7
    _begin(table(work))
    cleared = {name for name, array in arrays_of(work).items() if array.size and not array.any()}
    assert cleared == set(Carry._fields) - {"external"}  # which every step sets


@pytest.mark.parametrize("sizes", [ALL, BARE])
def test_no_two_fields_share_memory(sizes: Sizes) -> None:
    """The compiler counts on it: what is written to one field leaves all others as they were."""
    ranges, one = [], allocate_data(sizes)
    tables, frames = allocate_tables(sizes, 3)
    many = [data_view(words) for words in tables]
    for arrays in map(arrays_of, (one, allocate_model(sizes), *many)):
        ranges += [(a.ctypes.data, a.ctypes.data + a.nbytes) for a in arrays.values() if a.size]
    for data, frame in zip(many, frames, strict=True):
        assert [a.shape for a in arrays_of(data).values()] == [a.shape for a in arrays_of(one).values()]
        assert data.contact_frame.size == 0 or data.contact_frame.ctypes.data == frame.ctypes.data
    ranges.sort()
    assert len(ranges) > 100
    assert all(end <= start for (_, end), (start, _) in zip(ranges[:-1], ranges[1:], strict=True))


def test_each_start_strategy_has_a_count() -> None:
    assert allocate_data(ALL).strategy_solves.shape[0] >= ATTEMPTS
