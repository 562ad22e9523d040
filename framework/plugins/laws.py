"""What shapes and pairs have to obey: one list of laws each, tried on many inputs at once.

Registration tries four poses of two samples, as plain Python; ``carom plugins check`` thousands of random and extreme
ones, compiled. Lengths are compared within TOLERANCE times the scale of a pose: the distance of the centres plus the
sizes of both shapes. For the generic pair, which iterates for smooth shapes, the factor is GENERIC.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from ..outlines import Outline

UNIT = 1e-9  # how far from 1 a normal's length may be
TOLERANCE, GENERIC = 1e-9, 2e-6
RARE = 500  # one input in so many may be farther off in the generic pair: round shapes with rims, deep in each other
PATH = 24  # samples along a sweep
COARSE = 0.05  # of its size: so much smaller than the shape an outline may be, of what is round

ENCLOSE = "make bounds enclose the whole shape (for turned shapes: use shape.axes), or correct the "
APART = "apart, depth is minus the distance, or minus something smaller: fast bodies would pass through else"
PARTING = (
    "depth is how far the second shape has to move along the normal until they part; normal points from the first "
    "shape to the second"
)
POINT = "point counts from the centre of the first shape, and lies in the middle of the overlap"
LOOKS = "draw the shape that bounds and support describe; the outline, as support, is that of the core without rounding"
FIRST_TOUCH = "time, from 0 to 1, is the part of v after which they touch for the first time"
OF_CAROM = (
    "the contact is of carom's generic pair, from support and rounding: correct these if their shape is not convex, "
    "else please report it; a @plugin.pair of your own takes its place"
)
EXCHANGED = "write the function so that a and b may change places: depth stays, normal turns round"
# What support and rounding of a shape return in one direction per row: points (n, d), numbers (n,).
Support = Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]]


class Law(NamedTuple):
    """A law, tried on n inputs.

    broken
        (n,) bool, the inputs for which it does not hold
    what, cure
        what is said of such an input, with its ``values`` in the braces; what to do
    most
        so many inputs of thousands may break it; None: none may, so that a few inputs can tell
    """

    broken: np.ndarray
    what: str
    cure: str
    values: Sequence[Any] = ()
    most: float | None = None

    @property
    def is_broken(self) -> bool:
        return bool(self.broken.sum() > (self.most or 0))

    def said(self, row: int) -> str:
        return self.what.format(*(plain(value[row]) for value in self.values))


class Contacts(NamedTuple):
    """What a pair function returns for n poses: (n,), (n,), (n, d), (n, d)."""

    hit: np.ndarray
    depth: np.ndarray
    normal: np.ndarray
    point: np.ndarray


@dataclass
class Trial:
    """A pair of shapes in n poses, with what calls its functions: compiled, or as plain Python.

    call, sweep
        (a, b, d) -> Contacts, and (a, b, d, ways) -> hit (n,), time (n,)
    a, b
        the two shapes' parameters, as these take them
    d
        (n, d) m, from the centre of the first shape to that of the second
    halves
        half extents of the boxes around the two, m, (n, d) each
    steps, ways
        (n, d): how the second shape moves to see that the depth is steady, in units of their distance; how it is
        swept, m
    supports
        of both shapes; None where one has none
    own
        whether the function is the plugin's, and not the generic one of two support functions
    twins
        whether both shapes are of one class
    """

    call: Callable[[Any, Any, np.ndarray], Contacts]
    sweep: Callable[[Any, Any, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]] | None
    a: Any
    b: Any
    d: np.ndarray
    halves: tuple[np.ndarray, np.ndarray]
    steps: np.ndarray
    ways: np.ndarray
    supports: tuple[Support, Support] | None
    twins: bool
    own: bool = True

    def contacts(self, d: np.ndarray) -> Contacts:
        """With the second shape at d."""
        return self.call(self.a, self.b, d)

    @property
    def scale(self) -> np.ndarray:
        """(n,) the length that tolerances are relative to."""
        return np.sqrt((self.d * self.d).sum(axis=1)) + size_of(self.halves[0]) + size_of(self.halves[1])

    @property
    def tolerance(self) -> np.ndarray:
        """(n,) m"""
        return (TOLERANCE if self.own else GENERIC) * self.scale


def size_of(half: np.ndarray) -> np.ndarray:
    """(n,) the largest finite half extent; 0 if all are infinite."""
    return np.where(np.isfinite(half), half, 0.0).max(axis=1)


def pair_laws(trial: Trial) -> Iterator[Law]:
    """Of what the function of a pair returns; of the generic one the cure is not to correct that."""
    for law in _contact_laws(trial):
        cure = law.cure if trial.own or law.cure.startswith(ENCLOSE) else OF_CAROM
        yield law if trial.own else law._replace(cure=cure, most=max(law.most or 0, len(law.broken) // RARE))


def _contact_laws(trial: Trial) -> Iterator[Law]:
    r, d, (a, b), tolerance = trial.contacts(trial.d), trial.d, trial.halves, trial.tolerance
    convex = trial.supports is not None
    said, missed = "it returned ({}, {}, {}, {}): ", ~r.hit & (r.depth == -np.inf)  # and it does not tell how far
    finite = np.isfinite(np.column_stack((r.depth, r.normal, r.point))).all(axis=1)
    cure = "guard the divisions and roots that fail there; if the centres coincide: choose any normal then"
    yield Law(~missed & ~finite, said + "every value must be finite", cure, r)
    cure = "depth is how far they overlap; apart, it is minus the gap"
    yield Law(~missed & (r.hit != (r.depth >= 0)), said + "hit must be depth >= 0", cure, r)
    length = np.sqrt((r.normal * r.normal).sum(axis=1))
    wrong, what = ~missed & (np.abs(length - 1.0) > UNIT), "the normal's length is {:.6g}, it must be 1"
    yield Law(wrong, said + what, "divide it by its length", (*r, length))
    hit, depth = r.depth >= 0, np.where(missed, 0.0, r.depth)
    normal = np.where(missed[:, None], 0.0, r.normal)
    if trial.twins:
        yield from _exchange_laws(trial, r, ~missed)
    outside = hit & (np.abs(d) - (a + b) > tolerance[:, None]).any(axis=1) & (depth > tolerance)
    what = "they overlap by {:.6g}, but their boxes do not: half extents {} and {}"
    yield Law(outside, what, ENCLOSE + "depth", (depth, a, b))
    room = (np.abs(depth) + tolerance)[:, None]
    off = ((np.abs(r.point) - a > room) | (np.abs(r.point - d) - b > room)).any(axis=1)
    yield Law(hit & off, "the point of contact {} is outside of one of the shapes", POINT, (r.point,))
    cure = "return minus the gap, or less than it: times of impact and casts are found from it"
    always = hit.any() & (hit | missed).all()
    yield Law(missed & always, "apart, its depth is minus infinity", cure)
    near = (np.abs(d) <= a + b).all(axis=1)
    cure = "return depth >= 0 where they overlap; to keep two shapes apart use layer and mask"
    what = "they never touch, in no pose in which their boxes overlap"
    yield Law(near & ~(hit.any() | missed.all()), what, cure, most=max(near.sum() - 1, 0))
    left = trial.contacts(d + depth[:, None] * normal).depth
    # Hollow or composite shapes may run into another piece, but not in most poses.
    deep, most = (0.0, None) if convex else (0.5, 0.5 * hit.sum())
    what = "depth {:.9g}, normal {}: moved apart by that they "
    values = (depth, normal, np.abs(left))
    yield Law(hit & (left > deep * depth + tolerance), what + "still overlap, by {:.3g}", PARTING, values, most)
    if convex:
        yield Law(hit & (left < -tolerance), what + "are {:.3g} apart", PARTING, values)
    step = (np.abs(depth) + 0.1 * trial.scale)[:, None] * trial.steps
    moved, after = np.sqrt((step * step).sum(axis=1)), trial.contacts(d + step).depth
    jumps = ~missed & (after - depth > moved + 2 * tolerance) & (convex | ~hit)  # of overlapping pieces any goes
    yield Law(jumps, "depth is {:.9g}; the second shape moved by {:.3g} it is {:.9g}", APART, (depth, moved, after))
    if trial.supports is not None:
        (end, beyond), (start, before) = trial.supports[0](normal), trial.supports[1](-normal)
        room = ((end - start - d) * normal).sum(axis=1) + beyond + before
        cores = np.abs(beyond + before - depth)  # how far apart: rounding turns their normal by so much
        slack = tolerance + 4.0 * np.finfo(float).eps * trial.scale**2 / cores
        wrong = ~missed & (np.where(hit, np.abs(room - depth), room - depth) > slack)
        what = "depth {:.9g}, normal {}: along it, by their support functions, the depth is {:.9g}"
        yield Law(wrong, what, "correct the depth, the normal, or the support function", (depth, normal, room))


def _exchange_laws(trial: Trial, r: Contacts, known: np.ndarray) -> Iterator[Law]:
    """Of two of one class, with the roles exchanged."""
    back, tolerance = trial.call(trial.b, trial.a, -trial.d), trial.tolerance
    known = known & np.isfinite(back.depth)
    unequal = known & (np.abs(r.depth - back.depth) > 2 * tolerance)
    yield Law(unequal, "depth is {:.9g}, and seen from the other shape {:.9g}", EXCHANGED, (r.depth, back.depth))
    along = (r.normal * back.normal).sum(axis=1)
    level = (np.abs(trial.d) <= 1e-6 * trial.scale[:, None]).any(axis=1)  # either direction is right
    what = "the normal is {}, and seen from the other shape {}"
    yield Law(known & ~level & (along > 1e-6), what, EXCHANGED, (r.normal, back.normal))
    if trial.own:  # of faces that touch any point is right, so that some may differ
        same, gap = (r.depth >= 0) & (along < -1 + 1e-9), np.abs(back.point - (r.point - trial.d)).max(axis=1)
        slip, what = gap > np.abs(r.depth) + tolerance, "the points of contact seen from both sides are {:.6g} apart"
        yield Law(same & slip, what, POINT, (gap,), 0.5 * same.sum())


def sweep_laws(trial: Trial) -> Iterator[Law]:
    """Of a sweep in closed form, which agrees with the depth along the path."""
    assert trial.sweep is not None
    (hit, time), v = trial.sweep(trial.a, trial.b, trial.d, trial.ways), trial.ways
    yield Law(hit & ~((time >= 0) & (time <= 1)), "the sweep's time is {}", FIRST_TOUCH, (time,))
    away, until = trial.contacts(trial.d).depth < 0, np.where(hit, time, 1.0)
    slack = 1e3 * TOLERANCE * trial.scale + 1e-9 * np.sqrt((v * v).sum(axis=1))
    places = (trial.d + (part * until)[:, None] * v for part in np.linspace(0, 1, PATH, endpoint=False))
    deepest = np.fmax.reduce([trial.contacts(place).depth for place in places])
    what = "on the way to time {:.9g} they overlap by {:.6g} already"
    yield Law(away & (deepest > slack), what, FIRST_TOUCH, (until, deepest))
    end = trial.contacts(trial.d + until[:, None] * v).depth
    off = away & hit & ~(np.abs(end) <= slack)
    yield Law(off, "at the sweep's time {:.9g} they do not touch: depth {:.6g}", FIRST_TOUCH, (time, end))


def shape_laws(half: np.ndarray, support: Support | None, look: np.ndarray, other: np.ndarray) -> Iterator[Law]:
    """Of the bounds (n, d) of n shapes, and of their support in two directions each, (n, d)."""
    cure = "half extents are not negative, and inf where the shape has no end"
    yield Law(~(half >= 0).all(axis=1), "bounds returned {}", cure, (half,))
    if support is None:
        return
    (point, beyond), (elsewhere, _), (long, _) = (support(way) for way in (look, other, 1e6 * look))
    finite = np.isfinite(point).all(axis=1) & np.isfinite(beyond) & (beyond >= 0)
    what = "support({}) is {}, rounding {}"
    cure = "the shape's farthest point in a direction must be finite; rounding: return a number from 0"
    yield Law(~finite, what, cure, (look, point, beyond))
    slack = TOLERANCE * (np.abs(point).max(axis=1) + beyond)
    out = (np.abs(point) + beyond[:, None] > half + slack[:, None]).any(axis=1)
    what += " reach beyond the bounds {}"
    yield Law(out, what, ENCLOSE + "support", (look, point, beyond, half))
    here, there, far = ((end * look).sum(axis=1) for end in (point, elsewhere, long))
    what = "support({}) is {}, but for another direction it is {}, which is farther this way too"
    cure = "return the point whose product with the direction is largest"
    yield Law(there > here + slack, what, cure, (look, point, elsewhere))
    what, cure = "support({}) is {}, for a direction of another length {}", "the direction has any length, not only 1"
    yield Law(np.abs(far - here) > slack, what, cure, (look, point, long))


def edge_laws(ends: Sequence[np.ndarray], support: Support, look: np.ndarray) -> Iterator[Law]:
    """Of both ends (n, 2) of the edges of n shapes, those asked for in the directions ``look``, (n, 2)."""
    one, two = ends
    way = two - one
    outward = np.stack((way[:, 1], -way[:, 0]), axis=1)
    reach = ((support(towards)[0] * towards).sum(axis=1) for towards in (look, outward))
    most = (np.maximum((one * look).sum(axis=1), (two * look).sum(axis=1)), (one * outward).sum(axis=1))
    slack = TOLERANCE * np.abs(np.concatenate(ends, axis=1)).max(axis=1)
    what, cure = "edge({}) is from {} to {}, support reaches farther", "the farthest point is one end of it"
    for towards, farthest, own in zip((look, outward), reach, most, strict=True):
        yield Law(~(own >= farthest - slack * np.abs(towards).max(axis=1)), what, cure, (look, one, two))
        what, cure = "support reaches beyond edge({}), from {} to {}", "go from end to end counter-clockwise"


def outline_laws(
    outlines: Sequence[Outline], half: np.ndarray, beyond: np.ndarray, reach: np.ndarray | None, ways: np.ndarray
) -> Iterator[Law]:
    """Of the outlines of n shapes that are not turned, with their bounds (n, d) and roundings (n,); reach: (n, m) how
    far their support functions reach in the directions (m, d), None without these."""
    size = size_of(half)
    far = np.array([np.abs(one.corners).max(axis=0) for one in outlines]) + beyond[:, None]
    slack = TOLERANCE * (size + far.max(axis=1))
    what = "the outline reaches {}, bounds are {}"
    yield Law((far > half + slack[:, None]).any(axis=1), what, LOOKS, (far, half))
    if reach is not None:
        own = np.array([(one.corners @ ways.T).max(axis=0) for one in outlines])
        error = own - reach
        worst = np.argmax(np.where(error > slack[:, None], np.inf, np.abs(error)), axis=1)
        own, reach, error = (np.take_along_axis(each, worst[:, None], 1)[:, 0] for each in (own, reach, error))
        what = "in the direction {} the outline reaches {:.9g}, support {:.9g}"
        wrong = (error > slack) | (-error > COARSE * (size + far.max(axis=1)))
        yield Law(wrong, what, LOOKS, (ways[worst], own, reach))
    turns = np.array([_least_turn(one) for one in outlines])
    cure = "order the corners counter-clockwise, those of faces as seen from outside; only convex pieces are drawn"
    yield Law(turns < -slack * size, "a polygon of the outline is not convex, or is clockwise", cure)
    if ways.shape[1] == 3 and reach is not None:
        inward = np.array([_least_height(one) for one in outlines])
        yield Law(inward < -slack * size * size, "a face of the outline looks inward", cure)
        cure = "each edge of a face is that of another, too, in the other direction"
        yield Law(np.array([_is_open(one) for one in outlines]), "the faces of the outline leave a hole", cure)


def _normals_of(outline: Outline) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Of each polygon in space its corners and twice its area along the normal."""
    for face in outline.faces:
        ring = outline.corners[face]
        yield ring, np.cross(ring - ring[0], np.roll(ring, -1, axis=0) - ring[0]).sum(axis=0)


def _least_turn(outline: Outline) -> float:
    """The least product of an edge and the next, of all polygons; in space about the normal."""
    flat = outline.corners.shape[1] == 2
    found: list[tuple[np.ndarray, Any]]
    if flat:
        rings = [outline.corners[face] for face in outline.faces] or [outline.corners]
        found = [(ring, None) for ring in rings if len(ring) > 2]
    else:
        found = [(ring, normal / (np.linalg.norm(normal) or 1.0)) for ring, normal in _normals_of(outline)]
    least = 0.0
    for ring, normal in found:
        edges = np.roll(ring, -1, axis=0) - ring
        after = np.roll(edges, -1, axis=0)
        turns = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0] if flat else np.cross(edges, after) @ normal
        least = min(least, float(turns.min()))
    return least


def _least_height(outline: Outline) -> float:
    """Of a solid in space: how far, times an area, its faces look away from its middle."""
    middle = outline.corners.mean(axis=0)
    return min((float((ring.mean(axis=0) - middle) @ normal) for ring, normal in _normals_of(outline)), default=0.0)


def _is_open(outline: Outline) -> bool:
    """Whether an edge is not that of two faces; a single face has but one side."""
    edges = [edge for face in outline.faces for edge in zip(face.tolist(), np.roll(face, -1).tolist(), strict=True)]
    return len(outline.faces) > 1 and (len(set(edges)) < len(edges) or any((b, a) not in set(edges) for a, b in edges))


def mixing_laws(there: np.ndarray, back: np.ndarray) -> Iterator[Law]:
    """Of a rule that makes one number of the two bodies': what it returns in this and in the other order."""
    wrong = ~(np.isfinite(there) & (there >= 0))
    yield Law(wrong, "it returned {}", "return a number from 0", (there,))
    yield Law(there != back, "it returned {}, in the other order {}", "both are one", (there, back))


def plain(value: Any) -> Any:
    """Numbers and tuples without numpy's types."""
    if isinstance(value, np.ndarray) and value.ndim == 1:
        return tuple(value.tolist())
    if isinstance(value, tuple):
        return tuple(plain(part) for part in value)
    return value.tolist() if isinstance(value, (np.generic, np.ndarray)) else value
