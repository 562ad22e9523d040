"""Impacts: bounces at their time on the path, in order of time, each followed by a new look at both bodies.

The loop comes in two variants. The plain one takes pairs that overlap at the end of their motion. The other one sweeps:
pairs that are fast for their size, or all of them, are taken where they first touch on their way: see
``search_bounds``.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...framework.compilation import inlined, kernel, part
from ...framework.vectors import add, add_scaled, divided, dot, item, length, negative, row, scale, sub
from ..ccd.search_bounds import EVENT_DRIVEN, FAST, is_swept, leaves_at
from ..ccd.time_of_impact import APART, AT_CORNER
from ..integration.trajectory import ROUNDING, along, along_rate, first_root, is_straight, relative_path, travel_of
from ..shapes.mixing import mix_friction
from ..shapes.tolerances import reach, slop_of, smaller
from .heap import heap_pop, heap_push
from .impulses import (  # fmt: skip
    ASIDE,
    BOUNCE,
    CAPPED,
    CLUSTER,
    CROSS,
    CROSSED,
    FREE,
    LAST,
    LOGGED,
    NOW,
    STICK,
    STOP,
    STOPPED,
    UNTIL,
    WAITING,
    bounce,
    is_thrown,
    stick,
    stop,
)

TIME_ITERATIONS = 80
QUICK = 1e-3  # of the step: what has lost energy and is struck again so soon goes on like that
MOST_IMPACTS = 10_000_000  # of a body in a step, elastic ones included: some seconds, and then it is stopped

# What the kernel returns: all is done; there is no room for events or the log; a body leaves the space in which its
# neighbours are known, at clock[UNTIL].
DONE, FULL, LEFT = range(3)
HITS, ALL, NOBODY, MEMBERS = -1, -2, -3, -4  # in place of a pair in counts[LAST]


@inlined
def link_pairs(pair_a, pair_b, pairs, heads, links):
    """Chain the pairs of each body, ascending: heads[i] is the first of row i, then follows links[it], till -1.

    An entry is twice the pair for its first body, one more for its second.
    """
    for i in range(len(heads)):
        heads[i] = -1
    for c in range(pairs - 1, -1, -1):
        for side in range(2):
            i = pair_a[c] if side == 0 else pair_b[c]
            links[2 * c + side] = heads[i]
            heads[i] = 2 * c + side


def make_impact_kernel(evaluate: Any, corner: Any, mix: Any, first_touch: Any = None) -> Callable[..., Any]:
    """The event loop over the shapes of a scene; with ``first_touch`` the variant that sweeps."""
    sweeps = first_touch is not None

    @inlined
    def overlap_at_end(
        shape_a, a, shape_b, b, x0, x1, x2, x3, since, dt, slop, shapes, like,
    ):  # fmt: skip
        """(whether they overlap at the end of their motion; time, normal, point, from a's centre to b's of their first
        touch; the normal at the end).

        The time is ``since`` if they touch then already. It is found between a time apart and one in touch by Newton's
        method on the separation, whose rate is the speed along the normal; where that leads out of the bracket, and
        every eighth time, the bracket is halved instead.
        """
        low, high, guess = since, dt, dt
        met, t, normal, point, apart, end_normal = False, dt, like, like, like, like
        for look in range(TIME_ITERATIONS):  # one place that calls evaluate: it is what takes time to compile
            middle = dt if look == 0 else since
            if look > 1:
                middle = guess if low < guess < high and look % 8 != 7 else 0.5 * (low + high)
                if not low < middle < high:
                    break
            d = along(middle, x0, x1, x2, x3)
            hit, depth, n, p = evaluate(shape_a, a, shape_b, b, d, shapes, like)
            near = look > 1 and abs(depth) <= ROUNDING * length(d)
            guess = middle + depth / dot(along_rate(middle, x1, x2, x3), n)
            if look == 0 and hit:
                end_normal = n
                if corner(shape_a, a, shape_b, b, d, slop, shapes, like):
                    break
            if hit or near:
                met, t, normal, point, apart = True, middle, n, p, d
                if near:
                    break
                high = middle
                if look == 1:
                    break
            elif look == 0:
                break
            else:
                low = middle
        return met, t, normal, point, apart, end_normal

    @part
    def depth_at(shape_a, a, shape_b, b, d, shapes, like):
        return evaluate(shape_a, a, shape_b, b, d, shapes, like)[1]

    @inlined
    def consider(
        c, since, dt, pair_a, pair_b, passive, rank, size, shape_of, offset, shapes, velocity, start_velocity,
        inverse_mass, start, motion, restitution, friction, rules, material, limits, share, struck, spent, last,
        clusters, supported, sweep_of, crossed, pair_impulse, events, event_times, event_keys, event_values, heap,
        counts, like,
    ):  # fmt: skip
        """Put the pair's next impact into the queue, if it has one: a touch, and a fast approach.

        Swept pairs touch anywhere on their way, others overlap at the end of it and have a restitution above 0. A
        ``passive`` pair only has its crossing noted, if it is swept.
        """
        a, b = pair_a[c], pair_b[c]
        shape_a, shape_b = shape_of[a], shape_of[b]
        fixed_threshold, fixed_slop, cap = limits
        slop = slop_of(a, b, size, fixed_slop)
        x0, x1, x2, x3 = relative_path(a, b, motion, offset, like)
        threshold = fixed_threshold
        if threshold < 0.0:
            threshold = 2.0 * max(share[a], share[b])
        swept, met, edge = False, False, slop
        t, normal, point, apart, end_normal = dt, like, like, like, like
        if sweeps:
            travel = travel_of(x1, x2, x3, dt)
            swept = is_swept(a, b, travel, size, sweep_of)
            if passive and (not swept or crossed[c]):
                return
            if swept:
                straight = is_straight(a, b, x2, x3, dt, motion, like)
                # what slides may have sunk in by so much
                edge = min(reach(dt, a, b, share, size, fixed_slop), FAST * smaller(a, b, size))
                found, t, normal, point, apart = first_touch(
                    shape_a, a, shape_b, b, x0, x1, x2, x3, straight, since, dt, edge,
                    FAST * smaller(a, b, size) / travel * dt, threshold, shapes, like,
                )
                if found == APART:
                    return
                met = found != AT_CORNER
        e = mix(rules[0], restitution[material[a], a], restitution[material[b], b])
        if not met:
            if e <= 0.0 and not swept:
                return
            met, t, normal, point, apart, end_normal = overlap_at_end(
                shape_a, a, shape_b, b, x0, x1, x2, x3, since, dt, slop, shapes, like
            )
            if not met:
                return
            swept = False
        w = along_rate(t, x1, x2, x3)
        if dot(apart, apart) == 0.0 and length(apart) == 0.0 and length(w) > 0.0:
            if pair_impulse[c] > 0.0:  # it has parted already
                return
            normal = divided(negative(w), length(w))  # no direction between the centres: they part the way they came
        elif not swept and corner(shape_a, a, shape_b, b, apart, slop, shapes, like):
            normal = end_normal  # it slides from one thing onto the next: the edges are in nobody's way
        speed = dot(w, normal)
        nothing = 0.0
        if sweeps:  # else a plastic impact would be one again, by a rounding error
            nothing = ROUNDING * (length(row(motion[1], a, like)) + length(row(motion[1], b, like)))
            threshold += nothing
        gain = 0.0
        if not speed < -threshold and not passive:
            # Too slow to bounce: a contact at rest, unless what is fast would be far past the surface by the end of the
            # step. That is stopped there, or, on a path that leads back in, sent up so that it is there at the end.
            left, curve = dt - t, dot(add_scaled(x2, x3, 3.0 * t), normal)
            goes_far = swept and travel_of(x1, x2, x3, left) > FAST * smaller(a, b, size)
            if not (goes_far and -(speed + curve * left) * left > slop):
                return
            e, gain = 0.0, max(0.0, -curve * left)
        if sweeps and swept and not passive and (supported[a] or supported[b]):
            # What slides or rolls has sunk in a little, and meets the edge of the next thing in its row.
            curve = dot(add_scaled(x2, x3, 3.0 * t), normal)
            ahead = t + first_root(2.0 * edge, speed, curve, dot(x3, normal), dt - t)
            if not ahead <= dt:
                return
            if depth_at(shape_a, a, shape_b, b, along(ahead, x0, x1, x2, x3), shapes, like) <= edge:
                return
        if motion[4] == 1 and e != 1.0:
            # A straight path has the flight's velocity in its middle only. With that of another time a bounce gains
            # or loses, and a ball that always meets the floor at the same phase of a step hops for ever. Elastic
            # pairs do reflect the path: their flight then runs backwards exactly, and nothing drifts.
            bend_a = sub(row(velocity, a, like), row(start_velocity, a, like))
            bend_b = sub(row(velocity, b, like), row(start_velocity, b, like))
            speed = min(0.0, speed + dot(sub(bend_b, bend_a), normal) * (t / dt - 0.5))
            if sweeps and not passive and not speed < -nothing:  # not in the flight
                return
        kind = BOUNCE
        if passive:
            kind = CROSS
        elif spent[a] >= cap or spent[b] >= cap or struck[a] >= MOST_IMPACTS or struck[b] >= MOST_IMPACTS:
            still = (struck[a] >= STOPPED or inverse_mass[a] == 0.0) and (
                struck[b] >= STOPPED or inverse_mass[b] == 0.0
            )
            sinks = -speed * (dt - t) > slop
            if not sweeps or still or not sinks or not (
                travel_of(x1, x2, x3, dt - t) > FAST * smaller(a, b, size)
                or is_thrown(a, start, size, motion[0], like)
                or is_thrown(b, start, size, motion[0], like)
            ):
                counts[CAPPED] += 1
                return
            kind = STOP
            one, two = clusters[0][a], clusters[0][b]
            movable = one != two and clusters[3][one] + clusters[3][two] > 0.0
            since_last = t - max(last[a], last[b])
            collapse = e <= 0.0 or (e < 1.0 and since_last <= QUICK * dt)
            if movable and (collapse or (sweep_of[0] == EVENT_DRIVEN and since_last <= 0.0)):
                kind, e, gain = STICK, 0.0, 0.0
        elif sweeps and sweep_of[0] == EVENT_DRIVEN and e == 1.0:
            driven = (inverse_mass[a] == 0.0 and length(row(motion[1], a, like)) > 0.0) or (
                inverse_mass[b] == 0.0 and length(row(motion[1], b, like)) > 0.0
            )
            kind = BOUNCE if driven or t <= last[a] or t <= last[b] else FREE  # with no time between, it need not end
        pull = scale(like, 0.0)
        mu = mix_friction(mix, rules[1], friction[material[a], a], friction[material[b], b])
        if mu > 0.0:  # Coulomb: stops what slides, with at most mu times the normal impulse
            sliding = add_scaled(w, normal, -dot(w, normal))
            fast = length(sliding)
            if fast > 0.0:
                pull = scale(sliding, -min(1.0, -mu * (1.0 + e) * speed / fast))
        centre = add(add_scaled(row(motion[0], a, like), row(motion[1], a, like), t), row(offset, a, like))
        if motion[4] > 1:
            centre = add_scaled(centre, add_scaled(row(motion[2], a, like), row(motion[3], a, like), t), t * t)
        point = add(centre, point)
        event = heap[counts[WAITING]]
        events[event, 0], events[event, 1], events[event, 2], events[event, 3] = c, struck[a], struck[b], kind
        event_times[event], event_keys[event] = t, rank[a] * len(rank) + rank[b]
        event_values[event, 0], event_values[event, 1] = t, gain - (1.0 + e) * speed
        for k in range(len(like)):
            event_values[event, 2 + k] = item(normal, k)
            event_values[event, 2 + len(like) + k] = item(point, k)
            event_values[event, 2 + 2 * len(like) + k] = item(pull, k)
        counts[WAITING] = heap_push(heap, counts[WAITING], event_times, event_keys)

    @kernel
    def resolve_impacts(
        dt, pair_a, pair_b, pairs, responds, hits, supported, heads, links, looks, rank, size, shape_of, offset, shapes,
        position, velocity, start_velocity, inverse_mass, damping, start, motion, restitution, friction, rules,
        material, limits, share, struck, spent, last, clusters, sweep_of, roam_lower, roam_upper, crossed, pair_impulse,
        pair_normal, pair_point, pair_depth, events, event_times, event_keys, event_values, heap, log_pair, log_value,
        counts, clock, like,
    ):  # fmt: skip
        """Bounce every pair that touches in its motion and approaches faster than the threshold.

        hits: pairs that may have met; so may every pair of a body that is ``supported`` (n,). heads (n,), links
        (2 pairs,), looks (2 pairs + 1,): room, see link_pairs.
        restitution, friction: per slot and row, material: whose slot counts; rules: how two become one. limits: the
        threshold and the slop (below 0: from the bodies), the most impacts of a body.
        start (n, d): where the step started. share (n,): see reach. struck, spent (n,): impacts per dynamic body, and
        those that the cap counts; last (n,): times of the latest. clusters: see ``impulses.stick``. sweep_of,
        roam_lower, roam_upper: see ``search_bounds``. crossed (pairs,): pairs that met
        and do not push, or were stopped. pair_*: per pair, the impulse summed and the last impact's geometry and time.
        log_*: pair; time, impulse, normal, point of every impact. counts, clock: see WAITING, NOW.
        Returns DONE; FULL: call again with more room to go on; or LEFT.
        """
        linked = False
        while True:
            # What is looked at: at first what may have met, later the pairs of the two bodies just struck.
            c = counts[LAST]
            wanted = 0
            if c == HITS:
                for p in range(pairs):
                    if supported[pair_a[p]] or supported[pair_b[p]]:
                        looks[wanted] = p
                        wanted += 1
                for h in range(len(hits)):
                    if not (supported[pair_a[hits[h]]] or supported[pair_b[hits[h]]]):
                        looks[wanted] = hits[h]
                        wanted += 1
            elif c == ALL:
                for p in range(pairs):
                    looks[p] = p
                wanted = pairs
            elif c != NOBODY and not linked:
                link_pairs(pair_a, pair_b, pairs, heads, links)
                linked = True
            if c == MEMBERS:
                i = counts[CLUSTER]
                while i >= 0:
                    entry = heads[i]
                    while entry >= 0:
                        looks[wanted] = entry // 2
                        wanted += 1
                        entry = links[entry]
                    i = clusters[1][i]
            elif c >= 0:
                for side in range(2):
                    i = pair_a[c] if side == 0 else pair_b[c]
                    entry = heads[i] if inverse_mass[i] > 0.0 else -1
                    while entry >= 0:
                        if side == 0 or entry // 2 != c or inverse_mass[pair_a[c]] == 0.0:  # once is enough
                            looks[wanted] = entry // 2
                            wanted += 1
                        entry = links[entry]
            if counts[WAITING] + wanted > len(heap) or counts[LOGGED] == len(log_pair):
                return FULL
            for q in range(wanted):
                p = looks[q]
                if responds[p] or sweeps:
                    consider(
                        p, clock[NOW], dt, pair_a, pair_b, not responds[p], rank, size, shape_of, offset, shapes,
                        velocity, start_velocity, inverse_mass, start, motion, restitution, friction, rules, material,
                        limits, share, struck, spent, last, clusters, supported, sweep_of, crossed, pair_impulse,
                        events, event_times, event_keys, event_values, heap, counts, like,
                    )  # fmt: skip
            chosen = -1
            while counts[WAITING] > 0 and chosen < 0:
                event = heap[0]
                if sweeps and event_times[event] > clock[UNTIL]:
                    break
                p = events[event, 0]
                if events[event, 1] == struck[pair_a[p]] and events[event, 2] == struck[pair_b[p]]:
                    chosen = event
                counts[WAITING] = heap_pop(heap, counts[WAITING], event_times, event_keys)
            if chosen < 0 and sweeps and clock[UNTIL] < dt:
                return LEFT
            if chosen < 0:
                for i in range(len(struck) if sweeps else 0):
                    if 0 < struck[i] < ASIDE and is_thrown(i, start, size, motion[0], like):
                        struck[i] += ASIDE
                return DONE
            c = events[chosen, 0]
            counts[LAST], clock[NOW] = c, event_times[chosen]
            if sweeps and events[chosen, 3] == CROSS:
                crossed[c] = True
                counts[CROSSED] += 1
                counts[LAST] = NOBODY
                continue
            if sweeps and events[chosen, 3] == STICK:
                counts[CLUSTER] = stick(
                    chosen, dt, sweep_of[0] == EVENT_DRIVEN, pair_a, pair_b, position, velocity, start_velocity,
                    inverse_mass, damping, motion, struck, spent, clusters, pair_impulse, pair_normal, pair_point,
                    pair_depth, events, event_values, log_pair, log_value, counts, like,
                )  # fmt: skip
                counts[LAST] = MEMBERS
                i = counts[CLUSTER]
                while i >= 0:
                    last[i] = clock[NOW]
                    time = leaves_at(i, clock[NOW], dt, size, motion, sweep_of, roam_lower, roam_upper, like)
                    clock[UNTIL] = min(clock[UNTIL], time)
                    i = clusters[1][i]
                continue
            if sweeps and events[chosen, 3] == STOP:
                counts[CAPPED] += 1
                pair_depth[c] = 0.0
                crossed[c] = True
            else:
                bounce(
                    chosen, dt, sweeps and sweep_of[0] == EVENT_DRIVEN, pair_a, pair_b, position, velocity,
                    start_velocity, inverse_mass, damping, motion, struck, spent, pair_impulse, pair_normal, pair_point,
                    pair_depth, events, event_values, log_pair, log_value, counts, like,
                )  # fmt: skip
            for side in range(2 if sweeps else 0):
                i = pair_a[c] if side == 0 else pair_b[c]
                if inverse_mass[i] > 0.0 and struck[i] < STOPPED:
                    if events[chosen, 3] == STOP:
                        stop(i, clock[NOW], position, velocity, motion, struck, spent, like)
                        clusters[3][clusters[0][i]] = 0.0  # what sticks to it later does not push it on
                    else:
                        last[i] = clock[NOW]
                        time = leaves_at(i, clock[NOW], dt, size, motion, sweep_of, roam_lower, roam_upper, like)
                        clock[UNTIL] = min(clock[UNTIL], time)

    return resolve_impacts
