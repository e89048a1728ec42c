"""Scripts of benchmarks/ as modules: they are run, not installed, so no import finds them."""

import importlib.util
import sys
from pathlib import Path

FOLDER = Path(__file__).parent.parent / "benchmarks"


def loaded(name):
    """benchmarks/<name>.py as a module for as long as a fixture lasts: `yield from loaded(name)`."""
    sys.path.insert(0, str(FOLDER))  # as when it is run: its neighbours can be imported
    spec = importlib.util.spec_from_file_location(name, FOLDER / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    yield module
    sys.path.remove(str(FOLDER))
    del sys.modules[spec.name]
