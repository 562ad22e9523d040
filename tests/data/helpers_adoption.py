"""Comparison of esper's components with the rows of the table."""

from __future__ import annotations

import numpy as np
import pytest
from worlds import make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import Component, column


class Charge(Component):
    value = column(default=1.0)


def matches_esper(world):
    """Every body's row equals esper's components, and the table has no other rows."""
    bodies = world.bodies
    expected = [
        e
        for e, _ in world.get_component(Transform)
        if any(world.has_component(e, c) for c in (RigidBody, SphereCollider, AABBCollider))
    ]
    assert sorted(bodies.entity.tolist()) == sorted(expected)
    for e in expected:
        row = bodies.row_of(e)
        components = {type(c): c for c in world.components_for_entity(e) if isinstance(c, Component)}
        for component in (Transform, RigidBody, SphereCollider, AABBCollider, Charge):
            assert bodies.has(component)[row] == (component in components)
        for component, handle in components.items():
            assert handle.entity == e
            for name in component.columns:
                in_row = getattr(bodies, component.prefix + name)[row]
                got = getattr(handle, name)
                if isinstance(got, str):
                    got = component.columns[name].choices.index(got)
                assert np.array_equal(in_row, np.nan if got is None else got, equal_nan=True), (e, name)
        kind = components[RigidBody].kind if RigidBody in components else "static"
        assert e in getattr(bodies, kind).entity
    return True


@pytest.fixture
def world():
    return make_world()
