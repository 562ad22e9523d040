"""The longest safe step of a world: by the stability of its integrator, and by tunnelling.

limits = step_limits(world)         # the reasons; prints as sentences
world.settings = world.settings.replace(dt=min(1 / 60, suggest_dt(world)))
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...components import Collider
from ...framework import CaromError, NoPhysicsError, World
from ...systems import Integrator
from ..plain import jsonable
from .stability import stability_limits
from .stiffness import Modes, modes_of, unmeasured

SAFETY = 0.9  # fraction of the limit that is suggested
ROUNDS = 50  # more than needed to find the first pair that tunnels


@dataclass(frozen=True)
class Oscillation:
    """What limits stability: the oscillation x'' = -frequency^2 x - (drag + damping) x' of a body or of several.

    entity: the body with the largest amplitude
    frequency: rad/s; 0: drag alone
    drag, damping: 1/s, by forces and by linear_damping
    limit: s; 0 if the integrator makes it grow at any step
    """

    entity: int
    frequency: float
    drag: float
    damping: float
    limit: float


@dataclass(frozen=True)
class Passage:
    """The pair that tunnels first: two bodies that are sure to meet while speed * dt <= size.

    speed: m/s, the sum of both speeds
    size: m, the sum of both smallest extents: w + 2 r for a ball and a wall
    limit: s
    """

    entity: int
    other: int
    speed: float
    size: float
    limit: float


@dataclass(frozen=True)
class StepLimits:
    """What limits the step of a world in its present state; None if nothing does.

    dt: s, the present step
    integrator: as in its settings; "flight" if the world is event-driven
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
        """s: at longer steps the fastest bodies may pass through others."""
        return math.inf if self.passage is None else self.passage.limit

    @property
    def suggested(self) -> float:
        """s: SAFETY times the smaller limit; 0 if no step is stable, inf if nothing limits it."""
        return SAFETY * min(self.stability, self.tunnelling)

    def sentences(self) -> list[str]:
        """What limits the step, and the suggested step."""
        if self.suggested == math.inf:
            last = "Nothing limits the step: choose it by the accuracy you need."
        elif self.suggested == 0.0:
            last = f"No step is stable: choose another integrator than {self.integrator}."
        else:
            fits = "fits" if self.dt <= self.suggested else "is too long"
            last = f"Suggested: dt = {self.suggested:.4g} s, {SAFETY:g} of the limit."
            last += f" The step of {self.dt:.4g} s {fits}."
        return [self._on_stability(), self._on_passage(), last]

    def _on_stability(self) -> str:
        found = self.oscillation
        if found is None:
            return f"Stability ({self.integrator}): no force makes a body swing, or brakes it."
        parts = [f"swings at {found.frequency:.4g} rad/s"] * bool(found.frequency)
        parts += [f"is braked at {found.drag:.4g} /s"] * bool(found.drag)
        parts += [f"is damped at {found.damping:.4g} /s"] * bool(found.damping)
        what = f"entity {found.entity} {' and '.join(parts)}"
        if found.limit == 0.0:
            return f"Stability: {what}, and {self.integrator} makes that grow at any step."
        return f"Stability: {what}; {self.integrator} holds it up to dt = {found.limit:.4g} s."

    def _on_passage(self) -> str:
        found = self.passage
        if found is None:
            swept = self.collision != "discrete"
            return "Tunnelling: none, what is fast is swept." if swept else "Tunnelling: nothing that moves can meet."
        return (
            f"Tunnelling: entities {found.entity} and {found.other} may meet at {found.speed:.4g} m/s and overlap on a "
            f"way of {found.size:.4g} m; they are sure to be caught up to dt = {found.limit:.4g} s."
        )

    def __str__(self) -> str:
        return "\n".join(self.sentences())

    def as_dict(self) -> dict[str, Any]:
        """For JSON, which has no infinity: None means no limit."""
        numbers = {name: getattr(self, name) for name in ("stability", "tunnelling", "suggested")}
        return jsonable({**vars(self), **numbers})


def suggest_dt(world: World) -> float:
    """The longest step, in seconds, that is safe for ``world`` in its present state; see :func:`step_limits` for the
    reasons.

    At most SAFETY times the limits of stability of its integrator, which are known (Hairer & Wanner, Solving Ordinary
    Differential Equations II), for instance w dt = 2 for a spring of frequency w with semi-implicit Euler. In a world
    with discrete collisions also short enough to keep the fastest bodies from tunnelling.

    0.0: no step is stable, as with explicit Euler and a spring without damping. inf: nothing limits the step.
    """
    return step_limits(world).suggested


def step_limits(world: World) -> StepLimits:
    """What limits the step of ``world`` at its present state: positions, velocities, forces, bodies.

    A spring that stiffens when stretched, or a ball that will fall, may set another limit later. Force systems are the
    only user systems that are analysed. The world is left unchanged, bit for bit.

    ValueError if its forces are not finite, NoPhysicsError if it has no physics, CaromError inside a step, TypeError if
    ``world`` is not a World.
    """
    if not isinstance(world, World):
        raise TypeError(f"world must be a World, got {world!r}")
    if world.physics is None:
        raise NoPhysicsError("no physics in this world: World(Physics(...))")
    services: Any = world.physics
    if services.table.in_step:
        raise CaromError("the limits of a step can be asked for between steps only, not inside one")
    modes = modes_of(world)
    integrator = type(services.integration.integrator)()
    settings = world.settings
    passage = first_passage(world) if settings.collision == "discrete" else None
    oscillation = _first_to_grow(integrator, modes)
    return StepLimits(settings.dt, services.integration.integrator_name, settings.collision, oscillation, passage)


def _first_to_grow(integrator: Integrator, modes: Modes) -> Oscillation | None:
    """The mode with the shortest limit; of several the stiffest."""
    if not len(modes.entity):
        return None
    limits = stability_limits(integrator, modes.stiffness, modes.drag, modes.damping)
    stiffest = np.lexsort((modes.entity, -np.abs(modes.drag), -np.abs(modes.stiffness), limits))[0]
    limit, damping = float(limits[stiffest]), float(modes.damping[stiffest])
    if limit == math.inf:
        return None
    stiffness, drag = (float(np.abs(of[stiffest])) for of in (modes.stiffness, modes.drag))
    return Oscillation(int(modes.entity[stiffest]), math.sqrt(stiffness), drag, damping, limit)


def first_passage(world: World) -> Passage | None:
    """The pair of bodies that may tunnel at the shortest step, if collisions are discrete.

    They overlap over a path as long as the sum of their smallest extents; the speed at which they may meet is the sum
    of both speeds. Excluded: sensors, bodies with ``ccd``, pairs that never meet by their layers or groups, or
    of which none is dynamic. A tile map counts as one body. None if no pair is left, or nothing moves.
    """
    bodies, services = world.bodies, world.physics
    size, solid, group = _sizes(services)
    speed = np.zeros(len(bodies))
    moving = slice(0, bodies.kinematic.rows.stop)
    speed[moving] = np.linalg.norm(bodies.linear_velocity[moving], axis=1)
    solid &= ~np.asarray(bodies.ccd, bool) & np.isfinite(speed) & np.isfinite(size)
    if not solid.any() or not speed[solid].any():
        return None
    dynamic = np.arange(len(bodies)) < bodies.dynamic.rows.stop
    layers = np.unique(np.column_stack((group, dynamic))[solid], axis=0)
    members = [np.flatnonzero(solid & (group == g[:3]).all(axis=1) & (dynamic == g[3])) for g in layers]
    pairs = [
        (i, j)
        for i, one in enumerate(layers)
        for j, other in enumerate(layers[: i + 1])
        if (one[3] or other[3]) and one[0] & other[1] and other[0] & one[1] and not one[2] == other[2] != 0
    ]
    best: tuple[float, int, int] | None = None
    limit = 4 * float(size[solid].max()) / float(speed[solid].max())  # more than any
    for _ in range(ROUNDS):  # Dinkelbach's method for the smallest ratio of two sums
        room = size - limit * speed
        firsts = [rows[np.argsort(room[rows], kind="stable")[:2]] for rows in members]
        found = None
        for i, j in pairs:
            a, b = (firsts[i][0], firsts[j][0]) if i != j else (*firsts[i], -1)[:2]
            if b >= 0 and speed[a] + speed[b] > 0:
                candidate = (float(room[a] + room[b]), int(a), int(b))
                found = candidate if found is None or candidate < found else found
        if found is None:
            return None
        _, a, b = found
        shorter = float((size[a] + size[b]) / (speed[a] + speed[b]))
        if best is not None and shorter >= best[0]:
            break
        best = (shorter, a, b)
        limit = shorter
    assert best is not None
    limit, a, b = best
    fast, slow = (a, b) if speed[a] >= speed[b] else (b, a)
    entity = bodies.entity
    return Passage(int(entity[fast]), int(entity[slow]), float(speed[a] + speed[b]), float(size[a] + size[b]), limit)


def _sizes(services: Any) -> tuple[Any, Any, Any]:
    """Of every row: its smallest extent (m; inf if unbounded), whether it is solid, and (layer, mask, group)."""
    table = services.table
    count = table.count
    services.refresh_for_queries()
    size, solid, group = np.zeros(count), np.zeros(count, bool), np.zeros((count, 3), np.int64)
    if services.scene.linked is None:
        return size, solid, group
    services.scene.refresh_rotation()
    with unmeasured(services.state):
        services.search.index_now()  # makes the boxes
    services.queries.forget()
    bodies, rows = services.state.bodies, np.arange(count)
    slot = bodies.collider_slot[:count]
    names = "sensor", "layer", "mask", "group"
    sensor, *filters = (table.stack(f"{Collider.stack}.{name}")[slot, rows] for name in names)
    endless = np.isinf(bodies.upper[:count] - bodies.lower[:count]).all(axis=1)
    size = np.where(endless, np.inf, bodies.min_extent[:count])
    solid = (services.scene.levels[0, :count] >= 0) & ~sensor
    return size, solid, np.column_stack(filters)
