"""Bodies that spin, where another body touches them: how fast their surface moves, and how impulses there turn them.

An arm leads from the centre of mass of a body, which is its position, to the point. The spin is a vector; in 2D its
first component is the angular velocity, about the axis that leads out of the plane.
"""

from __future__ import annotations

import math

from ...framework.compilation import inlined, part
from ...framework.elementary import cos, sin
from ...framework.vectors import add, add_scaled, components, dot, item, length, replace, scale, sub, triple

SERIES = 0.06  # rad^2: below it six terms are exact


@inlined
def cross_spin(spin, arm):
    """spin x arm: the velocity at the end of the arm."""
    if len(arm) == 2:
        w = item(spin, 0)
        return replace(replace(arm, 0, -w * item(arm, 1)), 1, w * item(arm, 0))
    (a, b, c), (x, y, z) = components(spin), components(arm)
    return triple(arm, (b * z - c * y, c * x - a * z, a * y - b * x))


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
    (xx, yy, zz), (xy, xz, yz), (x, y, z) = components(diagonal), components(products), components(v)
    return triple(v, (xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z))


@inlined
def change_of_spin(bodies, i, turned):
    """How an angular impulse changes the spin of body i."""
    return symmetric(bodies.inverse_inertia[i], bodies.inverse_products[i], turned)


@inlined
def momentum_of_spin(bodies, i, spin):
    """The angular momentum of a body that spins so; 0 of what contacts do not turn."""
    d, p = bodies.inverse_inertia[i], bodies.inverse_products[i]
    if len(spin) == 2:
        w = item(d, 0)
        return scale(spin, 1.0 / w if w > 0.0 else 0.0)
    (a, b, c), (f, g, h) = components(d), components(p)
    aa, bb, cc = b * c - h * h, a * c - g * g, a * b - f * f
    ab, ac, bc = g * h - f * c, f * h - g * b, f * g - a * h
    size = a * aa + f * ab + g * ac
    diagonal, products = triple(d, (aa, bb, cc)), triple(p, (ab, ac, bc))
    return scale(symmetric(diagonal, products, spin), 1.0 / size if size > 0.0 else 0.0)


@inlined
def shares_of_small_turn(turn):
    """``shares_of_turn`` where its square is below SERIES."""
    s = dot(turn, turn)
    sine = 1.0 - s * (1 / 6 - s * (1 / 120 - s * (1 / 5_040 - s * (1 / 362_880 - s * (1 / 39_916_800)))))
    versine = 0.5 - s * (1 / 24 - s * (1 / 720 - s * (1 / 40_320 - s * (1 / 3_628_800 - s * (1 / 479_001_600)))))
    return sine, versine


@inlined
def shares_of_turn(turn):
    """(sin(t) / t, (1 - cos(t)) / t^2) of a turn by the angle t."""
    s = dot(turn, turn)
    if s < SERIES:
        return shares_of_small_turn(turn)
    t = math.sqrt(s)
    return sin(t) / t, (1.0 - cos(t)) / s


@inlined
def end_of_turn(turn, shares, arm):
    """By how much the end of an arm moves as it turns, in space about the direction of the turn (Rodrigues)."""
    once = cross_spin(turn, arm)
    return add_scaled(scale(once, shares[0]), cross_spin(turn, once), shares[1])


@inlined
def turn_of_arm(turn, arm):
    """The same of one arm alone."""
    return end_of_turn(turn, shares_of_turn(turn), arm)


@part
def quaternion_of(turn):
    """The unit quaternion of a vector by which something turns."""
    size = length(turn)
    sine = sin(0.5 * size) / size if size > 0.0 else 0.5
    x, y, z = components(turn)
    return cos(0.5 * size), sine * x, sine * y, sine * z


@inlined
def mixed_compliance(bodies, i, arm, along, other):
    """1 / kg that an impulse at the end of an arm, along a unit vector, moves along another by turning the body."""
    return dot(twist(arm, along), change_of_spin(bodies, i, twist(arm, other)))


@inlined
def compliance(bodies, i, arm, along):
    """1 / kg that an impulse at the end of an arm, along a unit vector, moves along it by turning the body."""
    return mixed_compliance(bodies, i, arm, along, along)


@inlined
def size_of_turn(turn):
    """Of a turn or a spin: its angle or its rate."""
    return abs(item(turn, 0)) if len(turn) == 2 else length(turn)


@inlined
def is_turned(bodies, i):
    """Whether contacts turn body i by pushing along their normals: it is not round."""
    return size_of_turn(bodies.inverse_inertia[i]) > 0.0 and bodies.rolling_radius[i] == 0.0


@inlined
def arms_to(bodies, a, b, normal, place, d):
    """(arm of a, arm of b) to where the two touch. place: of that, from the centre of a's shape; d: from there to that
    of b's; ``normal`` from a to b. What touches a round body does so at its surface, to which its arm leads along the
    normal.
    """
    r_a, r_b = bodies.rolling_radius[a], bodies.rolling_radius[b]
    place_a = add_scaled(d, normal, -r_b) if r_b > 0.0 else place
    place_b = scale(normal, r_a) if r_a > 0.0 else place
    arm_a = scale(normal, r_a) if r_a > 0.0 else add(bodies.offset[a], place_a)
    arm_b = scale(normal, -r_b) if r_b > 0.0 else add(bodies.offset[b], sub(place_b, d))
    return arm_a, arm_b


@inlined
def lever(bodies, i, arm, normal):
    """What an impulse of 1 along the normal twists at the end of an arm: nothing of a round body, not even by rounding.
    """
    return scale(arm, 0.0) if bodies.rolling_radius[i] > 0.0 else twist(arm, normal)


@inlined
def closing_by_spin(bodies, a, b, arms, normal):
    """How fast b's point moves away from a's along the normal, beside their bodies."""
    arm_a, arm_b = arms
    apart = dot(bodies.spin[b], lever(bodies, b, arm_b, normal))
    return apart - dot(bodies.spin[a], lever(bodies, a, arm_a, normal))


@inlined
def velocity_by_spin(bodies, a, b, arms):
    """The velocity of b's point as that of a sees it, beside that of their bodies."""
    return sub(cross_spin(bodies.spin[b], arms[1]), cross_spin(bodies.spin[a], arms[0]))
