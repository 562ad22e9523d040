"""Bodies that spin, where another body touches them: how fast their surface moves, and how impulses there turn them.

An arm leads from the centre of mass of a body, which is its position, to the point. The spin is a vector; in 2D its
first component is the angular velocity, about the axis that leads out of the plane.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined
from ...framework.vectors import add, add_scaled, dot, item, length, replace, scale, sub

SMALL_TURN = 1e-4  # rad: its cube is nothing beside 1


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
def symmetric(diagonal, products, v):
    """A symmetric matrix (xx, yy, zz), (xy, xz, yz) times a vector; in 2D the first component times it."""
    if len(v) == 2:
        return scale(v, item(diagonal, 0))
    x, y, z = item(v, 0), item(v, 1), item(v, len(v) - 1)
    xy, xz, yz = item(products, 0), item(products, 1), item(products, len(v) - 1)
    u = replace(v, 0, item(diagonal, 0) * x + xy * y + xz * z)
    u = replace(u, 1, xy * x + item(diagonal, 1) * y + yz * z)
    return replace(u, len(v) - 1, xz * x + yz * y + item(diagonal, len(v) - 1) * z)


@inlined
def change_of_spin(bodies, i, turned):
    """How an angular impulse changes the spin of body i."""
    return symmetric(bodies.inverse_inertia[i], bodies.inverse_products[i], turned)


@inlined
def spin_energy(bodies, i, u, v):
    """u . I v of a body: twice the energy of spin u, if v is the same; 0 of what contacts do not turn."""
    d, p = bodies.inverse_inertia[i], bodies.inverse_products[i]
    if len(u) == 2:
        w = item(d, 0)
        return item(u, 0) * item(v, 0) / w if w > 0.0 else 0.0
    last = len(u) - 1
    a, b, c, f, g, h = item(d, 0), item(d, 1), item(d, last), item(p, 0), item(p, 1), item(p, last)
    aa, bb, cc = b * c - h * h, a * c - g * g, a * b - f * f
    ab, ac, bc = g * h - f * c, f * h - g * b, f * g - a * h
    size = a * aa + f * ab + g * ac
    if not size > 0.0:
        return 0.0
    diagonal = replace(replace(replace(d, 0, aa), 1, bb), last, cc)
    products = replace(replace(replace(p, 0, ab), 1, ac), last, bc)
    return dot(u, symmetric(diagonal, products, v)) / size


@inlined
def turn_of_arm(turn, arm):
    """By how much the end of an arm moves as it turns; in space about the direction of the turn."""
    once, square = cross_spin(turn, arm), dot(turn, turn)
    if square < SMALL_TURN * SMALL_TURN:
        return add_scaled(once, cross_spin(turn, once), 0.5)
    size = math.sqrt(square)
    return add_scaled(scale(once, math.sin(size) / size), cross_spin(turn, once), (1.0 - math.cos(size)) / square)


@inlined
def compliance(bodies, i, arm, along):
    """1 / kg that an impulse at the end of an arm, along a unit vector, moves by turning the body."""
    turned = twist(arm, along)
    return dot(turned, change_of_spin(bodies, i, turned))


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
    return item(bodies.inverse_inertia[a], 0) * r_a * r_a + item(bodies.inverse_inertia[b], 0) * r_b * r_b


@inlined
def turn_by(bodies, a, b, normal, impulse):
    """An impulse along the surface, on b and back on a, changes the spins of both."""
    turned = twist(normal, impulse)
    w_a, w_b = item(bodies.inverse_inertia[a], 0), item(bodies.inverse_inertia[b], 0)
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
def is_turned(bodies, i):
    """Whether contacts turn body i by pushing along their normals: it is not round."""
    return length(bodies.inverse_inertia[i]) > 0.0 and bodies.rolling_radius[i] == 0.0


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
