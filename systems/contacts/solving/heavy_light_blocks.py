"""A light body squeezed between two heavy ones: both contacts solved together, rigidly.

One after the other they do not converge: each pass hands the light body's speed back and forth, and a load of ratio r
needs r passes. For two contacts the exact answer is a linear complementarity problem with four cases.
"""

from __future__ import annotations

from ....framework.compilation import part
from ....framework.jit.records.record_type import zero_of
from ....framework.vectors import add_scaled, dot, length, negative, scale, sub
from ...codes import OK

RATIO = 10.0  # a body is light between two that have at least this many times its mass
OPPOSED = -0.5  # cosine between the two contacts' directions, below which they squeeze

# Times the fastest closing speed of its contacts: no light body leaves them faster. Their planes are those of the
# step's start, so what is pinched at a small angle would be shot out; in truth the angle opens on the way.
SHOT = 4.0


@part
def light_body_of(solver, k):
    """The light body of contact k, or -1."""
    a, b, inverse_mass = solver.first[k], solver.second[k], solver.inverse_mass
    if inverse_mass[a] >= RATIO * inverse_mass[b] and inverse_mass[a] > 0.0:
        return int(a)
    if inverse_mass[b] >= RATIO * inverse_mass[a]:
        return int(b)
    return -1


@part
def bears_heavy(solver, k):
    """Whether contact k is of a light body and a heavy one that can be moved."""
    light = solver.light_of[k]
    if light < 0:
        return False
    heavy = solver.second[k] if solver.first[k] == light else solver.first[k]
    return solver.inverse_mass[heavy] > 0.0


def find_blocks(state, dt):
    """Pairs of contacts that squeeze a light body; at most one block per body, in the order of the contacts."""
    solver, inverse_mass = state.solver, state.solver.inverse_mass
    for q in range(solver.bodies if solver.contacts > 0 else 0):
        solver.last[q] = -1
    count, solver.any_uneven = 0, False
    for k in range(solver.contacts):
        solver.in_block[k] = False
        light = light_body_of(solver, k)
        solver.light_of[k] = light
        if light < 0:
            continue
        solver.any_uneven |= bears_heavy(solver, k)
        is_first = solver.first[k] == light
        outwards = solver.normal[k] if is_first else negative(solver.normal[k])
        heavy = solver.second[k] if is_first else solver.first[k]
        other = solver.last[light]
        while other >= 0:
            theirs, partner = solver.normal[other], solver.second[other]
            if solver.first[other] != light:
                theirs, partner = negative(theirs), solver.first[other]
            movable = inverse_mass[heavy] + inverse_mass[partner] > 0.0
            free = not solver.in_block[other] and not solver.in_block[k]
            if movable and free and dot(outwards, theirs) < OPPOSED:
                solver.block[count, 0], solver.block[count, 1] = other, k
                solver.in_block[other] = solver.in_block[k] = True
                count += 1
            other = solver.before[other]
        solver.before[k] = solver.last[light]
        solver.last[light] = k
    solver.blocks = count
    return OK


@part
def solve_blocks(solver, bias, chosen):
    """Solve the two contacts of each block exactly; bias: what they ask of the speed. chosen: only active ones."""
    velocity, inverse_mass, impulse, normal = solver.velocity, solver.inverse_mass, solver.impulse, solver.normal
    first, second = solver.first, solver.second
    for q in range(solver.blocks):
        j, k = solver.block[q, 0], solver.block[q, 1]
        if chosen and not (solver.active[j] or solver.active[k]):
            continue
        light = first[j] if first[j] == first[k] or first[j] == second[k] else second[j]
        one, two, p, r = normal[j], normal[k], second[j], second[k]  # normals from the light body to its partners
        if first[j] != light:
            one, p = negative(one), first[j]
        if first[k] != light:
            two, r = negative(two), first[k]
        w, w_p, w_r, v = inverse_mass[light], inverse_mass[p], inverse_mass[r], velocity[light]
        wrong_j = dot(sub(velocity[p], v), one) + bias[j]
        wrong_k = dot(sub(velocity[r], v), two) + bias[k]
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
        velocity[light] = add_scaled(add_scaled(v, one, -change_j * w), two, -change_k * w)
        velocity[p] = add_scaled(velocity[p], one, change_j * w_p)
        velocity[r] = add_scaled(velocity[r], two, change_k * w_r)


@part
def note_heaviest(state, dt):
    """Of each light body the heaviest partner and the speed that it may have; returns whether there are any."""
    solver, start, any_light = state.solver, state.bodies.start_velocity, False
    nothing = zero_of(state)
    for k in range(solver.contacts):
        light = solver.light_of[k]
        if light >= 0:
            any_light = True
            solver.heaviest[light], solver.fastest[light] = -1, 0.0
    for k in range(solver.contacts if any_light else 0):
        light = solver.light_of[k]
        if light < 0:
            continue
        heavy = solver.second[k] if solver.first[k] == light else solver.first[k]
        if solver.heaviest[light] < 0 or solver.inverse_mass[heavy] < solver.inverse_mass[solver.heaviest[light]]:
            solver.heaviest[light] = heavy
        row = solver.body_row[heavy]
        w = sub(start[solver.body_row[light]], start[row] if row < state.moving else nothing)
        pull = sub(solver.acceleration[light], solver.acceleration[heavy])
        speed = length(w) + length(pull) * dt
        solver.fastest[light] = max(solver.fastest[light], speed)
    return any_light


@part
def hold_light(state, dt):
    """A light body that is shot out from between heavy ones gives its heaviest partner what it has too much, so that
    momentum stays."""
    solver = state.solver
    if solver.contacts == 0 or not note_heaviest(state, dt):
        return OK
    velocity, inverse_mass = solver.velocity, solver.inverse_mass
    for k in range(solver.contacts):
        light = solver.light_of[k]
        if light < 0 or solver.heaviest[light] < 0:
            continue
        heavy, limit = solver.heaviest[light], SHOT * solver.fastest[light]
        solver.heaviest[light] = -1  # once
        w = sub(velocity[light], velocity[heavy])
        speed = length(w)
        if speed > limit:
            share = inverse_mass[heavy] / (inverse_mass[light] + inverse_mass[heavy])
            change = scale(w, 1.0 - limit / speed)
            velocity[light] = add_scaled(velocity[light], change, share - 1.0)
            velocity[heavy] = add_scaled(velocity[heavy], change, share)
    return OK
