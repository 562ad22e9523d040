"""What has changed in a world's entities since its table was brought up to date: short, and merged once per step."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ..component import Component, RowStore

Stores = Mapping[type[Component], RowStore]


class Arrival:
    """Consecutive entities that were created in bulk: until the table has their rows, which is at the next step."""

    __slots__ = ("first", "stop", "stores")

    def __init__(self, first: int, count: int, stores: Stores) -> None:
        self.first, self.stop, self.stores = first, first + count, stores


class ChangeLog:
    """What has changed since the table was brought up to date.

    touched
        entities with objects that came, went, gained, lost or replaced one of carom's components
    arrivals, deleted
        entities without objects that came; the ids of those that went
    lost
        handles that belong to no entity any more and that may be in use
    rounds
        how often the table has been brought up to date: another number whenever entities may have changed
    cleared
        esper.clear_database(): everything before it has gone
    followers
        sets that get what was touched, too: of plugins, which empty them when they look
    """

    __slots__ = ("arrivals", "base", "cleared", "deleted", "dirty", "followers", "lost", "rounds", "touched")

    def __init__(self, base: type[Any]) -> None:
        self.base = base  # only types derived from it are watched
        self.rounds = 0
        self.followers: list[set[int]] = []
        self.touched: set[int] = set()
        self.clear()

    def clear(self) -> None:
        self.cleared = self.dirty = False
        self.rounds += 1
        for follower in self.followers:
            follower |= self.touched
        self.touched = set()
        self.arrivals: list[Arrival] = []
        self.deleted: set[int] = set()
        self.lost: list[Any] = []
