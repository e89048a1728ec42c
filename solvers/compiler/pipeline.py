"""Which pipeline compiles kernels: the fast one, where it knows this Numba, or Numba's own.

The fast pipeline (fast_pipeline.py) builds on private parts of Numba. The results are the same; on Numba's own pipeline
a step takes about 1.3 times as long, and a cold start twice.

    DOJO_OPT_PLAIN_NUMBA=1    Numba's own
"""

from __future__ import annotations

import os
import sys
from typing import Any

import numba
from numba.core.compiler import Compiler, CompileResult

from solvers.compiler.notice import compiling

__all__ = [
    "FAST",
    "EntryCompiler",
    "InnerCompiler",
    "PlainCompiler",
    "SeldomCompiler",
    "UsersCompiler",
    "inner_result",
]

_KNOWN = ("0.66", "0.67", "0.68")  # versions of Numba that the fast pipeline was tested with


class PlainCompiler(Compiler):
    """Numba's own pipeline."""

    own = True

    def compile_extra(self, func: Any) -> Any:
        """Compile one function."""
        with compiling(func, self.own):
            return super().compile_extra(func)


class UsersCompiler(PlainCompiler):
    """The same for functions of the user, and loops around them."""

    own = False


def _compilers() -> tuple[bool, type[Compiler], type[Compiler], type[Compiler], Any]:
    """(whether they are fast, the compiler of entries, of entries that are seldom called, of kernels which kernels
    call, and the function that rebuilds a cached result of the last).
    """
    if os.environ.get("DOJO_OPT_PLAIN_NUMBA", "0") in ("", "0"):
        if any(numba.__version__.startswith(f"{known}.") for known in _KNOWN):
            from solvers.compiler.fast_pipeline import EntryCompiler, InnerCompiler, SeldomCompiler
            from solvers.compiler.libraries import inner_result

            return True, EntryCompiler, SeldomCompiler, InnerCompiler, inner_result
        print(
            f"dojo_opt: Numba {numba.__version__} is not one of {', '.join(_KNOWN)}, which the fast compiler knows: "
            "kernels are compiled by Numba alone, and steps take about 1.3 times as long",
            file=sys.stderr,
        )
    return False, PlainCompiler, PlainCompiler, PlainCompiler, CompileResult._rebuild


FAST, EntryCompiler, SeldomCompiler, InnerCompiler, inner_result = _compilers()
