"""Public docstrings name the parameters of the signature and no others, and say shapes, units and errors.

Public is what carom, joints, view and lab.testing list, with all methods and properties. An override may leave to what
it overrides what is said there; the functions of shapes, which kernels call, Plugin.shape describes.
"""

import inspect
import re

import carom
from carom import view
from carom.framework import Component, Plugin
from carom.framework.plugins.checks import SHAPE_FUNCTIONS
from carom.framework.world.world import Clock, Events
from carom.lab import testing
from carom.plugins import joints

# Parameters that mean the same everywhere: a and b two entities, mask layers; args, values, common fields to pass on.
COMMON = {"self", "cls", "world", "entity", "a", "b", "component", "component_type", "component_types", "dimensions"}
COMMON |= {"mask", "args", "values", "common"}
# Classes that only carom makes: their constructors are not for users.
MADE_BY_CAROM = {"Bodies", "BroadPhase", "Column", "ContactEvents", "Contacts", "ForceAccumulation", "Integration"}
MADE_BY_CAROM |= {"NarrowPhase", "Response", "Spring"}
# Not to be said each time: arguments of another type, a world without physics, what registering refuses.
ANYWHERE = {"AssertionError", "NoPhysicsError", "NotImplementedError", "PluginError", "TypeError"}
RETURNS = {  # by annotation: what the docstring has to have
    r"ndarray|\bArray\b|Floats|Integers|\bRows\b": ("shape", r"\((?:[a-z\d]|\.{3}|count|rows),[^()]*\)"),
    r"\bfloat\b|\bArray\b|Floats": ("unit", r"(?<![\w'])(?:[JNms]|[mn]s|kg|Hz|rad|[Ss]econds|Joules|0 to 1|unit)\b"),
}


def text(value) -> str:
    return inspect.cleandoc(value.__doc__ or "")


def public():
    """(name, object, its own docstring, those of what it overrides) of all that is public."""
    listed = {name: getattr(module, name) for module in (carom, joints, testing, view) for name in module.__all__}
    for name, value in {**listed, "Clock": Clock, "Events": Events}.items():  # which World's properties return
        bases = [base for base in getattr(value, "__mro__", ()) if base.__module__.startswith("carom.")]
        if bases or inspect.isfunction(value):
            yield name, value, text(value), "\n".join(map(text, bases))
        for of, key, member in ((base, *item) for base in bases for item in vars(base).items()):
            function = getattr(member, "fget", None) or getattr(member, "__func__", member)
            if inspect.isfunction(function) and key[0] != "_" and key not in SHAPE_FUNCTIONS:
                others = (text(vars(base)[key]) for base in of.__mro__[1:] if key in vars(base))
                yield f"{of.__name__}.{key}", function, text(function), "\n".join(others)


def says(doc: str, word: str) -> bool:
    return re.search(rf"(?<!\w){re.escape(word)}(?!\w)", doc) is not None


def entries(doc: str) -> set[str]:
    """The names of a definition list: alone on a line, with an indented text below."""
    return set(re.findall(r"\w+", " ".join(re.findall(r"^(\w+(?:, \w+)*)\n {4}", doc, re.MULTILINE))))


def raised(value) -> set[str]:
    """The errors that its own code raises."""
    functions = map(vars(value).get, ("__init__", "__post_init__", "_fill")) if inspect.isclass(value) else [value]
    codes = [function.__code__ for function in functions if inspect.isfunction(function)]
    source = [inspect.getsource(code) for code in codes if code.co_filename != "<string>"]
    return set(re.findall(r"^ +raise (\w+Error)\(", "\n".join(source), re.MULTILINE)) - ANYWHERE


def faults(value, own: str, overridden: str):
    bases, doc = getattr(value, "__mro__", ()), f"{own}\n{overridden}"
    columns = {k: c for k, c in value.columns.items() if c.constructor} if Component in bases else {}
    signature = {} if {BaseException, int}.intersection(bases) else inspect.signature(value).parameters
    known = {*(columns if "args" in signature else ()), *(n for n, p in signature.items() if p.annotation != "Never")}
    fields = {name for base in bases for name in (*vars(base), *vars(base).get("__annotations__", ()))}
    if not doc.strip():
        yield "has no docstring"
    yield from (f"has no parameter {name}" for name in entries(own) - known - fields)
    if value.__name__ not in MADE_BY_CAROM:
        silent = {n for n in known - COMMON if not says(doc, n if len(n) > 2 else f"``{n}``")} - entries(doc)
        yield from (f"does not name {name}" for name in silent)
        yield from (f"does not say that it raises {error}" for error in raised(value) if error not in doc)
    units = {column.unit for column in columns.values()} - {"", "1"}
    yield from (f"does not say {unit}" for unit in units if not any(says(doc, one) for one in unit.split(" or ")))
    for kind, (what, pattern) in RETURNS.items():
        if re.search(kind, str(value.__annotations__.get("return", ""))) and not re.search(pattern, doc):
            yield f"does not say the {what} of what it returns"


def test_docstrings_and_signatures_agree():
    found = {name: sorted(faults(value, own, more)) for name, value, own, more in public()}
    assert len(found) > 300
    assert [name for name in SHAPE_FUNCTIONS if name not in text(Plugin.shape)] == []
    assert {name: each for name, each in found.items() if each} == {}
