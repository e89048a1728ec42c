"""Kernels: kept on disk until a source changes, compiled when a scene needs them, once each."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from programs import HOME, PACKAGES, python

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
from sim.joints.ball_spring import spring_impulse
from sim.joints.cone_limit import cone_gap
from sim.coupling.system import factor_coupling
from sim.solve.interior_point import interior_point
from sim.solve.newton import newton
from sim.contacts.pyramid import start_pyramid
from sim.joints.swing import swing_pose
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


FEATURES = (  # what few scenes have: rooms and files with kernels of their own
    "sim.collision.", "sim.coupling.", "sim.high_order.", "sim.pairs.", "sim.parameters.", "sim.terrain.",
    "sim.contacts.pyramid", "sim.contacts.restitution", "sim.joints.cone_limit", "sim.joints.swing",
)  # fmt: skip
NOUNS = (  # what users write and mechanisms ask their parts for
    "sim.collision.broad", "sim.collision.kinds", "sim.contacts.clusters", "sim.contacts.left_out",
    "sim.coupling.closing", "sim.coupling.closure", "sim.coupling.loop_rank", "sim.coupling.nearest", "sim.pairs.touch",
    "sim.joints.swing_coordinates", "sim.terrain.ball_surface", "sim.terrain.spline", "sim.terrain.terrain",
)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize(
    ("program", "foreign"),
    [
        ("dojo.ilqr(dojo.problems.hop())", FEATURES),
        (
            "sim = dojo.Simulator(dojo.models.pendulum())\n"
            "sim.rollout(sim.neutral(), np.zeros((3, sim.nu)))\nsim.linearize(sim.neutral())",
            (*FEATURES, "sim.contacts.", "sim.solve.interior_point", "sim.solve.inequalities", "solvers.cones"),
        ),
    ],
    ids=["hop", "pendulum"],
)
def test_what_few_scenes_have_is_neither_compiled_nor_imported(program: str, foreign: tuple[str, ...]) -> None:
    text = f"""
import json, sys, numpy as np, dojo_opt as dojo
from solvers.jit import compiled_signatures
{program}
print(json.dumps([list(compiled_signatures()), list(sys.modules)]))
"""
    compiled, _ = json.loads(python(text))
    _, imported = json.loads(python(text))  # the first may have compiled, which imports what is called
    assert [name for name in compiled if name.startswith(foreign)] == []
    assert [name for name in imported if name.startswith(foreign) and name not in NOUNS] == []
    assert {"sim.step", "sim.calls"} <= set(imported)


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
