"""A light body squeezed between two heavy ones: both contacts solved together, rigidly.

One after the other they do not converge: each pass hands the light body's speed back and forth, and a load of ratio r
needs r passes. For two contacts the exact answer is a linear complementarity problem with four cases.
"""

from __future__ import annotations

from ...framework.compilation import part
from ...framework.vectors import add_scaled, dot, negative, row, store, sub

RATIO = 10.0  # a body is light between two that have at least this many times its mass
OPPOSED = -0.5  # cosine between the two contacts' directions, below which they squeeze


@part
def find_squeezed(first, second, normal, inverse_mass, light_of, last, before, in_block, blocks, like):
    """Pairs of contacts that squeeze a light body, into blocks (b, 2); returns how many.

    last (n,), before (m,): room for one list of contacts per body. At most one block per body, in the order of the
    contacts; ``light_of`` (m,) gets the light body of each contact, or -1.
    """
    for i in range(len(inverse_mass)):
        last[i] = -1
    count = 0
    for k in range(len(first)):
        a, b = first[k], second[k]
        in_block[k] = False
        light = -1
        if inverse_mass[a] >= RATIO * inverse_mass[b] and inverse_mass[a] > 0.0:
            light = a
        elif inverse_mass[b] >= RATIO * inverse_mass[a]:
            light = b
        light_of[k] = light
        if light < 0:
            continue
        outwards = row(normal, k, like) if light == a else negative(row(normal, k, like))
        heavy = b if light == a else a
        other = last[light]
        while other >= 0:
            theirs = row(normal, other, like)
            partner = second[other]
            if first[other] != light:
                theirs, partner = negative(theirs), first[other]
            movable = inverse_mass[heavy] + inverse_mass[partner] > 0.0
            if movable and not in_block[other] and not in_block[k] and dot(outwards, theirs) < OPPOSED:
                blocks[count, 0], blocks[count, 1] = other, k
                in_block[other] = in_block[k] = True
                count += 1
            other = before[other]
        before[k] = last[light]
        last[light] = k
    return count


@part
def solve_squeezed(
    chosen, active, blocks, first, second, normal, bias, impulse, velocity, inverse_mass, like
):  # fmt: skip
    """Solve the two contacts of each block exactly; bias (m,): what they ask, see ``solver.measure``.

    chosen: only blocks of which a contact is ``active`` (m,).
    """
    for q in range(len(blocks)):
        j, k = blocks[q, 0], blocks[q, 1]
        if chosen and not (active[j] or active[k]):
            continue
        light = first[j] if first[j] == first[k] or first[j] == second[k] else second[j]
        one, two = row(normal, j, like), row(normal, k, like)  # from the light body to its partners
        p, r = second[j], second[k]
        if first[j] != light:
            one, p = negative(one), first[j]
        if first[k] != light:
            two, r = negative(two), first[k]
        w, w_p, w_r = inverse_mass[light], inverse_mass[p], inverse_mass[r]
        v = row(velocity, light, like)
        wrong_j = dot(sub(row(velocity, p, like), v), one) + bias[j]
        wrong_k = dot(sub(row(velocity, r, like), v), two) + bias[k]
        cosine = dot(one, two)
        # changes of the two impulses: both contacts held; then one of them, the other let go; then none
        determinant = (1.0 - cosine * cosine) * w * w + w * (w_p + w_r) + w_p * w_r
        change_j = -(w * (wrong_j - cosine * wrong_k) + wrong_j * w_r) / determinant
        change_k = -(w * (wrong_k - cosine * wrong_j) + wrong_k * w_p) / determinant
        if impulse[j] + change_j < 0.0 or impulse[k] + change_k < 0.0:
            change_k = -impulse[k]
            change_j = max(-impulse[j], -(wrong_j + cosine * w * change_k) / (w + w_p))
            if wrong_k + cosine * w * change_j + (w + w_r) * change_k < 0.0:  # letting k go makes it close
                change_j = -impulse[j]
                change_k = max(-impulse[k], -(wrong_k + cosine * w * change_j) / (w + w_r))
        impulse[j] += change_j
        impulse[k] += change_k
        store(velocity, light, add_scaled(add_scaled(v, one, -change_j * w), two, -change_k * w))
        store(velocity, p, add_scaled(row(velocity, p, like), one, change_j * w_p))
        store(velocity, r, add_scaled(row(velocity, r, like), two, change_k * w_r))
