"""Contacts at rest: which pairs they are, and their geometry at the start of the step."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ...framework.compilation import inlined, kernel, part
from ...framework.vectors import add, add_scaled, dot, row, store, sub
from ..impacts.impulses import ASIDE
from ..shapes.mixing import mix_friction
from ..shapes.tolerances import reach, slop_of, smaller

ENTRY_ITERATIONS = 24
STAYS, PARTS_SLOWLY, PARTS = range(3)  # what an elastic pair does at the end of the step
SAME_PLACE = 1e-9  # of the size: a gap of rounding errors is none


@inlined
def between(a, b, position, offset, like):
    """From the centre of a's shape to that of b's."""
    at_a, at_b = add(row(position, a, like), row(offset, a, like)), add(row(position, b, like), row(offset, b, like))
    return sub(at_b, at_a)


def make_resting_kernels(evaluate: Any, corner: Any, mix: Any) -> tuple[Callable[..., Any], Callable[..., None], Any]:
    """The kernels over the shapes of a scene: (find the contacts at rest, linearise them, measure what touches)."""

    @inlined
    def touch(a, b, d, shape_of, shapes, like):
        """The pair function and its answer."""
        return evaluate(shape_of[a], a, shape_of[b], b, d, shapes, like)

    @part
    def touch_seldom(a, b, d, shape_of, shapes, like):
        """The same where speed is nothing, and code to compile is."""
        return evaluate(shape_of[a], a, shape_of[b], b, d, shapes, like)

    @part
    def entry(a, b, d, travel, at_end, slop, shape_of, shapes, like):
        """Gap at the start, normal and point where the pair first touches on its way from d to d + travel.

        That is the end if it touches nowhere or that is asked for. A touch of corners is none.
        """
        low, high, t = 0.0, 1.0, 1.0
        normal, point, depth, chosen = like, like, 0.0, 0.0
        for look in range(ENTRY_ITERATIONS):
            at = add_scaled(d, travel, t)
            _, depth_now, n, p = touch_seldom(a, b, at, shape_of, shapes, like)
            if corner(shape_of[a], a, shape_of[b], b, at, slop, shapes, like):
                depth_now = min(depth_now, -slop)  # so that the search goes on
            if look == 0 or depth_now >= 0.0:  # the end, or a time in touch
                normal, point, depth, chosen = n, p, depth_now, t
                if at_end or depth_now < 0.0:
                    break
                high = t
            else:
                low = t
            if abs(depth_now) <= slop and look > 0:
                break
            t = chosen + depth / dot(travel, normal)  # where its plane says, if that is between the two
            if not low < t < high or look % 4 == 3:
                t = 0.5 * (low + high)
        return -depth - chosen * dot(travel, normal), normal, point

    @kernel
    def find_resting(
        dt, pair_a, pair_b, pairs, responds, involved, pair_depth, shape_of, offset, shapes, position, velocity,
        start, size, restitution, material, rule, fixed_threshold, fixed_slop, share, struck, supported, change,
        travelled, pair_impulse, pair_parts, result, like,
    ):  # fmt: skip
        """Pairs whose gap is below the margin after the impacts and that are not bouncing; returns how many.

        pair_depth (m,) is that of the free flight, and still holds for bodies neither struck nor supported; only who is
        ``involved`` (m,) may be near then, and who overlaps now is so from now on. supported (n,), change (n, d): see
        ``resting_prediction``; travelled: the displacement by the latter, over it.
        """
        count = 0
        for c in range(pairs):
            if not responds[c]:
                continue
            a, b = pair_a[c], pair_b[c]
            if struck[a] >= ASIDE or struck[b] >= ASIDE:  # stopped, or thrown from afar
                involved[c] = True  # they may touch where they are now
                continue
            hit = struck[a] > 0 or struck[b] > 0
            carried = supported[a] or supported[b]
            if not involved[c] and not hit and not carried:
                continue
            slop = slop_of(a, b, size, fixed_slop)
            margin = reach(dt, a, b, share, size, fixed_slop)
            near = pair_depth[c] >= -margin and not hit
            if not near and not hit and not carried:
                continue
            d = between(a, b, position, offset, like)
            _, depth, normal, _ = touch(a, b, d, shape_of, shapes, like)
            if depth < -margin:
                if hit or not carried:
                    continue
                # Supports may push too much in the prediction; who meets in free flight is a contact all the same.
                free = between(a, b, position, offset, like)
                if supported[a]:
                    free = add_scaled(free, row(change, a, like), travelled)
                if supported[b]:
                    free = add_scaled(free, row(change, b, like), -travelled)
                _, depth, normal, _ = touch_seldom(a, b, free, shape_of, shapes, like)
                if depth < -margin:
                    continue
            involved[c] |= depth >= 0.0
            pair_parts[c] = STAYS
            e = mix(rule, restitution[material[a], a], restitution[material[b], b])
            if e > 0.0:
                threshold = fixed_threshold if fixed_threshold >= 0.0 else (margin - slop) / dt
                speed = dot(sub(row(velocity, b, like), row(velocity, a, like)), normal)
                touches = depth > (SAME_PLACE * smaller(a, b, size) if pair_impulse[c] == 0.0 else 0.0)
                if not touches and speed < -threshold:
                    continue  # the next step's impact
                if speed > 0.0:
                    pair_parts[c] = PARTS if speed > threshold and speed * dt > slop else PARTS_SLOWLY
                if pair_impulse[c] > 0.0 and speed > threshold:
                    _, before, _, _ = touch_seldom(a, b, between(a, b, start, offset, like), shape_of, shapes, like)
                    if before < 0.0:
                        continue  # on its way out
            if corner(shape_of[a], a, shape_of[b], b, d, slop, shapes, like):
                continue
            result[count] = c
            count += 1
        return count

    @kernel
    def linearise(
        resting, slot, pair_a, pair_b, shape_of, offset, shapes, position, start, size, friction, material, rule,
        fixed_slop, inverse_mass, pair_impulse, pair_parts, pair_normal, pair_point, normals, gaps, masses, frictions,
        extents, parting, like,
    ):  # fmt: skip
        """The contacts' columns: normal and gap where the step starts, and what the two bodies make of it together.

        resting (m,): pairs; slot (m,): where each contact's columns are.
        """
        for r in range(len(resting)):
            c, k = resting[r], slot[r]
            a, b = pair_a[c], pair_b[c]
            slop = slop_of(a, b, size, fixed_slop)
            d = between(a, b, start, offset, like)
            _, depth, normal, point = touch(a, b, d, shape_of, shapes, like)
            gap = -depth
            if depth < 0.0 or pair_parts[c] != STAYS or corner(shape_of[a], a, shape_of[b], b, d, slop, shapes, like):
                travel = sub(between(a, b, position, offset, like), d)
                gap, normal, point = entry(a, b, d, travel, pair_parts[c] != STAYS, slop, shape_of, shapes, like)
            if pair_impulse[c] > 0.0 and dot(normal, row(pair_normal, c, like)) <= 0.0:
                normal = row(pair_normal, c, like)  # coincident centres have parted: not back again
            point = add(point, add(row(start, a, like), row(offset, a, like)))
            store(normals, k, normal)
            store(pair_normal, c, normal)
            store(pair_point, c, point)
            gaps[k] = gap
            masses[k] = 1.0 / (inverse_mass[a] + inverse_mass[b])
            # After a blow at time t the body seems to come from dv t behind: no overlap to be pushed out.
            parting[k] = pair_parts[c] == PARTS or (pair_impulse[c] > 0.0 and gap > 0.0)
            extents[k] = smaller(a, b, size)
            frictions[k] = mix_friction(mix, rule, friction[material[a], a], friction[material[b], b])

    @kernel
    def find_touching(
        pair_a, pair_b, pairs, responds, involved, resting, struck, shape_of, offset, shapes, position, size,
        crossed, pair_impulse, pair_depth, pair_normal, pair_point, result, like,
    ):  # fmt: skip
        """Pairs that touch now that all is done, or pushed each other in the step or crossed; returns how many.

        Those that may are the ``involved`` (m,), the resting and struck ones, and those that push nobody. crossed (m,),
        or (0,) if nothing did.
        """
        for r in range(len(resting)):
            involved[resting[r]] = True
        for r in range(len(struck)):
            involved[struck[r]] = True
        count = 0
        for c in range(pairs):
            if responds[c] and not involved[c] and not (len(crossed) > 0 and crossed[c]):
                continue
            a, b = pair_a[c], pair_b[c]
            hit, depth, normal, point = touch(a, b, between(a, b, position, offset, like), shape_of, shapes, like)
            pushed = pair_impulse[c] > 0.0
            if responds[c] and depth >= -SAME_PLACE * smaller(a, b, size):
                hit = True
            if not hit and not pushed and not (len(crossed) > 0 and crossed[c]):
                continue
            pair_depth[c] = max(0.0, depth)
            if not pushed:
                store(pair_normal, c, normal)
            store(pair_point, c, add(point, add(row(position, a, like), row(offset, a, like))))
            result[count] = c
            count += 1
        return count

    return find_resting, linearise, find_touching
