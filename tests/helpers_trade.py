"""A trade of one scene in the process of the test, what its trial runs show, and its errors."""

from __future__ import annotations

from carom.framework import Settings, World
from carom.lab import trade
from carom.lab.jobs import Jobs
from carom.lab.trading.grid import Facts, survey
from carom.lab.trading.subject import Subject
from carom.lab.trading.trade import SceneTrade
from carom.plugins import Physics

HERE = {"timing": False, "workers": 1}
JOBS = Jobs(1)


def case_of(*targets, **options) -> SceneTrade:
    """The only scene of a trade in this process, without the clock."""
    (case,) = trade(*targets, **{**HERE, **options}).scenes
    return case


def errors(case: SceneTrade, norm: str) -> dict[tuple[str, str, float], float]:
    keys = {(point.settings.integrator, point.settings.collision, point.settings.dt): point for point in case.points}
    return {key: point.figures[norm].error for key, point in keys.items() if norm in point.figures}


def facts_of(target, seconds=1.0, **options) -> Facts:
    return survey(Subject.of(target, options), seconds, JOBS)


def world_of(settings, gravity=-10.0):
    return World(Physics(dimensions=2, gravity=(0, gravity)), settings=settings or Settings())
