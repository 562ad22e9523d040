"""Records inside compiled code: one pointer, whatever the number of columns.

A kernel gets a record as a pointer to its memory, an {address, length} pair for each column and a word for each scalar.
``bodies.position[i]`` is a tuple of floats, assigning to it stores one; ``len(bodies.position)`` is the number of rows.
Addresses and lengths are loaded as invariant: no column is replaced while a kernel runs, so a loop over ``s.x[i]`` is
as fast as one over a local array. Accesses of an ``unshared`` record are tagged: those of two columns never meet, so
that LLVM may work on several rows at once. A column on demand reads as its default while it has no rows. Indices are
not checked and never count from the end, unless ``CAROM_CHECK=1`` is set when carom is imported: then an index outside
the column raises IndexError with the record, the column and the index.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.datamodel import models
from numba.core.errors import TypingError
from numba.core.extending import lower_builtin, lower_cast, register_model
from numba.core.imputils import lower_getattr_generic, lower_setattr_generic
from numba.core.typeconv.castgraph import Conversion
from numba.core.typing.templates import AbstractTemplate, AttributeTemplate, infer_getattr, infer_global, signature
from numba.np.numpy_support import from_dtype

from ..lazy import arrayobj, intrinsic, operation
from ..log import CHECKED
from .schema import WORD, Column, Schema

_BYTE_POINTER = ir.IntType(8).as_pointer()
_WORD = ir.IntType(64)
CACHE_LINE = 64


_SCALARS = {"float64": types.float64, "int64": types.int64, "bool": types.boolean}


class ColumnType(types.Type):
    """A column of a record; ``field`` is its :class:`~.schema.Column`, ``label`` record and name in a checked build and
    of an unshared record: there each column has a type of its own."""

    def __init__(self, field: Column, dimensions: int, label: str = "", unshared: bool = False) -> None:
        self.field, self.label, self.unshared = field, label, unshared
        self.dtype = from_dtype(np.dtype(field.dtype))
        shape = (dimensions,) if field.item == "vector" else field.item_shape(dimensions)
        narrow = isinstance(self.dtype, types.Integer) and self.dtype.signed
        self.number: Any = types.int64 if narrow else self.dtype  # kernels see integers of one width
        self.item: Any = self.number
        for count in reversed(shape if field.item != "table" else ()):
            self.item = types.UniTuple(self.item, count)
        self.width = 1  # numbers that are kept of an item
        for count in (field.numbers(dimensions),) if field.item == "vector" else shape:
            self.width *= count
        self.dimensions = dimensions
        super().__init__(name=f"column({field!r},{dimensions},{label})")

    # Two columns of one kind may be two types; a variable may hold either of them.

    def can_convert_to(self, typingctx: Any, other: Any) -> Any:
        return Conversion.safe if self._is_like(other) else None

    def unify(self, typingctx: Any, other: Any) -> Any:
        if not self._is_like(other):
            return None
        labels = {*self.label.split(" or "), *other.label.split(" or ")}
        return ColumnType(self.field, self.dimensions, " or ".join(sorted(labels)))

    def _is_like(self, other: Any) -> bool:
        return isinstance(other, ColumnType) and (self.field, self.dimensions) == (other.field, other.dimensions)


class RecordType(types.Type):
    """A record of a schema in a world of that many dimensions; made by :func:`record_type`, one object per layout."""

    def __init__(self, schema: Schema, dimensions: int) -> None:
        self.schema, self.dimensions = schema, dimensions
        self.members: dict[str, Any] = {}
        for name, field in schema.fields.items():
            if isinstance(field, Schema):
                self.members[name] = record_type(field, dimensions)
            elif isinstance(field, Column):
                label = f"{schema.name}.{name}" if CHECKED or schema.unshared else ""
                self.members[name] = ColumnType(field, dimensions, label, schema.unshared)
            else:
                self.members[name] = _SCALARS[field.dtype]
        super().__init__(name=_name_of(schema, dimensions))

    def __reduce__(self) -> Any:
        return _known_type, (self.name,)  # cached kernels hold the name, which tells the layout


_known: dict[str, RecordType] = {}


def _name_of(schema: Schema, dimensions: int) -> str:
    return f"{schema.name}{dimensions}D({schema.digest}{',checked' if CHECKED else ''})"


def record_type(schema: Schema, dimensions: int) -> RecordType:
    """The type of that record in compiled code."""
    name = _name_of(schema, dimensions)
    if name not in _known:
        _known[name] = RecordType(schema, dimensions)
    return _known[name]


def _known_type(name: str) -> RecordType:
    if name not in _known:
        raise AttributeError(f"no record {name}")  # the cache takes it as a miss
    return _known[name]


@register_model(ColumnType)
class _ColumnModel(models.StructModel):
    def __init__(self, manager: Any, column: ColumnType) -> None:
        super().__init__(manager, column, [("data", types.CPointer(column.dtype)), ("length", types.int64)])


register_model(RecordType)(models.OpaqueModel)


class StackRecordType(types.Type):
    """A record on the stack, see :mod:`stack_record`: where each of its columns begins."""

    def __init__(self, schema: Schema, rows: int, dimensions: int) -> None:
        self.rows = rows
        self.members = {
            name: ColumnType(field, dimensions, f"{schema.name}.{name}", schema.unshared)
            for name, field in schema.fields.items()
            if isinstance(field, Column)
        }
        super().__init__(name=f"{rows} rows of {_name_of(schema, dimensions)}")


@register_model(StackRecordType)
class _StackRecordModel(models.StructModel):
    def __init__(self, manager: Any, record: StackRecordType) -> None:
        members = [(name, types.CPointer(column.dtype)) for name, column in record.members.items()]
        super().__init__(manager, record, members)


# -- fields ---------------------------------------------------------------------------------------


@infer_getattr
class _FieldOf(AttributeTemplate):
    key = RecordType

    def generic_resolve(self, record: RecordType, name: str) -> Any:
        return record.members.get(name)


@infer_getattr
class _ColumnOnStack(AttributeTemplate):
    key = StackRecordType

    def generic_resolve(self, record: StackRecordType, name: str) -> Any:
        return record.members.get(name)


@lower_getattr_generic(StackRecordType)
def _load_column(context: Any, builder: Any, record: StackRecordType, value: Any, name: str) -> Any:
    column = cgutils.create_struct_proxy(record.members[name])(context, builder)
    column.data = getattr(cgutils.create_struct_proxy(record)(context, builder, value), name)
    column.length = _WORD(record.rows)
    return column._getvalue()


def _place(builder: Any, record: Any, offset: int, kind: Any) -> Any:
    """Where a field stands, as a pointer to ``kind``."""
    return builder.bitcast(builder.gep(record, [_WORD(offset)], inbounds=True), kind.as_pointer())


def _invariant(builder: Any, place: Any) -> Any:
    value = builder.load(place)
    value.set_metadata("invariant.load", builder.module.add_metadata([]))
    return value


@lower_getattr_generic(RecordType)
def _load_field(context: Any, builder: Any, record: RecordType, value: Any, name: str) -> Any:
    kind, offset = record.members[name], record.schema.layout[name]
    if isinstance(kind, ColumnType):
        column = cgutils.create_struct_proxy(kind)(context, builder)
        pointer = context.get_data_type(kind.dtype).as_pointer()
        column.data = _invariant(builder, _place(builder, value, offset, pointer))
        column.length = _invariant(builder, _place(builder, value, offset + WORD, _WORD))
        return column._getvalue()
    if isinstance(kind, RecordType):
        return _invariant(builder, _place(builder, value, offset, _BYTE_POINTER))
    if kind == types.boolean:
        return builder.icmp_signed("!=", builder.load(_place(builder, value, offset, _WORD)), _WORD(0))
    return builder.load(_place(builder, value, offset, context.get_value_type(kind)))


@lower_setattr_generic(RecordType)
def _store_field(context: Any, builder: Any, sig: Any, values: Any, name: str) -> None:
    record, given = sig.args
    kind, offset = record.members[name], record.schema.layout[name]
    if isinstance(kind, (ColumnType, RecordType)):
        raise TypeError(f"{record.schema.name}.{name} cannot be replaced inside a kernel")
    value = context.cast(builder, values[1], given, kind)
    if kind == types.boolean:
        value = builder.zext(value, _WORD)
    builder.store(value, _place(builder, values[0], offset, value.type))


# -- items of columns -----------------------------------------------------------------------------


@infer_global(len)  # pyright: ignore[reportOptionalCall]
class _LengthOf(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 1 and isinstance(arguments[0], ColumnType):
            return signature(types.intp, arguments[0])
        return None


@lower_builtin(len, ColumnType)
def _column_length(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    return cgutils.create_struct_proxy(sig.args[0])(context, builder, values[0]).length


def _index_type(column: ColumnType, index: Any) -> Any:
    """The type the index is cast to, and what is found there; None if the column has no such index."""
    paired = column.field.stacked or column.field.item == "table"
    if isinstance(index, types.Integer) and not paired:
        return (types.intp if index.signed else types.uintp), column.item
    if isinstance(index, types.BaseTuple) and len(index) == 2 and all(isinstance(i, types.Integer) for i in index):  # pyright: ignore[reportGeneralTypeIssues]
        if column.field.stacked:
            return types.UniTuple(types.intp, 2), column.item
        if column.field.item == "table" or (column.field.item == "vector" and not column.field.apart):
            return types.UniTuple(types.intp, 2), column.number
    return None


@infer_global(operator.getitem)  # pyright: ignore[reportOptionalCall]
class _ItemOf(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 2 and isinstance(arguments[0], ColumnType):
            found = _index_type(*arguments)
            if found is not None:
                return signature(found[1], arguments[0], found[0])
        return None


@infer_global(operator.setitem)  # pyright: ignore[reportOptionalCall]
class _StoreItem(AbstractTemplate):
    def generic(self, arguments: Any, keywords: Any) -> Any:
        if len(arguments) == 3 and isinstance(arguments[0], ColumnType):
            found, (column, _, given) = _index_type(*arguments[:2]), arguments
            if found is not None:
                takes, got = (len(kind) if isinstance(kind, types.BaseTuple) else 0 for kind in (found[1], given))
                if takes != got:
                    told = f"{takes} numbers here" if takes else "one number here"
                    raise TypingError(f"{column.label or 'this column'} takes {told}, got {got or 'one'}")
                return signature(types.none, column, found[0], found[1])
        return None


def check(context: Any, builder: Any, column: ColumnType, index: Any, limit: Any) -> None:
    """In a checked build: IndexError unless 0 <= index < limit."""
    outside = builder.icmp_unsigned(">=", index, limit)
    with builder.if_then(outside, likely=False):
        context.call_conv.return_dynamic_user_exc(
            builder, IndexError, (f"{column.label}: index outside of the column (index, length)", index, limit),
            (types.intp, types.intp),
        )  # fmt: skip


def _item_place(context: Any, builder: Any, column: ColumnType, value: Any, index_type: Any, index: Any) -> Any:
    """Pointer to the first number of an item, or to one number of it; and whether it is one."""
    made = cgutils.create_struct_proxy(column)(context, builder, value)
    one = False
    if isinstance(index_type, types.BaseTuple):
        first, second = (builder.extract_value(index, k) for k in range(2))
        if column.field.stacked:  # the length is that of one of the arrays
            if CHECKED:
                check(context, builder, column, second, made.length)
            row = builder.add(builder.mul(first, made.length, flags=("nsw",)), second, flags=("nsw",))
            number = builder.mul(row, _WORD(column.width), flags=("nsw",))
        else:
            if CHECKED:
                check(context, builder, column, first, made.length)
                check(context, builder, column, second, _WORD(column.width))
            one = True
            number = builder.add(builder.mul(first, _WORD(column.width), flags=("nsw",)), second, flags=("nsw",))
    else:
        if CHECKED:
            check(context, builder, column, index, made.length)
        in_step = column.width == 1 or column.field.apart
        number = index if in_step else builder.mul(index, _WORD(column.width), flags=("nsw",))
    return builder.gep(made.data, [number], inbounds=True), one


def _tagged(builder: Any, column: ColumnType, access: Any, k: int = 0) -> Any:
    """A load or store that meets none of another column, if no memory is shared (LLVM's "tbaa" metadata); of one whose
    components are apart none of another of these."""
    if column.unshared:
        module = builder.module
        root = module.add_metadata([ir.MetaDataString(module, "column")])
        label = f"{column.label} {k}" if column.field.apart else column.label
        kind = module.add_metadata([ir.MetaDataString(module, label), root, _WORD(0)])
        access.set_metadata("tbaa", module.add_metadata([kind, kind, _WORD(0)]))
    return access


def _number_place(context: Any, builder: Any, column: ColumnType, value: Any, place: Any, k: int) -> Any:
    """Pointer to number k of an item, from that to its first one."""
    if not k:
        return place
    step = _WORD(k)
    if column.field.apart:
        step = builder.mul(cgutils.create_struct_proxy(column)(context, builder, value).length, step, flags=("nsw",))
    return builder.gep(place, [step], inbounds=True)


def _load_number(context: Any, builder: Any, column: ColumnType, place: Any, k: int) -> Any:
    number = _tagged(builder, column, builder.load(place), k)
    value = context.data_model_manager[column.dtype].from_data(builder, number)
    return context.cast(builder, value, column.dtype, column.number)


@lower_cast(ColumnType, ColumnType)
def _same_column(context: Any, builder: Any, one: Any, other: Any, value: Any) -> Any:
    return value


def _load_numbers(context: Any, builder: Any, sig: Any, values: Any) -> list[Any]:
    """The numbers of one item, or the one of it that the index names."""
    column = sig.args[0]
    place, one = _item_place(context, builder, column, values[0], sig.args[1], values[1])
    count = 1 if one or column.item == column.number else column.width
    places = [_number_place(context, builder, column, values[0], place, k) for k in range(count)]
    return [_load_number(context, builder, column, at, k) for k, at in enumerate(places)]


def _load_or_default(context: Any, builder: Any, sig: Any, values: Any) -> list[Any]:
    """The same of a column on demand. The branch is the same in every row: LLVM takes it out of loops."""
    column = sig.args[0]
    default = context.get_constant(column.number, np.dtype(column.field.dtype).type(column.field.default).item())
    length = cgutils.create_struct_proxy(column)(context, builder, values[0]).length
    before, found = builder.basic_block, []
    with builder.if_then(builder.icmp_unsigned("!=", length, _WORD(0))):
        loaded = _load_numbers(context, builder, sig, values)
        after = builder.basic_block
    for number in loaded:
        phi = builder.phi(number.type)
        phi.add_incoming(default, before)
        phi.add_incoming(number, after)
        found.append(phi)
    return found


@lower_builtin(operator.getitem, ColumnType, types.Any)
def _load_item(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    column = sig.args[0]
    load = _load_numbers if column.field.default is None else _load_or_default
    numbers = load(context, builder, sig, values)
    if sig.return_type == column.number:
        return numbers[0]
    result = ir.Constant(context.get_value_type(column.item), ir.Undefined)
    if column.field.item == "vector":
        for k in range(column.dimensions):
            number = numbers[k] if k < len(numbers) else context.get_constant(column.number, 0.0)
            result = builder.insert_value(result, number, k)
        return result
    count = column.item.count
    for j in range(count):  # axis j is column j of the matrix
        for k in range(count):
            result = builder.insert_value(result, numbers[k * count + j], [j, k])
    return result


@lower_builtin(operator.setitem, ColumnType, types.Any, types.Any)
def _set_item(context: Any, builder: Any, sig: Any, values: Any) -> Any:
    column = sig.args[0]
    place, one = _item_place(context, builder, column, values[0], sig.args[1], values[1])
    model = context.data_model_manager[column.dtype]
    if one or column.item == column.number:
        value = context.cast(builder, values[2], column.number, column.dtype)
        _tagged(builder, column, builder.store(model.as_data(builder, value), place))
    elif column.field.item == "vector":
        for k in range(column.width):
            target = _number_place(context, builder, column, values[0], place, k)
            _tagged(builder, column, builder.store(builder.extract_value(values[2], k), target), k)
    else:
        raise TypeError(f"{column.label or column}: axes are read-only")
    return context.get_dummy_value()


# -- whole columns, and records by address --------------------------------------------------------


@intrinsic
def compiled_rows(typing_context: Any, column: Any, start: Any, stop: Any) -> Any:
    if not isinstance(column, ColumnType) or column.field.rows_axis:
        return None
    dimensions = 1 if column.width == 1 and column.field.item != "table" else 2
    kind = types.Array(column.dtype, dimensions, "C", readonly=True)

    def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        made = cgutils.create_struct_proxy(column)(context, builder, values[0])
        size = context.get_abi_sizeof(context.get_data_type(column.dtype))
        count = builder.sub(values[2], values[1])
        first = builder.mul(values[1], _WORD(column.width))
        shape, strides = [count], [_WORD(size)]
        if dimensions == 2:
            shape, strides = [count, _WORD(column.width)], [_WORD(size * column.width), _WORD(size)]
        array = context.make_array(kind)(context, builder)
        arrayobj.populate_array(
            array, data=builder.gep(made.data, [first]), shape=cgutils.pack_array(builder, shape, _WORD),
            strides=cgutils.pack_array(builder, strides, _WORD), itemsize=_WORD(size), meminfo=None,
        )  # fmt: skip
        return array._getvalue()

    return kind(column, types.intp, types.intp), emit


@intrinsic
def compiled_request(typing_context: Any, column: Any, index: Any) -> Any:
    if not isinstance(column, ColumnType) or column.field.rows_axis or not isinstance(index, types.Integer):
        return None

    def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        made = cgutils.create_struct_proxy(column)(context, builder, values[0])
        number = builder.mul(values[1], _WORD(column.width))
        place = builder.bitcast(builder.gep(made.data, [number]), _BYTE_POINTER)
        flag = ir.IntType(32)
        prefetch = builder.module.declare_intrinsic(
            "llvm.prefetch", [_BYTE_POINTER], ir.FunctionType(ir.VoidType(), [_BYTE_POINTER, flag, flag, flag])
        )
        builder.call(prefetch, [place, flag(0), flag(3), flag(1)])  # to be read, soon, data
        return context.get_dummy_value()

    return types.none(column, types.intp), emit


def record_at(kind: RecordType) -> Any:
    """The function (address) -> record of that type."""

    def typing(typing_context: Any, address: Any) -> Any:
        def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            return builder.inttoptr(values[0], _BYTE_POINTER)

        return kind(types.int64), emit

    return operation("at", 1, typing)


@intrinsic
def compiled_zero(typing_context: Any, record: Any) -> Any:
    if not isinstance(record, RecordType):
        return None
    kind = types.UniTuple(types.float64, record.dimensions)

    def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        return cgutils.get_null_value(context.get_value_type(kind))

    return kind(record), emit


def stack_record_of(schema: Schema, rows: int) -> Any:
    """The function (zero vector) -> record on the stack."""

    def typing(typing_context: Any, zero: Any) -> Any:
        if not isinstance(zero, types.BaseTuple):
            return None
        kind = StackRecordType(schema, rows, len(zero))  # pyright: ignore[reportArgumentType]

        def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
            made = cgutils.create_struct_proxy(kind)(context, builder)
            for name, column in kind.members.items():
                data = context.get_data_type(column.dtype)
                with builder.goto_entry_block():  # cgutils.alloca_once would clear it in each call
                    memory = builder.alloca(ir.ArrayType(data, rows * column.width))
                    memory.align = CACHE_LINE
                setattr(made, name, builder.bitcast(memory, data.as_pointer()))
            return made._getvalue()

        return kind(zero), emit

    return operation("rows", 1, typing)
