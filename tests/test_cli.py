"""The command line: its messages, its files, and its exit status."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

import dojo_opt as dojo
from benchmarks import compare
from dojo_opt import __main__ as cli
from dojo_opt.report.command import MOVED
from dojo_opt.report.result import Report, Row
from dojo_opt.viewer.whole_file import whole_file
from sim.io.json_text import json_text
from support.programs import HOME
from support.urdf_files import branched, collision, inertial, joint, link, write


@pytest.mark.parametrize("command", [[], ["run"], ["report"], ["models"], ["show"], ["warmup"]])
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
    assert set(cli.PROBLEMS) == set(dojo.problems.__all__) - {"follow", "reach", "stand_up", "push"}  # of gaits, robots
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


def _refuse(name: str) -> None:
    raise AssertionError(f"no JSON: {name}")


def test_a_run_without_a_second_tick_has_no_nan(capsys: pytest.CaptureFixture[str]) -> None:
    command = ["run", "idto.acrobot", "--seconds", "0.003"]
    assert cli.main([*command, "--json"]) == 1
    result = json.loads(capsys.readouterr().out, parse_constant=_refuse)
    assert result["tick_median_ms"] == "nan"
    assert cli.main(command) == 1
    assert "too short for a second tick" in capsys.readouterr().out


def test_a_missed_bar_exits_with_1_only_when_strict(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = Report(
        "title", "command", [Row("fast", np.float64(1.0), "us", 2.0), Row("slow", np.float64(3.0), "us", 2.0)]
    )
    monkeypatch.setattr(import_module("dojo_opt.report.study"), "run_report", lambda name, **_: report)
    assert cli.main(["report", "timing", "--out", str(tmp_path)]) == 0
    assert "NO" in capsys.readouterr().out
    assert cli.main(["report", "timing", "--strict", "--json"]) == 1
    numbers = json.loads((tmp_path / "report.json").read_text())
    assert numbers["command"] == "dojo-opt report timing"
    assert numbers["studies"]["timing"]["rows"][1]["met"] is False
    capsys.readouterr()


def test_a_study_that_fails_takes_no_other_with_it(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    def run(name: str, **_: object) -> Report:
        if name == "stability":
            raise RuntimeError("MuJoCo has no license")
        return Report(name, "command", [Row("fast", 1.0, "us", 2.0)])

    monkeypatch.setattr(import_module("dojo_opt.report.study"), "run_report", run)
    assert cli.main(["report", "all", "--out", str(tmp_path)]) == 1
    studies = json.loads((tmp_path / "report.json").read_text())["studies"]
    assert [name for name, study in studies.items() if not study["met"]] == ["stability"]
    assert studies["stability"]["details"] == {"error": "RuntimeError: MuJoCo has no license"}
    assert "MuJoCo has no license" in capsys.readouterr().out
    with pytest.raises(RuntimeError, match="no license"):
        cli.main(["report", "stability"])


def test_a_study_that_moved_is_refused_with_the_command_that_has_it(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as stop:
        cli.main(["report", "mechanics"])
    assert stop.value.code == 2
    assert "python benchmarks/compare.py mechanics" in capsys.readouterr().err
    assert set(MOVED) == set(compare.STUDIES) - set(dojo.report.STUDIES)


def test_studies_beside_other_engines_have_a_command_line_of_their_own(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    report = Report("title", rows=[Row("slow", 3.0, "us", 2.0)])
    monkeypatch.setattr(import_module("dojo_opt.report.study"), "run_report", lambda name, **_: report)
    assert compare.main(["mechanics", "--out", str(tmp_path)]) == 0
    assert compare.main(["mechanics", "--strict", "--quick"]) == 1
    assert json.loads((tmp_path / "report.json").read_text())["command"] == "python benchmarks/compare.py mechanics"
    assert "command: python benchmarks/compare.py mechanics --quick" in capsys.readouterr().out


def test_links_that_touch_the_ground_are_named(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    measured = []

    def run(name: str, mechanism: dojo.Mechanism, **_: object) -> Report:
        measured.append(mechanism)
        return Report(name, "command", [Row("fast", 1.0, "us", 2.0)])

    monkeypatch.setattr(import_module("dojo_opt.report.study"), "run_report", run)
    foot = link("foot", inertial(), collision('<box size="0.1 0.1 0.1"/>'))
    robot = write(tmp_path, link("base", inertial()), foot, joint("hip", "base", "foot"), name="leg")
    assert cli.main(["report", "accuracy", str(robot), "--contacts", "foot", "base=0.2", "--out", str(tmp_path)]) == 0
    assert [c.body for c in measured[0].contacts].count("foot") == 8
    assert [c.radius for c in measured[0].contacts if c.body == "base"] == [0.2]
    page = json.loads((tmp_path / "report.json").read_text())
    for command in (page["command"], page["studies"]["accuracy"]["command"]):
        assert command == f"dojo-opt report accuracy {robot} --contacts foot base=0.2"
    assert cli.main(["report", "accuracy", str(robot), "--contacts", "foot=wide"]) == 2
    assert "--contacts foot=wide: expected LINK or LINK=RADIUS in metres" in capsys.readouterr().err


@pytest.mark.slow
def test_the_module_runs_as_a_program() -> None:
    done = subprocess.run(
        [sys.executable, "-m", "dojo_opt", "--version"],
        env={**os.environ, "PYTHONPATH": str(HOME)},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stdout.split()[0]) == (0, "dojo-opt")


@pytest.mark.parametrize("flag", [["--perturb", "payload=1"], ["--seconds", "2"]])
def test_a_plan_has_no_plant_to_perturb(flag: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["run", "hop", *flag]) == 2
    assert (
        "apply to closed loops (free_gait_mpc, hopper_mpc, humanoid_mpc, quadruped_mpc); hop is a plan"
        in capsys.readouterr().err
    )


@pytest.mark.parametrize(
    "command", [["run", "hop", "--out"], ["run", "hopper_mpc", "--html"], ["show", "block", "--plot"]]
)
def test_files_that_cannot_be_written_are_refused_first(
    command: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main([*command, str(tmp_path / "nowhere" / "file.png")]) == 2
    streams = capsys.readouterr()
    assert "there is no folder" in streams.err and streams.out == ""


def test_show_prints_and_draws_a_model(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    figure, page = tmp_path / "fall.png", tmp_path / "fall.html"
    command = ["show", "raiberthopper", "--drop", "0.1", "--seconds", "0.1", "--out", str(figure), "--html", str(page)]
    assert cli.main(command) == 0
    text = capsys.readouterr().out
    assert "raiberthopper: 2 bodies, 7 degrees of freedom" in text and "released for 0.1 s" in text
    assert "m at the beginning." in text
    assert figure.read_bytes().startswith(b"\x89PNG") and "MeshCat.Viewer" in page.read_text()


@pytest.mark.parametrize("name", ["pendulum", "slider", "cartpole", "fourbar"])
def test_show_releases_a_robot_that_does_not_float(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["show", name, "--seconds", "0.02"]) == 0
    assert "released for 0.02 s" in capsys.readouterr().out


@pytest.mark.filterwarnings("ignore::sim.io.urdf.report.UrdfWarning")
def test_show_reads_a_file_and_names_unsupported_elements(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = branched(tmp_path)
    assert cli.main(["show", str(path), "--seconds", "0.05", "--drop", "0.2"]) == 0
    text = capsys.readouterr().out
    assert "shoulder" in text and "robot.urdf: 7 links" in text


@pytest.mark.parametrize(
    ("words", "named"),
    [(["block", "--fixed"], "--fixed"), (["toy.xml", "--meshes", "box", "--contacts", "all"], "--meshes, --contacts")],
)
def test_show_refuses_what_only_urdf_files_have(
    words: list[str], named: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert cli.main(["show", *words]) != 0
    assert f"{named}: only for .urdf files" in capsys.readouterr().err


@pytest.mark.filterwarnings("ignore::sim.io.urdf.report.UrdfWarning")
def test_show_plays_the_motion_until_it_is_interrupted(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    opened, shown, pauses = [], [], []

    def sleep(seconds: float) -> None:
        pauses.append(seconds)
        if len(pauses) == 13:  # after 6 states, a pause, and 5 states
            raise KeyboardInterrupt

    monkeypatch.setattr("webbrowser.open", opened.append)
    monkeypatch.setattr(time, "sleep", sleep)
    monkeypatch.setattr(dojo.viewer.Live, "show", lambda view, x: shown.append(np.array(x)))
    assert (
        cli.main(["show", "raiberthopper", "--drop", "0.1", "--seconds", "0.1", "--time-step", "0.02", "--live"]) == 0
    )
    assert opened[0].startswith("http://127.0.0.1:") and opened[0] in capsys.readouterr().out
    assert len(shown) == 12 and all(0.0 <= pause <= 1.0 for pause in pauses)  # the neutral state first
    np.testing.assert_array_equal(shown[1:6], shown[7:])
    assert shown[1][2] > shown[5][2]


def test_numbers_that_json_has_not_are_strings(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    value = {1: np.array([0.5, np.nan]), "low": -np.inf, "pair": (np.float64(1.0), np.inf), "none": None}
    expected = {"1": [0.5, "nan"], "low": "-inf", "pair": [1.0, "inf"], "none": None}
    assert json.loads(json_text(value), parse_constant=_refuse) == expected
    monkeypatch.setattr("dojo_opt.viewer.show._numbers", lambda sim, motion: value)
    assert cli.main(["show", "pendulum", "--seconds", "0.05", "--json"]) == 0
    assert json.loads(capsys.readouterr().out, parse_constant=_refuse) == expected


INTERRUPTED = """
import os, signal, sys
from dojo_opt import __main__ as cli

signal.signal(signal.SIGINT, signal.default_int_handler)  # ignored in a shell's background jobs
for command in ("run hop", "report timing", "models", "show pendulum", "warmup"):
    child = os.fork()
    if child == 0:
        sys.argv = ["dojo-opt", *command.split()]
        cli._COMMANDS[sys.argv[1]] = lambda args: os.kill(os.getpid(), signal.SIGINT)
        print("begun", flush=True)
        sys.exit(cli.program())
    print(command, os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]), flush=True)
"""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for a single process")
def test_ctrl_c_ends_every_command_by_its_signal_and_in_silence() -> None:
    """A shell says 130, and a script around the command stops, too. In forks: a second each to load the command line."""
    done = subprocess.run(
        [sys.executable, "-c", INTERRUPTED], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(HOME)}
    )
    commands = ("run hop", "report timing", "models", "show pendulum", "warmup")
    expected = "".join(f"begun\n{command} {-signal.SIGINT}\n" for command in commands)
    assert (done.returncode, done.stdout, done.stderr) == (0, expected, "")


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGINT for a single process")
@pytest.mark.parametrize("module", ["numpy", "numba", "dojo_opt.report"])
def test_ctrl_c_during_imports_ends_a_command_in_silence(module: str) -> None:
    program = (
        "import os, signal, sys\n"
        "signal.signal(signal.SIGINT, signal.default_int_handler)\n"
        "class Finder:\n"
        "    def find_spec(self, name, *others):\n"
        f"        if name == {module!r}:\n"
        "            print('importing', flush=True)\n"
        "            os.kill(os.getpid(), signal.SIGINT)\n"
        "sys.meta_path.insert(0, Finder()); sys.argv = ['dojo-opt', 'models']\n"
        "from dojo_opt.__main__ import program; sys.exit(program())"
    )
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": str(HOME)}
    )
    assert (done.returncode, done.stdout, done.stderr) == (-signal.SIGINT, "importing\n", "")


def test_files_are_written_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    path = tmp_path / "plan.html"
    for before in (None, "old"):
        with pytest.raises(KeyboardInterrupt), whole_file(path) as file:
            file.write_text("half")
            raise KeyboardInterrupt
        assert [p.read_text() for p in tmp_path.iterdir()] == ([] if before is None else [before])
        path.write_text("old")
    path.chmod(0o640)
    link = tmp_path / "link.html"
    link.symlink_to(path)
    with whole_file(link) as file:
        file.write_text("new")
    assert link.is_symlink() and path.read_text() == "new" and path.stat().st_mode & 0o777 == 0o640
    with whole_file(Path(os.devnull)) as file:
        assert file == Path(os.devnull)


def test_show_prints_one_json_object(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = branched(tmp_path)
    assert cli.main(["show", str(path), "--seconds", "0.05", "--json"]) == 0
    numbers = json.loads(capsys.readouterr().out)
    assert numbers["success"] is True and numbers["status"] == 0
    assert len(numbers["bodies"]) == numbers["nbody"] and "robot.urdf: 7 links" in numbers["report"]
    assert np.shape(numbers["x"]) == (11, numbers["nq"] + numbers["nv"]) and len(numbers["time"]) == 11


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["quadrupet"], "'quadrupet' is neither a .urdf nor an .xml file, nor a model; did you mean 'quadruped'?"),
        (["nowhere.urdf"], "nowhere.urdf"),
        (["pendulum", "--seconds", "-1"], "--seconds: expected a number > 0, got -1"),
        (["block", "--drop", "nan"], "--drop: expected finite numbers, got nan"),
        (["pendulum", "--json", "--live"], "--json, --live: expected one of them"),
        (["pendulum", "--drop", "1"], "--drop requires a floating base; 'joint_0' is revolute"),
    ],
)
def test_show_refuses_by_name(arguments: list[str], message: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert cli.main(["show", *arguments]) == 2
    shown = capsys.readouterr()
    assert message in shown.err and not shown.out  # before any report
