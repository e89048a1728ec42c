"""Machine code for another system than the one that compiles: Linux on ARM, macOS, Windows.

A build runs every kernel that it ships, so it runs where it compiles. Beside the code for that processor it can
translate the same optimised instructions for other systems, and keep them as entries of their own. All of them have
64-bit addresses and the same numbers, so layouts agree; and their C libraries have the same functions, but for the
clock.

    DOJO_OPT_CROSS="linux-aarch64 macos-arm64"    the systems, as a build sets them for its workers; with an empty cache
"""

from __future__ import annotations

import os
import re
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import llvmlite.binding as llvm

from solvers.compiler.targets import system_of

__all__ = ["SYSTEMS", "Crossing", "System", "crossings", "keep_modules"]


class System(NamedTuple):
    """A system: LLVM's name, the target that its processors can run, and its number of the monotonic clock."""

    triple: str
    target: str
    clock: int | None  # of clock_gettime; None: it has none


SYSTEMS = {
    "linux-aarch64": System("aarch64-unknown-linux-gnu", "generic", 1),
    "linux-x86_64": System("x86_64-unknown-linux-gnu", "x86-64-v3", 1),
    "macos-arm64": System("arm64-apple-darwin", "apple-m1", 6),
    "windows-x86_64": System("x86_64-pc-windows-msvc", "x86-64-v3", None),
}

_CLOCK = "dojo_opt_clock"
_POSIX = """
declare i32 @clock_gettime(i32, ptr)
define private i32 @{name}(i32 %which, ptr %moment) {{
  %failed = call i32 @clock_gettime(i32 {clock}, ptr %moment)
  ret i32 %failed
}}"""
_WINDOWS = """
declare i64 @GetTickCount64()
define private i32 @{name}(i32 %which, ptr %moment) {{
  %ticks = call i64 @GetTickCount64()
  %whole = udiv i64 %ticks, 1000
  %rest = urem i64 %ticks, 1000
  %nano = mul i64 %rest, 1000000
  store i64 %whole, ptr %moment
  %second = getelementptr i64, ptr %moment, i64 1
  store i64 %nano, ptr %second
  ret i32 0
}}"""


class Crossing:
    """Translation for one system."""

    def __init__(self, name: str) -> None:
        self.name, self.system = name, SYSTEMS[name]
        llvm.initialize_all_targets()
        llvm.initialize_all_asmprinters()
        relocation = "static" if self.system.triple.startswith("x86") else "default"  # both as Numba has them
        self._machine = llvm.Target.from_triple(self.system.triple).create_target_machine(
            cpu=self.system.target, features="", opt=3, reloc=relocation, codemodel="jitdefault", jit=True
        )

    def folder(self, base: Path) -> Path:
        """Folder for the entries of this system, in that of the compiled code."""
        return base / self.name

    def magic_tuple(self) -> tuple[str, str, str]:
        """Properties in the names of entries, as a process on that system finds them."""
        return system_of(self.system.triple), self.system.target, ""

    def reduced(self, result: Any) -> tuple[Any, ...]:
        """The reduced form of one of Numba's compile results, as on that system."""
        (name, *code), *others = result._reduce()
        if not isinstance(code[0], str):  # a kernel that is shipped as instructions
            *parts, environments = code[0]
            moved = [tuple(self._moved(part).as_bitcode() for part in field) for field in parts]
            return (name, (*moved, environments)), *others
        kind, (_, described) = code
        found = self._machine.emit_object(self._moved(result.library._final_module.as_bitcode()))
        return (name, kind, (found, self._moved(described).as_bitcode())), *others

    def _moved(self, bitcode: bytes) -> Any:
        """A module of that system."""
        module = llvm.parse_bitcode(bitcode)
        if any(function.name == "clock_gettime" for function in module.functions):
            module = self._with_clock(str(module))
        module.triple, module.data_layout = self.system.triple, str(self._machine.target_data)
        return module

    def _with_clock(self, text: str) -> Any:
        """A module that asks the clock of that system."""
        text = re.sub(r"^declare [^\n]*@clock_gettime\(.*$", "", text, flags=re.MULTILINE)
        wrapper = _WINDOWS if self.system.clock is None else _POSIX
        text = text.replace("@clock_gettime(", f"@{_CLOCK}(")
        return llvm.parse_assembly(text + wrapper.format(name=_CLOCK, clock=self.system.clock))


@cache
def crossings() -> tuple[Crossing, ...]:
    """The translations that this process makes beside its own."""
    return tuple(map(Crossing, os.environ.get("DOJO_OPT_CROSS", "").split()))


def keep_modules(codegen: Any) -> None:
    """From now on have copies of optimised modules translated: that puts instructions of this processor into them."""
    take, library = codegen._add_module, "_CPUCodeLibrary__library"  # where Numba's cache of objects looks for it

    def taken(module: Any) -> Any:
        copy = module.clone()
        setattr(copy, library, getattr(module, library))
        return take(copy)

    codegen._add_module = taken
