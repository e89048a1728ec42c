"""python example.py FILE ARGUMENTS...: run an example as a user does; fail if it compiles what should be shipped."""

import runpy
import sys
from pathlib import Path

USERS = ("dojo_opt.planning.manifold.", "solvers.rotation.")  # compiled into the loops around users' functions

sys.argv = sys.argv[1:]
sys.path[0] = str(Path(sys.argv[0]).parent)
runpy.run_path(sys.argv[0], run_name="__main__")

from solvers.compiler import compiled, shipped  # noqa: E402  (imported by the example, when it needs them)

if not len(shipped()):
    raise SystemExit(f"no code was shipped: {shipped().why_not}")
missing = [name for name in compiled() if not name.startswith(USERS)]
if missing:
    raise SystemExit(f"{sys.argv[0]} compiled what should have been shipped: {', '.join(missing)}")
