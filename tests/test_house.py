"""The rules of the house that a script can check: imports, README, sizes of files."""

from __future__ import annotations

import importlib
import json
import pkgutil
import re
from pathlib import Path

import pytest

import dojo_opt as dojo
from benchmarks import compare
from dojo_opt import cli
from support.programs import HOME, PACKAGES, python

ROOT = Path(__file__).resolve().parent.parent


# -- imports -----------------------------------------------------------------------------------------------------------


def test_import_loads_little_and_leaves_the_heavy_libraries_out() -> None:
    """The time of an import is that of the modules that it loads; `benchmarks/compare.py compile` has the seconds."""
    count, loaded = json.loads(
        python(
            "import json, sys; n = len(sys.modules); import dojo_opt; n = len(sys.modules) - n; "
            "heavy = ('matplotlib', 'meshcat', 'mujoco', 'numba', 'numpy', 'scipy'); "
            "print(json.dumps([n, [m for m in heavy if m in sys.modules]]))"
        )
    )
    assert loaded == []
    assert count < 150  # 80 today, of the standard library; NumPy alone is 170, Numba 1,100


def test_a_simulation_needs_no_plotting_library() -> None:
    program = (
        "import sys, dojo_opt as dojo; sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01); "
        "print([m for m in ('matplotlib', 'meshcat', 'mujoco', 'scipy.optimize') if m in sys.modules])"
    )
    assert python(program).strip() == "[]"


def test_every_public_name_exists() -> None:
    for name in dojo.__all__:
        assert getattr(dojo, name) is not None, name
    assert set(dojo.__all__) <= set(dir(dojo))
    assert dojo.__all__ == sorted(dojo.__all__) and len(dojo.__all__) >= 60


def test_ilqr_stays_a_function_after_its_module_was_imported() -> None:
    assert python("import dojo_opt as d, dojo_opt.problems, dojo_opt.cli; print(callable(d.ilqr))").strip() == "True"


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


PAGES = ("README.md", "docs/guide.md", "docs/numbers.md")


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
            assert name in cli.LOOPS or name.removeprefix("quadruped_") in cli.PROBLEMS
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


@pytest.mark.parametrize("page", ["README.md", "docs/guide.md"])
def test_the_python_of_the_pages_runs(page: str, tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(), flags=re.DOTALL)
    assert blocks
    python("\n".join(blocks), cwd=tmp_path)


def test_the_python_for_jax_runs(tmp_path: Path) -> None:
    pytest.importorskip("jax")
    blocks = re.findall(r"```py\n(.*?)```", (ROOT / "docs/guide.md").read_text(), flags=re.DOTALL)
    assert len(blocks) == 1
    python("import numpy as np, dojo_opt as dojo\n" + blocks[0], cwd=tmp_path)


def test_files_stay_readable() -> None:
    """A file with kernels has about 300 lines, others up to 600; the planner is one file to read."""
    long = {}
    for package in PACKAGES:
        for file in (HOME / package).rglob("*.py"):
            text = file.read_text()
            length = len(text.splitlines())
            if length > (300 if "\n@kernel" in text else 700 if file.name == "ilqr.py" else 600):
                long[file.name] = length
    assert not long


def test_examples_are_short() -> None:
    for script in (ROOT / "examples").glob("*.py"):
        assert len(script.read_text().splitlines()) <= 60, script
