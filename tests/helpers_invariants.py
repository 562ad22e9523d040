"""What holds after every merge: `PYTHONPATH=tests pytest -p helpers_invariants` asserts it (slow; it counts as calls)."""

import numpy as np
from carom.framework.data.adoption import Adoption
from carom.framework.data.component import Component
before = Adoption.synchronize
calls = [0]
def synchronize(self):
    changed = before(self)
    t, en, log = self.table, self._entities, self._log
    if not log.dirty:
        calls[0] += 1
        assert not (log.touched or log.arrivals or log.deleted or log.lost or log.cleared)
        ids = t.column("entity").tolist(); made = t.column("has:objects").tolist()
        assert len(set(ids)) == len(ids)
        for row, (e, m) in enumerate(zip(ids, made)):
            assert m == dict.__contains__(en, e), (e, m)
            types = t.types_in(row)
            if m:
                own = dict.__getitem__(en, e)
                assert set(types) == {c for c in own if isinstance(c, type) and issubclass(c, Component)}, (e, types, own)
                for c in types:
                    h = own[c]
                    assert h._store is t and h._entity == e and (h._version != t.version or h._row == row)
                    assert e in en.members[c].listed
        for c, m in en.members.items():
            assert sorted(set(m.listed)) == sorted(e for e, own in dict.items(en) if c in own), c
    return changed
Adoption.synchronize = synchronize
