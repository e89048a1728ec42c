"""A callback from JAX to Python with NumPy arrays.

`jax.pure_callback` turns its arguments into arrays of JAX, which copies them on its computation threads, where
callbacks run, too. With a single thread, as on one core, a callback with large arguments deadlocks (jax 0.10). This is
the same without arrays of JAX.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np

__all__ = ["called"]

_KIND = np.dtype("float64")
Shapes = tuple[tuple[int, ...], ...]


def called(function: Callable[..., Any], shapes: Shapes, *arrays: Any) -> Any:
    """The results of function(*arrays), a tuple of doubles of these shapes; under vmap all have a leading axis.

    The function is kept, and compared, to tell whether a computation is known: a method of an object, not a lambda.
    """
    return _primitive().bind(*arrays, function=function, shapes=shapes)


@lru_cache(1)
def _primitive() -> Any:
    import jax
    from jax.extend.core import Primitive
    from jax.interpreters import batching, mlir

    call = Primitive("dojo_opt_call")
    call.multiple_results = True

    def lower(context: Any, *arrays: Any, function: Callable[..., Any], shapes: Shapes) -> Any:
        kinds = context.avals_in, context.avals_out
        return mlir.emit_python_callback(context, function, None, list(arrays), *kinds, has_side_effect=False)[0]

    def batch(arrays: Any, axes: Any, *, function: Callable[..., Any], shapes: Shapes) -> Any:
        n = next(array.shape[axis] for array, axis in zip(arrays, axes, strict=True) if axis is not None)
        rows = [
            jax.numpy.broadcast_to(array, (n, *array.shape)) if axis is None else jax.numpy.moveaxis(array, axis, 0)
            for array, axis in zip(arrays, axes, strict=True)
        ]
        return called(function, tuple((n, *shape) for shape in shapes), *rows), [0] * len(shapes)

    call.def_abstract_eval(lambda *_, function, shapes: [jax.core.ShapedArray(shape, _KIND) for shape in shapes])
    call.def_impl(jax.jit(call.bind, static_argnames=("function", "shapes")))
    mlir.register_lowering(call, lower)
    batching.primitive_batchers[call] = batch
    return call
