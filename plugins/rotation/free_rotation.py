"""How a body turns by itself in 3D: Euler's equations, split into rotations about its principal axes.

The kinetic energy is a sum of three terms, M_k^2 / (2 I_k), and under each alone the body turns about axis k at a
constant rate: exact, explicit, and the angular momentum stays what it is. One after the other, 1 2 3 2 1 with half
steps but for the third, they are of order 2 and symplectic (S. Reich, "Momentum conserving symplectic integrators",
1994). The energy swings by that order, until ``turn_to_energy`` puts it right at the end.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...systems.shapes.quaternions import product

SWEEPS = 16  # of Jacobi rotations: each squares what is off the diagonal
SPHERICAL = 1e-24  # square of the sine between momentum and angular velocity: less is none
DIAGONAL = 1e-15  # of the trace: what is off the diagonal by less is rounding


@part
def turned_about(q, m, k, angle):
    """(rotation, momentum in its frame) of a body that turns about its own axis k by an angle."""
    w, x, y, z = q
    half = 0.5 * angle
    c, s = math.cos(half), math.sin(half)
    cosine, sine = math.cos(angle), math.sin(angle)
    m0, m1, m2 = m
    if k == 0:
        turned = w * c - x * s, x * c + w * s, y * c + z * s, z * c - y * s
        return turned, (m0, cosine * m1 + sine * m2, cosine * m2 - sine * m1)
    if k == 1:
        turned = w * c - y * s, x * c - z * s, y * c + w * s, z * c + x * s
        return turned, (cosine * m0 - sine * m2, m1, cosine * m2 + sine * m0)
    turned = w * c - z * s, x * c + y * s, y * c - x * s, z * c + w * s
    return turned, (cosine * m0 + sine * m1, cosine * m1 - sine * m0, m2)


@part
def energy_of(m, inverse):
    """Twice the kinetic energy."""
    return m[0] * m[0] * inverse[0] + m[1] * m[1] * inverse[1] + m[2] * m[2] * inverse[2]


@part
def turn_to_energy(q, m, inverse, gained):
    """(rotation, momentum in its frame) of a body that has gained so much of :func:`energy_of` by splitting: the
    momentum is turned in the body towards its angular velocity, and the body back, so that it stays where it is."""
    square = m[0] * m[0] + m[1] * m[1] + m[2] * m[2]
    if gained == 0.0 or not square > 0.0:
        return q, m
    mean = energy_of(m, inverse) / square  # of the inverse moments, along the momentum
    x, y, z = m[0] * (inverse[0] - mean), m[1] * (inverse[1] - mean), m[2] * (inverse[2] - mean)
    steep = x * x + y * y + z * z
    if not steep > SPHERICAL * mean * mean * square:
        return q, m
    along, lacks = energy_of((x, y, z), inverse) / steep, -gained / square
    steep = math.sqrt(steep / square)
    left = steep * steep + (along - mean - lacks) * lacks
    tangent = lacks / (steep + math.sqrt(left)) if left >= 0.0 else steep / (mean + lacks - along)  # of the angle
    cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
    share, half = tangent * cosine / steep, math.sqrt(0.5 + 0.5 * cosine)
    back = -share / (2.0 * half * square)
    axis = back * (m[1] * z - m[2] * y), back * (m[2] * x - m[0] * z), back * (m[0] * y - m[1] * x)
    turned = product(q, (half, axis[0], axis[1], axis[2]))
    return turned, (m[0] * cosine + x * share, m[1] * cosine + y * share, m[2] * cosine + z * share)


@part
def turn_freely(q, m, inverse, h):
    """(rotation, momentum in its frame, what splitting has added to :func:`energy_of`) after h seconds. q: unit
    quaternion of the principal axes; m: angular momentum along them; inverse: 1 / principal moments."""
    energy = energy_of(m, inverse)
    for place in range(5):
        k = place if place < 3 else 4 - place
        rate = m[0] * inverse[0] if k == 0 else (m[1] * inverse[1] if k == 1 else m[2] * inverse[2])
        q, m = turned_about(q, m, k, rate * (h if k == 2 else 0.5 * h))
    return q, m, energy_of(m, inverse) - energy


@part
def diagonalised(xx, yy, zz, xy, xz, yz):
    """(eigenvalues, unit quaternion that turns the coordinate axes onto the eigenvectors) of a symmetric matrix, by
    Jacobi's rotations (Golub and Van Loan, "Matrix computations", 8.5)."""
    q, small = (1.0, 0.0, 0.0, 0.0), DIAGONAL * (abs(xx) + abs(yy) + abs(zz))
    for _ in range(SWEEPS):
        if abs(xy) + abs(xz) + abs(yz) <= small:
            break
        for k in range(3):
            # the plane of the two other axes: a, b on its diagonal, c off it; d, e couple them with axis k
            a, b, c, d, e = xx, yy, xy, xz, yz
            if k == 0:
                a, b, c, d, e = yy, zz, yz, xy, xz
            elif k == 1:
                a, b, c, d, e = zz, xx, xz, yz, xy
            if c == 0.0:
                continue
            angle = 0.5 * math.atan2(2.0 * c, a - b)
            if angle > 0.25 * math.pi:  # the smaller turn that does it
                angle -= 0.5 * math.pi
            elif angle < -0.25 * math.pi:
                angle += 0.5 * math.pi
            cosine, sine = math.cos(angle), math.sin(angle)
            mean, apart = 0.5 * (a + b), 0.5 * (a - b) * math.cos(2.0 * angle) + c * math.sin(2.0 * angle)
            a, b, d, e = mean + apart, mean - apart, cosine * d + sine * e, cosine * e - sine * d
            half_c, half_s = math.cos(0.5 * angle), math.sin(0.5 * angle)
            if k == 0:
                yy, zz, yz, xy, xz = a, b, 0.0, d, e
                q = product(q, (half_c, half_s, 0.0, 0.0))
            elif k == 1:
                zz, xx, xz, yz, xy = a, b, 0.0, d, e
                q = product(q, (half_c, 0.0, half_s, 0.0))
            else:
                xx, yy, xy, xz, yz = a, b, 0.0, d, e
                q = product(q, (half_c, 0.0, 0.0, half_s))
    return (xx, yy, zz), q
