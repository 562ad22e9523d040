"""The grid of settings worth trying in a scene, and each method's theoretical order of accuracy.

Settings without effect in a scene are not varied. Without force systems velocity Verlet, Runge-Kutta 4 and Yoshida 4
are one method; without any force all five are. Substeps matter for contacts at rest, geometry for bodies with levels,
the collision mode for scenes with contacts. Event-driven worlds have an integrator of their own.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from ...framework.settings import COLLISION_MODES, GEOMETRY_MODES
from ..measure.survey import Survey
from ..trading.records import CAROM, CHAOTIC, IMPACTS, PYMUNK, RESTING, SMOOTH, Cell

ALL_METHODS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")
CONSTANT_FORCE = ("explicit_euler", "semi_implicit_euler", "velocity_verlet")
SUBSTEPS = (1, 2, 4, 8, 16, 32)
ITERATIONS = (10, 50)  # of pymunk's solver: its default, and the number needed to hold a stack
SLOWEST = 1 / 15  # s: the largest step of a game
HALVINGS = 7
ORDER = {"explicit_euler": 1, "semi_implicit_euler": 1, "velocity_verlet": 2, "rk4": 4, "yoshida4": 4}
OF_STATE = ("position", "energy", "kinetic")


def steps_for(survey: Survey) -> tuple[float, ...]:
    """Steps from 1/15 s, or from four times the scene's recommended step, each half of the one before."""
    largest = max(SLOWEST, 4 * survey.settings.dt)
    smallest = min(largest / 2**HALVINGS, survey.settings.dt / 4)
    count = math.ceil(math.log2(largest / smallest)) + 1
    return tuple(largest / 2**k for k in range(count))


def methods(survey: Survey) -> tuple[Cell, ...]:
    """One cell per curve, with a step of 1 s."""
    own = survey.settings
    base = Cell(1.0, own.integrator, own.collision, own.substeps, own.geometry)
    integrators = ALL_METHODS if survey.force_systems else CONSTANT_FORCE
    if survey.kind == RESTING or (not survey.forces and not survey.damping):  # at rest the solver determines the result
        integrators = (own.integrator,)
    if own.integrator not in integrators and own.integrator not in ALL_METHODS:
        integrators = (*integrators, own.integrator)  # from a plugin
    collisions = COLLISION_MODES if survey.contacts else (own.collision,)
    substeps = SUBSTEPS if survey.kind == RESTING else (own.substeps,)
    geometries = GEOMETRY_MODES if survey.levels else (own.geometry,)
    found = []
    for collision in collisions:
        for integrator in integrators if collision != "event_driven" else integrators[-1:]:
            for count in substeps:
                for geometry in geometries:
                    cell = dataclasses.replace(
                        base, integrator=integrator, collision=collision, substeps=count, geometry=geometry
                    )
                    found.append(with_own_flight(cell))
    return tuple(dict.fromkeys(found))


def with_own_flight(cell: Cell) -> Cell:
    """Name an event-driven cell after the integrator its flight resembles; it ignores the integrator setting."""
    return dataclasses.replace(cell, integrator="velocity_verlet") if cell.collision == "event_driven" else cell


def peer_methods() -> tuple[Cell, ...]:
    """pymunk's curves."""
    return tuple(Cell(1.0, "", "discrete", count, "precise", PYMUNK) for count in ITERATIONS)


def grid(curves: Sequence[Cell], steps: Sequence[float]) -> tuple[Cell, ...]:
    """Every curve at every step."""
    return tuple(dataclasses.replace(method, dt=dt) for dt in steps for method in curves)


def theory(cell: Cell, norm: str, survey: Survey) -> float | None:
    """The order in dt expected of the method in this norm; inf: exact up to rounding; None: unknown.

    Continuous and event-driven worlds find impacts at their true time, so the flight between impacts sets the order.
    The error of contacts at rest scales with the square of the step. An apex sampled at steps only is missed by at most
    g dt^2 / 8.
    """
    if cell.engine != CAROM:
        return _of_pymunk(norm, survey)
    if survey.kind == RESTING:
        return 2.0 if norm in ("overlap", "overlap_mean") else None
    flight = _of_flight(cell, survey)
    if flight is None:
        return None
    if norm == "apex":
        return min(flight, 2.0)
    if survey.kind == SMOOTH:
        return _of_smooth(cell, norm, flight)
    if flight == math.inf:
        return None if cell.collision == "discrete" else math.inf  # discrete worlds miss grazing impacts
    if survey.kind == CHAOTIC:
        return None
    return {"energy": flight, "position": flight, "energy_square": 2 * flight}.get(norm) if flight == 1 else None


def _of_flight(cell: Cell, survey: Survey) -> float | None:
    """The order of the position between impacts."""
    if not survey.forces and not survey.damping:
        return math.inf
    order = 2 if cell.collision == "event_driven" else ORDER.get(cell.integrator)
    if order is None or survey.damping:
        return None
    return math.inf if order > 1 and not survey.force_systems else float(order)


def _of_smooth(cell: Cell, norm: str, flight: float) -> float | None:
    if norm == "position":
        return flight
    if norm in OF_STATE:  # Runge-Kutta 4 loses energy with dt^5, or dt^4 where the motion is not harmonic
        return None if cell.integrator == "rk4" and flight != math.inf else flight
    return None


def _of_pymunk(norm: str, survey: Survey) -> float | None:
    """pymunk moves like explicit Euler under gravity (measured) and detects impacts at step ends: both order 1."""
    first = {SMOOTH: ("position", "apex"), IMPACTS: ("energy",), CHAOTIC: ("pressure", "rate")}
    if survey.kind == IMPACTS and norm == "energy_square":
        return 2.0
    return 1.0 if norm in first.get(survey.kind, ()) else None
