"""Shipped code: found by its source, wherever the package is; trusted only if it is unchanged."""

from __future__ import annotations

import hashlib
import json
import os
import pickletools
import shutil
import signal
import stat
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import llvmlite.binding as llvm
import pytest

from solvers.compiler import targets
from solvers.compiler.crossing import SYSTEMS
from solvers.compiler.shipped import SUFFIX, Shipped, write_shipped
from support.fork_server import forked
from support.programs import HOME, PACKAGES, python

TARGET = (targets.usual() or ("none",))[0]
pytestmark = [
    pytest.mark.skipif(TARGET == "none", reason="no target is known for this processor"),
    pytest.mark.slow,  # its package is compiled and copied first
]

OWN = """
from solvers.compiler import kernel, parallel_kernel, prange, seconds, users_callee, users_loop

@kernel
def inner(x):
    return x + 1.0

@kernel
def one(x):
    return 2.0 * inner(x)

@parallel_kernel
def total(a):
    out = 0.0
    for i in prange(a.shape[0]):
        out += one(a[i])
    return out

@kernel
def clock():
    return seconds()

@users_callee
def half(x):
    return 0.5 * x

@users_loop
def looped(x):
    return half(x) + half(x)
"""
CALL = """
import json, warnings
import numpy as np
with warnings.catch_warnings(record=True) as told:
    warnings.simplefilter("always")
    from solvers.own import one, total
    numbers = [one(1.0), total(np.ones(3))]
from solvers.compiler import compiled, shipped
print(json.dumps([numbers, len(compiled()), shipped().why_not, [str(w.message) for w in told]]))
"""
SHIP = """
import sys
from pathlib import Path
from solvers.compiler.cache import ship
ship(Path(sys.argv[1]), Path(sys.argv[2]), sys.argv[3])
"""
SHIP_ABROAD = """
from pathlib import Path
from solvers.compiler.cache import ship
from solvers.compiler.crossing import SYSTEMS
for name, system in SYSTEMS.items():
    ship(Path("cache").resolve() / name, Path("abroad").resolve() / name, system.target)
"""
CALL_ONE = CALL.replace("total(np.ones(3))", "3.0 * one(1.0)")  # the loop over threads takes longest to compile
CALL_LOOP = CALL.replace("import one, total", "import looped").replace("one(1.0), total(np.ones(3))", "looped(3.0)")
CALL_CLOCK = (
    CALL.replace("import one, total", "import clock")
    .replace("one(1.0), total(np.ones(3))", "abs(clock() - time.monotonic()) // 1.0")
    .replace("import json", "import json, time")
)
NUMBERS = [4.0, 12.0]
HEAD = 17 + 32 + 8  # bytes before the index: a magic text, its digest and its length


class Package:
    """A copy of the packages with kernels of its own and their shipped code."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.folder, self.file = root / "solvers" / "shipped", root / "solvers" / "shipped" / f"{TARGET}{SUFFIX}"

    def index(self) -> dict[str, Any]:
        """The index in the file."""
        data = self.file.read_bytes()
        return dict(json.loads(data[HEAD : HEAD + int.from_bytes(data[HEAD - 8 : HEAD], "little")]))

    def rewrite(self, index: dict[str, Any]) -> None:
        """The file with another index, and its right digest."""
        data, text = self.file.read_bytes(), json.dumps(index).encode()
        head = data[: HEAD - 40] + hashlib.sha256(text).digest() + len(text).to_bytes(8, "little")
        self.file.write_bytes(head + text + data[HEAD + int.from_bytes(data[HEAD - 8 : HEAD], "little") :])

    def call(self, program: str = CALL, **environment: str) -> tuple[list[float], int, str, list[str]]:
        """(results, functions compiled, why shipped code is not used, warnings) with an empty cache."""
        cache = self.root / "cache"
        shutil.rmtree(cache, ignore_errors=True)
        run = forked if all(name.startswith("DOJO_OPT_") for name in environment) else python
        given = {"NUMBA_CACHE_DIR": str(cache), **environment}
        numbers, count, why, told = json.loads(run(program, home=self.root, **given))
        return numbers, count, why, told

    def compiles(self, **environment: str) -> tuple[str, list[str]]:
        """(why shipped code is not used, warnings) of a process that has to compile."""
        numbers, count, why, told = self.call(**environment)
        assert numbers == NUMBERS and count == 4  # inner, total, and one in two forms
        return why, told


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Package:
    """The packages where their code was compiled, and moved from there."""
    root = tmp_path_factory.mktemp("built") / "first"
    for package in PACKAGES:
        shutil.copytree(HOME / package, root / package, ignore=shutil.ignore_patterns("__pycache__", "shipped"))
    (root / "solvers" / "own.py").write_text(OWN)
    built = Package(root)
    worker = {**targets.build_environment(TARGET), "DOJO_OPT_CROSS": " ".join(SYSTEMS)}
    why, _ = built.compiles(**worker)
    assert why == "no code is shipped"
    build = {"NUMBA_CACHE_DIR": str(root / "cache"), **worker}
    assert json.loads(python(CALL_LOOP, home=root, **build))[:2] == [[3.0], 1]
    assert json.loads(python(CALL_CLOCK, home=root, **build))[:2] == [[0.0], 1]
    program = SHIP.replace("sys.argv[1]", repr(str(root / "cache"))).replace("sys.argv[2]", repr(str(built.folder)))
    python(program.replace("sys.argv[3]", repr(TARGET)), home=root)
    python(SHIP_ABROAD, cwd=root, home=root)
    moved = root.with_name("second")
    root.rename(moved)
    return Package(moved)


@pytest.fixture
def package(built: Package, tmp_path: Path) -> Package:
    """A copy that a test may spoil."""
    shutil.copytree(built.root, tmp_path / "copy")
    return Package(tmp_path / "copy")


def test_shipped_code_runs_elsewhere_and_nothing_is_compiled(package: Package) -> None:
    assert package.call() == (NUMBERS, 0, "", [])
    assert list((package.root / "cache" / "dojo_opt").rglob("*.nbc")) == []
    assert package.call(DOJO_OPT_CACHE="0") == (NUMBERS, 0, "", [])
    assert package.call(OMP_NUM_THREADS="1", NUMBA_NUM_THREADS="1") == (NUMBERS, 0, "", [])


def test_code_translated_for_other_systems_is_for_their_linkers(package: Package) -> None:
    elf, macho, coff = b"\x7fELF\2\1\1", b"\xcf\xfa\xed\xfe\x0c\0\0\1", b"\x64\x86"
    heads = {"linux-x86_64": elf, "linux-aarch64": elf, "macos-arm64": macho, "windows-x86_64": coff}
    machines = {"linux-x86_64": 62, "linux-aarch64": 183}
    for name, system in SYSTEMS.items():
        shipped = Shipped(package.root / "abroad" / name, system.target, package.index()["stamp"])
        assert shipped.why_not == "" and len(shipped) == len(package.index()["entries"])
        for entry in shipped._entries:
            parts = [part for op, part, _ in pickletools.genops(shipped.read(entry)) if op.name.endswith("BINBYTES")]
            bitcode = [part for part in parts if part.startswith((b"BC\xc0\xde", b"\xde\xc0\x17\x0b"))]
            objects = [part for part in parts if part.startswith(heads[name])]
            assert {llvm.parse_bitcode(part).triple for part in bitcode} == {system.triple}
            assert len(objects) == (0 if "-callee-" in entry else 1)
            for code in objects if name in machines else ():
                assert int.from_bytes(code[18:20], "little") == machines[name]


@pytest.mark.skipif(targets.system_of(llvm.get_process_triple()) != "x86_64-linux", reason="runs code of Linux")
@pytest.mark.skipif("x86-64-v3" not in targets.runnable(), reason="runs code for x86-64-v3")
def test_code_translated_for_another_system_runs_there(package: Package) -> None:
    """Translated code of this system is an entry like any other: it stands for those that cannot run here."""
    for file in package.folder.iterdir():
        file.unlink()
    shutil.copy(package.root / "abroad" / "linux-x86_64" / f"x86-64-v3{SUFFIX}", package.folder)
    assert package.call() == (NUMBERS, 0, "", [])
    assert package.call(CALL_LOOP) == ([3.0], 0, "", [])
    assert package.call(CALL_CLOCK) == ([0.0], 0, "", [])


def test_names_of_entries_keep_no_version_of_a_system() -> None:
    systems = {
        targets.system_of(f"{cpu}-apple-{name}")
        for cpu in ("arm64", "aarch64")
        for name in ("darwin23.6.0", "macosx15")
    }
    assert systems == {"aarch64-darwin"} == {targets.system_of(SYSTEMS["macos-arm64"].triple)}
    assert targets.system_of("x86_64-pc-windows-msvc") == "x86_64-windows"
    assert targets.system_of("x86_64-unknown-linux-gnu") == "x86_64-linux"


def test_kernels_that_loops_of_users_call_are_shipped(package: Package) -> None:
    assert package.call(CALL_LOOP) == ([3.0], 0, "", [])


def test_only_entries_and_what_users_call_are_shipped(package: Package) -> None:
    assert len(Shipped(package.folder, TARGET, "another stamp")) == 0
    stamp = package.index()["stamp"]
    names = sorted(name.split("-")[0] for name in package.index()["entries"])
    assert names == ["own_clock", "own_half", "own_one", "own_total", "users"]
    assert len(Shipped(package.folder, TARGET, stamp)) == 5


def test_an_edited_source_is_compiled(package: Package) -> None:
    for name in ("solvers/own.py", "sim/step.py"):
        before = (package.root / name).read_text()
        (package.root / name).write_text(before + "\n# edited\n")
        assert package.compiles() == ("the shipped code is for other sources or flags", [])
        (package.root / name).write_text(before)
    assert package.call()[1] == 0


@pytest.mark.parametrize(
    ("environment", "why"),
    [
        ({"DOJO_OPT_SHIPPED": "0"}, "DOJO_OPT_SHIPPED=0"),
        ({"DOJO_OPT_PLAIN_NUMBA": "1"}, "other sources or flags"),
        ({"NUMBA_BOUNDSCHECK": "1"}, "other sources or flags"),
        ({"NUMBA_CPU_NAME": "nehalem"}, "no code is shipped for this processor"),
        ({"NUMBA_CPU_NAME": TARGET}, "no code is shipped for this processor"),  # with the features of the host
    ],
    ids=lambda given: next(iter(given), None) if isinstance(given, dict) else None,
)
def test_kernels_that_were_not_shipped_are_compiled(package: Package, environment: dict[str, str], why: str) -> None:
    found, told = package.compiles(**environment)
    assert why in found and told == []


def test_the_target_by_name_is_the_shipped_one(package: Package) -> None:
    assert package.call(**targets.build_environment(TARGET))[1] == 0


def test_another_version_of_numba_is_named(package: Package) -> None:
    package.rewrite(package.index() | {"stamp": "0123456789abcdef", "versions": "Numba 0.1.0 and Python 3.11"})
    why, _ = package.compiles()
    assert why.startswith("the shipped code is for Numba 0.1.0 and Python 3.11, this is Numba")


def test_a_rewritten_index_is_read(package: Package) -> None:
    """The test above relies on this."""
    package.rewrite(package.index())
    assert package.call()[1] == 0


def spoiled(change: Callable[[bytes], bytes]) -> Callable[[Path], object]:
    return lambda path: path.write_bytes(change(path.read_bytes()))


def end_of_loop(data: bytes) -> int:
    """Where the entry of the loop over threads ends in a file."""
    begin = HEAD + int.from_bytes(data[HEAD - 8 : HEAD], "little")
    entries = json.loads(data[HEAD:begin])["entries"]
    ((start, length, _),) = (entry for name, entry in entries.items() if name.startswith("own_total"))
    return begin + start + length


DAMAGE: dict[str, Callable[[Path], object]] = {
    "empty": spoiled(lambda b: b""),
    "cut": spoiled(lambda b: b[: end_of_loop(b) - 100]),
    "cut in its index": spoiled(lambda b: b[:200]),
    "one bit of the index": spoiled(lambda b: b[:300] + bytes([b[300] ^ 1]) + b[301:]),
    "one bit of its length": spoiled(lambda b: b[:56] + bytes([b[56] ^ 64]) + b[57:]),
    "zeros": spoiled(lambda b: bytes(len(b))),
    "a folder": lambda p: (p.unlink(), p.mkdir()),
    "a pipe": lambda p: (p.unlink(), os.mkfifo(p)),
}


@pytest.mark.sweep(5)
@pytest.mark.parametrize("kind", DAMAGE)
def test_a_damaged_file_is_not_used(package: Package, kind: str) -> None:
    DAMAGE[kind](package.file)
    numbers, count, why, told = package.call(CALL if kind == "cut" else CALL_ONE)  # which the cut leaves whole
    assert numbers == NUMBERS and count > 0
    assert why or told


def test_a_damaged_entry_is_one_warning(package: Package) -> None:
    data = bytearray(package.file.read_bytes())
    end = end_of_loop(bytes(data))
    for k in range(end - 2000, end):
        data[k] ^= 1
    package.file.write_bytes(bytes(data))
    numbers, count, _, told = package.call()
    assert numbers == NUMBERS and count > 0
    assert len(told) == 1 and "is damaged" in told[0]


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes of POSIX")
@pytest.mark.parametrize("part", ["file", "folder"])
@pytest.mark.parametrize("whose", ["world", "another user"])
def test_code_that_others_can_write_is_refused(package: Package, part: str, whose: str) -> None:
    path = package.file if part == "file" else package.folder
    if whose == "another user":
        if os.geteuid() != 0:
            pytest.skip("only root gives files away")
        os.chown(path, 12345, 12345)
    else:
        path.chmod(path.stat().st_mode | stat.S_IWOTH)
    why, _ = package.compiles()
    assert str(path) in why and ("belongs to the user with id 12345" in why or "others can write" in why)


@pytest.mark.skipif(not hasattr(os, "geteuid"), reason="modes of POSIX")
def test_the_group_may_write_if_the_owner_is_its_only_member(package: Package) -> None:
    import grp

    package.file.chmod(0o664)
    about = package.file.stat()
    private = targets_private(about)
    assert (package.call()[1] == 0) == private
    if os.geteuid() == 0:
        shared = next(g.gr_gid for g in grp.getgrall() if g.gr_gid != 0)
        os.chown(package.file, 0, shared)
        assert "others can write" in package.compiles()[0]


def targets_private(about: os.stat_result) -> bool:
    """As `is_private_group` should find: by the names of owner and group, and the list of members."""
    import grp
    import pwd

    group = grp.getgrgid(about.st_gid)
    return group.gr_name == pwd.getpwuid(about.st_uid).pw_name and not set(group.gr_mem) - {group.gr_name}


def test_nothing_is_shipped_where_flags_or_sources_differ(package: Package, tmp_path: Path) -> None:
    assert package.call(DOJO_OPT_SHIPPED="0", **targets.build_environment(TARGET))[1] == 4
    cache, out = package.root / "cache", tmp_path / "out"
    program = f"""
from pathlib import Path
from solvers.compiler import cache
{{edit}}
try:
    cache.ship(Path({str(cache)!r}), Path({str(out)!r}), {TARGET!r})
except RuntimeError as error:
    print(error)
"""
    edit = f"Path({str(package.root / 'sim' / 'step.py')!r}).write_text('')"
    assert "nothing was compiled with the flags" in python(
        program.format(edit=""), home=package.root, NUMBA_BOUNDSCHECK="1"
    )
    assert "were edited during the build" in python(program.format(edit=edit), home=package.root)
    assert not out.exists()


def test_a_file_is_written_as_a_whole_or_not_at_all(tmp_path: Path) -> None:
    write_shipped(tmp_path, TARGET, "first", {"name": b"code"})
    with pytest.raises(TypeError):
        write_shipped(tmp_path, TARGET, "second", {"name": b"code", "other": "text"})  # type: ignore[dict-item]
    assert [path.name for path in tmp_path.iterdir()] == [f"{TARGET}{SUFFIX}"]
    assert Shipped(tmp_path, TARGET, "first").read("name") == b"code"


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="looks for processes as Linux lists them")
def test_a_killed_build_leaves_no_file_and_no_worker(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "dojo_opt.prebuild", "--out", str(tmp_path / "out"), "--cache", str(tmp_path)]
    environment = {**os.environ, "PYTHONPATH": str(HOME)}
    build = subprocess.Popen(command, env=environment, cwd=tmp_path, stdout=subprocess.DEVNULL)
    while not list(tmp_path.rglob("*.nbc")) and build.poll() is None:
        time.sleep(0.05)
    threads = Path(f"/proc/{build.pid}/task").iterdir()
    children = [int(pid) for thread in threads for pid in (thread / "children").read_text().split()]
    build.send_signal(signal.SIGKILL)
    build.wait()
    assert children and not (tmp_path / "out").exists()
    for _ in range(600):  # a minute, on a machine that does nothing else
        if not any(map(lives, children)):
            break
        time.sleep(0.1)
    else:
        pytest.fail("workers of a killed build live on")


def lives(pid: int) -> bool:
    """Whether a process is there, and has not ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def test_targets_are_those_that_the_processor_can_run(monkeypatch: pytest.MonkeyPatch) -> None:
    known = dict.fromkeys(targets.FEATURES["x86-64-v3"], True)
    monkeypatch.setattr(targets.platform, "machine", lambda: "x86_64")
    monkeypatch.setattr(targets.llvm, "get_host_cpu_features", lambda: known)
    assert targets.runnable() == ("x86-64-v3", "x86-64-v2")
    wide = known | dict.fromkeys(targets.FEATURES["x86-64-v4"], True)
    monkeypatch.setattr(targets.llvm, "get_host_cpu_features", lambda: wide)
    assert targets.runnable() == ("x86-64-v4", "x86-64-v3", "x86-64-v2")
    assert targets.usual() == ("x86-64-v3",)
    monkeypatch.setattr(targets.llvm, "get_host_cpu_features", lambda: known)
    assert targets.best_target(("x86-64-v2",)) == "x86-64-v2"
    known["avx2"] = False
    assert targets.runnable() == ("x86-64-v2",)
    known["ssse3"] = False
    assert targets.best_target(("x86-64-v2", "x86-64-v3")) is None
    monkeypatch.setattr(targets.platform, "machine", lambda: "riscv64")
    assert targets.runnable() == ()
