"""Build backend: hatchling, with a hook that adds the compiled code of the kernels to a wheel that is not pure.

    DOJO_OPT_PURE=1                        the pure wheel, for any system and Python; compiles on the first use
    DOJO_OPT_PREBUILD=all|examples|none    what is compiled: every entry, or those of guide and models (the default)
    DOJO_OPT_TARGETS="x86-64-v3 ..."       for which processors; by default one that most like this one can run

The code runs with the version of Numba that compiled it. A build in isolation has the newest; `pip install
--no-build-isolation .` takes that of the environment, which needs hatchling then.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

from hatchling import build
from hatchling.builders.hooks.plugin.interface import BuildHookInterface

_NEEDED = ("numba", "numpy", "scipy")  # what running a kernel takes


def _content() -> str:
    """What is compiled; "none" for a pure wheel."""
    if os.environ.get("DOJO_OPT_PURE", "0") not in ("", "0"):
        return "none"
    return os.environ.get("DOJO_OPT_PREBUILD", "") or "examples"


def get_requires_for_build_wheel(config_settings: dict[str, Any] | None = None) -> list[str]:
    """What a wheel needs beside hatchling: the libraries that run a kernel. An editable installation needs none."""
    needed = list(build.get_requires_for_build_wheel(config_settings))
    if _content() == "none":
        return needed
    with open(Path(__file__).with_name("pyproject.toml"), "rb") as file:
        given = tomllib.load(file)["project"]["dependencies"]
    return needed + [text for text in given if re.split(r"[^\w-]", text)[0].lower() in _NEEDED]


for _name in build.__all__:  # the rest of the backend is that of hatchling
    globals().setdefault(_name, getattr(build, _name))


class PrebuildHook(BuildHookInterface):  # type: ignore[type-arg]
    """Compile in worker processes, and add the files to the wheel."""

    _folder: str | None = None

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Before the wheel is written; an editable installation compiles on the first use."""
        if self.target_name != "wheel" or version == "editable" or _content() == "none":
            return
        self._folder = tempfile.mkdtemp(prefix="dojo_opt_build_")
        command = [sys.executable, "-m", "dojo_opt.prebuild", "--content", _content(), "--out", self._folder]
        command += ["--targets", *os.environ["DOJO_OPT_TARGETS"].split()] if "DOJO_OPT_TARGETS" in os.environ else []
        path = os.pathsep.join([self.root, *filter(None, [os.environ.get("PYTHONPATH")])])
        plain = {name: value for name, value in os.environ.items() if not name.startswith(("NUMBA_", "DOJO_OPT_"))}
        done = subprocess.run(command, cwd=self.root, env={**plain, "PYTHONPATH": path})
        if done.returncode:
            raise RuntimeError("the kernels could not be compiled ahead of time; DOJO_OPT_PURE=1 installs without that")
        files = sorted(Path(self._folder).glob("*.kernels"))
        if not files:  # no target is known for this processor: as a pure wheel
            return
        build_data["pure_python"], build_data["infer_tag"] = False, True
        for file in files:
            build_data["force_include"][str(file)] = f"solvers/shipped/{file.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """After the wheel was written."""
        if self._folder is not None:
            shutil.rmtree(self._folder, ignore_errors=True)
