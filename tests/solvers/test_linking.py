"""Kernels inside functions that Numba itself compiles: loops of users and loops over threads."""

from __future__ import annotations

import llvmlite.binding as llvm
import numpy as np
import pytest

from solvers.compiler import local_kernel, users_loop
from solvers.compiler.pipeline import FAST

LINES = (f"    total += np.sin(k * a[{i}] + total) * np.cos(a[{i + 1}])" for i in range(40))
TEXT = "\n".join(("def weight(a, k):", "    total = k", *LINES, "    return total"))  # too long to be inlined


def test_a_copy_of_a_kernel_in_an_entry_is_not_called_by_other_functions():
    """The copy takes fewer arguments; JIT linking once took it for the copy of a loop, by its name."""
    names = {"np": np}
    exec(TEXT, names)
    plain = names["weight"]
    weight = local_kernel(plain)

    def total(a):
        return weight(a, 0.5) + weight(a, 1.5) + weight(a, 2.5)

    a = np.linspace(-2.0, 2.0, 41)
    expected = sum(plain(a, k) for k in (0.5, 1.5, 2.5))
    assert np.isclose(local_kernel(total)(a), expected, rtol=1e-12)
    assert np.isclose(users_loop(total)(a), expected, rtol=1e-12)


def part(name, callee=""):
    """Bitcode of a function that calls another one, as a kernel is kept for its callers."""
    code = f"declare void @{callee}()\ndefine linkonce_odr void @{name}() {{ call void @{callee}() ret void }}"
    return llvm.parse_assembly(code if callee else f"define linkonce_odr void @{name}() {{ ret void }}").as_bitcode()


@pytest.mark.skipif(not FAST, reason="of the fast compiler")
def test_kernels_of_two_processes_are_linked_with_all_callees():
    """Both compiled `f`; one calls its callee g1, the other one g2, which only a later kernel calls here."""
    from solvers.compiler.libraries import Content, _link

    entry = llvm.parse_assembly(
        "declare void @f()\ndeclare void @later()\ndefine void @entry() { call void @f() call void @later() ret void }"
    )
    parts = part("f", "g1"), part("g1"), part("f", "g2"), part("g2"), part("later", "g2")
    _link(entry, Content(parts, (), ()))
    assert [function.name for function in entry.functions if function.is_declaration] == []
