"""World, settings, tables, schedule, registry: what everything else stands on; knows no physics itself."""

from .array_columns import array_column
from .bodies import Bodies
from .columns import Column, column
from .component import Component
from .contacts import Contact, Contacts
from .errors import (
    CaromError,
    MissingComponentError,
    NoPhysicsError,
    PluginError,
    ScheduleError,
    StepError,
    UnhandledPairError,
)
from .hits import CastHit, CastHits, Hits, NearestHit, NearestHits, Neighbours
from .plan import Plan
from .plugin import Convex, Plugin
from .schedule import ForceSystem, Phase, System
from .settings import Settings
from .statistics import Stats
from .world import World

__all__ = [
    "Bodies",
    "CaromError",
    "CastHit",
    "CastHits",
    "Column",
    "Component",
    "Contact",
    "Contacts",
    "Convex",
    "ForceSystem",
    "Hits",
    "MissingComponentError",
    "NearestHit",
    "NearestHits",
    "Neighbours",
    "NoPhysicsError",
    "Phase",
    "Plan",
    "Plugin",
    "PluginError",
    "ScheduleError",
    "Settings",
    "Stats",
    "StepError",
    "System",
    "UnhandledPairError",
    "World",
    "array_column",
    "column",
]
