"""Checks of a pair of shapes, for thousands of random and extreme poses.

Lengths are compared within TOLERANCE times the scale of the pose: the distance of the centres plus the sizes of both
shapes. For the generic pair, which iterates for smooth shapes, the factor is GENERIC.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...framework.plugins.checks import contact_fault, plain
from ...framework.plugins.registry import Pair, Shape
from .kernels import PairCode, RaisedError, SupportCode
from .samples import KINDS, Finding, Poses, Subject, directions, pose_shown

TOLERANCE, GENERIC = 1e-9, 2e-6
PLAIN_ORDINARY, PLAIN_EXTREME = 100, 15  # poses that are also run in plain Python
PATH = 24  # samples along a sweep


class PairChecks:
    """All checks of one pair in one dimension; findings are recorded in the subject."""

    def __init__(self, subject: Subject, pair: Pair, shapes: tuple[Shape, Shape], poses: Poses, by_hand: bool) -> None:
        self.subject, self.pair, self.shapes, self.poses = subject, pair, shapes, poses
        self.convex = all(shape.support is not None for shape in shapes)
        self.twins = shapes[0].component is shapes[1].component
        self.by_hand = by_hand  # the checked plugin's own function, not the generic pair
        self.tolerance = (GENERIC if pair.helpers and not by_hand else TOLERANCE) * poses.scale()
        self.rng = np.random.default_rng(7)
        self.d = poses.d
        self.subject.inputs = len(self.d)
        self.code = PairCode(pair, *shapes, self.d.shape[1])

    def run(self) -> None:
        try:
            result = self._evaluate(self.d)
        except RaisedError as error:
            cure = "return a contact for every input; a miss is (False, -gap, normal, point)"
            self._found_one(error.at, f"the compiled function raised {error}", cure)
            return
        good = self._contacts(result)
        if not good.any():
            return
        np.copyto(result.depth, -np.inf, where=~good)
        self._boxes(result)
        self._points(result)
        self._meets(result)
        self._parting(result)
        if self.convex and not self.subject.findings:  # otherwise it would repeat them
            self._supports(result)
        self._steadiness(result)
        if self.twins:
            self._turned_round(result)
        if self.by_hand:
            self._plain(result)
            if self.pair.sweep is not None:
                self._sweeps(result)

    # -- each pose by itself ----------------------------------------------------------------------

    def _contacts(self, r: Any) -> np.ndarray:
        """Check that results are valid, and return which of them are usable."""
        found = zip(r.hit.tolist(), r.depth.tolist(), r.normal.tolist(), r.point.tolist(), strict=True)
        faults = np.array([contact_fault(*contact) for contact in found])
        said = [self._said(r, i) for i in np.flatnonzero(faults != "")[:1]]
        cure = "guard the divisions and roots that fail there, and return depth >= 0.0 as the first value"
        self._found(faults != "", f"{''.join(said)}: {{}}", cure, faults)
        return (faults == "") & ~(~r.hit & (r.depth == -np.inf))

    def _boxes(self, r: Any) -> None:
        """At a contact the bounds of both shapes overlap; otherwise the broad phase does not report the pair."""
        a, b = self.poses.a.half, self.poses.b.half
        outside = (r.depth > self.tolerance) & (np.abs(self.d) - (a + b) > self.tolerance[:, None]).any(axis=1)
        what = "they overlap by {:.6g}, but their boxes do not: half extents {} and {}"
        cure = "make bounds enclose the whole shape (for turned shapes: use shape.axes), or correct the depth"
        self._found(outside, what, cure, r.depth, a, b)

    def _points(self, r: Any) -> None:
        """The contact point lies in both boxes, up to the overlap."""
        room = (np.abs(r.depth) + self.tolerance)[:, None]
        off = np.abs(r.point) - self.poses.a.half > room
        off |= np.abs(r.point - self.d) - self.poses.b.half > room
        cure = "point counts from the centre of the first shape, and lies in the overlap"
        what = "the point of contact {} is outside of one of the shapes"
        self._found((r.depth >= 0) & off.any(axis=1), what, cure, r.point)

    def _meets(self, r: Any) -> None:
        if not (r.depth >= 0).any():
            near = (np.abs(self.d) <= self.poses.a.half + self.poses.b.half).all(axis=1)
            what = f"they never touch, in none of {near.sum()} poses in which their boxes overlap"
            cure = "return depth >= 0 where they overlap; to keep two shapes apart use layer and mask"
            self._found_one(int(np.argmax(near)), what, cure)

    def _supports(self, r: Any) -> None:
        """The depth along the normal agrees with the support functions of both shapes."""
        known = np.isfinite(r.depth)
        normal = np.where(known[:, None], r.normal, np.eye(self.d.shape[1])[0])
        room = -(self.d * normal).sum(axis=1)
        for shape, rows, way in zip(self.shapes, (self.poses.a, self.poses.b), (normal, -normal), strict=True):
            point, beyond = SupportCode(shape, self.d.shape[1])(rows, way)
            room += (point * way).sum(axis=1) + beyond
        wrong = np.where(r.depth >= 0, np.abs(room - r.depth), room - r.depth) > self.tolerance
        what = "depth {:.9g}, normal {}: along it, by their support functions, the depth is {:.9g}"
        cure = "correct the depth, the normal, or the support function"
        self._found(known & wrong, what, cure, r.depth, r.normal, room)

    # -- two related poses ------------------------------------------------------------------------

    def _parting(self, r: Any) -> None:
        """After a translation by depth along the normal the shapes just touch."""
        hit = r.depth >= 0
        after = self._evaluate(self.d + np.where(np.isfinite(r.depth), r.depth, 0.0)[:, None] * r.normal)
        left = np.where(hit, after.depth, 0.0)
        if self.convex:
            deep, far = left > self.tolerance, left < -self.tolerance
        else:  # hollow or composite shapes may run into another piece, but not in most poses
            deep, far = left > 0.5 * r.depth + self.tolerance, np.zeros(len(hit), bool)
            deep &= (hit & deep).sum() > 0.5 * hit.sum()
        cure = (
            "depth is how far the second shape has to move along the normal until they part; normal points from the "
            "first shape to the second"
        )
        what = "depth {:.9g}, normal {}: moved apart by that they "
        self._found(hit & deep, what + "still overlap, by {:.3g}", cure, r.depth, r.normal, left)
        self._found(hit & far, what + "are {:.3g} apart", cure, r.depth, r.normal, -left)

    def _steadiness(self, r: Any) -> None:
        """A translation by s changes the distance by at most s: the search for the time of impact relies on it."""
        n, dimensions = self.d.shape
        size = np.where(np.isfinite(r.depth), np.abs(r.depth), 0.0) + 0.1 * self.poses.scale()
        step = (size * 10.0 ** self.rng.uniform(-6, 0, n))[:, None] * directions(n, dimensions, self.rng)
        moved = np.sqrt((step * step).sum(axis=1))
        after = self._evaluate(self.d + step)
        both = np.isfinite(r.depth) & np.isfinite(after.depth)
        with np.errstate(invalid="ignore"):
            jumps = both & (after.depth - r.depth > moved + 2 * self.tolerance)
        if not self.convex:
            jumps &= r.depth < 0  # the depth of overlapping pieces is arbitrary, their distance is not
        what = "depth is {:.9g}; the second shape moved by {:.3g} it is {:.9g}"
        cure = "apart, depth is minus the distance, or minus something smaller: fast bodies would pass through else"
        self._found(jumps, what, cure, r.depth, moved, after.depth)

    def _turned_round(self, r: Any) -> None:
        """Two of one shape, with the roles exchanged."""
        back = self.code(self.poses.b, self.poses.a, -self.d)
        both = np.isfinite(r.depth) & np.isfinite(back.depth)
        with np.errstate(invalid="ignore"):
            unequal = both & (np.abs(r.depth - back.depth) > 2 * self.tolerance)
        cure = "write the function so that a and b may change places: depth stays, normal turns round"
        self._found(unequal, "depth is {:.9g}, and seen from the other shape {:.9g}", cure, r.depth, back.depth)
        along = (r.normal * back.normal).sum(axis=1)
        # With level centres either direction is right.
        level = (np.abs(self.d) <= 1e-6 * self.poses.scale()[:, None]).any(axis=1)
        kept = both & ~unequal & ~level & (along > 1e-6)
        self._found(kept, "the normal is {}, and seen from the other shape {}", cure, r.normal, back.normal)
        if not self.by_hand:
            return
        gap = np.abs(back.point - (r.point - self.d)).max(axis=1)
        same = (r.depth >= 0) & (along < -1 + 1e-9)
        slip = same & (gap > np.abs(r.depth) + self.tolerance)
        slip &= slip.sum() > 0.5 * same.sum()  # for touching faces any point of them is right
        cure = "point counts from the centre of the first shape, and lies in the middle of the overlap"
        self._found(slip, "the points of contact seen from both sides are {:.6g} apart", cure, gap)

    # -- other ways to the same result ------------------------------------------------------------

    def _plain(self, r: Any) -> None:
        """Compiled code and plain Python agree."""
        chosen = np.concatenate(
            [np.flatnonzero(self.poses.kind == k)[: PLAIN_ORDINARY if k == 0 else PLAIN_EXTREME] for k in
             range(len(KINDS))]
        )  # fmt: skip
        for i in chosen.tolist():
            d = tuple(self.d[i])
            try:
                with np.errstate(all="ignore"):
                    result = self.pair.function(self.poses.a.at(i), self.poses.b.at(i), d, *self.pair.helpers)
            except Exception as error:  # raised by the plugin
                raised = f"{type(error).__name__}: {error}"
                what = f"as plain Python it raises {raised}; compiled it returns {self._said(r, i)}"
                self._found_one(i, what, "guard what fails: compiled code does not raise there, it goes on with nan")
                return
            hit, depth, normal, point = result
            if not r.hit[i] and r.depth[i] == -np.inf and not hit:
                continue
            there = np.array((depth, *normal, *point), float)
            here = np.array((r.depth[i], *r.normal[i], *r.point[i]))
            allowed = np.array([self.tolerance[i]] + [1e-9] * len(normal) + [self.tolerance[i]] * len(point))
            if not (np.abs(there - here) <= allowed).all():
                what = f"compiled it returns {self._said(r, i)}, as plain Python {plain(result)!r}"
                cure = "use what both know: numbers and tuples, math, carom.framework.vectors; no global that changes"
                self._found_one(i, what, cure)
                return

    def _sweeps(self, r: Any) -> None:
        """The closed-form sweep agrees with the depth along the path."""
        away = np.flatnonzero(r.depth < 0)
        poses = self.poses.take(away)
        d, tolerance = poses.d, 1e3 * self.tolerance[away]
        aim = self.rng.uniform(-1, 1, d.shape) * (poses.a.size() + poses.b.size())[:, None] - d
        v = aim * self.rng.uniform(0.5, 3.0, (len(d), 1))
        try:
            hit, time = self.code.sweep(poses.a, poses.b, d, v)
        except RaisedError as error:
            self._found_one(int(away[error.at]), f"the sweep raised {error}", "return (hit, time) for every input")
            return

        def found(bad: np.ndarray, what: str, *values: np.ndarray) -> None:
            cure = "time, from 0 to 1, is the part of v after which they touch for the first time"
            show = lambda i: f"{pose_shown(poses, i)}, v = {tuple(v[i].tolist())}"  # noqa: E731
            self.subject.found(bad, what, show, cure, *values)

        wrong = hit & ~((time >= 0) & (time <= 1))
        found(wrong, "the sweep's time is {}", time)
        until = np.where(hit & ~wrong, time, 1.0)
        slack = tolerance + 1e-9 * np.sqrt((v * v).sum(axis=1))
        deepest = np.full(len(d), -np.inf)
        for part in np.linspace(0, 1, PATH, endpoint=False):
            depth = self.code(poses.a, poses.b, d + (part * until)[:, None] * v).depth
            deepest = np.fmax(deepest, depth)
        at_end = self.code(poses.a, poses.b, d + until[:, None] * v).depth
        late = deepest > slack
        found(late, "on the way to time {:.9g} they overlap by {:.6g} already", until, deepest)
        off = hit & ~wrong & ~late & ~(np.abs(at_end) <= slack)
        found(off, "at the sweep's time {:.9g} they do not touch: depth {:.6g}", time, at_end)

    # -- help -------------------------------------------------------------------------------------

    def _evaluate(self, d: np.ndarray) -> Any:
        return self.code(self.poses.a, self.poses.b, d)

    def _said(self, r: Any, i: int) -> str:
        return repr((bool(r.hit[i]), float(r.depth[i]), tuple(r.normal[i].tolist()), tuple(r.point[i].tolist())))

    def _found(self, bad: np.ndarray, what: str, cure: str, *values: np.ndarray) -> None:
        self.subject.found(bad, what, lambda i: pose_shown(self.poses, i), cure, *values)

    def _found_one(self, at: int, what: str, cure: str) -> None:
        self.subject.findings.append(Finding(what, pose_shown(self.poses, at), cure))
