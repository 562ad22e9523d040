"""How a body turns by itself in 3D: Euler's equations, split into rotations about fixed axes.

The kinetic energy is a sum of three terms. Under M^2 / (2 I_k) alone a body turns in space about its angular momentum;
under what M_j^2 and M_l^2 add to that about its own axes j and l: each at a constant rate, so that the momentum stays
what it is. The first goes along with the others. These are taken one after the other, j l j with half steps for j: of
order 2 and symplectic (S. Reich, "Momentum conserving symplectic integrators", 1994). j and k are the axes of the most
similar moments; where these are the same, as of a bar, it is exact however far the body turns. Else the energy swings
by that order, until ``turn_to_energy`` puts it right at the end.
"""

from __future__ import annotations

import math

from ...framework.compilation import part
from ...framework.elementary import atan2, cos, sin
from .quaternions import product

JACOBI_SWEEPS = 16  # of Jacobi rotations: each squares what is off the diagonal
SPHERICAL = 1e-24  # square of the sine between momentum and angular velocity: less is none
ENERGY_ROUNDING = 1e-14  # of the energy
DIAGONAL = 1e-15  # of the trace: what is off the diagonal by less is rounding
PIECE, MOST_PIECES = 0.25, 64  # rad: as far as unlike moments turn a body in one of the pieces of its way


@part
def turned_about(q, m, k, angle):
    """(rotation, momentum in its frame) of a body that turns about its own axis k by an angle."""
    w, x, y, z = q
    half = 0.5 * angle
    c, s = cos(half), sin(half)
    cosine, sine = cos(angle), sin(angle)
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
def of_axis(v, k):
    """The k-th of three."""
    return v[0] if k == 0 else (v[1] if k == 1 else v[2])


@part
def energy_of(m, inverse):
    """Twice the kinetic energy."""
    return m[0] * m[0] * inverse[0] + m[1] * m[1] * inverse[1] + m[2] * m[2] * inverse[2]


@part
def turn_about_one(q, m, inverse, gained):
    """As :func:`turn_to_energy`, but about one axis of the body: the one that takes the least of the momentum along
    another. What swings far about two axes has states of its energy that no turn towards its velocity leads to."""
    axis, least, angle = 0, math.inf, 0.0
    for k in range(3):
        a, b = (k + 1) % 3, (k + 2) % 3
        x, y, steep = of_axis(m, a), of_axis(m, b), of_axis(inverse, a) - of_axis(inverse, b)
        change = gained / steep if steep != 0.0 else math.inf
        if abs(change) < least and -y * y <= change <= x * x:
            axis, least = k, abs(change)
            to_x, to_y = math.sqrt(x * x - change), math.sqrt(y * y + change)
            angle = atan2(y, x) - atan2(math.copysign(to_y, y), math.copysign(to_x, x))
    return turned_about(q, m, axis, angle)


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
    turned, wanted = product(q, (half, axis[0], axis[1], axis[2])), energy_of(m, inverse) - gained
    m = m[0] * cosine + x * share, m[1] * cosine + y * share, m[2] * cosine + z * share
    excess = energy_of(m, inverse) - wanted
    if left >= 0.0 or abs(excess) <= ENERGY_ROUNDING * wanted:
        return turned, m
    return turn_about_one(turned, m, inverse, excess)


@part
def most_similar(inverse):
    """(j, k, l): the axes of the two most similar moments, and the other one."""
    x, y, z = abs(inverse[1] - inverse[2]), abs(inverse[2] - inverse[0]), abs(inverse[0] - inverse[1])
    if x <= y and x <= z:
        return 1, 2, 0
    return (2, 0, 1) if y <= z else (0, 1, 2)


@part
def tensor_size(v, factor):
    x, y, z = factor * v[0], factor * v[1], factor * v[2]
    return math.sqrt(x * x + y * y + z * z)


@part
def turn_freely(q, m, inverse, h):
    """(rotation, momentum in its frame, what splitting has added to :func:`energy_of`) after h seconds. q: unit
    quaternion of the principal axes; m: angular momentum along them; inverse: 1 / principal moments."""
    energy, (j, k, other) = energy_of(m, inverse), most_similar(inverse)
    about_j, about_other = of_axis(inverse, j) - of_axis(inverse, k), of_axis(inverse, other) - of_axis(inverse, k)
    turned = tensor_size(m, about_j * h) / PIECE
    pieces = 1 + (int(turned) if turned < MOST_PIECES else MOST_PIECES)
    share, half = h / pieces, 0.5 * of_axis(inverse, k) * h
    size = tensor_size(m, half)
    sine = sin(size) / size * half if size > 0.0 else 0.0
    q = product(q, (cos(size), sine * m[0], sine * m[1], sine * m[2]))
    for _ in range(pieces):
        q, m = turned_about(q, m, j, 0.5 * share * about_j * of_axis(m, j))
        q, m = turned_about(q, m, other, share * about_other * of_axis(m, other))
        q, m = turned_about(q, m, j, 0.5 * share * about_j * of_axis(m, j))
    return q, m, energy_of(m, inverse) - energy


@part
def diagonalised(xx, yy, zz, xy, xz, yz):
    """(eigenvalues, unit quaternion that turns the coordinate axes onto the eigenvectors) of a symmetric matrix, by
    Jacobi's rotations (Golub and Van Loan, "Matrix computations", 8.5)."""
    q, small = (1.0, 0.0, 0.0, 0.0), DIAGONAL * (abs(xx) + abs(yy) + abs(zz))
    for _ in range(JACOBI_SWEEPS):
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
            angle = 0.5 * atan2(2.0 * c, a - b)
            if angle > 0.25 * math.pi:  # the smaller turn that does it
                angle -= 0.5 * math.pi
            elif angle < -0.25 * math.pi:
                angle += 0.5 * math.pi
            cosine, sine = cos(angle), sin(angle)
            mean, apart = 0.5 * (a + b), 0.5 * (a - b) * cos(2.0 * angle) + c * sin(2.0 * angle)
            a, b, d, e = mean + apart, mean - apart, cosine * d + sine * e, cosine * e - sine * d
            half_c, half_s = cos(0.5 * angle), sin(0.5 * angle)
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
