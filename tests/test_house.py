"""The rules of the house that a script can check: imports, README, sizes of files."""

from __future__ import annotations

import ast
import dataclasses
import functools
import importlib
import inspect
import json
import pkgutil
import re
import textwrap
from collections.abc import Iterator
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest

import dojo_opt as dojo
from benchmarks import compare
from dojo_opt import __main__ as cli
from dojo_opt.gaits.feet import Feet
from dojo_opt.models.catalog import Entry
from dojo_opt.mpc.moving_reference import References
from dojo_opt.mpc.policy import Policy
from dojo_opt.mpc.settings import MPCSettings
from dojo_opt.plant import monte_carlo, tick
from dojo_opt.viewer.motion import Motion
from sim.io.mjcf import report as mjcf_report
from sim.io.urdf import report as urdf_report
from support.fork_server import forked
from support.modules import files_of, nodes_of, source_of
from support.programs import PACKAGES, python

ROOT = Path(__file__).resolve().parent.parent


# -- imports -----------------------------------------------------------------------------------------------------------


def test_import_loads_little_and_leaves_the_heavy_libraries_out() -> None:
    """The modules that an import loads determine its time; `benchmarks/compare.py compile` has the seconds."""
    count, loaded = json.loads(
        python(
            "import json, sys; n = len(sys.modules); import dojo_opt; n = len(sys.modules) - n; "
            "heavy = ('matplotlib', 'meshcat', 'mujoco', 'numba', 'numpy', 'scipy'); "
            "print(json.dumps([n, [m for m in heavy if m in sys.modules]]))"
        )
    )
    assert loaded == []
    assert count < 150  # 80 today, of the standard library; NumPy alone is 170, Numba 1,100


def test_a_problem_needs_no_plotting_library_and_little_of_scipy() -> None:
    program = (
        "import sys, dojo_opt as dojo; dojo.problems.hop(); "
        "print([m for m in ('matplotlib', 'meshcat', 'mujoco', 'scipy.optimize', 'scipy.spatial') if m in sys.modules])"
    )
    assert forked(program).strip() == "[]"


def test_every_public_name_exists() -> None:
    for name in dojo.__all__:
        assert getattr(dojo, name) is not None, name
    assert set(dojo.__all__) <= set(dir(dojo))
    assert dojo.__all__ == sorted(dojo.__all__) and len(dojo.__all__) >= 60


def test_ilqr_stays_a_function_after_its_module_was_imported() -> None:
    assert (
        forked("import dojo_opt as d, dojo_opt.problems, dojo_opt.__main__; print(callable(d.ilqr))").strip() == "True"
    )


def test_an_unknown_name_is_refused_with_the_known_ones() -> None:
    with pytest.raises(AttributeError, match="no attribute 'Simulater'.*Simulator"):
        _ = dojo.Simulater


@pytest.mark.parametrize("name", ["sim", "solvers"])
@pytest.mark.parametrize("kind", ["module", "package"])
def test_a_foreign_package_in_the_way_is_named(tmp_path: Path, name: str, kind: str) -> None:
    foreign = tmp_path / f"{name}.py" if kind == "module" else tmp_path / name / "__init__.py"
    foreign.parent.mkdir(exist_ok=True)
    foreign.write_text("")
    program = "try:\n import dojo_opt\nexcept ImportError as error:\n print(error)"
    message = python(program, cwd=tmp_path)
    assert str(foreign) in message
    assert f"needs its own package '{name}'" in message


def test_every_module_can_be_imported() -> None:
    for package in PACKAGES:
        root = importlib.import_module(package)
        for module in pkgutil.walk_packages(root.__path__, f"{package}."):
            if not module.name.endswith("__main__"):
                importlib.import_module(module.name)


# -- README and sizes --------------------------------------------------------------------------------------------------


PAGES = ("README.md", *sorted(str(p.relative_to(ROOT)) for p in (ROOT / "docs").rglob("*.md")))


def test_commands_of_the_pages_exist() -> None:
    text = "\n".join((ROOT / page).read_text() for page in PAGES)
    for script in re.findall(r"python ((?:examples|benchmarks)/\w+\.py)", text):
        assert (ROOT / script).is_file(), script
    commands = re.findall(r"(?:python -m dojo_opt|dojo-opt) (run|report|models|show|warmup) ?(\w+)?", text)
    assert commands
    for command, name in commands:
        if command == "report":
            assert name == "all" or name in dojo.report.STUDIES
        if command == "run":
            assert name in (*cli.LOOPS, *cli.SUITES) or name.removeprefix("quadruped_") in cli.PROBLEMS
    compared = re.findall(r"benchmarks/compare\.py (\w+)", text)
    assert set(compared) <= {"all", *compare.STUDIES} and "timing" in compared


@pytest.mark.parametrize("page", PAGES)
def test_links_between_pages_lead_somewhere(page: str) -> None:
    for target, section in re.findall(r"\]\(([\w./-]*)(?:#([\w-]*))?\)", (ROOT / page).read_text()):
        file = (ROOT / page).parent / target if target else ROOT / page
        assert file.is_file(), target
        if section:
            titles = re.findall(r"^#+ (.*)$", file.read_text(), flags=re.MULTILINE)
            assert section in [re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles], section


@pytest.mark.parametrize("page", ["README.md", pytest.param("docs/guide.md", marks=pytest.mark.slow)])
def test_the_python_of_the_pages_runs(page: str, tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), flags=re.DOTALL)
    assert blocks
    python("\n".join(blocks), cwd=tmp_path)


@pytest.mark.parametrize("library", ["trimesh", pytest.param("jax", marks=pytest.mark.slow)])
def test_the_python_of_the_guide_that_needs_an_extra_runs(library: str, tmp_path: Path) -> None:
    """Such a block is marked py, and imports the library of the extra."""
    pytest.importorskip(library)
    blocks = re.findall(r"```py\n(.*?)```", (ROOT / "docs/guide.md").read_text(), flags=re.DOTALL)
    (block,) = [block for block in blocks if re.search(rf"^import {library}$", block, flags=re.MULTILINE)]
    assert len(blocks) == 2
    python("from pathlib import Path\nimport numpy as np, dojo_opt as dojo\n" + block, cwd=tmp_path)


@pytest.mark.parametrize("package", [*PACKAGES, "benchmarks", "examples", "docs"])
def test_prose_has_nouns_for_clauses(package: str) -> None:
    """At most 1.6 "what" in 1000 lines, names of variables included: 10 was the dialect, 0 to 1.6 are our models."""
    texts = [source_of(file) for file in files_of(package)]
    lines = sum(len(source.splitlines()) for source in texts)
    assert 1000 * sum(len(re.findall(r"\bwhat\b", source, re.IGNORECASE)) for source in texts) <= 1.6 * lines


KERNEL_MARKS = ("kernel", "jit", "inner_kernel", "parallel_kernel", "local_kernel", "inlined", "optional")


@pytest.mark.parametrize("package", PACKAGES)
def test_docstrings_begin_with_a_noun(package: str) -> None:
    """An editor shows a docstring by itself, where "Those of both" means nothing."""
    pronouns = re.compile(r'"""(Those|That of)\b')
    found = [str(file) for file in files_of(package) if pronouns.search(source_of(file))]
    assert found == []


def test_files_stay_readable() -> None:
    """A file with kernels has about 300 lines, others up to 600."""
    long = {}
    for file in files_of(*PACKAGES):
        length = len(source_of(file).splitlines())
        if length > (300 if re.search(rf"^@({'|'.join(KERNEL_MARKS)})\b", source_of(file), re.MULTILINE) else 600):
            long[file.name] = length
    assert not long


def test_functions_are_short() -> None:
    """Kernels have at most 45 lines after the docstring and 8 arguments, other functions at most 60 lines."""
    long, seen = [], 0
    for path in files_of(*PACKAGES):
        for node in nodes_of(path, ast.FunctionDef):
            marks = {ast.unparse(mark).partition("(")[0] for mark in node.decorator_list}
            body = node.body[1:] if isinstance(node.body[0], ast.Expr) else node.body
            lines = (node.end_lineno or 0) - body[0].lineno + 1 if body else 0
            is_kernel = not marks.isdisjoint(KERNEL_MARKS)
            seen += is_kernel
            if lines > (45 if is_kernel else 60) or (is_kernel and len(node.args.args) > 8):
                long.append(f"{path}:{node.name}: {lines} lines, {len(node.args.args)} arguments")
    assert seen > 500 and not long, long


def test_examples_are_short() -> None:
    for script in (ROOT / "examples").glob("*.py"):
        assert len(script.read_text().splitlines()) <= 60, script


# -- docstrings --------------------------------------------------------------------------------------------------------

# classes that users get from the public names, or with fields that are keywords of these
REACHED = (
    *(Entry, Feet, MPCSettings, Motion, Policy, References, tick.Tick),
    *(monte_carlo.MonteCarlo, monte_carlo.MonteCarloRun),
    *(mjcf_report.MjcfReport, urdf_report.UrdfReport, urdf_report.LinkFrame, urdf_report.Note),
)
UNDOCUMENTED = ("dojo.Environment",)  # its methods are Gymnasium's, with the arguments that are described there


def public_objects() -> Iterator[tuple[str, Any]]:
    """Every function, class, method and property that the public names lead to, with its name."""
    seen: set[int] = set()
    todo = [(f"dojo.{name}", getattr(dojo, name)) for name in dojo.__all__]
    todo += [(cls.__name__, cls) for cls in REACHED]
    while todo:
        name, thing = todo.pop()
        if isinstance(thing, ModuleType):
            todo += [(f"{name}.{key}", getattr(thing, key)) for key in getattr(thing, "__all__", ())]
        elif callable(thing) and _is_ours(thing) and id(thing) not in seen:
            seen.add(id(thing))
            yield name, thing
            for key in dir(thing) if inspect.isclass(thing) else ():
                member = inspect.getattr_static(thing, key)
                described = isinstance(member, property | functools.cached_property) or inspect.isroutine(member)
                if not key.startswith("_") and described and _is_ours(_owner(thing, key)):
                    yield f"{name}.{key}", member if not inspect.isroutine(member) else getattr(thing, key)


def _is_ours(thing: Any) -> bool:
    return str(getattr(thing, "__module__", "")).startswith(PACKAGES)


def _owner(cls: type, key: str) -> type:
    """The class that defines a member."""
    return next(c for c in cls.__mro__ if key in vars(c))


def _sections(thing: Any) -> dict[str, list[str]]:
    """Names that are described in each section of a docstring."""
    found = re.findall(
        r"^(Args|Attributes|Returns|Raises):\n((?:    .*\n|\n)*)", f"{inspect.getdoc(thing)}\n", flags=re.MULTILINE
    )
    return {title: re.findall(r"^    \*{0,2}(\w+):", text, flags=re.MULTILINE) for title, text in found}


def _undescribed(thing: Any) -> list[str]:
    """Gaps in the docstring of a function, a class or a property."""
    if not inspect.getdoc(thing):
        return ["docstring"]
    if isinstance(thing, property | functools.cached_property):
        return []
    if not inspect.isclass(thing):
        return [*_undescribed_arguments(thing, thing), *_undescribed_result(thing)]
    if dataclasses.is_dataclass(thing):
        fields = [field.name for field in dataclasses.fields(thing)]
    elif "_fields" in vars(thing):
        fields = thing._fields
    else:
        constructed = _is_ours(_owner(thing, "__init__")) and not getattr(thing, "_is_protocol", False)
        documented = constructed and not issubclass(thing, BaseException)
        return _undescribed_arguments(thing, thing.__init__) if documented else []
    known = {name for cls in thing.__mro__ for name in _sections(cls).get("Attributes", ())}
    return [f"field {name}" for name in fields if name not in known]


def _undescribed_arguments(thing: Any, function: Any) -> list[str]:
    """Gaps in the arguments and errors of a function, which the docstring of `thing` describes."""
    sections = _sections(thing)
    names = [name for name in inspect.signature(function).parameters if name not in ("self", "cls")]
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    raises = any(isinstance(node, ast.Raise) for node in ast.walk(tree)) and "Raises" not in sections
    return [f"Args {names}"] * (names != sections.get("Args", [])) + ["Raises"] * raises


def _undescribed_result(function: Any) -> list[str]:
    result = inspect.signature(function).return_annotation
    return ["Returns"] * (result not in (None, "None") and "Returns" not in _sections(function))


def test_everything_public_is_described() -> None:
    """A docstring names all arguments in their order, the result, and the errors that the function itself raises."""
    found = dict(public_objects())
    assert len(found) > 300 and len(UNDOCUMENTED) <= 5
    missing = {name: _undescribed(thing) for name, thing in found.items() if not name.startswith(UNDOCUMENTED)}
    assert {name: things for name, things in missing.items() if things} == {}


def test_the_check_of_docstrings_finds_gaps() -> None:
    def stale(a: float, b: float) -> float:
        """Add.

        Args:
            b: second number.
            a: first number.
        """
        if a < 0.0:
            raise ValueError
        return a + b

    @dataclasses.dataclass
    class Half:
        """A pair.

        Attributes:
            one: first number.
        """

        one: float
        other: float

    assert _undescribed(stale) == ["Args ['a', 'b']", "Raises", "Returns"]
    assert _undescribed(Half) == ["field other"]
    assert _undescribed(lambda: 0) == ["docstring"]
