"""Linking ahead: all that the bodies of a world, its queries and its settings can need.

Everything compiled that a step or a query calls has a fixed signature, so it can be compiled or loaded without a body
that uses it. What a step needs now is linked before it in any case (see ``StepLinks``). Of the rest, what is kept on
disk is loaded then too, so that it does not make a later step wait; what is not compiles in the background, unless it
is called before: then it compiles at that call, or in ``world.prepare()``.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache
from typing import Any

import numpy as np

from ...components import AABBCollider, Collider, SphereCollider
from ...framework.data.adoption import Adoption
from ...framework.data.bodies import Bodies, SelectedBodies
from ...framework.data.column_copies import copy_blocks
from ...framework.data.component import checked_types
from ...framework.data.row_moves import move_rows
from ...framework.data.table import Table
from ...framework.jit.background import link_in_background
from ...framework.jit.link_all import link_all
from ...framework.jit.linkable import Linkable
from ...framework.jit.tick_counter import ticks_now
from ...framework.plugins.registry import Registry
from ...framework.schedule.stages import Program, Stage, linked_stage, run_stages
from ...framework.world.world import World
from ..broad_phase.tree.tree import tree_passes
from ..forces.accumulation import required_bodies
from ..integration.system import Integration
from ..joints.own import OwnJoint, linked_joint
from ..plugin_stages.placement import placed
from ..plugin_stages.plugin_stages import NEEDED, QUERYING
from ..queries.kernels import query_kernels
from ..records import STATE
from ..scene import Scene
from ..shapes.geometry_levels import in_order
from ..shapes.linking.linked_shape import half_extents_kernel
from ..shapes.linking.linked_shapes import LinkedShapes, linked_shapes
from ..shapes.query import LinkedQuery, linked_query
from ..stage_list import LINKED_PARTS, WITH_COLLIDERS
from .parts import TAKE_TOGETHER, linked_part, needed_places

QUERY_SHAPES = (SphereCollider, AABBCollider)  # that queries ask with, beside casts of the shapes of the scene

# What the list depends on: dimension, the stages that there may be, and their conditions, the shapes of the scene,
# those that queries ask with, the joints of plugins.
Kind = tuple[
    int, tuple[Stage, ...], frozenset[str], LinkedShapes | None, tuple[LinkedQuery, ...], tuple[OwnJoint, ...]
]


def kind_of_world(scene: Scene, integration: Integration, program: Program) -> Kind:
    """What can be needed depends on this alone; the same for all worlds alike."""
    linked, registry, dimensions = scene.linked, scene.registry, scene.state.dimensions
    stages = program.stages
    of_plugins = [stage.name for stage in stages if stage.plugin]
    conditions = frozenset(("", "dynamic bodies", *integration.stages_possible, *of_plugins))
    if of_plugins:
        conditions |= {NEEDED}
    if linked is not None and scene.sweeps_asked:
        conditions |= {QUERYING}
    if any(plugin.name == "joints" for plugin in registry.plugins):  # which may come at any time
        conditions |= {"joints", "colliders or joints", "contacts may rest or joints", "bodies spin or joints"}
    if scene.state.parts.count > 0:
        conditions |= {"parts"}
    if linked is None:
        return dimensions, stages, conditions, None, (), own_joints(registry, dimensions)
    asking = dict.fromkeys((*QUERY_SHAPES, *(shape.component for shape in linked.shapes)))
    queries = tuple(linked_query(registry, linked, component) for component in asking if component in registry.shapes)
    if len(scene.state.colliders.one_way) > 0:
        conditions |= {"one-way colliders"}
    if scene.state.sleeping:
        conditions |= {"sleeping"}
    if any("spin" in stage.writes for stage in stages if stage.plugin):
        conditions |= {"bodies spin or joints"}
    return dimensions, stages, conditions | WITH_COLLIDERS, linked, queries, own_joints(registry, dimensions)


def own_joints(registry: Registry, dimensions: int) -> tuple[OwnJoint, ...]:
    """The joints of plugins that there may be."""
    return tuple(joint for joint in registry.joints.values() if dimensions in joint.component.dimensions)


def needed_functions(
    dimensions: int, stages: tuple[Stage, ...], conditions: frozenset[str], linked: LinkedShapes | None,
    queries: tuple[LinkedQuery, ...], joints: tuple[OwnJoint, ...],
) -> Iterator[Linkable]:  # fmt: skip
    """All that steps and queries of such a world may call, some more than once."""
    has_shapes = linked is not None
    yield from (run_stages, ticks_now, copy_blocks, move_rows)
    joined = "joints" in conditions
    turns = has_shapes and "bodies spin or joints" in conditions
    places = needed_places(dimensions, has_shapes, has_shapes, turns, joined)
    for place in (*places, *((TAKE_TOGETHER,) if has_shapes else ())):
        yield linked_part(place, LINKED_PARTS[place], dimensions)
    for stage in stages:
        if stage.needed in conditions or stage.name in conditions:
            yield linked_stage(stage, STATE, dimensions)
    yield from tree_passes(dimensions).of_world(has_shapes)
    yield from query_kernels(dimensions).of_world(has_shapes)
    yield from (linked_joint(joint, dimensions) for joint in joints)
    if linked is None:
        return
    yield from linked.all_functions(True, any("shapes" in stage.reads for stage in stages if stage.plugin))
    yield half_extents_kernel(dimensions)
    for query in queries:
        yield from query.all_functions()


def all_functions(registry: Registry, dimensions: int) -> Iterator[Linkable]:
    """All that any world may call that has some of these plugins, whatever its bodies, settings and queries.

    What two plugins need together is what a pair of their shapes needs, so a world of all of them needs all.
    """
    stages = tuple(placed(registry.stages.values(), dimensions))
    shapes = in_order(registry, (shape for shape in registry.shapes if dimensions in shape.dimensions))
    linked = linked_shapes(registry, shapes, dimensions)
    queries = tuple(linked_query(registry, linked, shape) for shape in shapes)
    conditions, joints = frozenset(stage.needed for stage in stages), own_joints(registry, dimensions)
    return needed_functions(dimensions, stages, conditions, linked, queries, joints)


@lru_cache(maxsize=128)  # once in a process for worlds alike
def link_possible(*kind: Any) -> None:
    """Load what is kept on disk of all that such a world may call, and compile the rest while it runs."""
    functions = list(dict.fromkeys(needed_functions(*kind)))
    link_all(function for function in functions if function.is_cached)
    link_in_background(functions)


def keep_ready(scene: Scene, adoption: Adoption, components: tuple[type[Any], ...]) -> None:
    """Let what bodies of these types will need belong to the scene; TypeError for what is no component type.

    The world keeps to the functions of all these shapes from now on, whether bodies of each exist or not.
    """
    components = checked_types("prepare", components)
    table = scene.table
    wanted = {c for c in components if issubclass(c, Collider)}
    wanted.update(c for c in table.stacked_types(Collider.stack) if table.has_mask(c)[: table.count].any())
    in_order(scene.registry, wanted)
    adoption.register(sorted({*wanted, *components}, key=lambda c: c.__name__))
    scene.prepared |= wanted
    scene.forget()


def link_needed(scene: Scene, integration: Integration, program: Program) -> None:
    """Compile or load now all that such a world may call."""
    link_all(needed_functions(*kind_of_world(scene, integration, program)))


def evaluate_forces(table: Table, bodies: Bodies, world: World) -> None:
    """Force systems of the game are pure: called for the bodies there are, they compile what they call.

    They get columns in place if all bodies have what they require, else copies that cannot be written: to numba two
    types.
    """
    if not world.force_systems:
        return
    table.make("force")
    kept = {name: table.arrays[name].copy() for name in ("force", "torque") if name in table.arrays}
    table.adding_forces = True
    try:
        for system in world.force_systems:
            required = required_bodies(table, bodies, system)
            if required is None:
                continue
            system.add_forces(required, world.time)
            if not isinstance(required, SelectedBodies):
                system.add_forces(SelectedBodies(table, np.arange(len(required))), world.time)
    finally:
        table.adding_forces = False
        for name in ("force", "torque"):
            if name in table.arrays:
                table.arrays[name][...] = kept.get(name, 0.0)
