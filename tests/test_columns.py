"""No number stands for a column of Model and Data that has a name (sim/model/record_columns.py)."""

from __future__ import annotations

import ast
import inspect
import itertools
import re
from collections.abc import Iterable
from pathlib import Path

from sim.model import record_columns
from sim.model.layout import CARRY_FIELDS, DATA_FIELDS, MODEL_FIELDS
from solvers.codes import Code
from support.modules import Node, files_of, last_name, nodes_of, source_of

SIM = Path(record_columns.__file__).parents[1]
WIDTHS = {name: shape[-1] for name, shape in {**MODEL_FIELDS, **CARRY_FIELDS, **DATA_FIELDS}.items()}
MATRICES = {name for name, shape in {**MODEL_FIELDS, **CARRY_FIELDS, **DATA_FIELDS}.items() if len(shape) == 2}
COMPONENTS = (1, 3, 4, 6, 9, 36)  # one number, vectors, quaternions, twists and wrenches, matrices of 3 or 6 rows
FRAMES = ("pair_frame", "loop_frame", "pair_place", "pair_relative")  # a rotation, with a point before or behind it
SIDES = ("coupling_body", "couple_live", "gear_dof", "gear_rate")  # of a and of b
PADDED = ("couple_x",)  # one column, in lanes
JACOBIANS = ("contact_turn", "pair_turn", "pair_shift")  # (3, 6) each, whose rows are passed
NUMBERED = ("_rate", "earlier_shift", "times_row")  # kernels that take the number of a row of a matrix


def _named() -> set[str]:
    """Fields whose columns have names, which the docstrings of the enumerations begin with."""
    enums = [thing for thing in vars(record_columns).values() if inspect.isclass(thing) and issubclass(thing, Code)]
    texts = [inspect.getdoc(thing) or "" for thing in enums if thing is not Code]
    return {name for text in texts for name in re.findall(r"\w+", text.partition(":")[0]) if name in WIDTHS}


def _field(node: ast.expr) -> str | None:
    """The field that an expression is, as data.cone or model.cluster."""
    if isinstance(node, ast.Attribute) and node.attr in WIDTHS:
        owner = node.value
        if isinstance(owner, ast.Attribute) and owner.attr == "carry":  # data.carry, as carry
            owner = owner.value
        return node.attr if isinstance(owner, ast.Name) and owner.id in ("data", "model", "work", "carry") else None
    return None


def _rows(function: list[ast.AST]) -> dict[str, str]:
    """Local names of rows of fields, `row = data.cone[c]`, and of vectors."""
    out = {}
    for node in function:
        if isinstance(node, ast.Assign):
            pairs = [(target, node.value) for target in node.targets]
            if isinstance(node.targets[0], ast.Tuple) and isinstance(node.value, ast.Tuple):
                pairs = list(zip(node.targets[0].elts, node.value.elts, strict=False))
            for target, value in pairs:
                row = value
                if isinstance(value, ast.Subscript) and not isinstance(value.slice, ast.Tuple | ast.Slice):
                    row = value.value
                name = _field(row)
                if isinstance(target, ast.Name) and name and (row is not value) == (name in MATRICES):
                    out[target.id] = name
    return out


def _passed_numbers(call: ast.Call, rows: dict[str, str]) -> list[tuple[str, str]]:
    """(field, call) where a row is passed with the number of a column, as three(data.cone[c], 3)."""
    if last_name(call.func) in NUMBERED:
        return []
    for row, column in itertools.pairwise(call.args):
        owner = row.value if isinstance(row, ast.Subscript) and not isinstance(row.slice, ast.Tuple) else row
        name = rows.get(row.id) if isinstance(row, ast.Name) else _field(owner)
        if name in MATRICES and name not in JACOBIANS and isinstance(getattr(column, "value", None), int):
            return [(name, ast.unparse(call))]
    return []


def numbers_of(functions: Iterable[ast.FunctionDef]) -> list[tuple[str, str]]:
    """(field, subscript) of every column that a function calls by a number."""
    found = []
    for function in functions:
        parts = list(ast.walk(function))
        rows, own = _rows(parts), {argument.arg for argument in function.args.args} & MATRICES
        for node in parts:
            if isinstance(node, ast.Call):
                found += _passed_numbers(node, rows)
            if not isinstance(node, ast.Subscript):
                continue
            name, last = _field(node.value), node.slice
            passed = isinstance(node.value, ast.Name) and node.value.id in own and isinstance(last, ast.Tuple)
            if passed:  # a matrix under its own name, as hull
                name = ast.unparse(node.value)
            if name in MATRICES:
                last = last.elts[-1] if isinstance(last, ast.Tuple) else ast.Name("a row")
            elif name is None and isinstance(node.value, ast.Name):
                name = rows.get(node.value.id)
            if name and isinstance(last, ast.Constant):
                found.append((name, ast.unparse(node)))
    return found


def _nodes(source: str, kind: type[Node]) -> list[Node]:
    return [node for node in ast.walk(ast.parse(source)) if isinstance(node, kind)]


def test_no_column_with_a_name_is_a_number() -> None:
    named = _named()
    assert {"contact_kin", "cone", "bound", "D", "pair_sizes"} <= named
    source = (
        "def f(data, hull):\n    k = data.contact_kin[c]\n    return k[3] + k[Kin.GAP] + data.bound[c, 1] + data.cone[0, j]"
        " + hull[o, 3] + along(k, 18, e) + along(data.cone[c], Cone.S, e)"
    )
    assert sorted(numbers_of(_nodes(source, ast.FunctionDef))) == [
        ("bound", "data.bound[c, 1]"),
        ("contact_kin", "along(k, 18, e)"),
        ("contact_kin", "k[3]"),
        ("hull", "hull[o, 3]"),
    ]
    wrong, seen = [], 0
    for file in files_of("sim"):
        functions = (f for f in nodes_of(file, ast.FunctionDef) if f.name != "row")  # which reads vectors
        for name, subscript in numbers_of(functions):
            seen += 1
            plain = WIDTHS[name] in COMPONENTS or name in SIDES + PADDED or not isinstance(WIDTHS[name], int)
            if name not in FRAMES and (name in named or not plain):
                wrong.append(f"{file.name}: {subscript}")
    assert seen > 1000 and wrong == []


def loop_numbers_of(subscripts: Iterable[ast.Subscript]) -> list[str]:
    """Subscripts by a number of settings and goals, and of columns of reports and of terms of parameters."""
    found = []
    for node in subscripts:
        name, last = last_name(node.value), node.slice
        in_row = isinstance(last, ast.Tuple)
        last = last.elts[-1] if isinstance(last, ast.Tuple) else last
        if name in ("settings", "goal") or (name in ("report", "reports", "terms") and in_row):
            found += [ast.unparse(node)] * isinstance(getattr(last, "value", None), int)
    return found


def test_no_setting_and_no_column_of_a_report_is_a_number() -> None:
    """Their names: StepSetting, AccuracyGoal, StepReport, ParameterTerm."""
    source = "settings[1] + line.reports[t, 0] + reports[0] + goal[Goal.END] + terms[t, 3]"
    assert sorted(loop_numbers_of(_nodes(source, ast.Subscript))) == [
        "line.reports[t, 0]",
        "settings[1]",
        "terms[t, 3]",
    ]
    rooms = ("integrators", "simulator", "solve", "model", "derivatives")
    files = [SIM / "step.py", *files_of(*(f"sim/{room}" for room in rooms))]
    assert [found for file in files for found in loop_numbers_of(nodes_of(file, ast.Subscript))] == []


def state_numbers_of(subscripts: Iterable[ast.Subscript]) -> list[str]:
    """Subscripts of states by numbers beyond the first four: columns that state_columns.py names."""
    found = []
    for node in subscripts:
        name, last = last_name(node.value), node.slice
        last = last.elts[-1] if isinstance(last, ast.Tuple) else last
        ends = (last.lower, last.upper) if isinstance(last, ast.Slice) else (last,)
        numbers = [end.value for end in ends if isinstance(end, ast.Constant) and isinstance(end.value, int)]
        if re.fullmatch(r"z|zs|x|xs|after|states?|start|goal|begin|home|now|first|back|change|contacts", name):
            found += [ast.unparse(node)] * any(number > 3 for number in numbers)
    return found


def test_no_part_of_a_state_is_a_number() -> None:
    source = "z[..., 6:10] + loop.x[:, 7] + x[3:7] + after[13] + x[:3] + x[nq] + x[2] + goal[JOINTS:]"
    found = state_numbers_of(_nodes(source, ast.Subscript))
    assert sorted(found) == ["after[13]", "loop.x[:, 7]", "x[3:7]", "z[..., 6:10]"]
    files = files_of("sim", "dojo_opt")
    assert {f"{f.name}: {found}" for f in files for found in state_numbers_of(nodes_of(f, ast.Subscript))} == set()


def test_no_size_of_the_second_shape_of_a_pair_is_a_number() -> None:
    """PairSize.B is where they begin."""
    assert [
        found for file in files_of("sim/contact") for found in re.findall(r"\bsizes\[[4-7]\]", source_of(file))
    ] == []
