"""The solver of contacts at rest: soft constraints, solved anew in each of a few substeps.

After Box2D v3's "soft step" (E. Catto, "Solver2D", 2024): per substep the forces act, last substep's impulses are
applied again, one pass pushes overlapping bodies apart like a stiff, overdamped spring, the bodies move, and relaxing
passes take back the speed that pushing has given them. The spring's frequency follows the rate of the substeps, so
that more of them mean stiffer contacts.

Contacts come sorted by colour: no two neighbours in the order move the same body, so that the processor can work on
several at once.
"""

from __future__ import annotations

import math

from ..framework.compilation import kernel, part
from ..framework.vectors import add_scaled, dot, row, scale, store, sub
from .squeezed import solve_squeezed

FREQUENCY = 0.25  # of the soft contact, times the rate of the substeps
DAMPING_RATIO = 10.0
RELAX_PASSES = 2
LAST_RELAX_PASSES = 4  # of the last substep, whose velocities stay
LET_GO_PASSES = 4  # once, after contacts have been lost
DEEP = 0.02  # of the size: overlap beyond it is pushed out in position only, for a speed given to many adds up
PUSH_RATE = 0.2  # of the deep overlap, per step
PUSH_LIMIT = 0.05  # of the size, per step


@part
def sweep(
    biased, chosen, active, h, bias_rate, mass_scale, impulse_scale, first, second, normal, gap, mass, friction, extent, parting,
    in_block, impulse, tangent, velocity, shift, inverse_mass, like,
):  # fmt: skip
    """One pass over all contacts: each gets the impulse that stops its approach; with friction after it.

    A contact still open may close within the substep. ``biased``: overlap gives an approach to be stopped too.
    chosen: only the contacts that are ``active`` (m,).
    """
    for k in range(len(first)):
        if chosen and not active[k]:
            continue
        a, b = first[k], second[k]
        n = row(normal, k, like)
        w_a, w_b = inverse_mass[a], inverse_mass[b]
        v_a, v_b = row(velocity, a, like), row(velocity, b, like)
        if not in_block[k]:
            room = gap[k] + dot(sub(row(shift, b, like), row(shift, a, like)), n)
            speed = dot(sub(v_b, v_a), n)
            old = impulse[k]
            if room > 0.0:
                new = old - mass[k] * (speed + room / h)
            elif biased and not parting[k] and room > -DEEP * extent[k]:
                new = old - mass_scale * mass[k] * (speed + bias_rate * room) - impulse_scale * old
            else:
                new = old - mass[k] * speed
            new = max(0.0, new)
            impulse[k] = new
            v_a = add_scaled(v_a, n, (old - new) * w_a)
            v_b = add_scaled(v_b, n, (new - old) * w_b)
        if friction[k] > 0.0:
            w = sub(v_b, v_a)
            along = add_scaled(w, n, -dot(w, n))
            old_pull = row(tangent, k, like)
            pull = add_scaled(old_pull, along, -mass[k])
            strength = math.sqrt(dot(pull, pull))
            limit = friction[k] * impulse[k]
            if strength > limit:
                pull = scale(pull, limit / strength)
            store(tangent, k, pull)
            change = sub(pull, old_pull)
            v_a = add_scaled(v_a, change, -w_a)
            v_b = add_scaled(v_b, change, w_b)
        store(velocity, a, v_a)
        store(velocity, b, v_b)


@kernel
def solve_contacts(
    substeps, h, any_loose, loose, active, first, second, normal, gap, mass, friction, extent, parting, in_block, blocks, impulse,
    tangent, total, worked, velocity, shift, acceleration, inverse_mass, like,
):  # fmt: skip
    """Advance the bodies by ``substeps`` of ``h`` seconds under ``acceleration`` and their contacts.

    Of contact k: first, second (m,) bodies; normal (m, d) from first to second; gap (m,) at the start (overlap is
    negative); mass (m,) 1 / (1/m_a + 1/m_b); friction (m,); extent (m,) size of the smaller body; parting (m,) its
    overlap needs no push; in_block (m,) and blocks (b, 2), see ``squeezed``. impulse (m,) and tangent (m, d) start with
    those of the last step's last substep and end with those of this one's; total (m,) sums the former over the step;
    worked (m,): it pushed at some time; active (m,): room.
    Of bodies: velocity, shift (n, d), the displacement since the start; acceleration (n, d); inverse_mass (n,); loose
    (n,): a contact that pushed in the last step has gone, so that the others push too much: before anything else
    these let go, and their neighbours.
    """
    omega = 2.0 * math.pi * FREQUENCY / h
    damping = 2.0 * DAMPING_RATIO + h * omega
    stiffness = h * omega * damping
    bias_rate, mass_scale, impulse_scale = omega / damping, stiffness / (1.0 + stiffness), 1.0 / (1.0 + stiffness)
    for k in range(len(first)):
        total[k] = 0.0
        worked[k] = False
    for step in range(substeps):
        for i in range(len(velocity)):
            store(velocity, i, add_scaled(row(velocity, i, like), row(acceleration, i, like), h))
        for k in range(len(first)):
            if impulse[k] > 0.0:
                push = add_scaled(row(tangent, k, like), row(normal, k, like), impulse[k])
                a, b = first[k], second[k]
                store(velocity, a, add_scaled(row(velocity, a, like), push, -inverse_mass[a]))
                store(velocity, b, add_scaled(row(velocity, b, like), push, inverse_mass[b]))
        last = LAST_RELAX_PASSES if step == substeps - 1 else RELAX_PASSES
        for turn in range(-LET_GO_PASSES if any_loose and step == 0 else 0, 1 + last):
            if turn < 0:
                spread(loose, first, second, inverse_mass, active)
            sweep(
                turn == 0, turn < 0, active, h, bias_rate, mass_scale, impulse_scale, first, second, normal, gap, mass, friction, extent,
                parting, in_block, impulse, tangent, velocity, shift, inverse_mass, like,
            )  # fmt: skip
            solve_squeezed(
                turn == 0, turn < 0, active, h, bias_rate, blocks, first, second, normal, gap, impulse, velocity, shift, inverse_mass,
                like,
            )  # fmt: skip
            if turn == 0:
                for k in range(len(first)):
                    worked[k] = worked[k] or impulse[k] > 0.0
                for i in range(len(velocity)):
                    store(shift, i, add_scaled(row(shift, i, like), row(velocity, i, like), h))
                push_deep(
                    substeps, first, second, normal, gap, mass, extent, parting, worked, shift, inverse_mass, like
                )
        for k in range(len(first)):
            total[k] += impulse[k]
            worked[k] = worked[k] or impulse[k] > 0.0


@part
def spread(loose, first, second, inverse_mass, active):
    """The contacts of loose bodies are active, and make the bodies on their other sides loose."""
    for k in range(len(first)):
        a, b = first[k], second[k]
        active[k] = (loose[a] and inverse_mass[a] > 0.0) or (loose[b] and inverse_mass[b] > 0.0)
    for k in range(len(first)):
        if active[k]:
            loose[first[k]] = loose[second[k]] = True


@part
def push_deep(substeps, first, second, normal, gap, mass, extent, parting, worked, shift, inverse_mass, like):
    """Move bodies that overlap deeply apart, a part of the way, without giving them speed."""
    for k in range(len(first)):
        a, b = first[k], second[k]
        n = row(normal, k, like)
        overlap = -gap[k] - dot(sub(row(shift, b, like), row(shift, a, like)), n)
        if overlap > DEEP * extent[k] and not parting[k]:
            push = min(PUSH_RATE * overlap, PUSH_LIMIT * extent[k]) / substeps * mass[k]
            store(shift, a, add_scaled(row(shift, a, like), n, -push * inverse_mass[a]))
            store(shift, b, add_scaled(row(shift, b, like), n, push * inverse_mass[b]))
            worked[k] = True
