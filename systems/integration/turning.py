"""Bodies that spin, where another body touches them: how fast their surface moves, and how impulses there turn them.

Only round dynamic bodies are turned: their contacts lie on the line of the normal through the centre, and what pushes
along that does not turn them. What is kinematic turns whatever its shape, and each point of it has its own velocity.
The spin is a vector; in 2D its first component is the angular velocity, about the axis that leads out of the plane.
"""

from __future__ import annotations

from ...framework.compilation import inlined
from ...framework.vectors import add, add_scaled, item, length, replace, scale, sub


@inlined
def cross_spin(spin, arm):
    """spin x arm: the velocity at the end of the arm."""
    if len(arm) == 2:
        w = item(spin, 0)
        return replace(replace(arm, 0, -w * item(arm, 1)), 1, w * item(arm, 0))
    x = item(spin, 1) * item(arm, 2) - item(spin, 2) * item(arm, 1)
    y = item(spin, 2) * item(arm, 0) - item(spin, 0) * item(arm, 2)
    z = item(spin, 0) * item(arm, 1) - item(spin, 1) * item(arm, 0)
    return replace(replace(replace(arm, 0, x), 1, y), 2, z)


@inlined
def twist(arm, impulse):
    """arm x impulse: the angular impulse, as a spin is stored."""
    if len(arm) == 2:
        out = item(arm, 0) * item(impulse, 1) - item(arm, 1) * item(impulse, 0)
        return replace(replace(arm, 0, out), 1, 0.0)
    return cross_spin(arm, impulse)


@inlined
def surface_velocity(bodies, a, b, normal):
    """How much faster than its centre the surface of b moves there, as the surface of a sees it; ``normal`` from a to
    b."""
    both = add_scaled(scale(bodies.spin[a], bodies.rolling_radius[a]), bodies.spin[b], bodies.rolling_radius[b])
    return scale(cross_spin(both, normal), -1.0)


@inlined
def turning_mass(bodies, a, b):
    """1 / kg that an impulse along the surface moves beside the bodies' inverse masses."""
    r_a, r_b = bodies.rolling_radius[a], bodies.rolling_radius[b]
    return bodies.inverse_inertia[a] * r_a * r_a + bodies.inverse_inertia[b] * r_b * r_b


@inlined
def turn_by(bodies, a, b, normal, impulse):
    """An impulse along the surface, on b and back on a, changes the spins of both."""
    turned = twist(normal, impulse)
    w_a, w_b = bodies.inverse_inertia[a], bodies.inverse_inertia[b]
    if w_a > 0.0:
        bodies.spin[a] = add_scaled(bodies.spin[a], turned, -w_a * bodies.rolling_radius[a])
    if w_b > 0.0:
        bodies.spin[b] = add_scaled(bodies.spin[b], turned, -w_b * bodies.rolling_radius[b])


@inlined
def turn_at(bodies, sides, normal, impulse, left):
    """The same where ``left`` seconds of the step are left, in which both turn with their new spins."""
    a, b = sides
    spin_a, spin_b = bodies.spin[a], bodies.spin[b]
    turn_by(bodies, a, b, normal, impulse)
    bodies.turn[a] = add_scaled(bodies.turn[a], sub(bodies.spin[a], spin_a), left)
    bodies.turn[b] = add_scaled(bodies.turn[b], sub(bodies.spin[b], spin_b), left)


@inlined
def is_mill(bodies, i):
    """Whether body i turns by itself and is not round, so that its surface moves along its normal too."""
    return bodies.inverse_mass[i] == 0.0 and bodies.rolling_radius[i] == 0.0 and length(bodies.spin[i]) > 0.0


@inlined
def carried(bodies, a, b, point, d):
    """The velocity of b's point, as that of a sees it, beside that of their centres, where one of the two is a mill.

    point: of the contact, from the centre of a's shape; d: from there to that of b's.
    """
    result = scale(d, 0.0)
    if is_mill(bodies, a):
        result = sub(result, cross_spin(bodies.spin[a], add(bodies.offset[a], point)))
    if is_mill(bodies, b):
        result = add(result, cross_spin(bodies.spin[b], add(bodies.offset[b], sub(point, d))))
    return result
