"""Libraries of LLVM code: of kernels that kernels call, and of entries.

Numba optimises every function together with all that it calls, translates it to machine code, and does both again
for each of its callers. Here a kernel that kernels call is kept as it was written, and only entries are optimised and
translated. Inside an entry everything but itself is private, so that the optimiser may drop unused arguments and
uncalled copies.
"""

from __future__ import annotations

from functools import cache
from itertools import chain
from typing import Any, NamedTuple

import llvmlite.binding as llvm
from numba.core import cgutils
from numba.core.codegen import CodeLibrary, JITCodeLibrary
from numba.core.compiler import CompileResult
from numba.core.environment import lookup_environment

__all__ = ["EntryLibrary", "InnerLibrary", "OptionalLibrary", "RolledLibrary", "SeldomLibrary", "inner_result"]

_ENVIRONMENT = "_ZN08NumbaEnv"  # Numba looks for such a variable of every function


class _Idle:
    """A code generator without an environment to set: that of code which does not run."""

    @staticmethod
    def set_env(name: str, environment: Any) -> None:
        """Do nothing: entries set those that they hold."""


class Content(NamedTuple):
    """Code of a kernel for its callers."""

    kernels: tuple[bytes, ...]  # bitcode of the kernel, and of its callees
    numbas: tuple[bytes, ...]  # of functions that Numba compiled
    environments: tuple[str, ...]  # their names


class _Name(NamedTuple):
    """A variable of a module."""

    name: str


class _Names(NamedTuple):
    """The environments in a module that is no longer there, for Numba, which keeps them with the code."""

    global_variables: list[_Name]


def _make_smaller(codegen: Any, ll_module: Any) -> None:
    """Numba runs all of its optimisations on each function; each entry does so again, after these three."""
    ll_module.data_layout = codegen._data_layout
    passes, builder = llvm.create_new_function_pass_manager(), codegen._pass_builder()
    passes.add_sroa_pass()
    passes.add_instruction_combine_pass()
    passes.add_simplify_cfg_pass()
    for function in ll_module.functions:
        if not function.is_declaration:
            passes.run(function, builder)


class InnerLibrary(JITCodeLibrary):
    """Code of a kernel for its callers: made smaller, not optimised, never translated.

    It holds the kernel itself and the code of each of its callees, direct or not, side by side. Only what runs links
    them: linked for each caller, every module was copied and parsed again by all callers of its callers.
    """

    def __init__(self, codegen: Any, name: str) -> None:
        CodeLibrary.__init__(self, codegen, name)  # Numba's own parses an empty module to link into
        self._linking_libraries: list[Any] = []
        self._final_module: Any = None
        self._shared_module: Any = None
        self.content = Content((), (), ())

    @property
    def codegen(self) -> Any:
        """For Numba, which has a new function set its environment."""
        return _Idle

    def get_pointer_to_function(self, name: str) -> int:
        """Numba's sign of a function without a way in for Python."""
        self._ensure_finalized()
        return 0

    def add_ir_module(self, ir_module: Any) -> None:
        """Parse the code of the kernel itself."""
        self._raise_if_finalized()
        module = llvm.parse_assembly(cgutils.normalize_ir_text(str(ir_module)))
        module.name = ir_module.name
        self.add_llvm_module(module)

    def add_llvm_module(self, ll_module: Any) -> None:
        """Take the code of the kernel itself."""
        _make_smaller(self._codegen, ll_module)
        if self._final_module is None:
            self._final_module = ll_module
        else:
            self._final_module.link_in(ll_module)

    def finalize(self) -> None:
        """Gather the code; nothing is optimised or linked."""
        self._raise_if_finalized()
        self._final_module.verify()
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                function.linkage = "linkonce_odr"
        self._finalize_dynamic_globals()
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
            self._dynamic_globals += library._dynamic_globals
        self._final_module.name = self.name
        own = Content((self._final_module.as_bitcode(),), (), _environments(self._final_module))
        self.content = _joined([own, *map(_content_of, self._linking_libraries)])
        self._final_module = _Names([_Name(name) for name in self.content.environments])
        self._finalized = True

    def _get_module_for_linking(self) -> Any:
        """For Numba's own libraries: the kernel, with all callees."""
        self._ensure_finalized()
        if self._shared_module is None:
            self._shared_module = llvm.parse_bitcode(self.content.kernels[0])
            _link(self._shared_module, self.content._replace(kernels=self.content.kernels[1:]))
            _relink(self._shared_module, llvm.Linkage.weak_odr, "linkonce_odr")  # as Numba has it
        return self._shared_module

    def serialize_using_object_code(self) -> Any:
        """The state that `inner_result` reads."""
        self._ensure_finalized()
        return self.name, tuple(self.content)

    @classmethod
    def read(cls, codegen: Any, kept: tuple[str, tuple[Any, ...]]) -> InnerLibrary:
        """A library that was kept."""
        library = cls(codegen, kept[0])
        library.content = Content(*kept[1])
        library._finalized = library._disable_inspection = True
        return library


def _joined(parts: list[Content]) -> Content:
    """All of them, each piece once."""
    fields = zip(Content((), (), ()), *parts, strict=True)
    return Content(*(tuple(dict.fromkeys(chain.from_iterable(field))) for field in fields))


def _environments(module: Any) -> tuple[str, ...]:
    return tuple(v.name for v in module.global_variables if v.name.startswith(_ENVIRONMENT))


@cache
def _content_of(library: Any) -> Content:
    if isinstance(library, InnerLibrary):
        return library.content
    module = library._get_module_for_linking()
    return Content((), (module.as_bitcode(),), _environments(module))


def _relink(module: Any, old: Any, new: str) -> None:
    """Functions of one linkage get another one."""
    for function in module.functions:
        if not function.is_declaration and function.linkage == old:
            function.linkage = new


def _link(module: Any, content: Content) -> None:
    """Add kernels to a module, and the functions of Numba that they call.

    All kernels: LLVM omits a function that may be defined several times (`linkonce`) where nothing calls it yet. Of two
    processes that compiled the same kernel, whose callees have other names in each, only the first copy gets in; and
    the callees of the second may have further callers, which come later. Functions of Numba only if they are called:
    every kernel comes with its reference counts.
    """
    for part in content.kernels:
        other = llvm.parse_bitcode(part)
        _relink(other, llvm.Linkage.linkonce_odr, "weak_odr")
        module.link_in(other)
    for part in content.numbas:
        module.link_in(llvm.parse_bitcode(part))


class _Kept:
    """A target context with one change: the library of a kernel that was kept is an `InnerLibrary`."""

    def __init__(self, context: Any) -> None:
        self._context = context

    def __getattr__(self, name: str) -> Any:
        return getattr(self._context, name)

    def codegen(self) -> Any:
        """For Numba, which asks it for the library."""
        return self

    def unserialize_library(self, kept: Any) -> InnerLibrary:
        """The library."""
        return InnerLibrary.read(self._context.codegen(), kept)


def inner_result(context: Any, *payload: Any) -> Any:
    """Numba's compile result of a kernel that kernels call, from the reduced one."""
    found = CompileResult._rebuild(_Kept(context), *payload)
    return found._replace(target_context=context)


class EntryLibrary(JITCodeLibrary):
    """Code of an entry, with all that it calls.

    Its copies of kernels are private, not internal. LLVM drops arguments of either, but its JIT linker knows internal
    functions by name too, and takes one for the copy of the same kernel in any function that Numba itself compiles.
    """

    def _optimize_functions(self, ll_module: Any) -> None:
        _make_smaller(self._codegen, ll_module)

    def finalize(self) -> None:
        """Link the code of all callees, optimise it, and translate it."""
        for library in self._linking_libraries:
            self._reload_init.update(library._reload_init)
        _link(self._final_module, _joined([*map(_content_of, self._linking_libraries)]))
        self._linking_libraries: list[Any] = []  # for Numba, which links them one by one
        super().finalize()

    def _optimize_final_module(self) -> None:
        for linkage in (llvm.Linkage.weak_odr, llvm.Linkage.linkonce_odr):
            _relink(self._final_module, linkage, "private")
        self._optimize()

    def _optimize(self) -> None:
        """All that Numba does."""
        super()._optimize_final_module()

    def _finalize_final_module(self) -> None:
        """Translate, and set the environments of all kernels in it."""
        super()._finalize_final_module()
        for name in _environments(self._final_module):
            if (environment := lookup_environment(name)) is not None:
                self._codegen.set_env(name, environment)

    def _get_module_for_linking(self) -> Any:
        """Data cached beside the machine code, a module with the names of this one: nothing links an entry, and Numba
        needs the variables that it looks for, and the external functions.
        """
        self._ensure_finalized()
        text = str(self._codegen._create_empty_module(self.name))
        for name in _environments(self._final_module):
            text += f'\n@"{name}" = common global i8* null'
        for function in self._final_module.functions:
            if not function.is_declaration and function.linkage == llvm.Linkage.external:
                text += f'\ndefine void @"{function.name}"() {{\n  ret void\n}}'
        return llvm.parse_assembly(text)


class OptionalLibrary(EntryLibrary):
    """An optional kernel: its loops run over a few joints, axes or contacts. Vectors of several rounds of a loop make
    them slower, by up to a tenth, and take a tenth of a cold start; those of neighbouring numbers gain nothing, and
    take a fiftieth. Kernels that need vectors have lanes.py.
    """

    def _optimize(self) -> None:
        passes, builder = self._codegen._module_pass_manager(loop_vectorize=False, slp_vectorize=False)
        passes.run(self._final_module, builder)


class RolledLibrary(EntryLibrary):
    """An optional kernel whose loops have few rounds, unknown beforehand. To unroll them gains nothing, and doubles the
    code: 0.6 of the 1.4 s that the system of the couplings takes. Anywhere else a step would be slower by a tenth.
    """

    def _optimize(self) -> None:
        tuning = llvm.create_pipeline_tuning_options(speed_level=2)
        tuning.loop_vectorization, tuning.slp_vectorization, tuning.loop_unrolling = False, False, False
        builder = llvm.create_pass_builder(self._codegen._tm, tuning)
        builder.getModulePassManager().run(self._final_module, builder)


class SeldomLibrary(EntryLibrary):
    """An entry that few steps call: optimised in a third of the time, for half the speed."""

    def _optimize(self) -> None:
        passes, builder = self._codegen._module_pass_manager(opt=1, loop_vectorize=False, slp_vectorize=False)
        passes.run(self._final_module, builder)
