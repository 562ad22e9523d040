"""A sum of floats that does not depend on their order, and changes its sign with theirs.

Each term is cut into a part above a common last place, one above a lower one, and a rest that is left out, some 2^-95
of the largest term if they are a few. The parts of all terms are multiples of one number and add up without rounding.
(J. Demmel, H. D. Nguyen, "Fast reproducible floating-point summation", 2013.)
"""

from __future__ import annotations

from ...framework.compilation import part

LAST_PLACE, HALF_PLACE = 2.0**-52, 2.0**-53


@part
def exact_sum(terms, count):
    """The sum of the first ``count`` terms; of two at most it is the plain one."""
    if count <= 2:
        return 0.0 if count == 0 else (terms[0] if count == 1 else terms[0] + terms[1])
    largest, several = 0.0, 4.0
    for k in range(count):
        largest = max(largest, abs(terms[k]))
    if largest == 0.0:
        return 0.0
    while several < count:
        several *= 2.0
    shifted = largest / HALF_PLACE
    power = abs((shifted + largest) - shifted)  # of two, the next above the largest (S. Rump)
    if power == 0.0:
        power = largest
    high = 3.0 * several * power  # adding it and taking it away again cuts a term at its last place
    low = high * several * LAST_PLACE
    total, rest = 0.0, 0.0
    for k in range(count):
        cut = (terms[k] + high) - high
        total += cut
        rest += ((terms[k] - cut) + low) - low
    return total + rest
