"""The state of a world as a whole: snapshots and going back to them, a hash."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, NoReturn

from ..errors import CaromError
from . import snapshots
from .snapshots import Snapshot

if TYPE_CHECKING:
    from .world import World


class StateVerbs:
    """Mixed into :class:`World`."""

    def snapshot(self: World) -> Snapshot:  # type: ignore[misc]
        """A copy of the state: entities with their components, columns, contacts, clock, gravity, what plugins keep.

        Objects that are not carom's components are in it by reference. It can be pickled.
        """
        self._pipeline.must_be_between_steps("a snapshot can be taken")
        return Snapshot.of(self, self._synchronized())

    def restore(self: World, snapshot: Snapshot) -> None:  # type: ignore[misc]
        """Go back to a snapshot, whatever has been created, deleted, given or taken since; the settings stay.

        The steps that follow repeat those that followed the snapshot, to the bit. CaromError if it is of a world of
        other dimensions or with plugins that this one does not have; nothing is changed then.
        """
        if not isinstance(snapshot, Snapshot):
            raise TypeError(f"restore takes what world.snapshot() returns, got {snapshot!r}")
        self._pipeline.must_be_between_steps("a snapshot can be restored")
        snapshots.restore(snapshot, self, self._services)

    def state_hash(self: World) -> str:  # type: ignore[misc]
        """A hash of every body's state, in order of the ids: equal bits, equal hash."""
        return snapshots.state_hash(self._synchronized())

    # -- what does not copy a world ---------------------------------------------------------------

    def __copy__(self) -> NoReturn:
        raise CaromError(NO_COPY)

    def __deepcopy__(self, memo: Any) -> NoReturn:
        raise CaromError(NO_COPY)

    def __reduce_ex__(self, protocol: Any) -> NoReturn:
        raise CaromError(NO_COPY)


NO_COPY = (
    "a world cannot be copied or pickled: world.snapshot() is a copy of its state, which can be pickled and restored"
)
