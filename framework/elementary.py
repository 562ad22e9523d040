"""sin, cos, atan2, exp, expm1 and power with the same bits on every platform, compiled or not.

The sin of one system's libm differs in its last digit from that of another, and numpy's from both. These take nothing
but + - * /, comparisons and integers; their error is below one unit in the last place, at any argument. Formulas and
coefficients are those of FDLIBM, on whose files e_rem_pio2.c, k_sin.c, k_cos.c, e_exp.c, s_expm1.c, s_atan.c and
e_pow.c this notice stands:

    Copyright (C) 1993 by Sun Microsystems, Inc. All rights reserved.
    Developed at SunPro, a Sun Microsystems, Inc. business. Permission to use, copy, modify, and distribute this
    software is freely granted, provided that this notice is preserved.

Not as there: words of a number are not looked at but compared; far from zero an angle is reduced in integers; atan2
divides once, by what brings it near zero, so that it rounds once, too.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .compilation import inlined, part
from .jit.lazy import intrinsic, ir, types

TWO_OVER_PI, ROUNDS = 0.6366197723675814, 1.5 * 2.0**52  # added and taken away again it rounds to a whole number
PIO2_1, PIO2_1T = 1.5707963267341256, 6.077100506506192e-11  # pi/2: its first 33 bits, and the rest
PIO2_2, PIO2_2T = 6.077100506303966e-11, 2.0222662487959506e-21  # the next 33, and the rest
PIO2_3, PIO2_3T = 2.0222662487111665e-21, 8.4784276603689e-32
FAR = 1e6  # rad: up to here a whole number times 33 bits is exact
CANCELLED, CANCELLED_TWICE = 2.0**-15, 2.0**-48  # of the angle: what is left so near a multiple of pi/2

PIO2, PIO2_LOW, PI, PI_LOW = 0.5 * math.pi, 6.123233995736766e-17, math.pi, 1.2246467991473532e-16
DIGIT, MASK = 24, 2**24 - 1  # bits
# 2/pi in digits of 24 bits, behind four that are 0.
_BITS = int(
    "a2f9836e4e441529fc2757d1f534ddc0db6295993c439041fe5163abdebbc561b7246e3a424dd2e006492eea09d1921cfe1deb1cb129a73ee8"
    "8235f52ebb4484e99c7026b45f7e413991d639835339f49c845f8bbdf9283b1ff897ffde05980fef2f118b5a0a6d1f6d367ecf27cb09b74f46"
    "3f669e5fea2d7527bac7ebe5f17b3d0739f78a5292ea6bfb5fb11f8d5d0856033046fc7b6babf0cfbc209af4361da9e3", 16,
)  # fmt: skip
DIGITS = np.array([0, 0, 0, 0, *(_BITS >> DIGIT * k & MASK for k in reversed(range(54)))], np.int64)

LN2_HIGH, LN2_LOW, LOG2_E = 0.6931471803691238, 1.9082149292705877e-10, 1.4426950408889634
LARGEST_EXPONENT, LEAST_EXPONENT = 709.782712893384, -745.1332191019411  # of e, between which it is finite and not 0
SPLITS = 2.0**27 + 1.0  # see high_part


def _typed_two_to(typing_context: Any, k: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        word = ir.IntType(64)
        return builder.bitcast(builder.shl(builder.add(values[0], word(1023)), word(52)), ir.DoubleType())

    return types.float64(types.int64), emit


def _typed_exponent_of(typing_context: Any, x: Any) -> Any:
    def emit(context: Any, builder: Any, sig: Any, values: Any) -> Any:
        word = ir.IntType(64)
        shifted = builder.lshr(builder.bitcast(values[0], word), word(52))
        return builder.sub(builder.and_(shifted, word(0x7FF)), word(1022))

    return types.int64(types.float64), emit


def _plain_two_to(k: int) -> float:
    """2**k, -1022 <= k <= 1023."""
    return math.ldexp(1.0, k)


def _plain_exponent_of(x: float) -> int:
    """k of 2**(k - 1) <= abs(x) < 2**k; -1022 of 0 and subnormal numbers, 1025 of what is not finite."""
    if not math.isfinite(x):
        return 1025
    return max(-1022, math.frexp(x)[1]) if x != 0.0 else -1022


two_to: Any = intrinsic(_typed_two_to, _plain_two_to)
exponent_of: Any = intrinsic(_typed_exponent_of, _plain_exponent_of)


# -- sin, cos ----------------------------------------------------------------------------------------------------------


@inlined
def high_part(x):
    """The first 26 bits of a number, so that a product of two such is exact (Veltkamp)."""
    large = x * SPLITS
    return large - (large - x)


@inlined
def sine_near_zero(x, tail):
    """sin(x + tail) up to pi/4; numbers or arrays."""
    z = x * x
    w, v = z * z, z * x
    r = 8.33333333332248946124e-03 + z * (-1.98412698298579493134e-04 + z * 2.75573137070700676789e-06)
    r = r + z * w * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    return x - ((z * (0.5 * tail - v * r) - tail) - v * -1.66666666666666324348e-01)


@inlined
def cosine_near_zero(x, tail):
    """cos(x + tail) up to pi/4; numbers or arrays."""
    z = x * x
    w = z * z
    r = z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * 2.48015872894767294178e-05))
    r = r + w * w * (-2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11))
    half = 0.5 * z
    most = 1.0 - half
    return most + (((1.0 - most) - half) + (z * r - x * tail))


@part
def reduced_far(x):
    """As ``reduced``, of any size: x times those digits of 2/pi that matter, in whole numbers (Payne and Hanek)."""
    size = abs(x)
    if not size < math.inf:
        return 0, x - x, 0.0
    unit = (exponent_of(size) - 1) // DIGIT
    z = size * two_to(-DIGIT * unit)
    t0 = int(z)
    z = (z - t0) * 16777216.0
    t1 = int(z)
    z = (z - t1) * 16777216.0
    t2 = int(z)
    t3 = int((z - t2) * 16777216.0)
    whole, first, second, third, carry = 0, 0, 0, 0, 0
    for step in range(7):  # six digits of the fraction, from the last on, and the whole
        k = unit + 9 - step
        carry += t0 * DIGITS[k] + t1 * DIGITS[k - 1] + t2 * DIGITS[k - 2] + t3 * DIGITS[k - 3]
        digit, carry = carry & MASK, carry >> DIGIT
        if step < 2:
            third += digit << DIGIT * step
        elif step < 4:
            second += digit << DIGIT * (step - 2)
        elif step < 6:
            first += digit << DIGIT * (step - 4)
        else:
            whole = digit
    sign = 1.0
    if first >= 1 << 47:  # nearer to the next
        whole, sign = whole + 1, -1.0
        first, second, third = (1 << 48) - 1 - first, (1 << 48) - 1 - second, (1 << 48) - 1 - third
    a, b, c = first * 2.0**-48, second * 2.0**-96, third * 2.0**-144
    low = b + c
    high = a + low
    rest = (low - (high - a)) + (c - (low - b))
    product, one, two = high * PIO2, high_part(high), high_part(PIO2)
    error = (one * two - product + one * (PIO2 - two) + (high - one) * two) + (high - one) * (PIO2 - two)
    error += rest * PIO2 + high * PIO2_LOW
    near = product + error
    tail = error - (near - product)
    if x < 0.0:
        whole, sign = -whole, -sign
    return whole, sign * near, sign * tail


@part
def reduced(x):
    """(n, y, tail): x is n pi/2 + y + tail, y up to pi/4."""
    if not abs(x) <= FAR:
        return reduced_far(x)
    turns = (x * TWO_OVER_PI + ROUNDS) - ROUNDS
    r, w = x - turns * PIO2_1, turns * PIO2_1T
    y = r - w
    if abs(y) < abs(x) * CANCELLED:
        before, w = r, turns * PIO2_2
        r = before - w
        w = turns * PIO2_2T - ((before - r) - w)
        y = r - w
        if abs(y) < abs(x) * CANCELLED_TWICE:
            before, w = r, turns * PIO2_3
            r = before - w
            w = turns * PIO2_3T - ((before - r) - w)
            y = r - w
    return int(turns), y, (r - y) - w


@part
def sin(x):
    """Of an angle in radians."""
    n, y, tail = reduced(x)
    value = cosine_near_zero(y, tail) if n & 1 else sine_near_zero(y, tail)
    return -value if n & 2 else value


@part
def cos(x):
    """Of an angle in radians."""
    n, y, tail = reduced(x)
    value = sine_near_zero(y, tail) if n & 1 else cosine_near_zero(y, tail)
    return -value if (n + 1) & 2 else value


FEW = 12  # angles that Python takes one by one as fast as numpy takes them together


def sines_and_cosines(angles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """sin and cos of an array, to the bit."""
    flat = np.asarray(angles, np.float64).ravel()
    if len(flat) <= FEW:
        values = flat.tolist()
        sines, cosines = (np.array([of(x) for x in values], np.float64) for of in (sin, cos))
        return sines.reshape(np.shape(angles)), cosines.reshape(np.shape(angles))
    far = ~(np.abs(flat) <= FAR)
    x = np.where(far, 0.0, flat)
    turns = (x * TWO_OVER_PI + ROUNDS) - ROUNDS
    r, w = x - turns * PIO2_1, turns * PIO2_1T
    y, size = r - w, np.abs(x)
    for limit, middle, rest in ((CANCELLED, PIO2_2, PIO2_2T), (CANCELLED_TWICE, PIO2_3, PIO2_3T)):
        near = np.abs(y) < size * limit
        if not near.any():
            break
        after = r - turns * middle
        left = turns * rest - ((r - after) - turns * middle)
        r, w = np.where(near, after, r), np.where(near, left, w)
        y = r - w
    n, tail = turns.astype(np.int64), (r - y) - w
    sines, cosines, odd = sine_near_zero(y, tail), cosine_near_zero(y, tail), (n & 1).astype(bool)
    sines, cosines = np.where(odd, cosines, sines), np.where(odd, sines, cosines)
    sines, cosines = np.where(n & 2, -sines, sines), np.where((n + 1) & 2, -cosines, cosines)
    for i in np.flatnonzero(far).tolist():
        sines[i], cosines[i] = sin(float(flat[i])), cos(float(flat[i]))
    return sines.reshape(np.shape(angles)), cosines.reshape(np.shape(angles))


# -- atan2 -------------------------------------------------------------------------------------------------------------


@part
def atan_of_ratio(small, big):
    """(head, rest) whose sum is atan(small / big); 0 <= small <= big."""
    if small < 2.0**-27 * big:
        return small / big, 0.0
    head, low, t, error = 0.0, 0.0, 0.0, 0.0
    if 16.0 * small < 7.0 * big:
        inverse = 1.0 / big
        t = small * inverse
        a, b = high_part(t), high_part(big)
        left = ((small - a * b) - a * (big - b) - (t - a) * b) - (t - a) * (big - b)
        error = left * inverse * (1.0 - t * t)
    elif 16.0 * small < 11.0 * big:
        head, low, t = 0.4636476090008061, 2.2698777452961687e-17, (2.0 * small - big) / (2.0 * big + small)
    else:
        head, low, t = 0.7853981633974483, 3.061616997868383e-17, (small - big) / (small + big)
    z = t * t
    w = z * z
    odd = 4.97687799461593236017e-02 + w * 1.62858201153657823623e-02
    odd = 9.09088713343650656196e-02 + w * (6.66107313738753120669e-02 + w * odd)
    odd = z * (3.33333333333329318027e-01 + w * (1.42857142725034663711e-01 + w * odd))
    even = -7.69187620504482999495e-02 + w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02)
    even = w * (-1.99999999998764832476e-01 + w * (-1.11111104054623557880e-01 + w * even))
    rest = (low + error) - t * (odd + even)
    return (t, rest) if head == 0.0 else (head, t + rest)


@part
def atan2(y, x):
    """The angle of the vector (x, y), from -pi to pi, rad."""
    along, aside = abs(x), abs(y)
    if not (along < math.inf and aside < math.inf):
        if math.isnan(x) or math.isnan(y):
            return x + y
        along, aside = (1.0 if along == math.inf else 0.0), (1.0 if aside == math.inf else 0.0)
    small, big = (along, aside) if aside > along else (aside, along)
    if big > 2.0**900:  # far from where products are not exact
        small, big = small * 2.0**-200, big * 2.0**-200
    elif big < 2.0**-500:
        small, big = small * 2.0**500, (big * 2.0**500 if big > 0.0 else 1.0)
    head, rest = atan_of_ratio(small, big)
    behind, base, low = math.copysign(1.0, x) < 0.0, 0.0, 0.0
    if aside > along:
        base, low = PIO2, PIO2_LOW
    elif behind:
        base, low = PI, PI_LOW
    if behind != (aside > along):
        head, rest = -head, -rest
    total = base + head
    return math.copysign(total + (((base - total) + head) + (low + rest)), y)


# -- exp, expm1, power -------------------------------------------------------------------------------------------------


@inlined
def times_two_to(x, k):
    """x * 2**k, x about 1, with one rounding."""
    if k > 1023:
        return x * 2.0 * two_to(k - 1)
    return x * two_to(k) if k >= -1021 else x * two_to(k + 1000) * 2.0**-1000


@inlined
def exp_series(x):
    """x less what x * coth(x / 2) has above 2: of that exp, expm1 and power are made."""
    t = x * x
    p = 6.61375632143793436117e-05 + t * (-1.65339022054652515390e-06 + t * 4.13813679705723846039e-08)
    return x - t * (1.66666666666666019037e-01 + t * (-2.77777777770155933842e-03 + t * p))


@part
def exp(x):
    """e**x."""
    if not (LEAST_EXPONENT <= x <= LARGEST_EXPONENT):
        return x if math.isnan(x) else (math.inf if x > 0.0 else 0.0)
    k, high, low = 0, x, 0.0
    if abs(x) > 0.34657359027997264:
        k = int(LOG2_E * x + math.copysign(0.5, x))
        high, low = x - k * LN2_HIGH, k * LN2_LOW
    x = high - low
    c = exp_series(x)
    return times_two_to(1.0 - ((low - (x * c) / (2.0 - c)) - high), k)


@part
def expm1(x):
    """e**x - 1, to full precision near 0."""
    if not (-39.0 <= x <= LARGEST_EXPONENT):
        return x if math.isnan(x) else (math.inf if x > 0.0 else -1.0)
    k, c = 0, 0.0
    if abs(x) > 0.34657359027997264:
        k = int(LOG2_E * x + math.copysign(0.5, x))
        high, low = x - k * LN2_HIGH, k * LN2_LOW
        x = high - low
        c = (high - x) - low
    half = 0.5 * x
    z = x * half
    r = -7.93650757867487942473e-05 + z * (4.00821782732936239552e-06 + z * -2.01099218183624371326e-07)
    r = 1.0 + z * (-3.33333333333331316428e-02 + z * (1.58730158725481460165e-03 + z * r))
    t = 3.0 - r * half
    e = z * ((r - t) / (6.0 - x * t))
    if k == 0:
        return x - (x * e - z)
    e = (x * (e - c) - c) - z
    if k == -1:
        return 0.5 * (x - e) - 0.5
    if k == 1:
        return -2.0 * (e - (x + 0.5)) if x < -0.25 else 1.0 + 2.0 * (x - e)
    if k < 0 or k > 56:
        return times_two_to(1.0 - (e - x), k) - 1.0
    if k < 20:
        return ((1.0 - two_to(-k)) - (e - x)) * two_to(k)
    return ((x - (e + two_to(-k))) + 1.0) * two_to(k)


@part
def log2_in_parts(x):
    """(high, low): log2(x) to some 70 bits, the first 26 in high; 0 < x < inf."""
    n = 0.0
    if x < 2.0**-1022:
        x, n = x * 2.0**54, -54.0
    k = exponent_of(x)
    x, n = x * two_to(1 - k) if k < 1024 else x * 2.0**-1023, n + (k - 1)
    base, high, low = 1.0, 0.0, 0.0
    if x >= 1.7320508075688772:
        x, n = 0.5 * x, n + 1.0
    elif x >= 1.224744871391589:
        base, high, low = 1.5, 5.84962487220764160156e-01, 1.35003920212974897128e-08
    u, v = x - base, 1.0 / (x + base)
    s = u * v
    s_high, t_high = high_part(s), high_part(x + base)
    s_low = v * ((u - s_high * t_high) - s_high * (x - (t_high - base)))
    z = s * s
    r = 2.72728123808534006489e-01 + z * (2.30660745775561754067e-01 + z * 2.06975017800338417784e-01)
    r = 5.99999999999994648725e-01 + z * (4.28571428578550184252e-01 + z * (3.33333329818377432918e-01 + z * r))
    r = z * z * r + s_low * (s_high + s)
    z = s_high * s_high
    t_high = high_part(3.0 + z + r)
    t_low = r - ((t_high - 3.0) - z)
    u, v = s_high * t_high, s_low * t_high + t_low * s
    p_high = high_part(u + v)
    p_low = v - (p_high - u)
    z_high = 9.61796700954437255859e-01 * p_high  # of 2 / (3 ln 2)
    z_low = -7.02846165095275826516e-09 * p_high + p_low * 9.61796693925975554329e-01 + low
    total = high_part(((z_high + z_low) + high) + n)
    return total, z_low - (((total - n) - high) - z_high)


@part
def power(x, y):
    """x**y of a number that is not negative; nan of others."""
    if y == 0.0 or x == 1.0:
        return 1.0
    if not (x >= 0.0) or math.isnan(y):
        return math.nan
    if x == 0.0 or x == math.inf or abs(y) > 2.0**64:
        return math.inf if (x > 1.0) == (y > 0.0) else 0.0
    one, two = log2_in_parts(x)
    high = high_part(y)
    low = (y - high) * one + y * two
    high = high * one
    z = low + high
    if not -1080.0 < z < 1024.0:
        return math.inf if z > 0.0 else 0.0
    n = (z + ROUNDS) - ROUNDS
    high = high - n
    t = high_part(low + high)
    u = t * 6.93147182464599609375e-01  # of ln 2
    v = (low - (t - high)) * 6.93147180559945286227e-01 + t * -1.90465429995776804525e-09
    z = u + v
    w, c = v - (z - u), exp_series(z)
    return times_two_to(1.0 - (((z * c) / (c - 2.0) - (w + z * w)) - z), int(n))
