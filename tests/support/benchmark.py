"""Scripts of benchmarks/ and docs/ as modules: they are run, not installed, so no import finds them."""

import importlib.util
import sys
from pathlib import Path

ROOT = Path(__file__).parents[2]


def loaded(name, folder="benchmarks"):
    """<folder>/<name>.py as a module for as long as a fixture lasts: `yield from loaded(name)`."""
    sys.path.insert(0, str(ROOT / folder))  # as when it is run: its neighbours can be imported
    spec = importlib.util.spec_from_file_location(name, ROOT / folder / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    sys.path.remove(str(ROOT / folder))
    del sys.modules[spec.name]
