"""What the API pages say of components: how each is made, and of each field its type, unit and meaning."""

from __future__ import annotations

import pytest
from helpers_folders import ROOT

import carom
from carom.framework import Component

griffe = pytest.importorskip("griffe", reason="the extra docs is not installed")


@pytest.fixture(scope="module")
def read():
    """carom, as the pages are made of it."""
    extensions = griffe.load_extensions(ROOT / "studies" / "site" / "reference.py")
    return griffe.load("carom", search_paths=[ROOT / "src"], extensions=extensions)


def components() -> list[type[Component]]:
    values = [getattr(carom, name) for name in carom.__all__]
    return [each for each in values if isinstance(each, type) and issubclass(each, Component) and not each._abstract]


@pytest.mark.slow
def test_a_component_has_the_signature_and_the_table_of_its_columns(read):
    rigid_body = read["components.rigid_body.RigidBody"]
    shown = {each.name: (str(each.annotation), each.default) for each in rigid_body.parameters}
    assert shown["linear_velocity"] == ("Vector", "0.0")
    assert shown["max_linear_speed"] == ("float | None", "None")
    assert shown["kind"] == ("Literal['dynamic', 'kinematic', 'static']", "'dynamic'")
    assert "| `linear_velocity` | `(d,)` | m/s | `0.0` | (d,) m/s, along each" in rigid_body.docstring.value


@pytest.mark.parametrize("component", components(), ids=lambda component: component.__name__)
def test_no_field_of_a_component_is_missing(read, component):
    """In the signature, or under the name that its own constructor has for it."""
    own = read[f"{component.__module__.removeprefix('carom.')}.{component.__qualname__}"]
    names = [each.name for each in own.parameters if each.name not in ("self", "args", "values", "common")]
    table = own.docstring.value
    assert [name for name in names if f"| `{name}` |" not in table] == []
    fields = component._arguments if component.__init__ is Component.__init__ else ()
    assert [name for name in fields if name not in names] == []
    units = {name: field.unit for name, field in component._arguments.items() if name in names and field.unit}
    assert [name for name, unit in units.items() if unit != "1" and f"| {unit} |" not in table] == []
