"""How much of a shape is below a level surface, and where the middle of that is.

Exact for boxes, however they are turned, and for round shapes. Others count as the box that has their second moments,
with their own area or volume; those that do not tell their moments as the box around them. Numbers are those of three
dimensions: in a plane the third extent is 1 m.
"""

from __future__ import annotations

import math

from ...components.spin import number
from ...framework.compilation import part
from ...framework.elementary import atan2, cos, sin
from ...framework.jit.records.record_type import zero_of
from ...framework.vectors import item
from ...systems.shapes.dispatch import half_extents, second_moments
from ...systems.shapes.free_rotation import diagonalised
from ...systems.shapes.poses import row_of_axes
from ...systems.shapes.quaternions import rotate

FLAT = 1e-3  # of the height of a box: an edge that rises by less is level, but for its small slope
ROUND = 1e-9  # by which the moments of a round shape may differ from those of a disc or ball


@part
def power(x, n):
    found = 1.0
    for _ in range(n):
        found *= x
    return found


@part
def box_below(n, h, s):
    """(volume, three first moments about its centre) of what is below n . x = s in a box of half extents h.

    With m edges that rise: sums over the corners of powers of their depth, as integrals of max(0, s - n . x)^0.
    """
    rise = (abs(n[0] * h[0]), abs(n[1] * h[1]), abs(n[2] * h[2]))
    top = rise[0] + rise[1] + rise[2]
    if s >= top:
        return 8.0 * h[0] * h[1] * h[2], 0.0, 0.0, 0.0
    if s <= -top:
        return 0.0, 0.0, 0.0, 0.0
    m, rest, slopes = 0, 1.0, 1.0
    for k in range(3):
        if rise[k] > FLAT * top:
            m, slopes = m + 1, slopes * n[k]
        else:
            rest *= 2.0 * h[k]
    level, volume, above, x, y, z = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    for corner in range(8):
        at, sign, once = s, 1.0, True
        for k in range(3):
            side = 1.0 if (corner >> k) & 1 else -1.0
            if rise[k] > FLAT * top:
                at, sign = at + side * n[k] * h[k], sign * side
            else:
                once &= side < 0.0
        if once and at > 0.0:
            low = sign * power(at, m - 1)
            level, volume, above = level + low, volume + low * at, above + low * at * at
            x += low * at if corner & 1 else -low * at
            y += low * at if corner & 2 else -low * at
            z += low * at if corner & 4 else -low * at
    least = slopes if m < 3 else 2.0 * slopes  # (m - 1)!
    level, volume, above = rest * level / least, rest * volume / (least * m), rest * above / (least * m * (m + 1))
    by = rest / (least * m)
    return (
        volume,
        above / n[0] - by * h[0] * x if rise[0] > FLAT * top else -n[0] * h[0] * h[0] / 3.0 * level,
        above / n[1] - by * h[1] * y if rise[1] > FLAT * top else -n[1] * h[1] * h[1] / 3.0 * level,
        above / n[2] - by * h[2] * z if rise[2] > FLAT * top else -n[2] * h[2] * h[2] / 3.0 * level,
    )


@part
def ball_below(r, s, d):
    """Area or volume of a disc or ball of radius r below what is s above its centre."""
    s = min(max(s, -r), r)
    if d == 2:
        across = math.sqrt(r * r - s * s)
        return r * r * atan2(across, -s) + s * across
    return math.pi / 3.0 * (r + s) * (r + s) * (2.0 * r - s)


@part
def along_body(state, i, v):
    """Three numbers of the world along the axes of a body."""
    if len(state.bodies.axes) == 0:
        return v
    d = len(zero_of(state))
    one, two, three = row_of_axes(state, i, 0), row_of_axes(state, i, 1), row_of_axes(state, i, d - 1)
    z = item(three, d - 1) * v[2] if d == 3 else v[2]
    x = item(one, 0) * v[0] + item(two, 0) * v[1] + (item(three, 0) * v[2] if d == 3 else 0.0)
    y = item(one, 1) * v[0] + item(two, 1) * v[1] + (item(three, 1) * v[2] if d == 3 else 0.0)
    return x, y, z + (item(one, d - 1) * v[0] + item(two, d - 1) * v[1] if d == 3 else 0.0)


@part
def along_world(state, i, v):
    """Three numbers along the axes of a body along those of the world."""
    if len(state.bodies.axes) == 0:
        return v
    d = len(zero_of(state))
    one, two, three = row_of_axes(state, i, 0), row_of_axes(state, i, 1), row_of_axes(state, i, d - 1)
    x = item(one, 0) * v[0] + item(one, 1) * v[1] + (item(one, d - 1) * v[2] if d == 3 else 0.0)
    y = item(two, 0) * v[0] + item(two, 1) * v[1] + (item(two, d - 1) * v[2] if d == 3 else 0.0)
    z = item(three, 0) * v[0] + item(three, 1) * v[1] + item(three, d - 1) * v[2] if d == 3 else v[2]
    return x, y, z


@part
def central_moments(state, i):
    """(measure, centre (3), xx, yy, zz, xy, xz, yz about it) of a shape, along the axes of its body."""
    d, found = len(zero_of(state)), second_moments(state, state.bodies.shape[i], i)
    x, y = number(found, 1), number(found, 2)
    if d == 2:
        xx, xy, yy = number(found, 3), number(found, 4), number(found, 5)
        return number(found, 0), (x, y, 0.0), xx - x * x, yy - y * y, 1.0 / 12.0, xy - x * y, 0.0, 0.0
    z = number(found, d)
    return (
        number(found, 0), (x, y, z), number(found, d + 1) - x * x, number(found, d + 2) - y * y,
        number(found, d + 3) - z * z, number(found, d + 4) - x * y, number(found, d + 5) - x * z,
        number(found, d + 6) - y * z,
    )  # fmt: skip


@part
def box_of_bounds(state, i):
    """The box around a shape, as three half extents."""
    half, d = half_extents(state, state.bodies.shape[i], i), len(zero_of(state))
    return item(half, 0), item(half, 1), item(half, d - 1) if d == 3 else 0.5


@part
def submerged(state, i, up, top, bottom):
    """(volume, its middle from the body's position, three numbers) of the shape of a body between two levels along the
    unit vector ``up``, three numbers."""
    bodies, d = state.bodies, len(zero_of(state))
    x, at = bodies.position[i], bodies.offset[i]
    from_body = item(at, 0), item(at, 1), item(at, d - 1) if d == 3 else 0.0
    height = 0.0
    for k in range(d):
        height += (item(x, k) + item(at, k)) * up[k]
    if state.shapes.moments[bodies.shape[i]] == 0:
        half = box_of_bounds(state, i)
        v, mx, my, mz = box_below(up, half, top - height)
        low, lx, ly, lz = box_below(up, half, bottom - height)
        v -= low
        by = 1.0 / v if v > 0.0 else 0.0
        return v, (from_body[0] + by * (mx - lx), from_body[1] + by * (my - ly), from_body[2] + by * (mz - lz))
    measure, centre, xx, yy, zz, xy, xz, yz = central_moments(state, i)
    shift = along_world(state, i, centre)
    height += shift[0] * up[0] + shift[1] * up[1] + shift[2] * up[2]
    from_body = from_body[0] + shift[0], from_body[1] + shift[1], from_body[2] + shift[2]
    radius = math.sqrt((d + 2) * xx)
    even = abs(xx - yy) <= ROUND * xx and (d == 2 or abs(xx - zz) <= ROUND * xx)
    if radius > 0.0 and even and abs(measure - ball_below(radius, radius, d)) <= ROUND * measure:
        return ball_below(radius, top - height, d) - ball_below(radius, bottom - height, d), from_body
    own = 1.0, 0.0, 0.0, 0.0  # from its principal axes to those of the body
    if d == 2 and xy != 0.0:
        angle = 0.5 * atan2(2.0 * xy, xx - yy)
        own, mean, apart = (cos(0.5 * angle), 0.0, 0.0, sin(0.5 * angle)), 0.5 * (xx + yy), 0.5 * (xx - yy)
        apart = math.sqrt(apart * apart + xy * xy)
        xx, yy = mean + apart, mean - apart
    elif xy != 0.0 or xz != 0.0 or yz != 0.0:
        (xx, yy, zz), own = diagonalised(xx, yy, zz, xy, xz, yz)
    half = math.sqrt(3.0 * max(xx, 0.0)), math.sqrt(3.0 * max(yy, 0.0)), math.sqrt(3.0 * max(zz, 0.0))
    whole = 8.0 * half[0] * half[1] * half[2]
    if not whole > 0.0:
        return 0.0, from_body
    n = rotate(own, along_body(state, i, up), True)
    v, mx, my, mz = box_below(n, half, top - height)
    low, lx, ly, lz = box_below(n, half, bottom - height)
    v -= low
    if not v > 0.0:
        return 0.0, from_body
    middle = along_world(state, i, rotate(own, ((mx - lx) / v, (my - ly) / v, (mz - lz) / v), False))
    return (
        v * measure / whole,
        (from_body[0] + middle[0], from_body[1] + middle[1], from_body[2] + middle[2]),
    )
