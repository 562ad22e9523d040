"""Attributes that may be set: those that a class has or declares."""

from __future__ import annotations

from typing import Any

from ..names import near_names


class KnownAttributes:
    """Refuses to set attributes that its direct subclass does not know; mixed into :class:`World`.

    Classes derived from that one may have others, unless the name is nearly that of one there is.
    """

    def __setattr__(self, name: str, value: Any) -> None:
        if not (name.startswith("_") or hasattr(type(self), name) or self._declared(name)):
            own = KnownAttributes not in type(self).__bases__  # a class derived from World
            near = near_names(name, [n for n in dir(type(self)) if n[0] != "_"], cutoff=0.75 if own else 0.6)
            if near or not own:
                hint = f" (did you mean {near[0]!r}?)" if near else ""
                raise AttributeError(
                    f"{type(self).__name__} has no attribute {name!r}{hint}: attributes of your own go into a class "
                    f"derived from World that declares them"
                )
        object.__setattr__(self, name, value)

    @classmethod
    def _declared(cls, name: str) -> bool:
        return any(name in vars(base).get("__annotations__", ()) for base in cls.__mro__)
