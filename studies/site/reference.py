"""What API pages need beyond the sources: constructors of components, and docstrings as Markdown. For mkdocstrings."""

from __future__ import annotations

import inspect
import re
from typing import Any

import griffe
import numpy as np

import carom
from carom.framework import Component
from carom.framework.data.columns import REQUIRED, Column

PUBLIC: list[str] = vars(carom)["__all__"]
ENTRY = re.compile(r"^(\w+(?:, \w+)*)\n((?: {4}.*(?:\n|\Z))+)", re.MULTILINE)  # a name, and below an indented text
ROLE = re.compile(r":(?:attr|class|data|exc|func|meth|mod):`~?([\w.]+)`")
DEFINITION = re.compile(r"\n`\w+`(?:, `\w+`)*\n:   .*(?:\n {4}.*)*\n?")  # as Markdown
PLAIN, BY_NAME = griffe.ParameterKind.positional_or_keyword, griffe.ParameterKind.keyword_only
TYPES = {"vector": "Vector", "rotation": "float | Vector", "angular": "float | Vector"}
SHAPES = {"vector": "(d,)", "rotation": "angle, in 3D (4,)", "angular": "float, in 3D (3,)", "array": "array"}


class Reference(griffe.Extension):
    """Changes what griffe has read, before anything is rendered."""

    def on_package(self, *, pkg: griffe.Module, **_: Any) -> None:
        for name in PUBLIC:
            getattr(carom, name)  # loads its module: all components are known then
        describe(pkg)
        for component in components(Component):
            module = component.__module__.removeprefix("carom.")
            if component.__module__.startswith("carom.") and not component._abstract:
                add_constructor(pkg[f"{module}.{component.__qualname__}"], component)


def components(base: type[Component]) -> list[type[Component]]:
    return [each for derived in base.__subclasses__() for each in (derived, *components(derived))]


def describe(found: griffe.Object) -> None:
    """Make Markdown of this docstring and of all below."""
    if found.docstring:
        found.docstring.value = markdown(found.docstring.value)
    for member in found.members.values():
        if not member.is_alias:
            describe(member)  # pyright: ignore[reportArgumentType]


def markdown(text: str) -> str:
    """A docstring with its lists of definitions and its references as Markdown has them."""
    text = ROLE.sub(lambda match: reference(match[1]), text)
    return ENTRY.sub(lambda match: f"\n`{match[1].replace(', ', '`, `')}`\n:   {match[2].lstrip()}\n", text)


def reference(name: str) -> str:
    """A link to what is public, by its name or as a method of a world."""
    parts = name.split(".")
    public = next((k for k, part in enumerate(parts) if part in PUBLIC), None)
    if public is not None:
        return f"[`{'.'.join(parts[public:])}`][{'.'.join(('carom', *parts[public:]))}]"
    if len(parts) == 1 and name in dir(carom.World):
        return f"[`{name}`][carom.World.{name}]"
    return f"`{name}`"


def add_constructor(found: griffe.Class, component: type[Component]) -> None:
    """The signature, made of the columns, and a table of the fields."""
    columns = component.columns
    own = [] if component.__init__ is Component.__init__ else [each for each in found.parameters if each.name != "self"]
    named = {each.name: each for each in own if "variadic" not in str(each.kind)}
    if not own or any(each.name == "args" for each in own):  # else it says itself what it takes
        made = {name: parameter(name, columns[name], PLAIN) for name in component._positional} | named
        made |= {name: parameter(name, columns[name], BY_NAME) for name in component._arguments if name not in made}
        for name in named:
            made[name].kind = BY_NAME
        named = made
        parameters = griffe.Parameters(griffe.Parameter("self", kind=PLAIN), *made.values())
        found.set_member("__init__", griffe.Function("__init__", parameters=parameters))
    told = entries_of(component)
    rows = []
    for name in dict.fromkeys((*named, *(name for name in columns if name in told))):
        cells = cells_of(columns[name]) if name in columns else cells_of_parameter(named[name])
        row = [cell.replace("|", "\\|") for cell in (f"`{name}`", *cells, told.get(name, ""))]
        rows.append(f"| {' | '.join(row)} |")
    if rows:
        head = ["| field | type | unit | default | |", "|---|---|---|---|---|"]
        prose = DEFINITION.sub("", found.docstring.value if found.docstring else "").strip()
        found.docstring = griffe.Docstring("\n".join((prose, "", *head, *rows, "")), parent=found)


def entries_of(component: type[Component]) -> dict[str, str]:
    """What the docstrings of a component and its bases say of each field."""
    told: dict[str, str] = {}
    for base in component.__mro__:
        for names, text in ENTRY.findall(inspect.cleandoc(base.__doc__ or "")):
            for name in names.split(", "):
                told.setdefault(name, " ".join(ROLE.sub(lambda match: reference(match[1]), text).split()))
    return told


def parameter(name: str, column: Column, kind: griffe.ParameterKind) -> griffe.Parameter:
    default = None if column.default is REQUIRED else repr(column.default)
    return griffe.Parameter(name, annotation=type_of(column), kind=kind, default=default)


def cells_of(column: Column) -> tuple[str, str, str]:
    """Type, unit and default."""
    shape = SHAPES.get(column.item, type_of(column).removesuffix(" | None"))
    default = "" if column.default is REQUIRED else f"`{column.default!r}`"
    return f"`{shape}{' or None' if column.optional else ''}`", column.unit if column.unit != "1" else "", default


def cells_of_parameter(found: griffe.Parameter) -> tuple[str, str, str]:
    kind, default = (f"`{value}`" if value else "" for value in (found.annotation, found.default))
    return kind.replace(" |", " or"), "", default


def type_of(column: Column) -> str:
    """As an annotation."""
    if column.choices:
        return f"Literal[{', '.join(map(repr, column.choices))}]"
    plain = "Layers" if column.layers else np.dtype(column.dtype).type.__name__.strip("_0123456789")
    found = "Sequence[Vector]" if column.item == "array" else TYPES.get(column.item, plain)
    return f"{found} | None" if column.optional else found
