"""The physics of one world: its table, its records, the program of its steps and the systems that it serves."""

from __future__ import annotations

from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np

from ..components import Transform
from ..components.spin import keep_gyration
from ..framework.data.adoption import Adoption
from ..framework.data.bodies import Bodies
from ..framework.data.column_copies import ColumnCopies
from ..framework.data.driven import STOPS, stop
from ..framework.data.esper_bridge import Membership
from ..framework.data.interpolation import restart
from ..framework.jit.records.record import Record, make_record
from ..framework.jit.records.schema import Schema
from ..framework.schedule.phases import System
from ..framework.schedule.plan import PlannedColumn, PlannedKernel
from ..framework.schedule.stages import Program
from ..framework.world.contacts import Contacts
from ..framework.world.world import World
from .broad_phase.search import CandidateSearch
from .broad_phase.system import BroadPhase
from .codes import AFTERWARDS
from .contacts.events import ContactEvents, RecordedContacts
from .contacts.response import Response
from .contacts.solving.records import WARM_START_ROWS
from .double_buffers import CONTACT_NUMBERS, WARM_START_NUMBERS, put_joints_back, put_rows_back, saved_rows
from .forces.accumulation import ForceAccumulation
from .inspection.counters import counters_of, reset, set_counters
from .inspection.energies import kinetic_energy, momentum, potential_energy
from .inspection.planned_columns import planned_columns
from .inspection.planned_kernels import planned_kernels
from .integration.system import Integration
from .integration.turns import TURNS
from .linking.preparation import evaluate_forces, keep_ready, link_needed
from .linking.steps import NEVER_LINKED, StepLinks
from .narrow_phase.system import NarrowPhase
from .plugin_stages.plugin_stages import PluginStages
from .quarantine.quarantine import Quarantine
from .queries.system import Queries
from .record_buffers import reserve_fixed
from .records import CONTACT_ROWS, STATE
from .scene import ENABLED, Scene, make_table
from .settings import check_settings, gravity_vector, write_settings
from .shapes.attribution import ErrorAttribution
from .shapes.geometry_levels import LevelCheck, check_pairs, check_sensors
from .sleeping.sleepers import Sleepers
from .stage_list import CLOSING, KEPT, OPENING, STAGES, SYSTEM_OF_STAGE
from .stage_requests import handlers
from .step_stages import KEEPS_WRITTEN


class Simulation:
    """What a physics plugin gives to a world; see ``PhysicsServices`` of the framework, and ``NoPhysics``.

    program
        the stages of all built-in systems
    parts_version
        changes whenever a system consists of other parts
    """

    def __init__(self, world: World, dimensions: int, gravity: Any) -> None:
        self._world, self.dimensions = world, dimensions
        self.state = state = make_record(STATE, dimensions)
        reserve_fixed(state)
        self.table = table = make_table(dimensions)
        self.set_gravity(gravity)
        self.scene = Scene(state, table, world)
        self.program = Program(state, STAGES, {}, AFTERWARDS)
        self.sleepers = Sleepers(state, table, self.scene, self.program, self._box_now)
        self.quarantine = Quarantine(state, table, self.scene, world.report_fault)
        self.adoption = Adoption(table, Transform, world._contents(), LevelCheck(table, world.registry))
        self.adoption.on_losing = partial(keep_gyration, table)
        self.bodies = Bodies(table)
        source = RecordedContacts(self.program, self.sleepers, world.clock, table, self.refresh_for_queries)
        self.contacts = Contacts(dimensions, self._membership, self._running_step, source)
        self.search = CandidateSearch(state, world, self._box_now, self.program.run_one)
        self.attribute_errors = ErrorAttribution(world.registry, state, self.scene.shapes)
        self.queries = Queries(state, table, world.registry, self.scene, self.search, self.refresh_for_queries)
        self.forces = ForceAccumulation(self.program, state, table, self.bodies, self.quarantine.report)
        self.integration = Integration(self.program, self.scene, self.forces, world)
        self.broad_phase = BroadPhase(self.program, self.search)
        self.narrow_phase = NarrowPhase(self.program, self.scene, world.registry, self.bodies)
        self.response = Response(self.program, self.contacts, world)
        self.contact_events = ContactEvents(self.program, source, self.contacts, self._membership, world)
        self.plugin_stages = PluginStages(state, self.scene, self.adoption, world.registry)
        self.integration.turns = self.plugin_stages.record(TURNS)
        self.links = StepLinks(self.scene, self.program, self.integration, self.search, self.plugin_stages)
        self.copies = ColumnCopies(table)
        self._wire_table()
        self._wire_program()
        self.wake, self.notice_written = self.sleepers.wake, self.sleepers.notice_written
        self.excluded, self.take_deferred = self.quarantine.excluded_now, self.contacts.take_deferred
        self.parts_version = 0
        self.must_check = False  # in every step: sensors among levels, pairs that no plugin has
        self.contacts_before: Any = None  # contacts that no RESPONSE has replaced, at the start of the step
        self._generation = table.generation
        self._words = state.words
        self._step_number, self._others_write = (state.word_of(name) for name in ("step_number", "others_write"))
        self._pushed, self._found_current = (state.word_of(name) for name in ("pushed", "found_current"))

    def _wire_table(self) -> None:
        """What the table calls when its columns change, and asks of the step."""
        table = self.table
        table.clock = self._world.clock
        table.before_rows_move = self.contacts.take_deferred
        table.on_make, table.on_expose = self._follow_columns, self._follow_exposed
        table.on_arrays_changed, table.on_changed_inside = self.scene.follow_arrays, self.sleepers.follow_change
        table.forces_are_summed, table.has_flown = self._forces_are_summed, lambda: self.state.moved
        table.writable_while = {"force": self._force_is_writable, "torque": self._torque_is_writable}

    def _wire_program(self) -> None:
        """What Python does for each code that a stage returns; what errors of stages are said to be."""
        program = self.program
        program.handlers, program.system_of = handlers(self), self.system_of_stage
        program.describe_error, program.on_alarm = self.attribute_errors.describe, self.attribute_errors.check
        program.alarm = self.state.word_of("unsound")

    def settled(self) -> bool:
        """Whether the table has all bodies as esper has them, and no plugin moves any."""
        return self.adoption.settled() and not self.plugin_stages.adopters

    def _forces_are_summed(self) -> bool:
        return self.state.forces_summed

    def _force_is_writable(self) -> bool:
        return self.table.adding_forces or self.state.forces_summed or not self._world.has_system(self.forces)

    def _torque_is_writable(self) -> bool:
        return self.table.adding_forces

    @property
    def systems(self) -> tuple[System, ...]:
        """The built-in systems, in the order of a step."""
        return (
            self.forces, self.integration, self.broad_phase, self.narrow_phase, self.response, self.contact_events,
        )  # fmt: skip

    # -- settings ---------------------------------------------------------------------------------

    def check_settings(self, settings: Any) -> None:
        check_settings(settings, self._world.registry)

    def take_settings(self, settings: Any) -> None:
        write_settings(self.state, settings, self._world.registry)
        self.sleepers.take_settings(settings.sleeping)
        self.search.read_settings()
        self.scene.forget()
        self.links.forget()

    def set_gravity(self, gravity: Any) -> None:
        self.gravity = gravity_vector(gravity, self.dimensions)
        self.state.gravity, self.state.pushed = self.gravity[None].copy(), True  # sleepers look at their forces

    # -- a step -----------------------------------------------------------------------------------

    def synchronize(self) -> None:
        """Bring the table in step with esper."""
        self.adoption.synchronize()
        for follow in self.plugin_stages.adopters:
            follow(self._world)

    def open_window(self, step: int) -> None:
        self.contacts.open_window(step)
        self.state.event_count, self.state.impacts_recorded = 0, True  # those of the last window that were never read
        self.table.frame += 1

    def begin_step(self, others_write: bool) -> None:
        """Refresh what depends on the table's structure and keep what a failed step puts back.

        others_write: whether code that is not carom's runs in the step, and may write any column.
        """
        self.table.in_step = True
        sleepers = self.sleepers
        if sleepers.on:
            sleepers.kept, sleepers.before = None, sleepers.followed
        self._follow(others_write)
        if sleepers.on:
            sleepers.begin_step()

    def _follow(self, others_write: bool) -> None:
        """Everything that depends on which bodies and systems there are."""
        table, scene, words = self.table, self.scene, self._words
        words[self._step_number] = self.table.clock.step_count  # first: what fails here goes back to before this step
        for follow in self.plugin_stages.followers:
            follow(self._world)
        self.contacts_before = self.contacts.columns_now() if words[self._found_current] else None
        if self._structure() != scene.structure or table.static_version != scene.static_version:
            self._refresh()
        if self.must_check:
            self._follow_enabled()
            self._check()
        if not self.links.follows(self.forces.kind()):
            self.link()
        if others_write or words[self._others_write]:
            self._begin_user_code(others_write)

    def _structure(self) -> int:
        """Another number whenever bodies, their components or plugins come or go."""
        return self.table.version + self.table.members_version + self._world.registry.version

    def _begin_user_code(self, others_write: bool) -> None:
        """Code of the game runs in this step, or did in the last one."""
        state = self.state
        if others_write != state.others_write:
            state.others_write = others_write
            self.parts_version += 1
        if others_write:
            state.stay_wanted = self._world.events.wanted("contact_stay")
            self.copies.keep()

    def _refresh(self) -> None:
        """Follow which bodies and colliders there are."""
        scene, state, table = self.scene, self.state, self.table
        if self._structure() != scene.structure and self.plugin_stages.follow(self.program):
            self.links.forget()
            self.parts_version += 1
        with self.attribute_errors():
            changed = scene.refresh()
        if changed:
            table.frames_applied = True
            if not state.collides:
                state.warm_start.counts[:] = 0
            self._find_checks()
            self.quarantine.bind()
        scene.refresh_statics()
        if table.generation != self._generation:
            self._generation, state.ids_changed = table.generation, True

    def _find_checks(self) -> None:
        """Whether something has to be looked at in every step, see ``_follow_enabled`` and ``_check``."""
        linked = self.scene.linked
        checked = linked is not None and (self.state.several_levels or bool(linked.unhandled))
        self.must_check = checked or (linked is not None and ENABLED in self.table.stacks)

    def _follow_enabled(self) -> None:
        """Which colliders are enabled may change at any time, also in place."""
        if ENABLED in self.table.stacks and self.scene.linked is not None and not self.scene.follow_enabled():
            self.scene.forget()
            self._refresh()
            self.scene.follow_enabled()

    def _follow_columns(self) -> None:
        """A column on demand has been made."""
        self.scene.bind_columns()
        self.links.version = NEVER_LINKED  # stages may need it
        self._find_checks()
        if self.state.version == self.table.version:  # else the next refresh does it, when rows are known
            self.quarantine.bind()

    def _follow_exposed(self, key: str) -> None:
        """Code of the game may write one more column in place."""
        self.sleepers.watch(key)
        exposed = self.table.exposed
        self.state.positions_exposed = exposed.get("position", False)
        self.state.inverse_masses_exposed = exposed.get("inverse_mass", False)
        self.quarantine.follow_exposed()

    def _check(self) -> None:
        """Errors of colliders that changes of their columns may bring about in any step."""
        scene, state, linked = self.scene, self.state, self.scene.linked
        if linked is None:
            return
        if state.several_levels:
            check_sensors(linked, scene.levels, state.shapes.slots, self.table)
        if linked.unhandled:
            check_pairs(linked, scene.levels, state.bodies.collider_slot, self.table, self._world.registry)

    def link(self) -> None:
        """Compile or load what the step needs."""
        try:
            self.parts_version += self.links.link(self.forces.kind())
        except Exception as error:
            self.attribute_errors.describe(error)
            raise

    def refresh_for_queries(self) -> None:
        """Between two steps: shapes, rows and columns up to date."""
        if self.table.in_step:
            return
        self._refresh()
        if self.must_check:
            self._follow_enabled()
        self.links.link_shapes()

    def _box_now(self) -> None:
        """Boxes around the bodies where they are at this moment."""
        state = self.state
        before = state.moved, state.candidates_ready
        state.moved = state.all_still = False
        self.program.run_one("box_statics", 0.0)
        self.program.run_one("box_motions", 0.0)
        state.moved, state.candidates_ready = before

    def opening_stages(self) -> list[Any]:
        """The parts of a step before all systems."""
        return [self.program.segment(OPENING[0].name, OPENING[-1].name)]

    def closing_stages(self) -> list[Any]:
        """The parts of a step after all systems."""
        return [self.program.segment(CLOSING[0].name, CLOSING[-1].name)]

    def abandon_step(self) -> None:
        """The step failed: put everything back to its start."""
        state, table, bodies = self.state, self.table, self.state.bodies
        if self.copies.kept:
            self.copies.put_back()
        for bit, column, copy, rows in KEPT:
            if state.kept & bit:
                kept = slice(state.kept_first, getattr(state, rows))
                getattr(bodies, column)[kept] = getattr(bodies, copy)[kept]
        if state.kept & KEEPS_WRITTEN:
            self.plugin_stages.written.put_back()
        self.copies.kept = False
        put_joints_back(state)
        if state.kept:
            state.warm_start.now, state.contacts.now = state.warm_start.before, state.contacts.before
        self.contacts.forget_step(state.step_number)
        table.static_version += 1
        self.sleepers.abandon_step()
        state.moved = state.forces_summed = state.found_current = False
        state.kept = 0
        state.impacts.logged = state.event_count = 0
        state.contacts_version += 1
        if self.contacts_before is not None:
            self.contacts.show(self.contacts_before)
        if len(bodies.place):
            bodies.place[:] = -1
        restart(table, slice(0, table.count), ("rotation",))
        self.queries.forget()
        table.in_step = False

    def end_phase(self) -> None:
        """One phase has run alone."""
        self.contacts.columns_now()  # rows may move before they are read
        self.table.in_step = False

    def end_step(self) -> None:
        for finish in self.plugin_stages.finishers:  # while there is a way back
            finish(self._world)
        if self.table.driven:
            stop(self.table)
        self.table.in_step = False
        self.copies.kept = False
        if self._words[self._found_current]:  # no RESPONSE has replaced them: they are read at any time
            self.contacts.columns_now()  # before rows move
        if self.sleepers.on:
            self.sleepers.end_step()

    def report_faults(self, prefix: str) -> None:
        """Name the bodies whose state is not finite in the world's faults; they are taken out of the next step."""
        moving, arrays = self.table.stops[1], self.table.arrays
        for name in ("position", "linear_velocity"):
            column = arrays[name][:moving]
            for row in np.flatnonzero(~np.isfinite(column).all(axis=1)).tolist():
                self.quarantine.report(row, name, column[row].tolist(), prefix)

    def end_window(self) -> None:
        """The last step of a ``step()`` or ``advance()`` is over: forces applied from outside have done their work."""
        table, words = self.table, self._words
        if not (table.frames_applied or words[self._pushed] or words[self._others_write]):
            return
        for component in table.component_types:
            if component.until_frame_ends:
                push, frame = (table.arrays.get(component.prefix + name) for name in component.until_frame_ends)
                if push is not None:
                    push[: table.stops[0]] = 0.0
                if frame is not None and table.frames_applied:
                    frame[: table.stops[0]] = -1  # else state_hash would tell frame rates apart
        table.frames_applied = False

    # -- snapshots --------------------------------------------------------------------------------

    def saved(self) -> dict[str, Any]:
        """What goes on from step to step beside the table, the contacts that users see, and the clock: a copy.

        Arrays, numbers, texts, and lists and dicts (by text) of these.
        """
        state = self.state
        if state.found_current:  # contacts of a narrow phase that no RESPONSE has followed are in no history
            self.contacts.columns_now()
        return {
            "gravity": self.gravity,
            "warm_start": saved_rows(state.warm_start, WARM_START_NUMBERS),
            "contacts": saved_rows(state.contacts, CONTACT_NUMBERS),
            "followed": self._structure() == self.scene.structure,
            "ids_changed": state.ids_changed or self.table.generation != self._generation,
            "quarantine": self.quarantine.saved(),
            "sleepers": self.sleepers.saved(),
            "records": self.plugin_stages.saved(),
            "counters": counters_of(state),
        }

    def take_back(self, saved: dict[str, Any], moved: bool) -> None:
        """Go on from that; the table is what it was then. moved: it has had other rows, or other components."""
        state = self.state
        self.set_gravity(saved["gravity"])
        self.table.driven = STOPS in self.table.arrays
        put_rows_back(state.warm_start, WARM_START_ROWS, saved["warm_start"])
        put_rows_back(state.contacts, CONTACT_ROWS, saved["contacts"])
        state.warm_start.rows_version[:] = -1
        self.sleepers.take_back(saved.get("sleepers"))
        self.plugin_stages.take_back(saved.get("records", {}))
        self._generation, state.ids_changed = self.table.generation, saved["ids_changed"]
        if self.quarantine.take_back(saved["quarantine"]) or moved or not saved["followed"]:
            self.scene.forget()
        self.scene.forget_enabled()
        self.links.version = NEVER_LINKED  # contacts may rest now
        set_counters(state, saved["counters"])
        state.impacts.logged = state.event_count = 0
        state.found_current = state.moved = False
        state.contacts_version += 1
        state.motion_version += 1
        self.queries.forget()

    # -- looking inside ---------------------------------------------------------------------------

    def system_of_stage(self, stage: int) -> str:
        """The name of the system that a stage belongs to; "" for those that open and close a step."""
        found = self.program.stages[stage]
        return SYSTEM_OF_STAGE[found.anchor or found.name]

    def look_ahead(self, others_write: bool) -> None:
        """Before a plan is made, between two steps."""
        self._follow(others_write)
        self.copies.kept = False
        self.scene.refresh_rotation()
        state = self.state
        state.sweeping = self.links.needs_sweeps()

    def planned_kernels(self) -> Iterable[PlannedKernel]:
        return planned_kernels(self.program)

    def planned_columns(self) -> Iterable[PlannedColumn]:
        copies = dict((*self.plugin_stages.written.sizes(), *self.copies.sizes()))
        return planned_columns(self.state, self.table, self.scene, copies)

    def counters(self) -> dict[str, int]:
        return counters_of(self.state)

    def reset_counters(self) -> None:
        reset(self.state)

    # -- answers ----------------------------------------------------------------------------------

    def kinetic_energy(self) -> float:
        return kinetic_energy(self.table, self.bodies.dynamic)

    def potential_energy(self) -> float:
        return potential_energy(self.table, self.bodies, self.gravity, self._world.force_systems)

    def momentum(self) -> np.ndarray:
        return momentum(self.bodies.dynamic, self.dimensions)

    def prepare(self, components: tuple[type[Any], ...]) -> None:
        """Compile what bodies of these component types need, and those there are, see :mod:`linking.preparation`."""
        keep_ready(self.scene, self.adoption, components)
        with self.attribute_errors():
            self.refresh_for_queries()
            link_needed(self.scene, self.integration, self.program)
        evaluate_forces(self.table, self.bodies, self._world)

    def record(self, schema: Schema) -> Record:
        return self.plugin_stages.record(schema)

    def _running_step(self) -> int | None:
        return self._world.step_count if self.table.in_step else None

    def _membership(self) -> Membership:
        return Membership(self._world._contents())
