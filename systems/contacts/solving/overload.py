"""Bodies too heavy for what they lie on: rows are solved with a capped mass, their impulses move the real one.

Such an impulse keeps momentum, and takes the more energy the heavier the body is. The island's external support carries
the capped weight, see ``find_support``.
"""

from __future__ import annotations

from ....framework.compilation import inlined, part
from ....framework.vectors import add, add_scaled, dot, length, scale, sub
from ...integration.turning import momentum_of_spin
from ...joints import calls
from ...joints.calls import for_joints
from ..constants import GAIN_ROUNDING
from .guard import work_of_row
from .records import OVERLOADED, note_fault
from .rows import compute_effective_mass, rotate_body


@part
def cap_mass_ratio(solver, t, dt, span, arms):
    """Cap the masses of island t at what it can carry with MOST_REPEATS."""
    least, mass = solver.lightest[t] / solver.load_share[t], solver.solver_mass
    solver.mass_of[t] = solver.force_of[t] = 0.0
    for q in range(span[2], span[3]):
        by = solver.inverse_mass[q] / least
        solver.mass_ratio[q] = min(1.0, by)
        if by < 1.0:
            note_fault(solver, OVERLOADED, solver.body_row[q])
            if len(arms) > 0:
                solver.inverse_inertia[q] = scale(solver.inverse_inertia[q], 1.0 / by)
                solver.inverse_products[q] = scale(solver.inverse_products[q], 1.0 / by)
                solver.inverse_moments[q] = scale(solver.inverse_moments[q], 1.0 / by)
            solver.inverse_mass[q], mass[q] = least, 1.0 / least
        solver.mass_of[t] += mass[q]
        solver.force_of[t] += mass[q] * length(solver.acceleration[q]) * dt
    for k in range(span[0], span[1]):
        compute_effective_mass(solver, k, arms)


@part
def find_support(solver, span, arms):
    """What pushes an island from outside in a substep: (direction, speed of that along it, what the heavy bodies have
    of the momentum that it gives: 0 to 1)."""
    total = scale(solver.velocity[span[2]], 0.0)
    velocity, before, mass = solver.velocity, solver.velocity_before, solver.solver_mass
    motion = given = work = 0.0
    for q in range(span[2], span[3]):  # among themselves they give none
        total = add_scaled(total, sub(velocity[q], before[q]), mass[q])
        motion += mass[q] * length(before[q])
    size = length(total)
    if not size > GAIN_ROUNDING * motion:
        return total, 0.0, 0.0
    way = scale(total, 1.0 / size)
    for q in range(span[2], span[3]):
        if solver.mass_ratio[q] < 1.0:
            given += max(0.0, dot(way, sub(velocity[q], before[q]))) * mass[q]
    for k in range(span[0], span[1] if solver.movers > 0 or solver.surfaces_run else span[0]):
        work += work_of_row(solver, k, arms)
    work = for_joints(solver, calls.SUM_WORK, (work, 0.0), span, arms)
    return way, -work / size, size / max(size, given)


@inlined
def braking_share(rest, held, motion, change):
    """The share of a change that stops what moves against it, where its ``rest`` has not acted, and of that at most as
    much as is ``held``. motion, change: the momentum of the change times the motion with all of it, and times itself.
    """
    return min(max(0.0, rest - motion / change), held * rest) if change > 0.0 else 0.0


@part
def restore_mass(solver, h, span, arms):
    """In the h of a substep bodies have moved as if they were light; where h is 0 velocities are as if they were.

    What is outside of the island stops them as if it were so: it can bear anything. It throws none.
    """
    way, speed, held = find_support(solver, span, arms)
    velocity, spins = solver.velocity, solver.spin
    for q in range(span[2], span[3]):
        rest = 1.0 - solver.mass_ratio[q]
        if rest > 0.0:
            change = sub(velocity[q], solver.velocity_before[q])
            along = max(0.0, dot(change, way))
            stop = braking_share(rest, held, along * (dot(velocity[q], way) - speed), along * along)
            change = add_scaled(scale(way, stop * along), change, -rest)
            if h > 0.0:
                solver.shift[q] = add_scaled(solver.shift[q], change, h)
            else:
                velocity[q] = add(velocity[q], change)
        if rest > 0.0 and len(arms) > 0:
            change = sub(spins[q], solver.spin_before[q])
            momentum = momentum_of_spin(solver, q, change)
            stop = braking_share(rest, held, dot(momentum, spins[q]), dot(momentum, change))
            change = scale(change, stop - rest)
            if h > 0.0:
                rotate_body(solver, q, add_scaled(solver.turn[q], change, h))
            else:
                spins[q] = add(spins[q], change)
