"""Types of what users give and get, for checkers and editors."""

from __future__ import annotations

from collections.abc import Sequence, Set
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Integers: TypeAlias = NDArray[np.int64]
Vector: TypeAlias = Sequence[float] | NDArray[Any]  # d numbers, in whatever holds them
Vectors: TypeAlias = Sequence[Vector] | NDArray[Any]  # m of them
Numbers: TypeAlias = float | Sequence[float] | NDArray[Any]  # m numbers, or one for all
Layers: TypeAlias = int | str | tuple[int | str, ...] | Set[int | str]  # bits, or names that a world gives them
Entities: TypeAlias = Sequence[int] | NDArray[np.integer[Any]]
Masks: TypeAlias = Layers | Sequence[Layers] | NDArray[np.integer[Any]]  # m of them or one for all
Excludes: TypeAlias = int | Entities | Sequence[Entities] | None  # for all queries, one for each, several for each

if TYPE_CHECKING:

    class VectorField:
        """A field of a component that takes d numbers, or one for all of them, and gives an array (d,)."""

        def __get__(self, component: object, owner: type[Any] | None = None) -> Array: ...

        def __set__(self, component: object, value: Vector | float) -> None: ...

    class RotationField:
        """Takes an angle in 2D or four numbers in 3D; gives a float in 2D, an array (4,) in 3D."""

        def __get__(self, component: object, owner: type[Any] | None = None) -> Any: ...

        def __set__(self, component: object, value: Vector | float) -> None: ...

    class ArrayField:
        """Takes what becomes an array (n, width); gives that array, which cannot be written to."""

        def __get__(self, component: object, owner: type[Any] | None = None) -> Array: ...

        def __set__(self, component: object, value: Sequence[Vector] | Vector) -> None: ...

    class LayerField:
        """Takes bits of layers, or names of ``World(layers=...)``, one or several; gives bits."""

        def __get__(self, component: object, owner: type[Any] | None = None) -> int: ...

        def __set__(self, component: object, value: Layers) -> None: ...

    class BodiesColumn:
        """A column of the bodies: an array (n, ...); what is assigned is written into it."""

        def __get__(self, bodies: object, owner: type[Any] | None = None) -> Array: ...

        def __set__(self, bodies: object, value: Numbers | Vectors) -> None: ...

else:
    VectorField = RotationField = ArrayField = LayerField = BodiesColumn = Any

__all__ = [
    "Array", "ArrayField", "BodiesColumn", "Entities", "Excludes", "Integers", "LayerField", "Layers", "Masks",
    "Numbers", "RotationField", "Vector", "VectorField", "Vectors",
]  # fmt: skip
