"""Expected results in closed form: flight, falls, bounces, collisions, sliding, springs, orbits.

Arguments may be numbers or arrays (d,) where a vector makes sense; metres, seconds, kilograms. The laws are those of
Newton, for impacts with his coefficient of restitution, and Coulomb's of friction.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

# Half steps by which a method's parabola lags (-) or leads (+): x = x0 + n dt v0 + a dt^2 n (n + lag) / 2.
LAGS = {"explicit_euler": -1, "semi_implicit_euler": 1, "velocity_verlet": 0, "rk4": 0, "yoshida4": 0}


def free_flight(seconds: float, position: Any, velocity: Any, acceleration: Any) -> tuple[Any, Any]:
    """(position, velocity), m and m/s, after ``seconds`` of constant ``acceleration``, m/s^2: the exact parabola."""
    x, v, a = (np.asarray(value, float) for value in (position, velocity, acceleration))
    return x + v * seconds + 0.5 * a * seconds**2, v + a * seconds


def flight_after(
    steps: int, dt: float, position: Any, velocity: Any, acceleration: Any, integrator: str = "semi_implicit_euler"
) -> tuple[Any, Any]:
    """(position, velocity) of the integrator after ``steps`` of ``dt`` s of constant acceleration, up to rounding.

    Both Euler methods differ from the parabola by a dt t / 2: explicit Euler lags, semi-implicit Euler leads.
    ValueError for an integrator that is not built in.
    """
    if integrator not in LAGS:
        raise ValueError(f"integrator must be one of {', '.join(LAGS)}, got {integrator!r}")
    x, v, a = (np.asarray(value, float) for value in (position, velocity, acceleration))
    return x + steps * dt * v + 0.5 * steps * (steps + LAGS[integrator]) * dt**2 * a, v + steps * dt * a


def fall_time(height: float, gravity: float) -> float:
    """Time of a fall of ``height`` from rest under ``gravity``, s: sqrt(2 h / g)."""
    return math.sqrt(2 * height / gravity)


def fall_speed(height: float, gravity: float) -> float:
    """Speed after a fall of ``height`` from rest under ``gravity``, or to jump so high, m/s: sqrt(2 g h)."""
    return math.sqrt(2 * gravity * height)


def bounce_heights(height: float, restitution: float, count: int) -> Any:
    """(count,) m: the apex after each of the first bounces from ``height`` with ``restitution``, h e^(2k)."""
    return height * float(restitution) ** (2 * np.arange(1, count + 1))


def bounce_times(height: float, gravity: float, restitution: float, count: int) -> Any:
    """(count,) s: when a ball dropped from ``height`` under ``gravity`` hits the floor, with ``restitution`` e; for
    e < 1 the limit is t1 (1 + e) / (1 - e)."""
    flights = 2 * float(restitution) ** np.arange(count)
    flights[:1] = 1.0
    return fall_time(height, gravity) * np.cumsum(flights)


def collide(
    mass_a: float, velocity_a: Any, mass_b: float, velocity_b: Any, restitution: float = 1.0, normal: Any = 1.0
) -> tuple[Any, Any]:
    """Velocities of two bodies after an impact without friction, from mass_a, velocity_a, mass_b, velocity_b before it.

    restitution: 1 conserves energy. normal: the unit vector from a to b; 1 in one dimension. mass_b may be infinite.
    """
    va, vb, n = (np.asarray(value, float) for value in (velocity_a, velocity_b, normal))
    share_a = 1.0 if math.isinf(mass_b) else mass_b / (mass_a + mass_b)
    change = -(1 + restitution) * np.sum((vb - va) * n) * n
    return va - share_a * change, vb + (1.0 - share_a) * change


def impact_time(position_a: Any, velocity_a: Any, position_b: Any, velocity_b: Any, distance: float) -> float:
    """When two spheres in straight flight from position_a and position_b with velocity_a and velocity_b reach
    ``distance`` between centres, the sum of radii, s; inf if never."""
    d = np.atleast_1d(np.subtract(position_b, position_a).astype(float))
    w = np.atleast_1d(np.subtract(velocity_b, velocity_a).astype(float))
    closing, fast, room = -float(d @ w), float(w @ w), float(d @ d) - distance**2
    if room <= 0:
        return 0.0
    under = closing**2 - fast * room
    return room / (closing + math.sqrt(under)) if closing > 0 and under >= 0 else math.inf


def sliding_distance(speed: float, friction: float, gravity: float) -> float:
    """Distance in which a body of that ``speed`` on level ground stops by ``friction``, under ``gravity``, m:
    v^2 / (2 mu g)."""
    return speed**2 / (2 * friction * gravity)


def sliding_time(speed: float, friction: float, gravity: float) -> float:
    """Time in which a body of that ``speed`` stops by ``friction``, under ``gravity``, s: v / (mu g)."""
    return speed / (friction * gravity)


def spring(seconds: float, stiffness: float, mass: float, position: Any, velocity: Any = 0.0) -> tuple[Any, Any]:
    """(position, velocity), from the rest position, of a ``mass`` on a spring of ``stiffness``, N/m, after ``seconds``,
    without drag; the period is 2 pi sqrt(m / k)."""
    rate = math.sqrt(stiffness / mass)
    x, v = np.asarray(position, float), np.asarray(velocity, float)
    c, s = math.cos(rate * seconds), math.sin(rate * seconds)
    return x * c + v / rate * s, v * c - x * rate * s


def orbit_speed(strength: float, radius: float) -> float:
    """Speed on a circle of ``radius`` r under the attraction strength / r^2, m/s: sqrt(strength / r); the period is
    2 pi r / speed."""
    return math.sqrt(strength / radius)


def damped_velocity(seconds: float, velocity: Any, acceleration: Any, damping: float) -> Any:
    """m/s after ``seconds`` of constant ``acceleration`` and ``damping`` c, 1/s, from ``velocity`` v:
    v e^(-c t) + a (1 - e^(-c t)) / c; exact for every integrator of carom."""
    v, a = np.asarray(velocity, float), np.asarray(acceleration, float)
    return v * math.exp(-damping * seconds) - a * math.expm1(-damping * seconds) / damping
