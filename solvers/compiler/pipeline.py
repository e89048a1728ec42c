"""Which pipeline compiles kernels: the fast one, where it knows this Numba, or Numba's own.

The fast pipeline (fast_pipeline.py) builds on private parts of Numba. The results are the same; on Numba's own pipeline
a step takes about 1.3 times as long, and a cold start twice.

    DOJO_OPT_PLAIN_NUMBA=1    Numba's own
    NUMBA_DEBUGINFO=1         Numba's own, too: the fast pipeline drops the scopes that debug information refers to
"""

from __future__ import annotations

import os
import sys
from typing import Any, NamedTuple

import numba
from numba.core import config
from numba.core.compiler import Compiler, CompileResult
from numba.core.untyped_passes import IRProcessing

from solvers.compiler.index_checks import RefuseNegativeIndices
from solvers.compiler.index_typing import IndexTyping
from solvers.compiler.operators import OPERATORS, with_our_cases
from solvers.compiler.progress import compiling

__all__ = [
    "FAST",
    "EntryCompiler",
    "InnerCompiler",
    "OptionalCompiler",
    "PlainCompiler",
    "RolledCompiler",
    "SeldomCompiler",
    "inner_result",
]

_KNOWN = ("0.66", "0.67", "0.68")  # versions of Numba that the fast pipeline was tested with


class _PlainTyping(IndexTyping):
    """Numba's typing context, with the operators of types of our own."""

    __slots__ = ()

    def resolve_value_type(self, val: Any) -> Any:
        """The type of a constant."""
        found = super().resolve_value_type(val)
        return with_our_cases(val, found) if any(val is op for op, *_ in OPERATORS) else found


class PlainCompiler(Compiler):
    """Numba's own pipeline."""

    own = True

    def __init__(self, typingctx: Any, *others: Any) -> None:
        super().__init__(_PlainTyping(typingctx), *others)
        self.state.targetctx.typing_context = self.state.typingctx  # of a copy that is this compilation's own

    def define_pipelines(self) -> list[Any]:
        """Numba's passes, and a look at indices where bounds are checked."""
        pipelines: list[Any] = super().define_pipelines()
        if self.own and config.BOUNDSCHECK:
            for passes in pipelines:
                passes.add_pass_after(RefuseNegativeIndices, IRProcessing)
                passes.finalize()
        return pipelines

    def compile_extra(self, func: Any) -> Any:
        """Compile one function."""
        with compiling(func, self.own):
            return super().compile_extra(func)


class _Compilers(NamedTuple):
    """Compilers of each form of a kernel."""

    fast: bool
    entry: type[Compiler]  # called from Python
    optional: type[Compiler]  # called by its address
    rolled: type[Compiler]  # the same, with loops of few rounds
    seldom: type[Compiler]  # the same, by few steps
    inner: type[Compiler]  # called by kernels
    inner_result: Any  # rebuilds a cached result of the last


def _compilers() -> _Compilers:
    if os.environ.get("DOJO_OPT_PLAIN_NUMBA", "0") in ("", "0") and not config.DEBUGINFO_DEFAULT:
        if any(numba.__version__.startswith(f"{known}.") for known in _KNOWN):
            from solvers.compiler import fast_pipeline as fast
            from solvers.compiler.libraries import inner_result

            by_address = (fast.OptionalCompiler, fast.RolledCompiler, fast.SeldomCompiler)
            return _Compilers(True, fast.EntryCompiler, *by_address, fast.InnerCompiler, inner_result)
        print(
            f"dojo_opt: Numba {numba.__version__} is not one of {', '.join(_KNOWN)}, which the fast compiler knows: "
            "kernels are compiled by Numba alone, and steps take about 1.3 times as long",
            file=sys.stderr,
        )
    return _Compilers(False, *(PlainCompiler,) * 5, CompileResult._rebuild)


FAST, EntryCompiler, OptionalCompiler, RolledCompiler, SeldomCompiler, InnerCompiler, inner_result = _compilers()
