"""Type inference of kernels: each constraint once, and again when a type that it reads has changed.

Numba goes through all constraints of a function until no type changes, twice at least, and catches the warnings of each
constraint. In a kernel only the variables of loops need a second look.
"""

from __future__ import annotations

from typing import Any

from numba import types
from numba.core import errors, typed_passes
from numba.core.compiler_machinery import register_pass
from numba.core.typeinfer import ConstraintNetwork, IntrinsicCallConstraint, TypeInferer

__all__ = ["KernelInference"]

_ONE = ("src", "value", "index", "index_var", "pair", "iterator", "vararg", "target")  # one variable that is read


def _names(constraint: Any) -> tuple[str, ...]:
    """The variables whose types a constraint reads."""
    read = [getattr(constraint, field, None) for field in _ONE]
    if not isinstance(constraint, IntrinsicCallConstraint):  # whose function is an operator
        read.append(getattr(constraint, "func", None))
    read += [*(getattr(constraint, "args", None) or ()), *(getattr(constraint, "items", None) or ())]
    read += [variable for _, variable in getattr(constraint, "kws", None) or ()]
    return tuple(name for v in read if isinstance(name := getattr(v, "name", v), str))


class _Network(ConstraintNetwork):
    """The constraints of a function."""

    def __init__(self) -> None:
        super().__init__()
        self._names: list[tuple[str, ...]] = []
        self._held: dict[int, list[Any]] = {}  # types that a constraint read when it held, by its number

    def append(self, constraint: Any) -> None:
        """One more."""
        super().append(constraint)
        self._names.append(_names(constraint))

    def propagate(self, typeinfer: Any) -> list[Exception]:
        """Apply the constraints; errors of those that fail, perhaps for want of types that others will find."""
        failed: list[Exception] = []
        variables = typeinfer.typevars
        for k, (constraint, names) in enumerate(zip(self.constraints, self._names, strict=True)):
            held = self._held.get(k)
            if held is not None and held == [variables[name].type for name in names]:
                continue
            try:
                constraint(typeinfer)
            except errors.ForceLiteralArg as error:
                failed.append(error)
            except errors.TypingError as error:
                failed.append(errors.TypingError(str(error), loc=constraint.loc, highlighting=False))
                failed[-1].__cause__ = error
            else:
                found = [variable.type for name in names if (variable := variables.get(name)) is not None]
                if len(found) == len(names) and all(kind is not None and kind.is_precise() for kind in found):
                    self._held[k] = found
        return failed


class _Inferer(TypeInferer):
    """Numba's, with the above."""

    def __init__(self, *args: Any) -> None:
        super().__init__(*args)
        self.constraints = _Network()

    def get_state_token(self) -> list[Any]:
        """The types found so far, in any order that stays."""
        return [variable.type for variable in self.typevars.values()]


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelInference(typed_passes.NopythonTypeInference):
    """Numba's pass, with the above."""

    _name = "kernel_inference"

    def run_pass(self, state: Any) -> bool:
        """Find the types of all variables and calls."""
        infer = _Inferer(state.typingctx, state.func_ir, None)
        with state.typingctx.callstack.register(state.targetctx.target, infer, state.func_id, state.args):
            for k, (name, kind) in enumerate(zip(state.func_ir.arg_names, state.args, strict=True)):
                infer.seed_argument(name, k, kind)
            if state.return_type is not None:
                infer.seed_return(state.return_type)
            for name, kind in state.locals.items():
                infer.seed_type(name, kind)
            infer.build_constraint()
            state.typing_errors = infer.propagate()
            state.typemap, state.return_type, state.calltypes = infer.unify()
        if isinstance(state.return_type, types.Array | types.Function | types.Phantom):
            name = state.func_id.func_qualname
            raise errors.NumbaTypeError(
                f"kernel {name}: expected to return numbers and tuples, got {state.return_type}"
            )
        return True
