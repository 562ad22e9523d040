"""The longest safe step of a world: by the stability of its integrator, and by tunnelling.

limits = step_limits(world)         # the reasons; prints as sentences
world.settings = world.settings.replace(dt=min(1 / 60, suggest_dt(world)))
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, cast

import numpy as np

from ...components import Collider
from ...components.part_of import PartOf
from ...framework import CaromError, NoPhysicsError, World
from ...plugins.joints.joint import Joint, whole_body
from ...plugins.joints.kinds import KINDS
from ..reporting.text import jsonable
from .stability import stability_limits
from .stiffness import modes_of, unmeasured

SAFETY = 0.9  # fraction of the limit that is suggested
FASTEST = 200  # bodies that are compared with all others


@dataclass(frozen=True)
class Oscillation:
    """x'' = -frequency^2 x - (drag + damping) x', of a body or of several."""

    entity: int  # the one with the largest amplitude
    frequency: float  # rad/s
    drag: float  # 1/s, by forces
    damping: float  # 1/s, linear or angular
    limit: float  # s; 0 if the integrator makes it grow at any step


@dataclass(frozen=True)
class Passage:
    """Two bodies, the faster one first, that are sure to meet while speed * dt <= size."""

    entity: int
    other: int
    speed: float  # m/s, the sum of both
    size: float  # m, the sum of both smallest extents: w + 2 r of a wall and a ball
    limit: float  # s


@dataclass(frozen=True)
class StepLimits:
    """What limits the step of a world in its present state; None if nothing does.

    dt: s, the present step; integrator: as in its settings, "flight" if the world is event-driven
    """

    dt: float
    integrator: str
    collision: str
    oscillation: Oscillation | None
    passage: Passage | None

    @property
    def stability(self) -> float:
        """s: at longer steps oscillations grow; 0 if they grow at any step, inf if at none."""
        return math.inf if self.oscillation is None else self.oscillation.limit

    @property
    def tunnelling(self) -> float:
        """s: at longer steps fast bodies may pass through others."""
        return math.inf if self.passage is None else self.passage.limit

    @property
    def suggested(self) -> float:
        """s: SAFETY times the smaller limit; 0 if no step is stable, inf if nothing limits it."""
        return SAFETY * min(self.stability, self.tunnelling)

    def __str__(self) -> str:
        fits = "fits" if self.dt <= self.suggested else "is too long"
        last = f"Suggested: dt = {self.suggested:.4g} s, {SAFETY:g} of the limit. The step of {self.dt:.4g} s {fits}."
        if self.suggested == math.inf:
            last = "Nothing limits the step: choose it by the accuracy you need."
        elif self.suggested == 0.0:
            last = f"No step is stable: choose another integrator than {self.integrator}."
        return "\n".join((self._on_stability(), self._on_passage(), last))

    def _on_stability(self) -> str:
        found = self.oscillation
        if found is None:
            return f"Stability ({self.integrator}): no force makes a body swing, or brakes it."
        numbers = found.frequency, found.drag, found.damping
        words = "swings at {:.4g} rad/s", "is braked at {:.4g} /s", "is damped at {:.4g} /s"
        what = " and ".join(each.format(value) for each, value in zip(words, numbers, strict=True) if value)
        held = f"; {self.integrator} holds it up to dt = {found.limit:.4g} s."
        grows = f", and {self.integrator} makes that grow at any step."
        return f"Stability: entity {found.entity} {what}{held if found.limit else grows}"

    def _on_passage(self) -> str:
        found = self.passage
        if found is None:
            swept = self.collision != "discrete"
            return "Tunnelling: none, what is fast is swept." if swept else "Tunnelling: nothing that moves can meet."
        return (
            f"Tunnelling: entities {found.entity} and {found.other} may meet at {found.speed:.4g} m/s and overlap on a "
            f"way of {found.size:.4g} m; they are sure to be caught up to dt = {found.limit:.4g} s."
        )

    def as_dict(self) -> dict[str, Any]:
        """For JSON, which has no infinity: None means no limit."""
        numbers = {name: getattr(self, name) for name in ("stability", "tunnelling", "suggested")}
        return jsonable({**vars(self), **numbers})


def suggest_dt(world: World) -> float:
    """The longest step, in seconds, that is safe for ``world`` in its present state: SAFETY times the shorter limit of
    stability and of tunnelling, for which see :func:`step_limits`.

    0.0: no step is stable, as with explicit Euler and a spring without damping. inf: nothing limits the step.
    """
    return step_limits(world).suggested


def step_limits(world: World) -> StepLimits:
    """What limits the step of ``world`` at its present state: its force systems, and speeds if collisions are discrete.

    A spring that stiffens when stretched, or a ball that will fall, may set another limit later. The world is left
    unchanged, bit for bit. ValueError if its forces are not finite, NoPhysicsError if it has no physics, CaromError
    inside a step, TypeError if ``world`` is not a World.
    """
    if not isinstance(world, World):
        raise TypeError(f"world must be a World, got {world!r}")
    if world.physics is None:
        raise NoPhysicsError("no physics in this world: World(Physics(...))")
    services: Any = world.physics
    if services.table.in_step:
        raise CaromError("the limits of a step can be asked for between steps only, not inside one")
    settings, integration = world.settings, services.integration
    passage = _first_passage(world) if settings.collision == "discrete" else None
    return StepLimits(settings.dt, integration.integrator_name, settings.collision, _first_to_grow(world), passage)


def _first_to_grow(world: World) -> Oscillation | None:
    """The mode with the shortest limit; of several the stiffest."""
    services: Any = world.physics
    modes = modes_of(world)
    limits = stability_limits(
        type(services.integration.integrator), world.settings.collision, modes.stiffness, modes.drag, modes.damping
    )
    if not np.isfinite(limits).any():
        return None
    first = np.lexsort((modes.entity, -np.abs(modes.drag), -np.abs(modes.stiffness), limits))[0]
    frequency, drag = abs(modes.stiffness[first]) ** 0.5, abs(modes.drag[first])
    numbers = frequency, drag, modes.damping[first], limits[first]
    return Oscillation(int(modes.entity[first]), *map(float, numbers))


def _first_passage(world: World) -> Passage | None:
    """The pair that may tunnel at the shortest step, of the fastest bodies and all that they may meet.

    Left out: sensors, what has no end, bodies with ``ccd``, parts of one body, pairs that layers, groups or joints
    keep apart, or of which none is dynamic. A tile map counts as one body.
    """
    bodies, count = world.bodies, len(world.bodies)
    services: Any = world.physics
    services.refresh_for_queries()
    if services.scene.linked is None:
        return None
    services.scene.refresh_rotation()
    with unmeasured(services.state):
        services.search.index_now()  # makes the boxes
    services.queries.forget()
    columns, rows, slot = services.state.bodies, np.arange(count), services.state.bodies.collider_slot[:count]
    names = "sensor", "layer", "mask", "group"
    sensor, layer, mask, group = (services.table.stack(f"{Collider.stack}.{name}")[slot, rows] for name in names)
    size, speed = columns.min_extent[:count].copy(), np.linalg.norm(bodies.linear_velocity, axis=1)
    speed[bodies.static.rows] = 0.0
    endless = np.isinf(columns.upper[:count] - columns.lower[:count]).all(axis=1)
    parts = {part: whole_body(world._contents(), part) for part, _ in world.get_component(PartOf)}
    body, ccd = np.array([parts.get(each, each) for each in bodies.entity.tolist()]), np.asarray(bodies.ccd, bool)
    counts = (services.scene.levels[0, :count] >= 0) & ~sensor & ~endless & ~ccd & ~ccd[bodies.rows_of(body)]
    solid = np.flatnonzero(counts & np.isfinite(speed))
    fast = solid[np.argsort(-speed[solid], kind="stable")[:FASTEST]]
    a, dynamic = fast[:, None], rows < bodies.dynamic.rows.stop
    meet = (a != solid) & (dynamic[a] | dynamic[solid]) & (layer[a] & mask[solid] != 0) & (layer[solid] & mask[a] != 0)
    meet &= (speed[a] > 0.0) & ((group[a] != group[solid]) | (group[a] == 0))
    meet &= body[a] != body[solid]
    for kind in (*KINDS, *world.registry.joints):  # their record is that of the last step
        for _, joint in cast("list[tuple[int, Joint]]", world.get_component(kind)):
            ends = [parts.get(cast(int, end), end) for end in (joint.a, joint.b)]
            for one, other in (ends, ends[::-1]) if not joint.collide_connected else ():
                meet[np.ix_(body[fast] == one, body[solid] == other)] = False
    if not meet.any():
        return None
    limits = np.where(meet, size[a] + size[solid], np.inf) / np.where(meet, speed[a] + speed[solid], 1.0)
    one, other = np.unravel_index(np.argmin(limits), limits.shape)
    pair = np.array(sorted((fast[one], solid[other]), key=lambda row: -speed[row]))
    numbers = speed[pair].sum(), size[pair].sum(), limits[one, other]
    return Passage(*bodies.entity[pair].tolist(), *map(float, numbers))
