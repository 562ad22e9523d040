"""What queries see of a world: its shapes and their parameters, brought up to date before they are used."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..scene import Scene
from ..shapes.linking.linked_shapes import LinkedShapes, ParameterRecords


class QueriedScene:
    """A scene as queries use it.

    refresh
        between two steps: brings shapes, rows and columns up to date
    """

    def __init__(self, scene: Scene, refresh: Callable[[], None]) -> None:
        self._scene, self.refresh = scene, refresh

    @property
    def linked(self) -> LinkedShapes | None:
        return self._scene.linked

    @property
    def parameter_records(self) -> ParameterRecords:
        assert self._scene.parameters is not None
        return self._scene.parameters

    @property
    def version(self) -> Any:
        return self._scene.version, self._scene.table.static_version, self._scene.state.motion_version

    def refresh_rotation(self) -> None:
        self._scene.refresh_rotation()
