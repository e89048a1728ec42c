"""The rules of the house that a script can check: imports, cache, kernels, command line, README."""

from __future__ import annotations

import importlib
import json
import os
import pkgutil
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from dojo_opt import cli
from dojo_opt.report.result import Report, Row

PACKAGES = ("dojo_opt", "sim", "solvers")
HOME = Path(dojo.__file__).resolve().parent.parent  # where the three packages are: the source tree, or an installation
ROOT = Path(__file__).resolve().parent.parent


def python(program: str, *, cwd: Path | None = None, home: Path = HOME, **environment: str) -> str:
    """Output of `program` in a new process that finds the packages below `home`."""
    path = os.pathsep.join([str(home)] if cwd is None else [str(cwd), str(home)])
    done = subprocess.run(
        [sys.executable, "-W", "error", "-c", program],
        env={**os.environ, "PYTHONPATH": path, "PYTHONSAFEPATH": "1", **environment},
        cwd=cwd,
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


# -- imports -----------------------------------------------------------------------------------------------------------


def test_import_is_quick_and_leaves_the_heavy_libraries_out() -> None:
    seconds, loaded = json.loads(
        python(
            "import json, sys, time; t = time.process_time(); import dojo_opt; t = time.process_time() - t; "
            "print(json.dumps([t, [m for m in ('matplotlib', 'meshcat', 'mujoco', 'numba') if m in sys.modules]]))"
        )
    )
    assert loaded == []
    assert seconds < 0.7


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
    assert dojo.__all__ == sorted(dojo._HOME) == list(dojo._HOME)


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


# -- the kernel cache --------------------------------------------------------------------------------------------------


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the three packages that a test may edit."""
    for package in PACKAGES:
        shutil.copytree(HOME / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def test_the_cache_folder_changes_with_every_source(copy: Path) -> None:
    program = "from solvers.jit import cache_folder; print(cache_folder().name)"

    def digest() -> str:
        return python(program, home=copy, NUMBA_CACHE_DIR=str(copy / "cache"))

    seen = [digest(), digest()]
    assert seen[0] == seen[1]
    for name in ("sim/model.py", "solvers/status.py"):
        file = copy / name
        file.write_text(file.read_text() + "\n# edited\n")
        seen.append(digest())
    assert len(set(seen)) == 3
    for folder in ("urdf", "mjcf"):  # files that no kernel reads
        loader = copy / "sim" / folder / "load.py"
        loader.write_text(loader.read_text() + "\n# edited\n")
    assert digest() == seen[-1]


def test_an_edited_callee_reaches_its_caller(copy: Path) -> None:
    callee, caller = copy / "solvers" / "callee.py", copy / "solvers" / "caller.py"
    body = "from solvers.jit import kernel\n\n@kernel\ndef one(x):\n    return x + {}\n"
    callee.write_text(body.format("1.0"))
    caller.write_text(
        "from solvers.callee import one\nfrom solvers.jit import kernel\n\n"
        "@kernel\ndef two(x):\n    return 2.0 * one(x)\n"
    )
    program = "from solvers.caller import two; print(two(0.0))"
    cache = str(copy / "cache")
    assert float(python(program, home=copy, NUMBA_CACHE_DIR=cache)) == 2.0
    callee.write_text(body.format("5.0"))
    assert float(python(program, home=copy, NUMBA_CACHE_DIR=cache)) == 10.0


def test_the_cache_can_be_switched_off(tmp_path: Path) -> None:
    program = (
        "from solvers import jit, cones, status; print(jit.cache_folder())\n"
        "kernel = jit.kernel(lambda x: x + 1.0); print(kernel(1.0))"
    )
    out = python(program, NUMBA_CACHE_DIR=str(tmp_path), DOJO_OPT_CACHE="0").split()
    assert out == ["None", "2.0"]
    assert not any(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    program = "from solvers import jit; print(jit.cache_folder())"
    assert python(program, NUMBA_CACHE_DIR=str(blocked / "cache")).strip() == "None"


# -- kernels -----------------------------------------------------------------------------------------------------------


def test_a_pendulum_compiles_no_contact_code() -> None:
    program = """
import json, numpy as np, dojo_opt as dojo
from solvers.jit import compiled_signatures
sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01)
x = sim.neutral()
x[0] += 0.5
assert sim.rollout(x, np.zeros((10, sim.nu))).status == 0
sim.linearize(x, np.zeros(sim.nu))
print(json.dumps(compiled_signatures()))
"""
    kernels = json.loads(python(program))
    assert any(name.startswith("sim.") for name in kernels)
    hard = "contact complementarity friction interior_point inequalities limits central_path direction line_search merit".split()
    foreign = ("solvers.cones", *(f"sim.{name}" for name in hard))
    assert [name for name in kernels if name.startswith(foreign)] == []


def test_what_few_scenes_have_is_compiled_by_them_only() -> None:
    program = """
import numpy as np, dojo_opt as dojo
from sim.ball_spring import spring_impulse
from sim.cone_limit import cone_gap
from sim.coupling import factor_coupling
from sim.interior_point import interior_point
from sim.newton import newton
from sim.pyramid import start_pyramid
from sim.swing import swing_pose
late = (newton, interior_point, swing_pose, cone_gap, spring_impulse, start_pyramid, factor_coupling)
body = dojo.Body("b", 1.0, (1, 1, 1))
scenes = (
    dojo.models.pendulum(),
    dojo.models.hopper(),
    dojo.Mechanism([body], [dojo.Joint("spherical", None, "b", cone=0.5)]),
    dojo.models.orbital(),
)
for mech in scenes:
    sim = dojo.Simulator(mech, time_step=0.01)
    sim.step(sim.neutral())
    print("".join("x" if kernel.compiled else "." for kernel in late))
"""
    assert python(program).split() == ["x......", "xx.....", "xx.x...", "xxxx..."]


@pytest.mark.slow
def test_kernels_have_one_signature_each() -> None:
    program = """
import json, numpy as np, dojo_opt as dojo
from solvers.jit import compiled_signatures
dojo.ilqr(dojo.problems.hop())
sim = dojo.Simulator(dojo.models.pendulum(), time_step=0.01)
sim.rollout(sim.neutral(), np.zeros((3, sim.nu)))
sim.linearize(sim.neutral(), np.zeros(sim.nu))
print(json.dumps([name for name, count in compiled_signatures().items() if count > 1]))
"""
    assert json.loads(python(program)) == []


# -- command line ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", [[], ["run"], ["report"], ["models"], ["warmup"]])
def test_help_is_no_error(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main([*command, "--help"])
    assert stop.value.code == 0
    assert "usage: dojo-opt" in capsys.readouterr().out


@pytest.mark.parametrize("command", [[], ["rum"], ["report", "nothing"], ["run"]])
def test_a_command_that_cannot_be_read_exits_with_2(command: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(command)
    assert stop.value.code == 2
    capsys.readouterr()


def test_an_unknown_problem_exits_with_2_and_the_known_ones(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", "hopp"]) == 2
    assert "hop" in capsys.readouterr().err


def test_every_problem_can_be_run_from_the_command_line() -> None:
    assert set(cli.PROBLEMS) == set(dojo.problems.__all__) - {"follow"}  # which takes a gait
    assert set(cli.GAITS) <= set(cli.PROBLEMS)


def test_arguments_of_a_problem_are_literals_or_words() -> None:
    parsed = cli._arguments(["goal=up", "target=(0.5, 0.5)", "horizon=10"])
    assert parsed == {"goal": "up", "target": (0.5, 0.5), "horizon": 10}
    with pytest.raises(ValueError, match="expected KEY=VALUE, got 'goal'"):
        cli._arguments(["goal"])


def test_models_lists_every_model_as_json(capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["models", "--json"]) == 0
    names = {row["name"] for row in json.loads(capsys.readouterr().out)}
    assert names == set(dojo.models.__all__)


def test_run_writes_plan_figure_and_animation(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figure, page = tmp_path / "block.png", tmp_path / "block.html"
    command = ["run", "block", "--set", "goal=right", "--json", "--out", str(figure), "--html", str(page)]
    assert cli.main(command) == 0
    result = json.loads(capsys.readouterr().out)
    assert result["success"] is True
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert page.read_text().count("MeshCat.Viewer") == 1


def test_a_missed_bar_exits_with_1_only_when_strict(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = Report(
        "title", "command", [Row("fast", np.float64(1.0), "us", 2.0), Row("slow", np.float64(3.0), "us", 2.0)]
    )
    monkeypatch.setattr(cli, "run_report", lambda name, **_: report)
    assert cli.main(["report", "timing", "--out", str(tmp_path)]) == 0
    assert "NO" in capsys.readouterr().out
    assert cli.main(["report", "timing", "--strict", "--json"]) == 1
    numbers = json.loads((tmp_path / "report.json").read_text())
    assert numbers["command"] == "dojo-opt report timing"
    assert numbers["studies"]["timing"]["rows"][1]["met"] is False
    capsys.readouterr()


def test_the_module_runs_as_a_program() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "dojo_opt", "--version"],
        env={**os.environ, "PYTHONPATH": str(HOME)},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout.split()[0]) == (0, "dojo-opt")


# -- README and sizes --------------------------------------------------------------------------------------------------


def test_commands_of_the_readme_exist() -> None:
    text = (ROOT / "README.md").read_text()
    for script in re.findall(r"python (examples/\w+\.py)", text):
        assert (ROOT / script).is_file(), script
    commands = re.findall(r"(?:python -m dojo_opt|dojo-opt) (run|report|models|warmup) ?(\w+)?", text)
    assert commands
    for command, name in commands:
        if command == "report":
            assert name == "all" or name in dojo.report.STUDIES
        if command == "run":
            assert name in cli.LOOPS or name.removeprefix("quadruped_") in cli.PROBLEMS


def test_the_python_of_the_readme_runs(tmp_path: Path) -> None:
    blocks = re.findall(r"```python\n(.*?)```", (ROOT / "README.md").read_text(), flags=re.DOTALL)
    assert blocks
    python("\n".join(blocks), cwd=tmp_path)


def test_files_stay_readable() -> None:
    long = {}
    for package in PACKAGES:
        for file in (HOME / package).rglob("*.py"):
            length = len(file.read_text().splitlines())
            if length > 300 and file.name != "model.py":  # a table of fields
                long[file.name] = length
    assert not long


def test_examples_are_short() -> None:
    for script in (ROOT / "examples").glob("*.py"):
        assert len(script.read_text().splitlines()) <= 60, script
