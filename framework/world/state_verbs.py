"""The state of a world as a whole: snapshots and going back to them, a hash, files."""

from __future__ import annotations

import enum
import os
from collections.abc import Collection, Iterable
from typing import Any, NoReturn, Self

from ..data.component import Component, checked_types, listed
from ..data.layers import LayerNames
from ..errors import CaromError
from ..plugins.plugin import Plugin, must_be_plugin
from . import saved_files, snapshots
from .snapshots import Snapshot


class StateVerbs:
    """Mixed into :class:`World`."""

    def snapshot(self: Any) -> Snapshot:
        """A copy of the state: entities with their components, columns, contacts, clock, gravity, what plugins keep.

        Objects that are not carom's components are in it by reference. It can be pickled.
        """
        self._pipeline.must_be_between_steps("a snapshot can be taken")
        return Snapshot.of(self, self._synchronized())

    def restore(self: Any, snapshot: Snapshot) -> None:
        """Go back to a snapshot, whatever has been created, deleted, given or taken since; the settings stay.

        The steps that follow repeat those that followed the snapshot, to the bit. CaromError if it is of a world of
        other dimensions or with plugins that this one does not have; nothing is changed then.
        """
        if not isinstance(snapshot, Snapshot):
            raise TypeError(f"restore takes what world.snapshot() returns, got {snapshot!r}")
        self._pipeline.must_be_between_steps("a snapshot can be restored")
        snapshots.restore(snapshot, self, self._services)

    def state_hash(self: Any) -> str:
        """A hash of every body's state, in order of the ids: equal bits, equal hash."""
        return snapshots.state_hash(self._synchronized())

    # -- files ------------------------------------------------------------------------------------

    def save(self: Any, path: str | os.PathLike[str], *, leave_out: Collection[type[Any]] = ()) -> None:
        """Write a snapshot and the settings into the file ``path``, for :meth:`load`; it is replaced at once.

        leave_out
            types of components that are not carom's: no file holds them, and without this they are a CaromError

        Systems and handlers are not in it.
        """
        saved_files.must_be_path("world.save", path)
        leave_out = listed("world.save: leave_out", leave_out)
        saved_files.write(path, self.snapshot(), self.settings, self._layer_names, leave_out)

    @classmethod
    def load(
        cls,
        path: str | os.PathLike[str],
        *plugins: Plugin,
        components: Iterable[type[Component]] = (),
        name: str | None = None,
        layers: type[enum.IntFlag] | None = None,
    ) -> Self:
        """A world that goes on where the one saved at ``path`` was, to the bit.

        plugins
            all that the saved world had, of the same versions or newer
        components
            your own component classes that it had, but for those of the plugins
        name, layers
            as for a new world; layers are needed if the saved world had some, with the same bits

        Add your systems afterwards. CaromError, and no world is made, if the file is damaged, of a newer carom or no
        saved world, or if it needs a plugin, a component class, layers or dimensions that are not given.
        """
        saved_files.must_be_path("World.load", path)
        for plugin in plugins:
            must_be_plugin("World.load takes plugins", plugin)
        components = checked_types("World.load: components", components)
        names = None if layers is None else LayerNames(layers)
        file = saved_files.SavedFile(path)
        file.check_plugins(plugins)
        file.check_layers(names)
        world: Any = cls(*plugins, settings=file.settings(), name=name, layers=layers)  # type: ignore[call-arg]
        try:
            physics = world._services
            of_stages = [component for stage in world.registry.stages.values() for component in stage.components]
            of_plugins = [component for plugin in plugins for component in plugin.components]
            own = (*world.registry.shapes, *world.registry.joints)
            known = (*physics.table.component_types, *own, *of_stages, *of_plugins, *components)
            snapshot = file.snapshot(dict.fromkeys(known))
            file.whole(lambda: snapshots.restore_world(snapshot, world, physics))
            snapshots.restore_plugins(snapshot, world)
        except BaseException:
            world.close()
            raise
        return world

    # -- what does not copy a world ---------------------------------------------------------------

    def __copy__(self) -> NoReturn:
        raise CaromError(NO_COPY)

    def __deepcopy__(self, memo: Any) -> NoReturn:
        raise CaromError(NO_COPY)

    def __reduce_ex__(self, protocol: Any) -> NoReturn:
        raise CaromError(NO_COPY)


NO_COPY = (
    "a world cannot be copied or pickled: world.snapshot() is a copy of its state, which can be pickled and restored; "
    "world.save(path) and World.load(path, ...) keep it in a file"
)
