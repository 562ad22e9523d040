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

from ...framework.compilation import kernel, part
from ...framework.vectors import add_scaled, dot, row, scale, store, sub
from .heavy_light_blocks import solve_squeezed

FREQUENCY = 0.25  # of the soft contact, times the rate of the substeps
DAMPING_RATIO = 10.0
RELAX_PASSES = 2
LAST_RELAX_PASSES = 4  # of the last substep, whose velocities stay
LET_GO_PASSES = 4  # once, after contacts have been lost
SHOCK = 0.01  # of the size, per step: a contact that closes faster is a shock
SHOCK_PASSES = 16  # at most, in each substep of a step with shocks
SETTLED = 0.02  # of the largest shock's speed: corrections below it are left to the other passes
DEEP = 0.02  # of the size: overlap beyond it is pushed out in position only, for a speed given to many adds up
PUSH_RATE = 0.2  # of the deep overlap, per step
PUSH_LIMIT = 0.05  # of the size, per step


@kernel
def solve_contacts(
    substeps, h, plastic, any_loose, loose, active, first, second, normal, gap, mass, rubs, friction, extent, parting,
    in_block, blocks, impulse, tangent, total, worked, opening, pushing, soft, velocity, shift, acceleration,
    inverse_mass, like,
):  # fmt: skip
    """Advance the bodies by ``substeps`` of ``h`` seconds under ``acceleration`` and their contacts.

    Of contact k: first, second (m,) bodies; normal (m, d) from first to second; gap (m,) at the start (overlap is
    negative); mass (m,) 1 / (1/m_a + 1/m_b); friction (m,), rubs: any is above 0; extent (m,) size of the smaller body;
    parting (m,) its overlap needs no push; in_block (m,) and blocks (b, 2), see ``heavy_light_blocks``. impulse (m,)
    and tangent (m, d) start with those of the last step's last substep and end with those of this one's; total (m,)
    sums the former over the step; worked (m,): it pushed at some time; active, opening, pushing, soft (m,): room.
    Of bodies: velocity, shift (n, d), the displacement since the start; acceleration (n, d); inverse_mass (n,); loose
    (n,): a contact that pushed in the last step has gone, so that the others push too much: before anything else
    these let go, and their neighbours. plastic: nothing has bounced in this step, so what closes fast is a shock.
    """
    omega = 2.0 * math.pi * FREQUENCY / h
    damping = 2.0 * DAMPING_RATIO + h * omega
    stiffness = h * omega * damping
    bias_rate, mass_scale, impulse_scale = omega / damping, stiffness / (1.0 + stiffness), 1.0 / (1.0 + stiffness)
    for k in range(len(first)):
        total[k] = 0.0
        worked[k] = False
    measure(h, bias_rate, first, second, normal, gap, extent, parting, shift, opening, pushing, soft, like)
    shock = strike(substeps * h, first, second, normal, gap, extent, velocity, loose, like) if plastic else 0.0
    for step in range(substeps):
        for i in range(len(velocity)):
            store(velocity, i, add_scaled(row(velocity, i, like), row(acceleration, i, like), h))
        for k in range(len(first)):
            if impulse[k] > 0.0:
                push = scale(row(normal, k, like), impulse[k])
                if rubs:
                    push = add_scaled(push, row(tangent, k, like), 1.0)
                a, b = first[k], second[k]
                store(velocity, a, add_scaled(row(velocity, a, like), push, -inverse_mass[a]))
                store(velocity, b, add_scaled(row(velocity, b, like), push, inverse_mass[b]))
        last = LAST_RELAX_PASSES if step == substeps - 1 else RELAX_PASSES
        turn = -LET_GO_PASSES if any_loose and step == 0 else 0
        turn = -SHOCK_PASSES if shock > 0.0 else turn
        while turn <= last:
            if turn < 0:
                spread(loose, first, second, inverse_mass, active)
            largest = 0.0
            bias = pushing if turn == 0 else opening
            for k in range(len(first)):
                if in_block[k] or (turn < 0 and not active[k]):
                    continue
                a, b = first[k], second[k]
                n = row(normal, k, like)
                v_a, v_b = row(velocity, a, like), row(velocity, b, like)
                old = impulse[k]
                wanted = mass[k] * (dot(sub(v_b, v_a), n) + bias[k])
                if turn == 0 and soft[k]:
                    wanted = mass_scale * wanted + impulse_scale * old
                new = max(0.0, old - wanted)
                largest = max(largest, abs(new - old) / mass[k])
                impulse[k] = new
                store(velocity, a, add_scaled(v_a, n, (old - new) * inverse_mass[a]))
                store(velocity, b, add_scaled(v_b, n, (new - old) * inverse_mass[b]))
            solve_squeezed(turn < 0, active, blocks, first, second, normal, bias, impulse, velocity, inverse_mass, like)
            if rubs:
                rub(
                    turn < 0, active, first, second, normal, mass, friction, impulse, tangent, velocity, inverse_mass,
                    like,
                )  # fmt: skip
            if turn == 0:
                for k in range(len(first)):
                    worked[k] |= impulse[k] > 0.0
                for i in range(len(velocity)):
                    store(shift, i, add_scaled(row(shift, i, like), row(velocity, i, like), h))
                if measure(
                    h, bias_rate, first, second, normal, gap, extent, parting, shift, opening, pushing, soft, like
                ):
                    push_deep(
                        substeps, first, second, normal, gap, mass, extent, parting, worked, shift, inverse_mass, like
                    )
                    measure(
                        h, bias_rate, first, second, normal, gap, extent, parting, shift, opening, pushing, soft, like
                    )
            turn = 0 if turn < 0 and largest < SETTLED * shock else turn + 1
        for k in range(len(first)):
            total[k] += impulse[k]
            worked[k] |= impulse[k] > 0.0


@part
def strike(dt, first, second, normal, gap, extent, velocity, loose, like):
    """Mark the bodies of contacts that close fast as ``loose``; returns the largest such speed, 0 if there is none.

    A shock has to travel through all that touches before anything is pushed apart: what one pass leaves undone would
    become overlap, and the push against that a bounce.
    """
    largest = 0.0
    for k in range(len(first)):
        a, b = first[k], second[k]
        speed = dot(sub(row(velocity, a, like), row(velocity, b, like)), row(normal, k, like))
        if speed * dt > SHOCK * extent[k] and speed * dt > gap[k]:
            largest = max(largest, speed)
            loose[a] = loose[b] = True
    return largest


@part
def measure(h, bias_rate, first, second, normal, gap, extent, parting, shift, opening, pushing, soft, like):
    """What each contact asks of the speed along its normal, from where the bodies are now.

    opening (m,): at most closing what is open within a substep; pushing (m,): in the pass that pushes, overlap is to
    open as well, softly where ``soft`` (m,) says so. Returns whether some overlap is too deep for that.
    """
    any_deep = False
    for k in range(len(first)):
        room = gap[k] + dot(sub(row(shift, second[k], like), row(shift, first[k], like)), row(normal, k, like))
        opening[k] = pushing[k] = max(0.0, room) / h
        soft[k] = False
        if room <= 0.0 and not parting[k]:
            if room >= -DEEP * extent[k]:
                soft[k] = True
                pushing[k] = bias_rate * room
            else:
                any_deep = True
    return any_deep


@part
def rub(chosen, active, first, second, normal, mass, friction, impulse, tangent, velocity, inverse_mass, like):
    """Friction: stop what slides, with at most ``friction`` times the normal impulse (Coulomb's cone).

    chosen: only the contacts that are ``active`` (m,).
    """
    for k in range(len(first)):
        if friction[k] == 0.0 or (chosen and not active[k]):
            continue
        a, b = first[k], second[k]
        n = row(normal, k, like)
        w = sub(row(velocity, b, like), row(velocity, a, like))
        old = row(tangent, k, like)
        pull = add_scaled(old, add_scaled(w, n, -dot(w, n)), -mass[k])
        strength, limit = math.sqrt(dot(pull, pull)), friction[k] * impulse[k]
        if strength > limit:
            pull = scale(pull, limit / strength)
        store(tangent, k, pull)
        change = sub(pull, old)
        store(velocity, a, add_scaled(row(velocity, a, like), change, -inverse_mass[a]))
        store(velocity, b, add_scaled(row(velocity, b, like), change, inverse_mass[b]))


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
