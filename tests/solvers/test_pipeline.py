"""The two pipelines of the compiler are invisible to other users of Numba in the process."""

from __future__ import annotations

import io
import json
import os
from pathlib import Path

import numpy as np
import pytest
from numba.core.bytecode import ByteCode, FunctionIdentity
from numba.core.interpreter import Interpreter

from solvers.compiler.fast_pipeline import drop_caches
from support.fork_server import forked
from support.programs import python

SIMULATION = """
import json, numpy as np, dojo_opt as dojo
from solvers.compiler.pipeline import FAST
sim = dojo.Simulator(dojo.models.hopper() if {whole} else dojo.models.pendulum(), 0.02, divide={whole})
x = sim.neutral()
found = [*sim.integrate(x, 0.3 * np.ones(sim.ndx))]
if {whole}:
    found += [*sim.maximal(x).ravel()]
    for _ in range(3):  # pressed onto the ground, it slides
        x = sim.step(x, 0.1 * np.ones(sim.nu)).x
        found += [*x]
print(json.dumps([FAST, *found]))
"""
WHOLE = os.environ.get("WHOLE_PIPELINE", "0") == "1"  # with steps in contact, which take a minute to compile


@pytest.mark.slow
def test_numbas_own_pipeline_gives_the_same_digits():
    program = SIMULATION.format(whole=WHOLE)
    fast, *numbers = json.loads(python(program, DOJO_OPT_PLAIN_NUMBA="0"))
    plain, *others = json.loads(python(program, DOJO_OPT_PLAIN_NUMBA="1"))
    assert (fast, plain) == (True, False)
    np.testing.assert_allclose(numbers, others, rtol=1e-12, atol=1e-13)


def _branches(a, out):
    total = 0.0
    for i in range(a.shape[0]):
        j = 0
        while j < i and a[i, j] > 0.0:
            total += a[i, j] * a[j, i] if j % 2 else -a[i, j]
            j += 1
        if total > 10.0:
            break
        out[i], out[-1] = total, max(total, a[i, i])
    return total


def test_functions_are_the_same_without_the_caches_in_their_bytecode():
    found = []
    for drops in (False, True):
        function = FunctionIdentity.from_function(_branches)
        bytecode = ByteCode(function)
        if drops:
            drop_caches(bytecode)
            assert "CACHE" not in [instruction.opname for instruction in bytecode]
        text = io.StringIO()
        Interpreter(function).interpret(bytecode).dump(file=text)
        found.append(text.getvalue())
    assert found[0] == found[1] and "getitem" in found[0]


UNKNOWN = """
import contextlib, io, numba
numba.__version__ = "0.99.0"
with contextlib.redirect_stderr(io.StringIO()) as said:
    from solvers.compiler.pipeline import FAST
    import solvers.compiler
print(FAST, said.getvalue().count("\\n"), said.getvalue())
"""


def test_an_unknown_numba_is_used_as_it_is_and_said_so_in_one_line():
    first, *rest = forked(UNKNOWN, DOJO_OPT_PLAIN_NUMBA="0").split()
    assert (first, rest[0]) == ("False", "1") and "0.99.0" in rest
    assert forked(UNKNOWN, DOJO_OPT_PLAIN_NUMBA="1").split() == ["False", "0"]


@pytest.mark.parametrize("setting", ["NUMBA_DEBUGINFO", "NUMBA_ENABLE_PROFILING"])
def test_debug_information_is_for_numbas_own_pipeline(setting: str):
    """With it the fast pipeline makes invalid modules, or kernels with wrong results."""
    program = "from solvers.compiler.pipeline import FAST; print(FAST)"
    assert forked(program, DOJO_OPT_PLAIN_NUMBA="0", **{setting: "1"}).split() == ["False"]
    assert forked(program, DOJO_OPT_PLAIN_NUMBA="0", **{setting: "0"}).split() == ["True"]


@pytest.mark.slow
def test_the_cache_keeps_the_pipelines_apart(tmp_path: Path):
    program = "from solvers.compiler import cache_folder; print(cache_folder().name)"
    names = [forked(program, NUMBA_CACHE_DIR=str(tmp_path), DOJO_OPT_PLAIN_NUMBA=plain) for plain in "01"]
    assert names[0] != names[1]


GUEST = """
{first}
import gc, json, operator
import numba, numpy as np

@numba.njit
def guest(a, i, n, x):
    a[i] += n
    return a[i], a[-1], n + n, n - 1, n / n, x * n, x / x, n < x, n == n, x != x, (n, x) == (n, x), n ** 2, n // 2

@numba.njit
def direct(n, x):
    return operator.add(n, n), operator.mul(x, x), operator.lt(x, x), operator.iadd(n, x)

arguments = np.arange(8.0)[4:], -1, 3, 0.5
found = [repr(guest(*arguments)), repr(direct(3, 0.5))]
found += [str(f.nopython_signatures) for f in (guest, direct)]
context = numba.core.registry.cpu_target.typing_context
plus = context.resolve_value_type(operator.add)
signature = plus.get_call_type(context, (numba.float64, numba.float64), {{}})
found += [str(signature), str(context.resolve_function_type(plus, (numba.int64, numba.float64), {{}}))]
found += [str(gc.get_threshold()), str(gc.isenabled())]
ours = [t.__module__ for t in plus.templates if t.__module__.split(".")[0] in ("dojo_opt", "sim", "solvers")]
print(json.dumps(found + ours))
"""
COMPILE = """
from solvers.compiler import local_kernel
import numpy as np
def product(a, i, n):
    a[i] += n * n + 1.5 * n
    return a[i] / 2.0
product = local_kernel(product)
product(np.zeros(3), 1, 2)
from solvers.lanes import load, store
def lanes(A):
    store(A, 0, 0, 2.0 * load(A, 1, 0) + load(A, 0, 0))
A = np.ones((2, 8))
local_kernel(lanes)(A)
assert A[0, 7] == 3.0
"""


@pytest.fixture(scope="module")
def alone() -> str:
    """What Numba compiles in a process without dojo-opt."""
    return python(GUEST.format(first=""))


@pytest.mark.slow
@pytest.mark.parametrize("plain", ["0", "1"], ids=["fast", "plain"])
def test_numba_compiles_others_functions_as_it_does_without_us(alone: str, plain: str):
    """No type is registered with an operator, not even lanes, by either pipeline."""
    first = "import dojo_opt, sim.integrators.rollout" + COMPILE
    assert python(GUEST.format(first=first), DOJO_OPT_PLAIN_NUMBA=plain) == alone


INDEXED = """
import solvers.compiler.index_typing as index_typing
index_typing.OLD = True  # before the pipeline is chosen
from enum import IntEnum
import numpy as np
from solvers.compiler import local_kernel

class Column(IntEnum):
    FIRST = 0
    THIRD = 2

def move(a, i):
    row = a[i]
    row[Column.FIRST] = a[i, Column.THIRD]
    a[i, Column.THIRD] += row[Column.FIRST]

a = np.arange(6.0).reshape(2, 3)
local_kernel(move)(a, 1)
print(*a.ravel())
"""


@pytest.mark.slow
def test_names_of_columns_are_indices_for_old_numbas_too():
    """Numba 0.66 and 0.67 refuse members of an IntEnum; this one takes them, and has to with our signatures, too."""
    for plain in "01":
        assert forked(INDEXED, DOJO_OPT_PLAIN_NUMBA=plain).split() == ["0.0", "1.0", "2.0", "5.0", "4.0", "10.0"]


PRUNED = """
import os, time
from pathlib import Path
root = Path(os.environ["NUMBA_CACHE_DIR"]) / "dojo_opt"
ages = {}  # [days]
for k, days in enumerate((1, 2, 13, 15, 16, 30, 400)):
    folder = root / f"{k:016x}"
    folder.mkdir(parents=True, mode=0o700)
    (folder / "kernel.nbc").write_bytes(b"")
    os.utime(folder, (time.time() - 86400 * days,) * 2)
(root / "notes").mkdir()
os.utime(root / "notes", (0, 0))
from solvers.compiler import cache_folder, kernel
from solvers import cones
print(len(list(root.iterdir())))
from solvers.dense import dot
import numpy as np
dot(np.ones(2), np.ones(2))
print(*sorted(d.name.lstrip("0") for d in root.iterdir() if d != cache_folder()))
"""


@pytest.mark.slow
def test_folders_are_dropped_when_a_new_one_is_filled_and_only_after_weeks(tmp_path: Path):
    os.chmod(tmp_path, 0o700)
    own = {"NUMBA_CACHE_DIR": str(tmp_path), "DOJO_OPT_CACHE": "1", "DOJO_OPT_SHIPPED": "0"}
    imported, left = forked(PRUNED, **own).splitlines()
    assert imported == "9"  # seven, the notes, and the new one
    assert left.split() == ["1", "2", "notes"]
