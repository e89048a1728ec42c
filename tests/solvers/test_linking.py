"""Kernels inside functions that Numba itself compiles: loops of users and loops over threads."""

from __future__ import annotations

import numpy as np

from solvers.compiler import local_kernel, users_loop

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
