"""Processors that code is shipped for: families of them, by LLVM's names, instead of the one that compiles.

Code for x86-64-v3 (AVX2 and FMA, every x86 processor since 2013 to 2015 but the smallest) is as fast as code for the
processor itself, or takes up to a twelfth longer where that has the twice as many registers of x86-64-v4 (AVX-512);
code for x86-64-v2 takes a third longer. The others have one family each: 64-bit ARM has vectors and
fused products in every processor, and all of Apple's later ones can run code for its first.
"""

from __future__ import annotations

import platform
import sys

import llvmlite.binding as llvm
import numba

__all__ = ["FEATURES", "best_target", "build_environment", "runnable", "system_of", "usual"]

_V2 = ("cx16", "popcnt", "sahf", "sse3", "sse4.1", "sse4.2", "ssse3")
_V3 = (*_V2, "avx", "avx2", "bmi", "bmi2", "f16c", "fma", "lzcnt", "movbe")
_V4 = (*_V3, "avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl")

FEATURES: dict[str, tuple[str, ...]] = {  # features of a processor beyond the least of its architecture
    "x86-64-v4": _V4,
    "x86-64-v3": _V3,
    "x86-64-v2": _V2,
    "apple-m1": (),
    "generic": (),  # of 64-bit ARM
}


def target_names() -> tuple[str, ...]:
    """Targets of the architecture of this process, best first; empty where there are none."""
    machine = platform.machine().lower()
    if sys.maxsize < 2**32:  # a 32-bit Python on such a machine
        return ()
    if machine in ("x86_64", "amd64"):
        return ("x86-64-v4", "x86-64-v3", "x86-64-v2")
    if machine in ("aarch64", "arm64"):
        return ("apple-m1",) if sys.platform == "darwin" else ("generic",)
    return ()


def system_of(triple: str) -> str:
    """Processor and system of one of LLVM's names, without versions: that of macOS changes with every update."""
    processor = {"arm64": "aarch64", "amd64": "x86_64"}.get(triple.split("-")[0], triple.split("-")[0])
    known = ("linux", "darwin", "macos", "windows")
    system = next((name for name in known if name in triple), triple)
    return f"{processor}-{'darwin' if system == 'macos' else system}"


def runnable() -> tuple[str, ...]:
    """Targets whose code this processor can run, best first. A user who names a processor to Numba gets that one."""
    if numba.config.CPU_NAME is not None or numba.config.CPU_FEATURES is not None:
        named = numba.config.CPU_NAME if numba.config.CPU_FEATURES == "" else None
        return tuple(target for target in target_names() if target == named)
    try:
        host = dict(llvm.get_host_cpu_features())
    except RuntimeError:  # LLVM does not know this system
        host = {}
    if not numba.config.ENABLE_AVX:  # which Numba turns off where it is known to fail
        host = {name: has and not name.startswith("avx") for name, has in host.items()}
    return tuple(target for target in target_names() if all(host.get(name, False) for name in FEATURES[target]))


def usual() -> tuple[str, ...]:
    """The target of a build unless others are named: the best that most processors can run, for wheels are copied."""
    return tuple(target for target in runnable() if target != "x86-64-v4")[:1]


def best_target(shipped: tuple[str, ...]) -> str | None:
    """The best of the shipped targets that this processor can run; None: none of them."""
    return next((target for target in runnable() if target in shipped), None)


def build_environment(target: str) -> dict[str, str]:
    """Variables of a process that compiles for a target.

    Without the empty list of features Numba adds those of the processor it runs on to the named one. Intel's vector
    functions are a library of the machine that compiles.
    """
    return {"NUMBA_CPU_NAME": target, "NUMBA_CPU_FEATURES": "", "NUMBA_DISABLE_INTEL_SVML": "1"}
