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
from ...framework.jit.stack_arrays import stack_array
from ...framework.vectors import add_scaled, cross, dot, item, replace, scale
from .convex.gjk import norm
from .quaternions import product

JACOBI_SWEEPS = 16  # of Jacobi rotations: each squares what is off the diagonal
SPHERICAL = 1e-16  # square of the sine between momentum and angular velocity: less tells rounding, and gains no energy
DIAGONAL = 1e-15  # of the trace: what is off the diagonal by less is rounding
SMALL_TURN, NO_TURN = 1e-4, 1e-12  # rad: by what unlike moments add splitting is right; by that little they are alike
MOST_MEANS, SAME_MEANS = 16, 1e-8  # of each other: the next arithmetic and geometric mean are the same number
MOST_DOUBLINGS, NEAR_MEAN, ARCTAN_SERIES = 64, 2e-3, 1e-8  # of their mean: what is nearer has a series of six terms
SEPARATRIX = 1e-32  # least square of the complementary modulus


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
def energy_of(m, inverse):
    """Twice the kinetic energy."""
    return m[0] * m[0] * inverse[0] + m[1] * m[1] * inverse[1] + m[2] * m[2] * inverse[2]


@part
def turn_to_energy(q, m, inverse, gained):
    """(rotation, momentum in its frame) of a body that has gained so much of :func:`energy_of` by splitting: the
    momentum is turned in the body towards its angular velocity, and the body back, so that it stays where it is."""
    square = dot(m, m)
    if gained == 0.0 or not square > 0.0:
        return q, m
    mean = energy_of(m, inverse) / square  # of the inverse moments, along the momentum
    way = m[0] * (inverse[0] - mean), m[1] * (inverse[1] - mean), m[2] * (inverse[2] - mean)
    steep = dot(way, way)
    if not steep > SPHERICAL * mean * mean * square:
        return q, m
    along, lacks = energy_of(way, inverse) / steep, -gained / square
    steep = math.sqrt(steep / square)
    left = steep * steep + (along - mean - lacks) * lacks
    tangent = lacks / (steep + math.sqrt(left)) if left >= 0.0 else steep / (mean + lacks - along)  # of the angle
    cosine = 1.0 / math.sqrt(1.0 + tangent * tangent)
    share, half = tangent * cosine / steep, math.sqrt(0.5 + 0.5 * cosine)
    back = -share / (2.0 * half * square)
    axis = scale(cross(m, way), back)
    return product(q, (half, axis[0], axis[1], axis[2])), add_scaled(scale(m, cosine), way, share)


@part
def most_similar(inverse):
    """(j, k, l): the axes of the two most similar moments, and the other one."""
    x, y, z = abs(inverse[1] - inverse[2]), abs(inverse[2] - inverse[0]), abs(inverse[0] - inverse[1])
    if x <= y and x <= z:
        return 1, 2, 0
    return (2, 0, 1) if y <= z else (0, 1, 2)


@part
def elliptic_functions(u, complement):
    """(sn, cn, dn) of u, k^2 = 1 - complement, by the arithmetic-geometric mean (R. Bulirsch, 1965)."""
    means, roots = stack_array(MOST_MEANS, 0.0), stack_array(MOST_MEANS, 0.0)
    mean, factor, dn, c, last = 1.0, complement, 1.0, 1.0, 0
    for i in range(MOST_MEANS):
        root = math.sqrt(factor)
        means[i], roots[i], last, c = mean, root, i, 0.5 * (mean + root)
        if abs(mean - root) <= SAME_MEANS * mean:
            break
        factor, mean = root * mean, c
    sn, cn = sin(c * u), cos(c * u)
    if sn == 0.0:
        return sn, cn, dn
    ratio = cn / sn
    c *= ratio
    for i in range(last, -1, -1):
        ratio *= c
        c *= dn
        dn = (roots[i] + ratio) / (means[i] + ratio)
        ratio = c / means[i]
    sn = math.copysign(1.0 / math.sqrt(c * c + 1.0), sn)
    return sn, c * sn, dn


@part
def elliptic_integrals(sn, cn, complement, nu):
    """(of du, of du / (1 + nu sn^2)) from 0 to where sn and cn >= 0 of u are these, by duplication (B. C. Carlson,
    "Numerical computation of real or complex elliptic integrals", 1995)."""
    square = sn * sn
    x, y, z, p = cn * cn, cn * cn + complement * square, 1.0, 1.0 + nu * square
    far, share, sum_of = (p - x) * (p - y) * (p - z), 1.0, 0.0
    for _ in range(MOST_DOUBLINGS):
        mean = 0.2 * (x + y + z + 2.0 * p)
        if max(abs(mean - x), abs(mean - y), abs(mean - z), abs(mean - p)) <= NEAR_MEAN * mean:
            break
        rx, ry, rz, rp = math.sqrt(x), math.sqrt(y), math.sqrt(z), math.sqrt(p)
        product_of, more = (rp + rx) * (rp + ry) * (rp + rz), rx * ry + rx * rz + ry * rz
        root = math.sqrt(share * share * share * far) / product_of
        sum_of += share / product_of * (atan2(root, 1.0) / root if root > ARCTAN_SERIES else 1.0 - root * root / 3.0)
        share *= 0.25
        x, y, z, p = 0.25 * (x + more), 0.25 * (y + more), 0.25 * (z + more), 0.25 * (p + more)
    mean = (x + y + z) / 3.0
    a, b = 1.0 - x / mean, 1.0 - y / mean
    c = -(a + b)
    e2, e3 = a * b - c * c, a * b * c
    first = (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / math.sqrt(mean)
    mean = 0.2 * (x + y + z + 2.0 * p)
    a, b, c = 1.0 - x / mean, 1.0 - y / mean, 1.0 - z / mean
    d = -0.5 * (a + b + c)
    e2 = a * b + a * c + b * c - 3.0 * d * d
    volume = a * b * c
    e3, e4 = volume + 2.0 * e2 * d + 4.0 * d * d * d, (2.0 * volume + e2 * d + 3.0 * d * d * d) * d
    series = 1.0 - 3.0 * e2 / 14.0 + e3 / 6.0 + 9.0 * e2 * e2 / 88.0 - 3.0 * e4 / 22.0 - 9.0 * e2 * e3 / 52.0
    third = share * (series + 3.0 * volume * d * d / 26.0) / (mean * math.sqrt(mean)) + 6.0 * sum_of
    return sn * first, sn * (first - nu / 3.0 * square * third)


@part
def axes_of_way(m, inverse):
    """(p, y, o): the axis that the momentum goes round, that of the middle moment, and the other one."""
    x, y, z = inverse
    middle = 0 if y <= x <= z or z <= x <= y else (1 if x <= y <= z or z <= y <= x else 2)
    p, o = (middle + 1) % 3, (middle + 2) % 3
    steep, gentle = item(inverse, middle) - item(inverse, p), item(inverse, o) - item(inverse, middle)
    if abs(steep) * item(m, p) * item(m, p) < abs(gentle) * item(m, o) * item(m, o):
        return o, middle, p
    return p, middle, o


@part
def turn_far(q, m, inverse, h):
    """As :func:`turn_freely`, exactly: the momentum by Jacobi's elliptic functions, and how far the body has gone round
    it by the integral of the third kind (E. T. Whittaker, "Analytical dynamics", 69; R. van Zon and J. Schofield,
    "Numerical implementation of the exact dynamics of free rigid bodies", 2007)."""
    p, y, o = axes_of_way(m, inverse)
    steep, gentle = item(inverse, y) - item(inverse, p), item(inverse, o) - item(inverse, y)
    a, b, c = item(m, p), item(m, y), item(m, o)
    both, size = steep + gentle, math.sqrt(a * a + b * b + c * c)
    around, along = b * b * steep + c * c * both, a * a * both + b * b * gentle
    if not around / both > 0.0:
        return turned_about(q, m, p, item(inverse, p) * a * h)
    most_p, most_y, most_o = math.sqrt(along / both), math.sqrt(around / steep), math.sqrt(around / both)
    complement = max(SEPARATRIX, both * (steep * a * a - gentle * c * c) / (steep * along))
    nu, rate = gentle / steep, math.sqrt(along * steep)
    if (a < 0.0) == (item(inverse, (y + 2) % 3) > item(inverse, (y + 1) % 3)):
        rate = -rate
    u, s0, c0 = rate * h, b / most_y, c / most_o
    sn, cn, dn = elliptic_functions(u, complement)
    s1, c1 = s0 * cn * dn + sn * c0 * abs(a) / most_p, c0 * cn - s0 * abs(a) / most_p * sn * dn  # by addition
    unit = math.sqrt(s1 * s1 + c1 * c1)
    s1, c1 = s1 / unit, c1 / unit
    a1 = math.copysign(most_p * math.sqrt(c1 * c1 + complement * s1 * s1), a)
    to = replace(replace(replace(m, p, a1), y, most_y * s1), o, most_o * c1)
    begun, angle_begun = elliptic_integrals(math.copysign(s0, s0 * c0), abs(c0), complement, nu)
    ended, angle_ended = elliptic_integrals(math.copysign(s1, s1 * c1), abs(c1), complement, nu)
    angle, left = angle_ended - angle_begun, begun + u - ended
    if abs(left) > 1.0:  # whole half periods between them, each pi or longer
        half, angle_half = elliptic_integrals(1.0, 0.0, complement, nu)
        halves = 2.0 * math.floor(0.5 * left / half + 0.5)
        angle, left = angle + halves * angle_half, left - halves * half
    angle += left / (1.0 + nu * s1 * s1)  # near the axis of the middle moment sn and cn do not tell where u is
    angle = size * (item(inverse, p) * h + both / rate * angle)
    from_pole, azimuth = angles_from(m, p)
    q, _ = turned_about(q, m, p, azimuth)
    q, _ = turned_about(q, m, (p + 2) % 3, from_pole)
    q, _ = turned_about(q, m, p, angle)
    from_pole, azimuth = angles_from(to, p)
    q, _ = turned_about(q, m, (p + 2) % 3, -from_pole)
    q, _ = turned_about(q, m, p, -azimuth)
    return q, to


@part
def angles_from(m, p):
    """(angle from the axis p, angle about it) of a momentum."""
    x, y = item(m, (p + 1) % 3), item(m, (p + 2) % 3)
    return atan2(math.sqrt(x * x + y * y), item(m, p)), atan2(y, x)


@part
def turn_freely(q, m, inverse, h):
    """(rotation, momentum in its frame, what splitting has added to :func:`energy_of`) after h seconds. q: unit
    quaternion of the principal axes; m: angular momentum along them; inverse: 1 / principal moments."""
    energy, (j, k, other) = energy_of(m, inverse), most_similar(inverse)
    about_j, about_other = item(inverse, j) - item(inverse, k), item(inverse, other) - item(inverse, k)
    if norm(scale(m, about_j * h)) > NO_TURN and norm(scale(m, about_other * h)) > SMALL_TURN:
        q, m = turn_far(q, m, inverse, h)
        return q, m, 0.0
    half = 0.5 * item(inverse, k) * h
    size = norm(scale(m, half))
    sine = sin(size) / size * half if size > 0.0 else 0.0
    q = product(q, (cos(size), sine * m[0], sine * m[1], sine * m[2]))
    q, m = turned_about(q, m, j, 0.5 * h * about_j * item(m, j))
    q, m = turned_about(q, m, other, h * about_other * item(m, other))
    q, m = turned_about(q, m, j, 0.5 * h * about_j * item(m, j))
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
