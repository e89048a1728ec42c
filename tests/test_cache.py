"""Kernels: kept on disk until a source changes, compiled when a scene needs them, once each."""

from __future__ import annotations

import hashlib
import json
import os
import pickle
import shutil
import stat
from collections.abc import Callable
from pathlib import Path

import pytest

from sim.model.shape_kinds import Pair
from support.fork_server import forked
from support.programs import HOME, PACKAGES, python

# -- the kernel cache --------------------------------------------------------------------------------------------------


@pytest.fixture
def copy(tmp_path: Path) -> Path:
    """A copy of the three packages that a test may edit."""
    for package in PACKAGES:
        shutil.copytree(HOME / package, tmp_path / package, ignore=shutil.ignore_patterns("__pycache__"))
    return tmp_path


def test_the_cache_folder_changes_with_every_source(copy: Path) -> None:
    program = "from solvers.compiler import cache_folder; print(cache_folder().name)"

    def digest() -> str:
        return forked(program, home=copy, NUMBA_CACHE_DIR=str(copy / "cache")).strip()

    seen = [digest(), digest()]
    assert seen[0] == seen[1]
    for name in ("sim/model/model.py", "solvers/status.py"):
        file = copy / name
        file.write_text(file.read_text() + "\n# edited\n")
        seen.append(digest())
    assert len(set(seen)) == 3
    for folder in ("urdf", "mjcf"):  # files that no kernel reads
        loader = copy / "sim" / "io" / folder / "load.py"
        loader.write_text(loader.read_text() + "\n# edited\n")
    assert digest() == seen[-1]


def test_an_edited_callee_reaches_its_caller(copy: Path) -> None:
    callee, caller = copy / "solvers" / "callee.py", copy / "solvers" / "caller.py"
    body = "from solvers.compiler import kernel\n\n@kernel\ndef one(x):\n    return x + {}\n"
    callee.write_text(body.format("1.0"))
    caller.write_text(
        "from solvers.callee import one\nfrom solvers.compiler import kernel\n\n"
        "@kernel\ndef two(x):\n    return 2.0 * one(x)\n"
    )
    program = "from solvers.caller import two; print(two(0.0))"
    cache = str(copy / "cache")
    assert float(forked(program, home=copy, NUMBA_CACHE_DIR=cache)) == 2.0
    callee.write_text(body.format("50.0"))  # of another length: bytecode is told apart by size and by whole seconds
    assert float(forked(program, home=copy, NUMBA_CACHE_DIR=cache)) == 100.0


def test_the_cache_can_be_switched_off(tmp_path: Path) -> None:
    program = (
        "from solvers import compiler, cones, status; print(compiler.cache_folder())\n"
        "kernel = compiler.kernel(lambda x: x + 1.0); print(kernel(1.0))"
    )
    out = forked(program, NUMBA_CACHE_DIR=str(tmp_path), DOJO_OPT_CACHE="0").split()
    assert out == ["None", "2.0"]
    assert not any(tmp_path.iterdir())


def test_a_folder_that_cannot_be_written_is_no_error(tmp_path: Path) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    program = "from solvers import compiler; print(compiler.cache_folder())"
    assert forked(program, NUMBA_CACHE_DIR=str(blocked / "cache")).strip() == "None"


# -- files that are kept, and files that are trusted -------------------------------------------------------------------

HITS = "print(one(1.0), sum(one.entry.stats.cache_hits.values()))"  # of a kernel, and the number of its loads
COUNTED = f"""
import warnings
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter("always")
    from own import one, two
    {HITS}
    two(1.0)
print([str(w.message) for w in told])
"""


class FilledCache:
    """A folder of compiled code, and a program with its kernel in this folder."""

    def __init__(self, home: Path) -> None:
        self.home, self.base = home, home / "cache"
        text = "from solvers.compiler import kernel\n\n@kernel\ndef {}(x):\n    return x + {}\n\n"
        (home / "own.py").write_text(text.format("one", "1.0") + text.format("two", "2.0"))
        assert self.run() == ["2.0", "0"]
        self.digest = next((self.base / "dojo_opt").iterdir())
        (self.file,) = self.digest.iterdir()
        self.code = self.file.read_bytes()

    def restore(self) -> None:
        """As after the first run."""
        for path in (self.base, self.digest.parent, self.digest):
            if hasattr(os, "geteuid") and os.geteuid() == 0:
                os.chown(path, 0, 0)
            path.chmod(0o700)
        for path in self.digest.iterdir():
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        self.file.write_bytes(self.code)
        self.file.chmod(0o600)
        shutil.rmtree(self.home / "ran", ignore_errors=True)

    def run(self, program: str = f"from own import one; {HITS}", **environment: str) -> list[str]:
        return forked(program, cwd=self.home, **{"NUMBA_CACHE_DIR": str(self.base), **environment}).split(maxsplit=2)


@pytest.fixture(scope="module")
def once(tmp_path_factory: pytest.TempPathFactory) -> FilledCache:
    return FilledCache(tmp_path_factory.mktemp("filled"))


@pytest.fixture
def filled(once: FilledCache) -> FilledCache:
    once.restore()
    return once


def written(path: Path, body: bytes) -> None:
    """A file as the cache writes it."""
    path.write_bytes(hashlib.blake2b(body).digest() + body)


def swapped(path: Path, make: Callable[[Path], object]) -> None:
    path.unlink()
    make(path)


class Evil:
    """Unpickling it leaves a folder."""

    def __init__(self, marker: Path) -> None:
        self.marker = str(marker)

    def __reduce__(self) -> tuple[object, ...]:
        return (os.makedirs, (self.marker,))


DAMAGE: dict[str, Callable[[Path], object]] = {
    "empty": lambda p: p.write_bytes(b""),
    "cut": lambda p: p.write_bytes(p.read_bytes()[:-100]),
    "cut before its check": lambda p: p.write_bytes(p.read_bytes()[:10]),
    "zeros": lambda p: p.write_bytes(bytes(p.stat().st_size)),
    "other bytes": lambda p: p.write_bytes(b"\x80\x04 not a pickle" * 100),
    "one bit": lambda p: p.write_bytes((b := p.read_bytes())[:2000] + bytes([b[2000] ^ 1]) + b[2001:]),
    "longer": lambda p: p.write_bytes(p.read_bytes() + b"0"),
    "no pickle": lambda p: written(p, b"nothing"),
    "another pickle": lambda p: written(p, pickle.dumps([1, 2, 3])),
    "another key": lambda p: written(p, pickle.dumps((("key",), ()))),
    "a folder": lambda p: swapped(p, lambda q: (q / "in").mkdir(parents=True)),
    "a link to nothing": lambda p: swapped(p, lambda q: q.symlink_to("nowhere")),
    "a link to itself": lambda p: swapped(p, lambda q: q.symlink_to(q)),
    "a pipe": lambda p: swapped(p, os.mkfifo),
}


@pytest.mark.sweep(7)
@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_file_is_compiled_again(filled: FilledCache, kind: str) -> None:
    DAMAGE[kind](filled.file)
    assert filled.run() == ["2.0", "0"]
    assert filled.file.read_bytes()[:64] == hashlib.blake2b(filled.file.read_bytes()[64:]).digest()
    assert [path.name for path in filled.digest.iterdir()] == [filled.file.name]


ALARM = """
import os, pickle, signal
from numba.core.registry import cpu_target
from own import one

def alarm(number, frame):
    signal.signal(number, signal.SIG_IGN)
    raise TimeoutError("alarm")

def during(owner, name):
    before = getattr(owner, name)
    def call(*args):
        signal.raise_signal(signal.SIGTERM)
        return before(*args)
    setattr(owner, name, call)

signal.signal(signal.SIGTERM, alarm)
engine = cpu_target.target_context.codegen()._engine._ee
during({})
try:
    one(1.0)
    print("lost", end=" ")
except TimeoutError:
    print("heard", end=" ")
print(one(1.0))
"""
DURING = {  # where the handler of a signal raises
    "code comes from LLVM": "engine, '_object_cache_notify'",
    "a file is written": "os, 'replace'",
    "a file is read": "pickle, 'loads'",
    "code goes to LLVM": "engine, '_object_cache_getbuffer'",
}


@pytest.mark.parametrize("name", DURING)
def test_an_exception_of_a_signal_is_heard_and_loses_no_code(filled: FilledCache, name: str) -> None:
    if name in ("code comes from LLVM", "a file is written"):
        filled.file.unlink()
    assert filled.run(ALARM.format(DURING[name])) == ["heard", "2.0"]
    assert filled.run() == ["2.0", "1"]


def test_a_value_that_cannot_be_pickled_is_one_warning(tmp_path: Path) -> None:
    """Functions without a module are pickled with all values beside them."""
    program = (
        "import threading, dojo_opt as dojo\nlock = threading.Lock()\n"
        "@dojo.jit\ndef f(x): return x + 1.0\n@dojo.jit\ndef g(h, x): return h(x)\nprint(g(f, 1.0))"
    )
    counted = (
        "import warnings\nwith warnings.catch_warnings(record=True) as told:\n    warnings.simplefilter('always')\n"
        f"    exec({program!r}, {{}})\nprint(*told)"
    )
    value, told = python(counted, NUMBA_CACHE_DIR=str(tmp_path)).splitlines()
    assert value == "2.0" and told.count("compiled code cannot be stored") == 1 and "cannot pickle" in told


def test_a_full_disk_is_one_warning(filled: FilledCache) -> None:
    filled.file.unlink()
    limit = "import resource; resource.setrlimit(resource.RLIMIT_FSIZE, (0, 0))\n"  # the system's own error for a write
    value, hits, told = filled.run(limit + COUNTED)
    assert (value, hits) == ("2.0", "0")
    assert told.count("compiled code cannot be stored") == 1 and "NUMBA_CACHE_DIR" in told
    assert list(filled.digest.iterdir()) == []


def test_a_disk_without_room_for_a_folder_is_one_warning(filled: FilledCache) -> None:
    patch = "import errno, os, pathlib\ndef full(*a, **k): raise OSError(errno.ENOSPC, 'No space left on device')\n"
    value, hits, told = filled.run(
        patch + "pathlib.Path.mkdir = full\n" + COUNTED, NUMBA_CACHE_DIR=str(filled.home / "new")
    )
    assert (value, hits) == ("2.0", "0")
    assert told.count("compiled code cannot be stored") == 1 and "No space left on device" in told


def test_a_filled_folder_that_is_read_only_is_read(filled: FilledCache) -> None:
    for path in (filled.file, filled.digest, filled.digest.parent, filled.base):
        path.chmod(path.stat().st_mode & ~0o222)
    value, hits, told = filled.run(COUNTED.replace("two(1.0)", "pass"))
    assert (value, hits, told.strip()) == ("2.0", "1", "[]")


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes of POSIX")
@pytest.mark.parametrize("part", ["base", "root", "digest", "file"])
@pytest.mark.parametrize("whose", ["group", "world", "another user"])
def test_files_that_others_can_write_are_not_read(filled: FilledCache, part: str, whose: str) -> None:
    marker = filled.home / "ran"
    written(filled.file, pickle.dumps(Evil(marker)))
    path = {"base": filled.base, "root": filled.digest.parent, "digest": filled.digest, "file": filled.file}[part]
    if whose == "another user":
        if os.geteuid() != 0:
            pytest.skip("only root gives files away")
        os.chown(path, 12345, 12345)
    else:
        path.chmod(path.stat().st_mode | (stat.S_IWGRP if whose == "group" else stat.S_IWOTH))
    value, hits, told = filled.run(COUNTED)
    assert (value, hits) == ("2.0", "0")
    assert not marker.exists()
    if part != "file":  # which is replaced
        wrong = "belongs to the user with id 12345" if whose == "another user" else "others can write to"
        assert told.count(wrong) == 1 and str(path) in told


def test_a_planted_file_runs_where_the_folder_is_believed(filled: FilledCache) -> None:
    """The tests above rely on this: the planted file would run."""
    marker = filled.home / "ran"
    written(filled.file, pickle.dumps(Evil(marker)))
    assert filled.run() == ["2.0", "0"]
    assert marker.exists()


def test_a_new_folder_is_the_users_own(filled: FilledCache) -> None:
    for path in (filled.base, filled.digest.parent, filled.digest):
        assert stat.S_IMODE(path.stat().st_mode) == 0o700
    assert stat.S_IMODE(filled.file.stat().st_mode) == 0o600


def test_a_sticky_folder_of_root_is_no_danger(filled: FilledCache) -> None:
    filled.base.chmod(0o1777)
    assert filled.run() == ["2.0", "1"]


def test_a_link_to_the_folder_is_followed(filled: FilledCache) -> None:
    (filled.home / "link").symlink_to(filled.base)
    assert filled.run(NUMBA_CACHE_DIR=str(filled.home / "link")) == ["2.0", "1"]


@pytest.mark.parametrize("given", ["", "here", "./here"])
def test_no_folder_depends_on_where_a_process_starts(tmp_path: Path, given: str) -> None:
    home = tmp_path / "home"
    program = "from solvers.compiler import cache_folder; print(cache_folder())"
    folder = forked(program, cwd=tmp_path, NUMBA_CACHE_DIR="", XDG_CACHE_HOME=given, HOME=str(home)).strip()
    assert folder.startswith(str(home / ".cache" / "dojo_opt"))
    assert forked(program, cwd=tmp_path, NUMBA_CACHE_DIR="", XDG_CACHE_HOME=given, HOME="here").strip() == "None"
    assert sorted(path.name for path in tmp_path.iterdir()) == ["home"]


@pytest.mark.slow
def test_a_user_that_the_system_does_not_know_can_import(filled: FilledCache) -> None:
    unknown = """
import os, pwd
def nobody(uid): raise KeyError(uid)
pwd.getpwuid = nobody
for name in ("HOME", "XDG_CACHE_HOME", "NUMBA_CACHE_DIR"):
    os.environ.pop(name, None)
import dojo_opt
"""
    value, hits, told = python(unknown + COUNTED, cwd=filled.home, DOJO_OPT_CACHE="1").split(maxsplit=2)
    assert (value, hits) == ("2.0", "0")
    assert told.count("the user has no home folder") == 1


AT_ONCE = """
import os
children = []
for _ in range(4):
    child = os.fork()
    if child == 0:
        from own import one
        os._exit(0 if one(1.0) == 2.0 else 7)
    children.append(child)
print([os.waitpid(child, 0)[1] for child in children])
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
def test_processes_may_write_at_once(filled: FilledCache) -> None:
    for _ in range(2):
        filled.file.unlink()
        assert json.loads(" ".join(filled.run(AT_ONCE))) == [0] * 4
        assert [path.name for path in filled.digest.iterdir()] == [filled.file.name]
        assert filled.run() == ["2.0", "1"]


# -- kernels -----------------------------------------------------------------------------------------------------------


def test_modules_of_tests_take_no_steps_when_they_are_imported(kernels_at_import: list[str]) -> None:
    """All workers would compile the same at the same time."""
    assert len(kernels_at_import) < 20, kernels_at_import


@pytest.mark.slow
def test_rare_features_are_compiled_only_by_their_scenes() -> None:
    program = """
import numpy as np, dojo_opt as dojo
from sim.dynamics.joints.ball_spring import spring_impulse
from sim.dynamics.joints.cone_limit import cone_gap
from sim.dynamics.loops.coupling_system import factor_coupling
from sim.solve.interior_point import interior_point
from sim.solve.newton import newton
from sim.contact.pyramid import start_pyramid
from sim.dynamics.joints.swing import swing_pose
optional = (newton, interior_point, swing_pose, cone_gap, spring_impulse, start_pyramid, factor_coupling)
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
    print("".join("x" if kernel.compiled else "." for kernel in optional))
"""
    assert python(program).split() == ["x......", "xx.....", "xx.x...", "xxxx..."]


FEATURES = (  # of few scenes: rooms and files with kernels of their own
    "sim.contact.collision.", "sim.contact.pairs.", "sim.contact.pyramid", "sim.contact.restitution",
    "sim.contact.terrain_contact", "sim.contact.height_field", "sim.dynamics.joints.cone_limit",
    "sim.dynamics.joints.swing", "sim.dynamics.loops.", "sim.derivatives.parameters.", "sim.integrators.hamilton",
    "sim.integrators.runge_kutta",
)  # fmt: skip

COLLIDING = (
    "sim.contact.collision.",
    "sim.contact.pairs.",
    "sim.contact.restitution",
    "sim.dynamics.loops.",
)  # in part
OTHER_PAIRS = (
    *(f"sim.contact.collision.pair_kernels.{name}" for name in ("arrange", "choose", "sides", "face")),
    *(f"sim.contact.collision.pair_kernels._{name.lower()}" for name in Pair.__members__ if name != "SPHERE_SPHERE"),
    "sim.contact.collision.cylinder", *(f"sim.contact.pairs.{name}" for name in ("cylinder_pairs.choose", "string")),
    "sim.contact.restitution.find", "sim.dynamics.loops.gears", "sim.dynamics.loops.closure", "sim.derivatives.loop_stiffness",
)  # fmt: skip


HARD = "complementarity interior_point inequalities globalization known_start direction step_length merit".split()
NO_CONTACTS = ("solvers.cones", "sim.contact", "sim.dynamics.joints.limits", *(f"sim.solve.{name}" for name in HARD))

# lines that take numbers or lanes of them, rows of one layout or another; the loop over time, with a law and without:
# a signature for each
SEVERAL = (
    "solvers.lu.solve_two",
    "solvers.lu.solve_three",
    "solvers.rotation.three",
    "solvers.rotation.put_three",
    "sim.integrators.rollout.roll",
)

SCENES: dict[str, tuple[str, tuple[str, ...]]] = {  # each with kernels that neither it nor those above it need
    "pendulum": (
        "sim = dojo.Simulator(dojo.models.pendulum())\n"
        "motion = sim.rollout(sim.neutral(), np.zeros((3, sim.nu)))\nsim.linearize(sim.neutral())\n"
        "sim.vjp(motion, np.ones((4, sim.ndx)))",
        (*FEATURES, *NO_CONTACTS),
    ),
    "limit": (
        "body = dojo.Body('link', 1.0, shape=dojo.Sphere(0.1))\n"
        "hinge = dojo.Joint('revolute', None, 'link', axis=(1.0, 0.0, 0.0), limits=(-0.1, 0.1))\n"
        "sim = dojo.Simulator(dojo.Mechanism(bodies=[body], joints=[hinge]))\n"
        "sim.rollout(sim.neutral(), np.ones((3, sim.nu)))\nsim.linearize(sim.neutral())",
        (*FEATURES, "sim.contact.", "sim.solve.loop_branch"),
    ),
    "block": (
        "sim = dojo.Simulator(dojo.models.block())\n"
        "sim.rollout(sim.neutral(), np.zeros((3, sim.nu)))\nsim.linearize(sim.neutral())",
        FEATURES,
    ),
    "two balls": (
        "balls = [dojo.Body(name, 1.0, shape=dojo.Sphere(0.1)) for name in 'ab']\n"
        "joints = [dojo.Joint('floating', None, name) for name in 'ab']\n"
        "sim = dojo.Simulator(dojo.Mechanism(bodies=balls, joints=joints, collisions=[dojo.Collision('a', 'b')]))\n"
        "sim.rollout(sim.neutral(), np.zeros((3, 0)))\nsim.linearize(sim.neutral())",
        (*(name for name in FEATURES if name not in COLLIDING), *OTHER_PAIRS),
    ),
}


@pytest.mark.slow
def test_kernels_are_compiled_once_and_only_by_scenes_that_need_them(tmp_path: Path) -> None:
    """In an empty cache: kernels that come with the code that calls them are not counted. What is compiled does not
    depend on how well."""
    parts = "".join(f"{program}\nprint(json.dumps(compiled_signatures()))\n" for program, _ in SCENES.values())
    text = f"import gc, json, numpy as np, dojo_opt as dojo\nfrom solvers.compiler import compiled_signatures\n{parts}"
    text = text.replace("\n", "\ngc.disable()\n", 1)  # a tenth of the time, which is that of Numba's Python
    out = python(text, DOJO_OPT_SHIPPED="0", NUMBA_OPT="0", NUMBA_CACHE_DIR=str(tmp_path)).splitlines()
    for (name, (_, foreign)), line in zip(SCENES.items(), out, strict=True):
        found = json.loads(line)
        assert sum(kernel.startswith("sim.") for kernel in found) > 50, name
        assert [kernel for kernel in found if kernel.startswith(foreign)] == [], name
        assert {kernel for kernel, signatures in found.items() if signatures > 1} <= set(SEVERAL), name
