"""No number stands for a column of Model and Data that has a name (sim/model/record_columns.py)."""

from __future__ import annotations

import ast
import inspect
import re
from pathlib import Path

from sim.model import record_columns
from sim.model.layout import CARRY_FIELDS, DATA_FIELDS, MODEL_FIELDS
from solvers.codes import Code

SIM = Path(record_columns.__file__).parents[1]
WIDTHS = {name: shape[-1] for name, shape in {**MODEL_FIELDS, **CARRY_FIELDS, **DATA_FIELDS}.items()}
MATRICES = {name for name, shape in {**MODEL_FIELDS, **CARRY_FIELDS, **DATA_FIELDS}.items() if len(shape) == 2}
COMPONENTS = (1, 3, 4, 6, 9, 36)  # one number, vectors, quaternions, twists and wrenches, matrices of 3 or 6 rows
FRAMES = ("pair_frame", "loop_frame", "pair_place", "pair_relative")  # a rotation, with a point before or behind it
SIDES = ("coupling_body", "couple_live", "gear_dof", "gear_rate")  # of a and of b
PADDED = ("couple_x",)  # one column, in lanes


def _named() -> set[str]:
    """Fields whose columns have names, which the docstrings of the enumerations begin with."""
    enums = [thing for thing in vars(record_columns).values() if inspect.isclass(thing) and issubclass(thing, Code)]
    texts = [inspect.getdoc(thing) or "" for thing in enums if thing is not Code]
    return {name for text in texts for name in re.findall(r"\w+", text.partition(":")[0]) if name in WIDTHS}


def _field(node: ast.expr) -> str | None:
    """The field that an expression is, as data.cone or model.cluster."""
    if isinstance(node, ast.Attribute) and node.attr in WIDTHS:
        return node.attr if re.fullmatch(r"(data|model|work)(\.carry)?|carry", ast.unparse(node.value)) else None
    return None


def _rows(function: ast.FunctionDef) -> dict[str, str]:
    """Local names of rows of fields, `row = data.cone[c]`, and of vectors."""
    out = {}
    for node in ast.walk(function):
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


def numbers_of(source: str) -> list[tuple[str, str]]:
    """(field, subscript) of every column that a function of a source calls by a number."""
    found = []
    for function in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.FunctionDef)):
        rows = _rows(function)
        for node in ast.walk(function):
            if not isinstance(node, ast.Subscript):
                continue
            name, last = _field(node.value), node.slice
            if name in MATRICES:
                last = last.elts[-1] if isinstance(last, ast.Tuple) else ast.Name("a row")
            elif name is None and isinstance(node.value, ast.Name):
                name = rows.get(node.value.id)
            if name and isinstance(last, ast.Constant):
                found.append((name, ast.unparse(node)))
    return found


def test_no_column_with_a_name_is_a_number() -> None:
    named = _named()
    assert {"contact_kin", "cone", "bound", "D", "pair_sizes"} <= named
    source = (
        "def f(data):\n    k = data.contact_kin[c]\n    return k[3] + k[Kin.GAP] + data.bound[c, 1] + data.cone[0, j]"
    )
    assert sorted(numbers_of(source)) == [("bound", "data.bound[c, 1]"), ("contact_kin", "k[3]")]
    wrong, seen = [], 0
    for file in SIM.rglob("*.py"):
        for name, text in numbers_of(file.read_text()):
            seen += 1
            plain = WIDTHS[name] in COMPONENTS or name in SIDES + PADDED or not isinstance(WIDTHS[name], int)
            if name not in FRAMES and (name in named or not plain):
                wrong.append(f"{file.name}: {text}")
    assert seen > 1000 and wrong == []


def loop_numbers_of(source: str) -> list[str]:
    """Subscripts by a number of the arrays of loops over time: settings, goals, and columns of reports."""
    found = []
    for node in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Subscript)):
        name, last = ast.unparse(node.value).split(".")[-1], node.slice
        in_row = isinstance(last, ast.Tuple)
        last = last.elts[-1] if isinstance(last, ast.Tuple) else last
        if name in ("settings", "goal") or (name in ("report", "reports") and in_row):
            found += [ast.unparse(node)] * isinstance(getattr(last, "value", None), int)
    return found


def test_no_setting_and_no_column_of_a_report_is_a_number() -> None:
    """Their names: StepSetting, AccuracyGoal, StepReport."""
    assert loop_numbers_of("settings[1] + line.reports[t, 0] + reports[0] + goal[Goal.END]") == [
        *("settings[1]", "line.reports[t, 0]")
    ]
    rooms = ("integrators", "simulator", "solve", "model")
    files = [SIM / "step.py", *(file for room in rooms for file in (SIM / room).rglob("*.py"))]
    assert [text for file in files for text in loop_numbers_of(file.read_text())] == []


def state_numbers_of(source: str) -> list[str]:
    """Subscripts of states by numbers beyond the first four: columns that state_columns.py names."""
    found = []
    for node in (node for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Subscript)):
        name, last = ast.unparse(node.value).split(".")[-1], node.slice
        last = last.elts[-1] if isinstance(last, ast.Tuple) else last
        ends = (last.lower, last.upper) if isinstance(last, ast.Slice) else (last,)
        numbers = [end.value for end in ends if isinstance(end, ast.Constant) and isinstance(end.value, int)]
        if re.fullmatch(r"z|zs|x|xs|after|states?|start|goal|begin|home|now|first|back|change|contacts", name):
            found += [ast.unparse(node)] * any(number > 3 for number in numbers)
    return found


def test_no_part_of_a_state_is_a_number() -> None:
    found = state_numbers_of("z[..., 6:10] + loop.x[:, 7] + x[3:7] + after[13] + x[:3] + x[nq] + x[2] + goal[JOINTS:]")
    assert sorted(found) == ["after[13]", "loop.x[:, 7]", "x[3:7]", "z[..., 6:10]"]
    files = [file for package in ("sim", "dojo_opt") for file in (SIM.parent / package).rglob("*.py")]
    assert {f"{file.name}: {text}" for file in files for text in state_numbers_of(file.read_text())} == set()


def test_no_size_of_the_second_shape_of_a_pair_is_a_number() -> None:
    """PairSize.B is where they begin."""
    texts = [file.read_text() for file in (SIM / "contact").rglob("*.py")]
    assert [found for text in texts for found in re.findall(r"\bsizes\[[4-7]\]", text)] == []
