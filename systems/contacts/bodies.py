"""The bodies that have contacts at rest, gathered for the solver, and what it made of them put back."""

from __future__ import annotations

from ...framework.compilation import kernel
from ...framework.vectors import add, row, scale, store, sub
from .heavy_light_blocks import find_squeezed

COLOURS = 62  # bits of a mask; contacts beyond share the last


@kernel
def gather(
    dt, resting, pair_a, pair_b, inverse_masses, moving, start, origin, velocity, start_velocity, supported, change,
    place, rows, used, colours, starts, slot, first, second, velocities, shifts, accelerations, inverse_mass, like,
):  # fmt: skip
    """Number the bodies of the contacts, sort the contacts by colour; returns how many bodies.

    place (n,): -1 for every row, and is so again after :func:`put_back`. slot (m,): the place of each contact.
    Neighbours of one colour share no body that moves.
    """
    count = 0
    for k in range(COLOURS + 2):
        starts[k] = 0
    for r in range(len(resting)):
        a, b = pair_a[resting[r]], pair_b[resting[r]]
        taken = 0
        for side in range(2):
            i = a if side == 0 else b
            if place[i] < 0:
                place[i] = count
                rows[count] = i
                used[count] = 0
                count += 1
            if inverse_masses[i] > 0.0:
                taken |= used[place[i]]
        colour = 0
        while colour < COLOURS - 1 and (taken >> colour) & 1:
            colour += 1
        for side in range(2):
            i = a if side == 0 else b
            if inverse_masses[i] > 0.0:
                used[place[i]] |= 1 << colour
        colours[r] = colour
        starts[colour + 1] += 1
    for k in range(1, COLOURS + 1):
        starts[k] += starts[k - 1]
    for r in range(len(resting)):
        k = starts[colours[r]]
        starts[colours[r]] += 1
        slot[r] = k
        first[k], second[k] = place[pair_a[resting[r]]], place[pair_b[resting[r]]]
    for q in range(count):
        i = rows[q]
        inverse_mass[q] = inverse_masses[i]
        nothing = scale(like, 0.0)
        v, x, a = nothing, nothing, nothing
        if i < moving:
            v = row(start_velocity, i, like)
            if inverse_masses[i] > 0.0:
                x = sub(row(origin, i, like), row(start, i, like))
                a = sub(row(velocity, i, like), v)
                if supported[i]:
                    a = sub(a, row(change, i, like))
                a = scale(a, 1.0 / dt)
        store(velocities, q, v)
        store(shifts, q, x)
        store(accelerations, q, a)
    return count


@kernel
def squeeze(first, second, normal, inverse_mass, light_of, last, before, in_block, blocks, like):
    """See :func:`~carom.systems.contacts.heavy_light_blocks.find_squeezed`."""
    return find_squeezed(first, second, normal, inverse_mass, light_of, last, before, in_block, blocks, like)


@kernel
def put_back(
    resting, slot, first, second, total, worked, rows, bodies, place, held, start, position, velocity, velocities,
    shifts, inverse_mass, pair_impulse, like,
):  # fmt: skip
    """Bodies that some contact pushed take what the solver says; ``held`` (n,) tells which they are."""
    for r in range(len(resting)):
        k = slot[r]
        pair_impulse[resting[r]] += total[k]
        if worked[k]:
            held[rows[first[k]]] = held[rows[second[k]]] = True
    for q in range(bodies):
        i = rows[q]
        place[i] = -1
        if held[i] and inverse_mass[q] > 0.0:
            store(position, i, add(row(start, i, like), row(shifts, q, like)))
            store(velocity, i, row(velocities, q, like))
