"""The grid of settings worth trying in a scene, and the order of accuracy that theory gives to each method.

Dials that change nothing in a scene are left alone: without force systems velocity Verlet, Runge-Kutta 4 and Yoshida 4
are one method, without any force all five are; substeps matter where something rests, geometry where bodies have
levels, the kind of collision where something touches; what is driven by events has an integrator of its own.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence

from ..measure.survey import Survey
from ..trading.records import CAROM, CHAOTIC, IMPACTS, PYMUNK, RESTING, SMOOTH, Cell

ALL_METHODS = ("explicit_euler", "semi_implicit_euler", "velocity_verlet", "rk4", "yoshida4")
CONSTANT_FORCE = ("explicit_euler", "semi_implicit_euler", "velocity_verlet")
COLLISIONS = ("discrete", "continuous", "event_driven")
SUBSTEPS = (1, 2, 4, 8, 16, 32)
ITERATIONS = (10, 50)  # of pymunk's solver: its default, and what it takes to hold a stack
SLOWEST = 1 / 15  # s: the largest step of a game
HALVINGS = 7
ORDER = {"explicit_euler": 1, "semi_implicit_euler": 1, "velocity_verlet": 2, "rk4": 4, "yoshida4": 4}
OF_STATE = ("position", "energy", "kinetic")


def steps_for(survey: Survey) -> tuple[float, ...]:
    """From 1/15 s, or four times what the scene recommends, downwards; each half of the one before."""
    largest = max(SLOWEST, 4 * survey.settings.dt)
    smallest = min(largest / 2**HALVINGS, survey.settings.dt / 4)
    count = math.ceil(math.log2(largest / smallest)) + 1
    return tuple(largest / 2**k for k in range(count))


def methods(survey: Survey) -> tuple[Cell, ...]:
    """One cell per curve, with a step of 1 s."""
    own = survey.settings
    base = Cell(1.0, own.integrator, own.collision, own.substeps, own.geometry)
    integrators = ALL_METHODS if survey.force_systems else CONSTANT_FORCE
    if survey.kind == RESTING or (not survey.forces and not survey.damping):  # at rest the solver decides
        integrators = (own.integrator,)
    if own.integrator not in integrators and own.integrator not in ALL_METHODS:
        integrators = (*integrators, own.integrator)  # a plugin's
    collisions = COLLISIONS if survey.contacts else (own.collision,)
    substeps = SUBSTEPS if survey.kind == RESTING else (own.substeps,)
    geometries = ("precise", "bounds") if survey.levels else (own.geometry,)
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
    """What is driven by events flies its own way, whatever the integrator: named after the one that it resembles."""
    return dataclasses.replace(cell, integrator="velocity_verlet") if cell.collision == "event_driven" else cell


def peer_methods() -> tuple[Cell, ...]:
    """pymunk's curves."""
    return tuple(Cell(1.0, "", "discrete", count, "precise", PYMUNK) for count in ITERATIONS)


def grid(curves: Sequence[Cell], steps: Sequence[float]) -> tuple[Cell, ...]:
    """Every curve at every step."""
    return tuple(dataclasses.replace(method, dt=dt) for dt in steps for method in curves)


def theory(cell: Cell, norm: str, survey: Survey) -> float | None:
    """The order in dt that the method should show in this norm; inf: exact but for rounding; None: nobody knows.

    Impacts are found at their true time in continuous and event-driven worlds, so the flight between them decides;
    contacts at rest give way with the square of the step; a highest point that is looked for at steps only is missed by
    g dt^2 / 8 at most.
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
        return None if cell.collision == "discrete" else math.inf  # a discrete world misses grazes
    if survey.kind == CHAOTIC:
        return None
    return {"energy": flight, "position": flight, "energy_square": 2 * flight}.get(norm) if flight == 1 else None


def _of_flight(cell: Cell, survey: Survey) -> float | None:
    """Of the position, between impacts."""
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
    """It moves as explicit Euler does under gravity (measured), and sees impacts at the ends of steps: both order 1."""
    first = {SMOOTH: ("position", "apex"), IMPACTS: ("energy",), CHAOTIC: ("pressure", "rate")}
    if survey.kind == IMPACTS and norm == "energy_square":
        return 2.0
    return 1.0 if norm in first.get(survey.kind, ()) else None
