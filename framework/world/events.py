"""Event handlers of a world: strongly held, called in the order they were added."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Any

from ..data import esper_bridge
from ..names import did_you_mean

Handler = Callable[..., None]
CONTACT_EVENTS = ("contact_begin", "contact_stay", "contact_end", "impact")
ALSO = {"contact_start": "contact_begin", "collision": "contact_begin", "contact_stop": "contact_end"}


class Events:
    """Named events. Handlers set with ``esper.set_handler`` in the same context get them too."""

    def __init__(self) -> None:
        self._known: dict[str, None] = dict.fromkeys(CONTACT_EVENTS)  # in the order in which they were defined
        self.handlers: dict[str, list[Handler]] = {}
        self.of_esper: dict[str, Any] = {}

    def attach(self) -> None:
        """Note esper's own handlers; called in the world's context."""
        self.of_esper = esper_bridge.event_registry()

    def define(self, *names: str) -> None:
        """Declare events of your own, ``names``, so that ``on`` takes them; ``dispatch`` declares its event too."""
        for name in names:
            if not isinstance(name, str) or not name:
                raise TypeError(f"the name of an event is text, got {name!r}")
            self._known[name] = None

    @property
    def names(self) -> tuple[str, ...]:
        """The events that there are: those of contacts, and those that have been defined."""
        return tuple(self._known)

    def on(self, name: str, handler: Handler) -> Handler:
        """Call ``handler`` on every event of that name from now on; returns it, so it serves as a decorator's core.

        ValueError for an event that is not defined.
        """
        if name not in self._known:
            raise ValueError(
                f"no event {name!r}{did_you_mean(str(name), self._known, ALSO)}: there are {', '.join(self._known)}; "
                f"declare one of your own with world.events.define({name!r})"
            )
        if not callable(handler):
            raise TypeError(f"a handler for {name!r} must be callable, got {handler!r}")
        self.handlers.setdefault(name, []).append(handler)
        return handler

    def off(self, name: str, handler: Handler) -> None:
        """Stop calling ``handler`` on events ``name``; KeyError if it was not set. Safe inside a handler."""
        handlers = self.handlers.get(name, [])
        if handler not in handlers:
            raise KeyError(f"no such handler for {name!r}: {handler!r}")
        handlers.remove(handler)

    def wanted(self, name: str) -> bool:
        """True if the event ``name`` has a handler; lets callers skip building the payload."""
        return bool(self.handlers.get(name)) or bool(self.of_esper.get(name))

    def any_handlers(self) -> bool:
        """True if any event has a handler."""
        if self.of_esper:
            return True
        for handlers in self.handlers.values():  # noqa: SIM110  called in every step
            if handlers:
                return True
        return False

    def dispatch_many(self, name: str, records: Iterable[Any]) -> None:
        """One event ``name`` for each of ``records``; quick where a single handler listens, which is usual."""
        for record in records:
            handlers = self.handlers.get(name, ())
            if len(handlers) == 1 and not self.of_esper.get(name):
                _call(name, handlers[0], (record,))
            else:
                self.dispatch(name, record)

    def dispatch(self, name: str, *args: Any) -> None:
        """Call the handlers of ``name`` that were set when the event began and have not been removed since."""
        if name not in self._known:
            self.define(name)
        for handler in tuple(self.handlers.get(name, ())):
            if handler in self.handlers.get(name, ()):
                _call(name, handler, args)
        for handler in esper_bridge.event_handlers(name):
            _call(name, handler, args)


def _call(name: str, handler: Handler, args: tuple[Any, ...]) -> None:
    try:
        handler(*args)
    except Exception as error:
        error.add_note(f"in {getattr(handler, '__qualname__', handler)}, a handler of {name}")
        raise
