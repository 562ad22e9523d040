"""World, settings, tables, schedule, registry: what everything else stands on; knows no physics itself."""

from .data.arrays.column import array_column
from .data.bodies import Bodies
from .data.columns import Column, column
from .data.component import Component
from .errors import (
    CaromError,
    FaultError,
    MissingComponentError,
    NoPhysicsError,
    PhysicsWarning,
    PluginError,
    ScheduleError,
    StepError,
    UnhandledPairError,
)
from .jit.libraries import use_kernels
from .plugins.plugin import Convex, Plugin
from .schedule.phases import ForceSystem, Phase, System
from .schedule.plan import Plan
from .schedule.profile_report import Stats
from .settings import Settings
from .typing import Vector
from .world.contacts import Contact, Contacts, ContactsBetween
from .world.queries.hits import CastHit, CastHits, Hits, NearestHit, NearestHits, Neighbours, OverlapHit, OverlapHits
from .world.rollback import Rollback
from .world.snapshots import Snapshot
from .world.world import World

__all__ = [
    "Bodies",
    "CaromError",
    "CastHit",
    "CastHits",
    "Column",
    "Component",
    "Contact",
    "Contacts",
    "ContactsBetween",
    "Convex",
    "FaultError",
    "ForceSystem",
    "Hits",
    "MissingComponentError",
    "NearestHit",
    "NearestHits",
    "Neighbours",
    "NoPhysicsError",
    "OverlapHit",
    "OverlapHits",
    "Phase",
    "PhysicsWarning",
    "Plan",
    "Plugin",
    "PluginError",
    "Rollback",
    "ScheduleError",
    "Settings",
    "Snapshot",
    "Stats",
    "StepError",
    "System",
    "UnhandledPairError",
    "Vector",
    "World",
    "array_column",
    "column",
    "use_kernels",
]
