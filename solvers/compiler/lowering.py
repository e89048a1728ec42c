"""Translation of kernels to LLVM instructions: entries and rows of arrays, shapes, plain arithmetic.

For one entry of a matrix Numba 0.68 writes 45 instructions, most of which copy its seven words about, and looks through
every implementation of every operator for each `+`: reading, cleaning and optimising that was a third of a cold start.
Here the same takes four to ten, which the optimiser turns into the same code. Everything else is left to Numba.

Reads and writes say what they can meet (LLVM's `tbaa`): numbers of their type, in the same field of a record where the
field is known, for no two fields share memory. So a write to one leaves the numbers read from others in registers.

An index counts from the end where it is written as a number, a[-1]. Any other must not be negative: to ask, at every
access, whether it is took a tenth of the time of a step. Where bounds are checked (NUMBA_BOUNDSCHECK=1), a negative
index is an IndexError like one beyond the end: the checks catch reads of other memory.
"""

from __future__ import annotations

from collections import Counter
from typing import Any

from llvmlite.ir import Constant, IntType, MetaDataString
from numba import types
from numba.core import cgutils, ir
from numba.core.analysis import compute_cfg_from_blocks, must_use_alloca
from numba.core.compiler_machinery import register_pass
from numba.core.errors import NumbaError
from numba.core.lowering import Lower
from numba.core.typed_passes import NativeLowering

from solvers.compiler.arithmetic import ARITHMETIC, choice
from solvers.compiler.array_words import DATA, SHAPE, STRIDES, WORD, ArrayWords
from solvers.compiler.operators import OPERATORS
from solvers.compiler.ranges import RANGE, Loop, RangeIterator, RangeRound, RangeValue
from solvers.compiler.records import RecordType, field_words

__all__ = ["KernelLowering"]

_NUMBERS = (types.float64, types.int64)


def _is_whole(kind: Any) -> bool:
    """Whether a type is that of whole numbers, or of names for them."""
    kind = types.unliteral(kind)
    return kind == types.int64 or (isinstance(kind, types.IntEnumMember) and kind.dtype == types.int64)


def _variables_read(statement: Any) -> list[str]:
    """Names of the variables that a statement reads."""
    value = statement.value if isinstance(statement, ir.Assign) else statement
    if isinstance(value, ir.Var):
        return [value.name]
    return [v.name for v in value.list_vars()] if isinstance(value, ir.Inst) else []


class _Lower(Lower):
    """Numba's lowering with the changes above, for functions without reference counts."""

    _disable_sroa_like_opt = False  # Numba looks for debug information, which kernels have on its own pipeline only

    def init(self) -> None:
        """Before anything is lowered."""
        super().init()
        self._items: dict[Any, list[Any]] = {}  # of tuples, by their values
        self._refusals: dict[str, Any] = {}  # blocks that end the kernel, by their messages
        self._accesses: dict[tuple[str, str], Any] = {}  # what `_mark` writes, by type and field

    def _find_singly_assigned_variable(self) -> None:
        """Variables that need no place in memory: assigned once, where all that use them come by after that."""
        blocks = self.func_ir.blocks
        above = compute_cfg_from_blocks(blocks).dominators()
        times = Counter(s.target.name for block in blocks.values() for s in block.find_insts(ir.Assign))
        home = {s.target.name: label for label, block in blocks.items() for s in block.find_insts(ir.Assign)}
        several = {name for name, count in times.items() if count > 1}
        for label, block in blocks.items():
            found: set[str] = set()  # names assigned so far in this block
            for statement in block.body:
                for name in _variables_read(statement):
                    origin = home.get(name, label)
                    before = name in found if origin == label else origin < label and origin in above[label]
                    if not before:
                        several.add(name)
                if isinstance(statement, ir.Assign):
                    found.add(statement.target.name)
        self._singly_assigned_vars = set(home) - several - set(must_use_alloca(blocks))
        self._blk_local_varmap: dict[str, Any] = {}

    def extract_function_arguments(self) -> list[Any]:
        """The arguments, arrays among them as words."""
        flat = iter(self.call_conv.get_arguments(self.function))
        self.fnargs = []
        for kind in self.fndesc.argtypes:
            packer = self.call_conv._get_arg_packer((kind,))
            words = [next(flat) for _ in packer.argument_types]
            if isinstance(kind, types.Array):
                self.fnargs.append(ArrayWords.from_flat(words, kind.ndim))
            else:
                self.fnargs += packer.from_arguments(self.builder, words)
        return self.fnargs

    def loadvar(self, name: str) -> Any:
        """The value of a variable."""
        value = super().loadvar(name)
        return self._as_value(value, self.typeof(name))

    def _as_value(self, value: Any, kind: Any) -> Any:
        """Of words one value."""
        if isinstance(value, ArrayWords | RangeValue | RangeIterator | RangeRound):
            return value.value(self.builder, self.context.get_value_type(kind))
        return value

    def storevar(self, value: Any, name: str, argidx: Any = None) -> None:
        """Keep the value of a variable: no reference is counted, so its last one is of no interest."""
        kind = self.typeof(name)
        self._alloca_var(name, kind)
        if name in self._singly_assigned_vars:
            self._blk_local_varmap[name] = value
        else:
            self.builder.store(self._as_value(value, kind), self.getvar(name))

    def lower_block(self, block: Any) -> None:
        """The statements of a block; an error names its own."""
        self.pre_block(block)
        statement = None
        try:
            for statement in block.body:
                self.loc = statement.loc
                self.lower_inst(statement)
        except NumbaError as error:
            error.add_context(f'lowering "{statement}" at {self.loc}')
            raise
        self.post_block(block)

    def lower_inst(self, inst: Any) -> None:
        """One statement."""
        if isinstance(inst, ir.Assign):
            self.storevar(self.lower_assign(self.typeof(inst.target.name), inst), inst.target.name)
        elif isinstance(inst, ir.Jump) and (head := self.blkmap[inst.target]).instructions:  # written before: a loop
            self.builder.branch(head).set_metadata("llvm.loop", Loop.of(self.builder.module))
        elif not (isinstance(inst, ir.SetItem | ir.StaticSetItem) and self._write(inst)):
            super().lower_inst(inst)

    def lower_assign(self, ty: Any, inst: Any) -> Any:
        """Lower the assigned value."""
        value = inst.value
        if isinstance(ty, types.Dispatcher):
            return self.context.get_dummy_value()
        if isinstance(value, ir.Var) and ty == self.typeof(value.name) and value.name in self._blk_local_varmap:
            return self._blk_local_varmap[value.name]
        if isinstance(value, ir.Arg) and isinstance(self.fnargs[value.index], ArrayWords):
            words, kind = self.fnargs[value.index], self.typeof("arg." + value.name)
            return words if kind == ty else self.context.cast(self.builder, self._as_value(words, kind), kind, ty)
        return super().lower_assign(ty, inst)

    def lower_expr(self, resty: Any, expr: Any) -> Any:
        """One expression."""
        if expr.op in ("getitem", "static_getitem"):
            value = self._read(resty, expr.value.name, expr.index if expr.op == "getitem" else expr.index_var)
            if value is not None:
                return value
            items = self._items.get(self._blk_local_varmap.get(expr.value.name))
            if items is not None and expr.op == "static_getitem" and isinstance(expr.index, int):
                kind = self.typeof(expr.value.name).types[expr.index]
                return self.context.cast(self.builder, items[expr.index], kind, resty)
        elif expr.op == "getattr":
            kind = self.typeof(expr.value.name)
            if isinstance(kind, RecordType):
                return field_words(self.context, self.builder, kind, self.loadvar(expr.value.name), expr.attr)
            if expr.attr == "shape" and isinstance(kind, types.Array):
                sizes = [self._word(expr.value.name, SHAPE, k) for k in range(kind.ndim)]
                value = cgutils.pack_array(self.builder, sizes)
                self._items[value] = sizes
                return value
        elif expr.op in ("getiter", "iternext", "pair_first", "pair_second"):
            value = self._lower_loop(resty, expr)
            if value is not None:
                return value
        value = super().lower_expr(resty, expr)
        if expr.op == "build_tuple":
            kinds = zip(expr.items, resty, strict=True)
            self._items[value] = [self._cast_var(item, kind) for item, kind in kinds]
        return value

    def _lower_loop(self, resty: Any, expr: Any) -> Any:
        """A part of a loop over a range; None: of another loop."""
        held = self._blk_local_varmap.get(expr.value.name)
        if isinstance(held, RangeValue) and expr.op == "getiter":
            return held.begin(self.builder)
        if isinstance(held, RangeIterator) and expr.op == "iternext":
            return held.go_on(self.builder)
        if isinstance(held, RangeRound) and expr.op == "pair_first":
            return self.context.cast(self.builder, held.number, types.int64, resty)
        return held.follows if isinstance(held, RangeRound) and expr.op == "pair_second" else None

    def _lower_call_normal(self, fnty: Any, expr: Any, signature: Any) -> Any:
        """A call: of a kernel with its words as they are, and with the caller's place for an exception."""
        if isinstance(fnty, types.Function) and (write := choice(fnty.typing_key, signature.args)):
            values = [self._cast_var(var, kind) for var, kind in zip(expr.args, signature.args, strict=True)]
            return write(self.builder, *values)
        if isinstance(fnty, types.Function) and fnty.typing_key is range and signature.return_type == RANGE:
            found = RangeValue.of(
                [self._cast_var(var, kind) for var, kind in zip(expr.args, signature.args, strict=True)]
            )
            if found is not None:
                return found
        code = fnty.dispatcher.overloads.get(tuple(signature.args)) if isinstance(fnty, types.Dispatcher) else None
        plain = not (expr.vararg or expr.kws) and len(expr.args) == len(signature.args)
        if code is None or not plain or isinstance(signature.return_type, types.Optional):
            return super()._lower_call_normal(fnty, expr, signature)
        b, desc = self.builder, code.fndesc
        self.library.add_linking_library(code.library)
        place = cgutils.alloca_once(b, self.call_conv.get_return_type(desc.restype).pointee, zfill=False)
        words = [word for var, kind in zip(expr.args, desc.argtypes, strict=True) for word in self._passed(var, kind)]
        failed = b.call(self.context.declare_function(b.module, desc), [place, self.function.args[1], *words])
        with cgutils.if_unlikely(b, cgutils.is_not_null(b, failed)):
            b.ret(failed)
        return self.context.get_returned_value(b, desc.restype, b.load(place))

    def _passed(self, var: Any, kind: Any) -> Any:
        """The words that a function takes for a variable."""
        held = self._blk_local_varmap.get(var.name)
        if isinstance(held, ArrayWords) and self.typeof(var.name) == kind:
            return held.flat
        return self.call_conv._get_arg_packer((kind,)).as_arguments(self.builder, [self._cast_var(var, kind)])

    def lower_binop(self, resty: Any, expr: Any, op: Any) -> Any:
        """An operator of two numbers, or of types that have one in kernels."""
        kinds = self.fndesc.calltypes[expr].args
        write = ARITHMETIC.get((op, kinds[0])) if kinds[0] == kinds[1] else None
        if write is None and (op, *kinds) in OPERATORS:
            write = OPERATORS[op, *kinds][1]
        if write is None:
            return super().lower_binop(resty, expr, op)
        x, y = (
            self.context.cast(self.builder, self.loadvar(side.name), self.typeof(side.name), kind)
            for side, kind in zip((expr.lhs, expr.rhs), kinds, strict=True)
        )
        result = self.fndesc.calltypes[expr].return_type
        return self.context.cast(self.builder, write(self.builder, x, y), result, resty)

    def _word(self, name: str, *path: int) -> Any:
        """A word of an array."""
        held = self._blk_local_varmap.get(name)
        if isinstance(held, ArrayWords):
            return held.word(*path)
        if held is not None:
            return self.builder.extract_value(held, path)
        slot = self.builder.gep(self.getvar(name), [IntType(32)(k) for k in (0, *path)], inbounds=True)
        return self.builder.load(slot)

    def _indices(self, index: Any) -> list[Any] | None:
        """The whole numbers of an index; None when it has anything else, a slice for one."""
        if index is None:
            return None
        kind = types.unliteral(self.typeof(index.name))
        several = isinstance(kind, types.BaseTuple)
        if not all(map(_is_whole, kind.types if several else (kind,))):
            return None
        value = self.loadvar(index.name)
        if not several:
            return [value]
        return self._items.get(value) or [self.builder.extract_value(value, k) for k in range(len(kind.types))]

    def _place(self, name: str, index: Any) -> tuple[Any, list[int]] | None:
        """Where entry or row array[index] begins, and which dimensions it has left; None: not for us."""
        kind = self.typeof(name)
        if not isinstance(kind, types.Array) or kind.layout != "C" or kind.dtype not in _NUMBERS or not kind.aligned:
            return None
        indices = self._indices(index)
        if indices is None or len(indices) > kind.ndim:
            return None
        b = self.builder
        offset: Any = WORD(0)
        for k in range(kind.ndim):
            i = indices[k] if k < len(indices) else WORD(0)
            known = isinstance(i, Constant) and i.constant >= 0
            if self.context.enable_boundscheck and k < len(indices):
                self._check(i, name, k)
            zero = [isinstance(n, Constant) and n.constant == 0 for n in (offset, i)]
            size = self._word(name, SHAPE, k) if not (known and zero[0]) else None
            if isinstance(i, Constant) and not known:
                i = b.add(i, size)
            if zero[0]:
                offset = i
            else:
                offset = b.mul(offset, size, flags=["nsw", "nuw"])
                offset = offset if zero[1] else b.add(offset, i, flags=["nsw", "nuw"])
        return b.gep(self._word(name, DATA), [offset], inbounds=True), list(range(len(indices), kind.ndim))

    def _check(self, index: Any, name: str, k: int) -> None:
        """Look at the bounds of dimension k; a number that is written as a negative one counts from the end."""
        size = self._word(name, SHAPE, k)
        place = self.builder.add(index, size) if isinstance(index, Constant) and index.constant < 0 else index
        outside = self.builder.icmp_unsigned(">=", place, size)  # negative numbers are large ones, too
        array = "an array" if name.startswith("$") else name.split(".")[0]
        refusal = self._refusal(f"index outside {array}, axis {k}, or negative")
        inside = self.builder.append_basic_block("inside")
        self.builder.cbranch(outside, refusal, inside).set_weights([1, 99])
        self.builder.position_at_end(inside)

    def _refusal(self, why: str) -> Any:
        """The block that raises IndexError: one for all looks with one message, for code grows by each."""
        if why not in self._refusals:
            self._refusals[why] = block = self.builder.append_basic_block("outside")
            said = f"kernel {self.func_ir.func_id.func_qualname}: {why}"
            with self.builder.goto_block(block):
                self.call_conv.return_user_exc(self.builder, IndexError, (said,))
        return self._refusals[why]

    def _read(self, resty: Any, name: str, index: Any) -> Any:
        """array[index], an entry or a row."""
        place = self._place(name, index)
        if place is None:
            return None
        data, left = place
        kind = self.typeof(name)
        if not left:
            number = self.builder.load(data)
            self._mark(number, name, kind.dtype)
            return self.context.cast(self.builder, number, kind.dtype, resty)
        shape, strides = ([self._word(name, words, k) for k in left] for words in (SHAPE, STRIDES))
        owner = [self._word(name, k) for k in (0, 1)]
        return ArrayWords.of(self.builder, data, shape, strides, owner, self._home(name))

    def _write(self, inst: Any) -> bool:
        """array[index] = value, of an entry; False: not for us."""
        name, kind = inst.target.name, self.typeof(inst.target.name)
        place = self._place(name, inst.index if isinstance(inst, ir.SetItem) else inst.index_var)
        if place is None or place[1]:
            return False
        value = self.context.cast(self.builder, self.loadvar(inst.value.name), self.typeof(inst.value.name), kind.dtype)
        self._mark(self.builder.store(value, place[0]), name, kind.dtype)
        return True

    def _home(self, name: str) -> str:
        """The field of a record that an array is part of, where that is known."""
        held = self._blk_local_varmap.get(name)
        return held.home if isinstance(held, ArrayWords) else ""

    def _mark(self, access: Any, name: str, kind: Any) -> None:
        """Mark a read or a write of a number: it can meet those of its type, of the same field where that is known."""
        found = str(kind), self._home(name)
        if found not in self._accesses:
            module = self.builder.module
            node = module.add_metadata([MetaDataString(module, "dojo_opt")])
            for part in filter(None, found):
                node = module.add_metadata([MetaDataString(module, part), node, WORD(0)])
            self._accesses[found] = module.add_metadata([node, node, WORD(0)])
        access.set_metadata("tbaa", self._accesses[found])


@register_pass(mutates_CFG=True, analysis_only=False)
class KernelLowering(NativeLowering):
    """Numba's pass, with the above."""

    _name = "kernel_lowering"

    @property
    def lowering_class(self) -> type[Lower]:
        """The lowering class."""
        return _Lower
