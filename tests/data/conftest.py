"""For tests of data: what holds after each merge of the log of changes into the table."""

from __future__ import annotations

import pytest

from carom.framework import Component
from carom.framework.data.adoption import Adoption
from carom.framework.data.table import HAS_OBJECTS


@pytest.fixture
def invariants(monkeypatch):
    merge = Adoption.synchronize

    def checked(self):
        changed = merge(self)
        if self.settled():
            assert_table_and_entities_agree(self)
        return changed

    monkeypatch.setattr(Adoption, "synchronize", checked)


def assert_table_and_entities_agree(adoption):
    """A row has objects if its id is in esper's dict; its masks are the types there, whose handles are bound to it."""
    table, entities, log = adoption.table, adoption._entities, adoption._log
    assert not any((log.touched, log.arrivals, log.deleted, log.lost, log.cleared))
    ids = table.column("entity").tolist()
    assert len(set(ids)) == len(ids)
    for row, (entity, has_objects) in enumerate(zip(ids, table.column(HAS_OBJECTS).tolist(), strict=True)):
        assert has_objects == dict.__contains__(entities, entity), entity
        if not has_objects:
            continue
        own = {c: h for c, h in dict.__getitem__(entities, entity).items() if issubclass(c, Component)}
        assert set(table.types_in(row)) == own.keys(), entity
        for component, handle in own.items():
            assert (handle._store, handle._entity) == (table, entity)
            assert handle._version != table.version or handle._row == row, entity
            assert entity in entities.members[component].listed
    for component, members in entities.members.items():
        assert members.listed == {entity for entity, own in dict.items(entities) if component in own}, component
