"""The extension module around compiled kernels, in LLVM's language: what Python imports of a library.

No C compiler and no header of Python is at hand for every platform that libraries are built for, so the few functions
and tables that an extension module has are written out here. They use the stable ABI of Python 3.11 alone: one file
serves every later version.

The module has a function for each :class:`Entry`, which takes as many numbers as the kernel and returns an integer;
a dict ``addresses`` of the linked functions by name; a dict ``facts`` of texts about the build; and
``set_error_handler(callable)``: when a kernel ends with an error, ``callable(status, address)`` is called with numba's
status and the address of its description of the error, to raise the exception.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass

from .platforms import Platform

# numba's kinds of arguments: LLVM's type in a call, and Python's function that gives it, with its type.
_KINDS = {
    "int64": ("i64", "PyLong_AsLongLong", "i64"),
    "float64": ("double", "PyFloat_AsDouble", "double"),
    "bool": ("i8", "PyObject_IsTrue", "i32"),
    "address": ("ptr", "PyLong_AsLongLong", "i64"),
}

_FAST_CALL, _ONE_ARGUMENT = 0x80, 0x08  # METH_FASTCALL, METH_O
_ABI = 3  # PYTHON_ABI_VERSION


@dataclass(frozen=True)
class Entry:
    """A kernel that Python calls.

    name
        of the function in the module
    symbol
        of the kernel; with numba's calling convention ``int32 symbol(int64 *result, void **error, arguments...)``
    kinds
        of its arguments: "int64", "float64", "bool" or "address"
    result
        "int64", or "none": the function returns None
    """

    name: str
    symbol: str
    kinds: Sequence[str]
    result: str = "int64"


def glue(
    module: str, entries: Sequence[Entry], addresses: Mapping[str, str], facts: Mapping[str, str], platform: Platform
) -> str:
    """The extension module ``module`` in LLVM's language.

    addresses
        symbols of linked functions by the names under which Python finds their addresses
    facts
        texts that Python finds under these names

    Raises ValueError for an argument of a kind that numbers cannot be turned into.
    """
    for entry in entries:
        for kind in entry.kinds:
            if kind not in _KINDS:
                raise ValueError(f"{entry.name}: an entry takes numbers ({', '.join(_KINDS)}), not {kind}")
        if entry.result not in ("int64", "none"):
            raise ValueError(f"{entry.name}: an entry returns int64 or none, not {entry.result}")
    texts = _Texts()
    size = f"i{8 * platform.pointer_bytes}"  # Py_ssize_t
    outside = "external dllimport global" if platform.is_windows else "external global"
    parts = [
        _DECLARATIONS.format(size=size, outside=outside),
        *_kernels(entries, addresses.values()),
        *(_entry(number, entry, size, texts) for number, entry in enumerate(entries)),
        _HANDLER.format(
            none=texts(""), arguments=texts("iL"), unhandled=texts("a kernel ended with status %d"),
            silent=texts("a kernel ended with status %d, of which the handler of errors raised nothing"),
        ),
        *_tables(entries, addresses, facts, texts),
        _INIT.format(
            module=module, size=size, abi=_ABI, name=texts(module), addresses=texts("addresses"), facts=texts("facts"),
            export="dllexport " if platform.is_windows else "",
        ),
        *texts.lines(),
    ]  # fmt: skip
    return "\n".join(parts) + "\n"


class _Texts:
    """Constants of the module that end with a zero byte; a call gives the name of one."""

    def __init__(self) -> None:
        self._names: dict[str, str] = {}

    def __call__(self, text: str) -> str:
        if "\0" in text:
            raise ValueError(f"a text with a zero byte cannot be kept: {text!r}")
        return self._names.setdefault(text, f"@glue.text.{len(self._names)}")

    def lines(self) -> Iterator[str]:
        for text, name in self._names.items():
            data = text.encode() + b"\0"
            yield f'{name} = private unnamed_addr constant [{len(data)} x i8] c"{_escaped(data)}"'


def _kernels(entries: Sequence[Entry], linked: Iterable[str]) -> Iterator[str]:
    """What stands in other objects. The type of what is not called here does not matter, in no object format."""
    called = {entry.symbol: entry.kinds for entry in entries}
    for symbol, kinds in called.items():
        arguments = "".join(f", {_KINDS[kind][0]}" for kind in kinds)
        yield f"declare hidden i32 {_global(symbol)}(ptr, ptr{arguments})"
    for symbol in dict.fromkeys(linked):
        if symbol not in called:
            yield f"declare hidden void {_global(symbol)}()"


def _entry(number: int, entry: Entry, size: str, texts: _Texts) -> str:
    """The function ``(self, values, count)`` that Python calls: converts, calls the kernel, and answers."""
    count = len(entry.kinds)
    wrong_count = texts(f"{entry.name}() takes {count} argument{'s' * (count != 1)}, not %zd")
    convert: list[str] = []
    failed, passed = "false", ""
    for k, kind in enumerate(entry.kinds):
        argument, function, given = _KINDS[kind]
        compare, none = ("fcmp oeq", "-1.0") if given == "double" else ("icmp eq", "-1")
        convert += [
            f"  %place{k} = getelementptr ptr, ptr %values, {size} {k}",
            f"  %object{k} = load ptr, ptr %place{k}",
            f"  %given{k} = call {given} @{function}(ptr %object{k})",
            f"  %minus{k} = {compare} {given} %given{k}, {none}",
            f"  %failed{k} = or i1 {failed}, %minus{k}",
        ]
        value = f"%given{k}"
        if argument != given:
            value = f"%value{k}"
            way = "inttoptr" if argument == "ptr" else "trunc"
            convert.append(f"  {value} = {way} {given} %given{k} to {argument}")
        failed, passed = f"%failed{k}", f"{passed}, {argument} {value}"
    none = f"(ptr, ...) @Py_BuildValue(ptr {texts('')})"
    return _ENTRY.format(
        answer=none if entry.result == "none" else "@PyLong_FromLongLong(i64 %number)", number=number,
        size=size, count=count, wrong_count=wrong_count, convert="\n".join(convert), failed=failed,
        kernel=_global(entry.symbol), passed=passed,
    )  # fmt: skip


def _tables(
    entries: Sequence[Entry], addresses: Mapping[str, str], facts: Mapping[str, str], texts: _Texts
) -> Iterator[str]:
    methods = [
        f"ptr {texts(entry.name)}, ptr @glue.entry.{number}, i32 {_FAST_CALL}, ptr null"
        for number, entry in enumerate(entries)
    ]
    methods.append(f"ptr {texts('set_error_handler')}, ptr @glue.set_error_handler, i32 {_ONE_ARGUMENT}, ptr null")
    yield _table("methods", "%Method", methods)
    yield _table("addresses", "%Pair", [f"ptr {texts(name)}, ptr {_global(at)}" for name, at in addresses.items()])
    yield _table("facts", "%Pair", [f"ptr {texts(name)}, ptr {texts(text)}" for name, text in facts.items()])


def _table(name: str, kind: str, rows: Sequence[str]) -> str:
    """A constant array whose last row is zero."""
    inside = "".join(f"  {kind} {{ {row} }},\n" for row in rows)
    return f"@glue.{name} = internal global [{len(rows) + 1} x {kind}] [\n{inside}  {kind} zeroinitializer\n]"


def _global(symbol: str) -> str:
    return f'@"{_escaped(symbol.encode())}"'


def _escaped(data: bytes) -> str:
    return "".join(chr(byte) if 32 <= byte < 127 and byte not in b'"\\' else f"\\{byte:02X}" for byte in data)


# A conversion that fails gives -1 and leaves an exception.
_ENTRY = """\
define internal ptr @glue.entry.{number}(ptr %self, ptr %values, {size} %count) {{
  %result = alloca i64
  %error = alloca ptr
  store i64 0, ptr %result
  store ptr null, ptr %error
  %right = icmp eq {size} %count, {count}
  br i1 %right, label %convert, label %wrong_count
wrong_count:
  %type_error = load ptr, ptr @PyExc_TypeError
  call ptr (ptr, ptr, ...) @PyErr_Format(ptr %type_error, ptr {wrong_count}, {size} %count)
  ret ptr null
convert:
{convert}
  br i1 {failed}, label %ask, label %run
ask:
  %exception = call ptr @PyErr_Occurred()
  %clean = icmp eq ptr %exception, null
  br i1 %clean, label %run, label %failed
run:
  %status = call i32 {kernel}(ptr %result, ptr %error{passed})
  %good = icmp eq i32 %status, 0
  br i1 %good, label %answer, label %raise
answer:
  %number = load i64, ptr %result
  %object = call ptr {answer}
  ret ptr %object
raise:
  %description = load ptr, ptr %error
  call void @glue.raise(i32 %status, ptr %description)
  ret ptr null
failed:
  ret ptr null
}}
"""

# PyModuleDef: the head of an object, init, index, copy; name, doc, size, methods, slots, traverse, clear, free.
_DECLARATIONS = """\
%Method = type {{ ptr, ptr, i32, ptr }}
%Pair = type {{ ptr, ptr }}
%Definition = type {{ {size}, ptr, ptr, {size}, ptr, ptr, ptr, {size}, ptr, ptr, ptr, ptr, ptr }}
@PyExc_TypeError = {outside} ptr
@PyExc_RuntimeError = {outside} ptr
declare ptr @PyDict_New()
declare i32 @PyDict_SetItemString(ptr, ptr, ptr)
declare ptr @PyErr_Format(ptr, ptr, ...)
declare ptr @PyErr_Occurred()
declare double @PyFloat_AsDouble(ptr)
declare i64 @PyLong_AsLongLong(ptr)
declare ptr @PyLong_FromLongLong(i64)
declare ptr @PyLong_FromVoidPtr(ptr)
declare i32 @PyModule_AddObject(ptr, ptr, ptr)
declare ptr @PyModule_Create2(ptr, i32)
declare ptr @PyObject_CallFunction(ptr, ptr, ...)
declare i32 @PyObject_IsTrue(ptr)
declare ptr @PyUnicode_FromString(ptr)
declare ptr @Py_BuildValue(ptr, ...)
declare void @Py_DecRef(ptr)
declare void @Py_IncRef(ptr)
"""

_HANDLER = """\
@glue.handler = internal global ptr null
define internal ptr @glue.set_error_handler(ptr %self, ptr %callable) {{
  %before = load ptr, ptr @glue.handler
  call void @Py_IncRef(ptr %callable)
  store ptr %callable, ptr @glue.handler
  call void @Py_DecRef(ptr %before)
  %none = call ptr (ptr, ...) @Py_BuildValue(ptr {none})
  ret ptr %none
}}
define internal void @glue.raise(i32 %status, ptr %description) {{
  %handler = load ptr, ptr @glue.handler
  %none = icmp eq ptr %handler, null
  br i1 %none, label %unhandled, label %call
unhandled:
  %error = load ptr, ptr @PyExc_RuntimeError
  call ptr (ptr, ptr, ...) @PyErr_Format(ptr %error, ptr {unhandled}, i32 %status)
  ret void
call:
  %place = ptrtoint ptr %description to i64
  %answer = call ptr (ptr, ptr, ...) @PyObject_CallFunction(ptr %handler, ptr {arguments}, i32 %status, i64 %place)
  %raised = icmp eq ptr %answer, null
  br i1 %raised, label %done, label %silent
silent:
  call void @Py_DecRef(ptr %answer)
  %other = load ptr, ptr @PyExc_RuntimeError
  call ptr (ptr, ptr, ...) @PyErr_Format(ptr %other, ptr {silent}, i32 %status)
  ret void
done:
  ret void
}}
"""

# One pass over a table, for both dicts: `make` turns what a pair holds into an object.
_INIT = """\
@glue.definition = internal global %Definition {{
  {size} 1, ptr null, ptr null, {size} 0, ptr null, ptr {name}, ptr null, {size} -1, ptr @glue.methods,
  ptr null, ptr null, ptr null, ptr null
}}
define internal i32 @glue.fill(ptr %module, ptr %name, ptr %pairs, ptr %make) {{
  %dict = call ptr @PyDict_New()
  %no_dict = icmp eq ptr %dict, null
  br i1 %no_dict, label %failed, label %next
next:
  %pair = phi ptr [ %pairs, %0 ], [ %following, %kept ]
  %key = load ptr, ptr %pair
  %end = icmp eq ptr %key, null
  br i1 %end, label %add, label %item
item:
  %place = getelementptr %Pair, ptr %pair, i32 0, i32 1
  %content = load ptr, ptr %place
  %value = call ptr %make(ptr %content)
  %no_value = icmp eq ptr %value, null
  br i1 %no_value, label %drop, label %put
put:
  %refused = call i32 @PyDict_SetItemString(ptr %dict, ptr %key, ptr %value)
  call void @Py_DecRef(ptr %value)
  %following = getelementptr %Pair, ptr %pair, i32 1
  %was_put = icmp eq i32 %refused, 0
  br i1 %was_put, label %kept, label %drop
kept:
  br label %next
add:
  %added = call i32 @PyModule_AddObject(ptr %module, ptr %name, ptr %dict)
  %is_added = icmp eq i32 %added, 0
  br i1 %is_added, label %done, label %drop
drop:
  call void @Py_DecRef(ptr %dict)
  br label %failed
failed:
  ret i32 -1
done:
  ret i32 0
}}
define {export}ptr @PyInit_{module}() {{
  %module = call ptr @PyModule_Create2(ptr @glue.definition, i32 {abi})
  %none = icmp eq ptr %module, null
  br i1 %none, label %failed, label %first
first:
  %a = call i32 @glue.fill(ptr %module, ptr {addresses}, ptr @glue.addresses, ptr @PyLong_FromVoidPtr)
  %a_good = icmp eq i32 %a, 0
  br i1 %a_good, label %second, label %drop
second:
  %f = call i32 @glue.fill(ptr %module, ptr {facts}, ptr @glue.facts, ptr @PyUnicode_FromString)
  %f_good = icmp eq i32 %f, 0
  br i1 %f_good, label %done, label %drop
drop:
  call void @Py_DecRef(ptr %module)
  br label %failed
failed:
  ret ptr null
done:
  ret ptr %module
}}
"""
