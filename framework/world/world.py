"""World: one esper context, its plugins, its systems and its clock."""

from __future__ import annotations

import enum
import itertools
import math
import numbers
from collections.abc import Callable, Iterable
from contextlib import AbstractContextManager
from typing import Any, Never, Self, TypeVar

import esper

from ..data import esper_bridge
from ..data.bodies import Bodies, counts_by_kind
from ..data.component import Component, checked_types
from ..data.layers import LayerNames
from ..errors import CaromError, NoPhysicsError, PluginError
from ..jit.records.record import Record
from ..jit.records.schema import Schema
from ..plugins.plugin import Plugin, must_be_plugin
from ..plugins.registry import Registry
from ..schedule.clock import Clock
from ..schedule.phases import ForceSystem, Phase, System
from ..schedule.plan import Plan
from ..schedule.profile_report import Stats
from ..schedule.step import Pipeline
from ..settings import Settings
from ..typing import Array, Vector
from .attributes import KnownAttributes
from .contacts import Contacts
from .entities import EntityVerbs
from .events import Events
from .queries.queries import QueryVerbs
from .services import PhysicsServices
from .state_verbs import StateVerbs

P = TypeVar("P", bound=esper.Processor)

FASTEST = 10.0  # time_scale
_numbers = itertools.count(1)


class World(KnownAttributes, EntityVerbs, QueryVerbs, StateVerbs):
    """A world of entities, stepped by systems in a fixed step.

    plugins
        what the world can do: ``World(Physics(dimensions=2))``
    settings
        see :class:`Settings`
    name
        of the esper context, unique by default; ``"default"`` takes over esper's default context
    layers
        an ``enum.IntFlag`` class whose members name the layers: ``layer="player"`` and ``mask=("player", "walls")`` are
        understood then wherever bits of layers are

    ValueError if another world has the name, PluginError if two plugins have the same.

    Inside ``with world:`` plain esper calls work on this world.

    Attributes of your own go into a class derived from World, which declares them: ``score: int``.
    """

    name: str
    closed: bool
    registry: Registry
    physics: PhysicsServices | None
    plugins: tuple[Plugin, ...]

    def __init__(
        self,
        *plugins: Plugin,
        settings: Settings | None = None,
        name: str | None = None,
        layers: type[enum.IntFlag] | None = None,
    ) -> None:
        if settings is not None and not isinstance(settings, Settings):
            raise TypeError(f"settings must be Settings, got {settings!r}")
        for plugin in plugins:
            must_be_plugin("World takes plugins", plugin)
        names = [plugin.name for plugin in plugins]
        for twice in (n for n in names if names.count(n) > 1):
            raise PluginError(f"a world takes one plugin named {twice!r}, got {names.count(twice)}")
        if name is None:
            name = next(n for n in (f"carom-{i}" for i in _numbers) if not esper_bridge.context_exists(n))
        elif name != "default" and esper_bridge.context_exists(name):
            raise ValueError(f"an esper world named {name!r} exists already")
        self.name = name
        self.closed = False
        self.registry = Registry(declare=self._declare)
        self._layer_names = None if layers is None else LayerNames(layers)
        self.physics = None
        self.plugins = plugins
        self._settings = settings or Settings()
        self._events = Events()
        self._depth: list[str] = []
        self._pipeline = Pipeline(self)
        for plugin in plugins:
            self.registry.add(plugin)
        with esper_bridge.context(name):
            if esper_bridge.watched():
                raise ValueError(f"esper's context {name!r} is a World already")
            esper_bridge.watch(Component)
            self._pipeline.attach()
            self._events.attach()
        self._own_context = esper_bridge.own_context(name)
        try:
            for plugin in plugins:
                plugin.install(self)
            self._pipeline.physics.check_settings(self._settings)
            self._pipeline.physics.take_settings(self._settings)
            self.registry.world = self
        except BaseException:
            self._give_back()
            raise

    # -- being an esper context -------------------------------------------------------------------

    def __enter__(self) -> Self:
        self._open()
        self._depth.append(esper.current_world)
        esper.switch_world(self.name)
        return self

    def __exit__(self, *_: object) -> None:
        esper_bridge.leave(self._depth.pop())

    def __repr__(self) -> str:
        name, physics = f"{type(self).__name__} {self.name!r}", self.physics
        if self.closed:
            return f"<{name}, closed>"
        bodies = "no physics" if physics is None else f"{physics.dimensions}D, bodies: {counts_by_kind(physics.table)}"
        entities, clock = len(self._pipeline.contents.entities), self._pipeline.clock
        return f"<{name}, {bodies}; {entities} entities; step {clock.step_count}, {clock.time:.6g} s>"

    def close(self) -> None:
        """Give the esper context back; the world cannot be used afterwards. Closing twice is fine.

        Handles of its components, and arrays of columns, keep their last values. CaromError inside its own with block.
        """
        if self.closed:
            return
        if self._depth:
            raise CaromError(f"world {self.name!r} cannot be closed inside its own with block")
        self._pipeline.must_be_between_steps("a world can be closed")
        if self.physics is not None:
            self.physics.adoption.release()
        self._give_back()

    def _give_back(self) -> None:
        self.closed = True
        with esper_bridge.context(self.name):
            self._pipeline.order.detach()
            esper.clear_database()
            esper_bridge.unwatch()
        if self.name != "default":
            if esper.current_world == self.name:
                esper.switch_world("default")
            esper.delete_world(self.name)

    def _context(self) -> AbstractContextManager[None]:
        self._open()
        return esper_bridge.context(self.name)

    def _contents(self) -> esper_bridge.Contents:
        self._open()
        return self._pipeline.contents

    def _open(self) -> None:
        if self.closed:
            raise CaromError(f"world {self.name!r} is closed")

    # -- plugins ----------------------------------------------------------------------------------

    def add_plugin(self, plugin: Plugin) -> None:
        """Take another plugin, between two steps; the next step knows what it brings.

        PluginError if it registers what another one has registered, or if one of its name is here already.
        """
        self._open()
        self._pipeline.must_be_between_steps("a plugin can be added")
        must_be_plugin("add_plugin takes a plugin", plugin)
        if any(plugin.name == other.name for other in self.plugins):
            raise PluginError(f"a plugin named {plugin.name!r} is in this world already")
        self.registry.add(plugin)
        try:
            plugin.install(self)
        except BaseException:
            self.registry.drop(plugin)
            raise
        self.plugins = (*self.plugins, plugin)

    def _declare(self, components: Iterable[type[Component]], events: Iterable[str]) -> None:
        """Take what plugins declare; PluginError, and nothing is taken, if bodies have such columns already."""
        if self.physics is not None:
            fresh = [component for component in components if component not in self.physics.table.mask_names]
            if fresh and self._pipeline.in_step:
                raise PluginError(f"component {fresh[0].__name__} can be registered between steps only")
            try:
                self.physics.adoption.register(fresh)
            except ValueError as error:
                raise PluginError(str(error)) from None
        self._events.define(*events)

    # -- settings and physics ---------------------------------------------------------------------

    @property
    def settings(self) -> Settings:
        """Replace between steps: ``world.settings = world.settings.replace(dt=1/120)``."""
        return self._settings

    @settings.setter
    def settings(self, settings: Settings) -> None:
        if not isinstance(settings, Settings):
            raise TypeError(f"settings must be Settings, got {settings!r}")
        self._open()
        self._pipeline.must_be_between_steps("settings can be replaced")
        if settings == self._settings:
            return
        self._pipeline.physics.check_settings(settings)
        self._pipeline.clock.set_dt(settings.dt)
        self._settings = settings
        self._pipeline.physics.take_settings(settings)

    def take_physics(self, physics: PhysicsServices) -> None:
        """Called by the plugin that provides physics; ValueError if there is some already."""
        if self.physics is not None:
            raise ValueError("a world takes one Physics")
        self.physics = self._pipeline.physics = physics
        self._declare(self.registry.declared, ())
        physics.table.layer_names = self._layer_names

    @property
    def _services(self) -> PhysicsServices:
        self._open()
        if self.physics is None:
            raise NoPhysicsError("no physics in this world: World(Physics(...))")
        return self.physics

    @property
    def gravity(self) -> Array:
        """(d,) m/s^2; assign between steps."""
        return self._services.gravity

    @gravity.setter
    def gravity(self, gravity: Vector | float) -> None:
        self._pipeline.must_be_between_steps("gravity can be replaced")
        self._services.set_gravity(gravity)

    @property
    def bodies(self) -> Bodies:
        """The columns of all bodies; outside a step, up to date with what was created and deleted."""
        services = self._services
        self._pipeline.synchronize()
        return services.bodies

    @property
    def contacts(self) -> Contacts:
        """The contacts of the last step, as columns, and what has begun, ended and struck."""
        return self._services.contacts

    def kinetic_energy(self) -> float:
        """Joules, of the dynamic bodies, summed in order of their ids."""
        self._synchronized()
        return self._services.kinetic_energy()

    def potential_energy(self) -> float:
        """Joules, of gravity (zero at the origin), constant forces and force systems that have a potential."""
        self._synchronized()
        return self._services.potential_energy()

    def momentum(self) -> Array:
        """(d,) kg m/s of the dynamic bodies."""
        self._synchronized()
        return self._services.momentum()

    def wake(self, entity: int) -> None:
        """Wake the body and what sleeps with it, see ``Settings.sleeping``; KeyError if it is no body."""
        self._synchronized().wake(entity)

    def _synchronized(self) -> PhysicsServices:
        services = self._services
        self._pipeline.synchronize()
        return services

    # -- systems ----------------------------------------------------------------------------------

    def add_system(
        self, system: System | ForceSystem | esper.Processor, *, before: Any = (), after: Any = (), frame: bool = False
    ) -> None:
        """Add a system; during a step it joins at its end.

        A System runs in its phase after the built-in one, or ``before``/``after`` a system (type or instance). A
        ForceSystem is called by the integrator. ``frame=True``: once per ``advance``, after its steps, with the
        frame's seconds.
        """
        self._open()
        self._pipeline.order.add(system, before, after, frame)

    def remove_system(self, system: System | ForceSystem | esper.Processor) -> None:
        """Remove ``system``, an instance; during a step it leaves at its end. KeyError if it is not in this world."""
        self._open()
        self._pipeline.order.remove(system)

    def has_system(self, system: System | ForceSystem | esper.Processor) -> bool:
        """Whether that very system is in this world, or joins at the end of the step."""
        return self._pipeline.order.has(system)

    def add_processor(self, processor: esper.Processor, priority: float = 0) -> None:
        """esper's verb: any processor at any priority; Phase.X.priority are the bands of carom's own.

        A System runs in its phase, whatever the priority.
        """
        self._open()
        if isinstance(processor, System):
            self._pipeline.order.add(processor, (), (), False)
            return
        self._pipeline.order.add_plain(processor, priority)

    def remove_processor(self, processor: type[esper.Processor] | esper.Processor) -> None:
        """esper's verb: ``processor`` is a type, of which the last one added is removed, or an instance."""
        self._open()
        self._pipeline.order.remove_processor(processor)

    def get_processor(self, processor_type: type[P]) -> P | None:
        """esper's verb: the last one added of ``processor_type``, carom's systems too; None if there is none."""
        self._open()
        processors = self._pipeline.order.in_esper_order()
        return next((one for one in reversed(processors) if type(one) is processor_type), None)

    @property
    def force_systems(self) -> list[ForceSystem]:
        """Those that this step calls, in order of addition."""
        return self._pipeline.order.force_systems

    @property
    def systems(self) -> list[System]:
        """carom's systems in the order in which they run."""
        return list(self._pipeline.order.systems)

    # -- time -------------------------------------------------------------------------------------

    def step(self, *given: Never) -> None:
        """One fixed step of ``settings.dt``."""
        if given:
            raise TypeError(
                f"step takes no time, got {given[0]!r}: each step is one of settings.dt, World(..., settings=Settings("
                f"dt=1 / 60)); as many as fit into the seconds of a frame: world.advance(seconds)"
            )
        if self.closed:
            self._open()
        self._pipeline.step()

    def advance(self, seconds: float) -> int:
        """Take as many fixed steps as fit into the time not yet simulated and these ``seconds``; returns how many.

        The seconds are multiplied by :attr:`time_scale`. At most ``settings.max_steps_per_advance``, times the scale
        above 1; whole steps beyond that are dropped and counted in ``stats().counters["dropped_steps"]``. What is less
        than a step is kept: ``alpha``. ValueError if ``seconds`` are negative or not finite.
        """
        self._open()
        if not (isinstance(seconds, numbers.Real) and math.isfinite(seconds) and seconds >= 0):
            raise ValueError(f"advance takes seconds, finite and not negative, got {seconds!r}")
        return self._pipeline.advance(float(seconds))

    @property
    def time_scale(self) -> float:
        """Seconds simulated per second of a frame, 0 (pause) to 10; 1 if nothing else is set. Only :meth:`advance`
        heeds it, from its next call on. ValueError for any other number."""
        return self._pipeline.clock.scale

    @time_scale.setter
    def time_scale(self, scale: float) -> None:
        if isinstance(scale, bool) or not (isinstance(scale, numbers.Real) and 0 <= scale <= FASTEST):
            raise ValueError(f"world {self.name!r}: time_scale must be a number from 0 to {FASTEST:g}, got {scale!r}")
        self._open()
        self._pipeline.clock.scale = float(scale)

    @property
    def alpha(self) -> float:
        """The time not yet simulated as a part of a step, 0 to 1; for drawing between two steps."""
        return self._pipeline.clock.alpha

    @property
    def time(self) -> float:
        """Seconds simulated."""
        return self._pipeline.clock.time

    @property
    def step_count(self) -> int:
        """Fixed steps simulated; :meth:`restore` sets it back."""
        return self._pipeline.clock.step_count

    @property
    def clock(self) -> Clock:
        """What ``time``, ``step_count`` and ``alpha`` come from."""
        return self._pipeline.clock

    def run(self, phase: Phase) -> None:
        """Run one phase alone on the state as it is; the clock stands still. For tests."""
        self._open()
        self._pipeline.run(Phase(phase))

    def register(self, *component_types: type[Component]) -> None:
        """Columns of these components are in ``bodies`` from now on, before a body has one; between two steps.

        A component is registered by itself when the first body has it. TypeError for what is no Component.
        """
        self._pipeline.must_be_between_steps("components can be registered")
        self._synchronized().adoption.register(checked_types("register", component_types))

    def record(self, schema: Schema) -> Record:
        """The record of this world for that ``schema``, as stages of plugins get it: numbers, and arrays (n, ...)."""
        return self._services.record(schema)

    def prepare(self, *component_types: type[Any]) -> None:
        """Compile ahead what bodies of these component types, and those there are, will need; between two steps.

        All of it: impacts and rest, trees for hundreds of bodies, queries, what force systems call. Whatever of these
        types comes and goes later, nothing compiles in mid-game. It registers them too.
        """
        self._pipeline.must_be_between_steps("a world can be prepared")
        self._synchronized().prepare(component_types)

    # -- events -----------------------------------------------------------------------------------

    def on(self, name: str, handler: Callable[..., None]) -> Callable[..., None]:
        """Call ``handler(contact)`` on contact_begin, contact_stay, contact_end or impact; or on events of your own.

        Those are declared by ``world.events.define(name)``, or have been dispatched: ValueError for another.
        """
        return self._events.on(name, handler)

    def off(self, name: str, handler: Callable[..., None]) -> None:
        """Remove a handler of the event ``name``; safe inside a handler. KeyError if it was not set."""
        self._events.off(name, handler)

    def dispatch_event(self, name: str, *args: Any) -> None:
        """Call the handlers of the event ``name``, esper's own included; it is declared by that."""
        with self._context():
            self._events.dispatch(name, *args)

    @property
    def events(self) -> Events:
        """The events and their handlers; ``events.define(name)`` declares one of your own."""
        return self._events

    # -- looking inside ---------------------------------------------------------------------------

    def stats(self) -> Stats:
        """Time per system and counters since the world began (or ``reset_stats``); ``print`` shows a table."""
        return self._pipeline.profiler.stats()

    def reset_stats(self) -> None:
        """Set the times and counters of :meth:`stats` to 0."""
        self._pipeline.profiler.reset()

    def profile(self) -> AbstractContextManager[None]:
        """``with world.profile():`` times each call of a kernel; ``stats().kernels`` has the result.

        Kernels are timed for one world at a time: CaromError inside another profile.
        """
        return self._pipeline.profiler.profile()

    @property
    def faults(self) -> list[str]:
        """What went wrong without stopping the world: bodies whose state is no longer finite, limits reached."""
        return self._pipeline.faults.texts

    def report_fault(self, text: str, *, kind: str | None = None, entity: int | None = None) -> None:
        """Add to :attr:`faults`, which hold the last 100 different ones, and tell it as ``settings.on_fault`` says.

        Faults of one kind and of one entity are told once; without a kind, those of the same text. Inside a step they
        are told at its end, outside at the end of the next.
        """
        self._pipeline.faults.report(text, kind, entity)

    def plan(self) -> Plan:
        """What a step of the bodies there are now runs, in order, with which kernels, on which columns, and why."""
        with self._context():
            if self._pipeline.processors.changed:
                self._pipeline.order.reconcile()
            self._pipeline.look_ahead()
            return Plan.of(self.systems, self._pipeline.physics)
