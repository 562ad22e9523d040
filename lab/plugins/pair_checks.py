"""Checks of a pair of shapes, for thousands of random and extreme poses.

Lengths are compared within TOLERANCE times the scale of the pose: the distance of the centres plus the sizes of both
shapes. For the generic pair, which iterates for smooth shapes, the factor is GENERIC.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from ...framework.plugins.checks import plain
from ...framework.plugins.registry import Pair, Shape
from .kernels import PairCode, RaisedError, SupportCode
from .samples import KINDS, Poses, Subject, directions, numbers_shown, pose_shown

TOLERANCE, GENERIC = 1e-9, 2e-6
UNIT = 1e-6  # tolerance of a normal's length
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
            what = f"the compiled function raised {error}"
            self._found_one(error.at, what, "return a contact for every input; a miss is (False, -gap, normal, point)")
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
        apart = ~r.hit & (r.depth == -np.inf)
        finite = np.isfinite(r.depth) & np.isfinite(r.normal).all(axis=1) & np.isfinite(r.point).all(axis=1) | apart
        self._found(
            ~finite, lambda i: f"{self._said(r, i)}: not finite", "guard the divisions and roots that fail there"
        )
        wrong = finite & (r.hit != (r.depth >= 0))
        self._found(
            wrong, lambda i: f"{self._said(r, i)}: hit must be depth >= 0", "return depth >= 0.0 as the first value"
        )
        length = np.sqrt((r.normal**2).sum(axis=1))
        bent = finite & ~apart & (np.abs(length - 1.0) > UNIT)
        self._found(
            bent, lambda i: f"the normal's length is {length[i]:.9g}, it must be 1", "divide the normal by its length"
        )
        return finite & ~bent & ~apart

    def _boxes(self, r: Any) -> None:
        """At a contact the bounds of both shapes overlap; otherwise the broad phase does not report the pair."""
        reach = self.poses.a.half + self.poses.b.half
        outside = (r.depth > self.tolerance) & (np.abs(self.d) - reach > self.tolerance[:, None]).any(axis=1)
        self._found(
            outside,
            lambda i: f"they overlap by {r.depth[i]:.6g}, but their boxes do not: half extents "
            f"{numbers_shown(self.poses.a.half[i])} and {numbers_shown(self.poses.b.half[i])}",
            "make bounds enclose the whole shape (for turned shapes: use shape.axes), or correct the depth",
        )

    def _points(self, r: Any) -> None:
        """The contact point lies in both boxes, up to the overlap."""
        room = np.abs(r.depth) + self.tolerance
        hit = r.depth >= 0
        off_a = np.any(np.abs(r.point) - self.poses.a.half > room[:, None], axis=1)
        off_b = np.any(np.abs(r.point - self.d) - self.poses.b.half > room[:, None], axis=1)
        self._found(
            hit & (off_a | off_b),
            lambda i: f"the point of contact {numbers_shown(r.point[i])} is outside of "
            f"{'the first' if off_a[i] else 'the second'} shape",
            "point counts from the centre of the first shape, and lies in the overlap",
        )

    def _meets(self, r: Any) -> None:
        if not (r.hit & (r.depth >= 0)).any():
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
        hit = r.depth >= 0
        wrong = np.where(hit, np.abs(room - r.depth), room - r.depth) > self.tolerance
        self._found(
            known & wrong,
            lambda i: f"depth {r.depth[i]:.9g}, normal {numbers_shown(r.normal[i])}: along it, by their support "
            f"functions, the depth is {room[i]:.9g}",
            "correct the depth, the normal, or the support function",
        )

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
        cure = "depth is how far the second shape has to move along the normal until they part; normal points from the "
        self._found(
            hit & deep,
            lambda i: f"depth {r.depth[i]:.9g}, normal {numbers_shown(r.normal[i])}: moved apart by that they still "
            f"overlap, by {left[i]:.3g}",
            cure + "first shape to the second",
        )
        self._found(
            hit & far,
            lambda i: f"depth {r.depth[i]:.9g}, normal {numbers_shown(r.normal[i])}: moved apart by that they are "
            f"{-left[i]:.3g} apart",
            cure + "first shape to the second",
        )

    def _steadiness(self, r: Any) -> None:
        """A translation by s changes the distance by at most s: the search for the time of impact relies on it."""
        n, dimensions = self.d.shape
        size = np.where(np.isfinite(r.depth), np.abs(r.depth), 0.0) + 0.1 * self.poses.scale()
        step = (size * 10.0 ** self.rng.uniform(-6, 0, n))[:, None] * directions(n, dimensions, self.rng)
        moved = np.sqrt((step * step).sum(axis=1))
        after = self._evaluate(self.d + step)
        both = np.isfinite(r.depth) & np.isfinite(after.depth)
        with np.errstate(invalid="ignore"):
            change = np.where(both, after.depth - r.depth, 0.0)
        jumps = change > moved + 2 * self.tolerance
        if not self.convex:
            jumps &= r.depth < 0  # the depth of overlapping pieces is arbitrary, their distance is not
        self._found(
            jumps,
            lambda i: f"depth is {r.depth[i]:.9g}; the second shape moved by {moved[i]:.3g} it is {after.depth[i]:.9g}",
            "apart, depth is minus the distance, or minus something smaller: fast bodies would pass through else",
        )

    def _turned_round(self, r: Any) -> None:
        """Two of one shape, with the roles exchanged."""
        back = self.code(self.poses.b, self.poses.a, -self.d)
        both = np.isfinite(r.depth) & np.isfinite(back.depth)
        with np.errstate(invalid="ignore"):
            unequal = both & (np.abs(r.depth - back.depth) > 2 * self.tolerance)
        cure = "write the function so that a and b may change places: depth stays, normal turns round"
        self._found(
            unequal,
            lambda i: f"depth is {r.depth[i]:.9g}, and seen from the other shape {back.depth[i]:.9g}",
            cure,
        )
        along = (r.normal * back.normal).sum(axis=1)
        # With level centres either direction is right.
        level = (np.abs(self.d) <= 1e-6 * self.poses.scale()[:, None]).any(axis=1)
        self._found(
            both & ~unequal & ~level & (along > UNIT),
            lambda i: f"the normal is {numbers_shown(r.normal[i])}, and seen from the other shape "
            f"{numbers_shown(back.normal[i])}",
            cure,
        )
        if not self.by_hand:
            return
        gap = np.abs(back.point - (r.point - self.d)).max(axis=1)
        same = (r.depth >= 0) & (along < -1 + 1e-9)
        slip = same & (gap > np.abs(r.depth) + self.tolerance)
        slip &= slip.sum() > 0.5 * same.sum()  # for touching faces any point of them is right
        self._found(
            slip,
            lambda i: f"the points of contact seen from both sides are {gap[i]:.6g} apart",
            "point counts from the centre of the first shape, and lies in the middle of the overlap",
        )

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

        def show(i: int) -> str:
            return f"{pose_shown(poses, i)}, v = {numbers_shown(v[i])}"

        cure = "time, from 0 to 1, is the part of v after which they touch for the first time"
        wrong = hit & ~((time >= 0) & (time <= 1))
        self.subject.found(wrong, lambda i: f"the sweep's time is {time[i]!r}", show, cure)
        until = np.where(hit & ~wrong, time, 1.0)
        speed = np.sqrt((v * v).sum(axis=1))
        slack = tolerance + 1e-9 * speed
        deepest = np.full(len(d), -np.inf)
        for part in np.linspace(0, 1, PATH, endpoint=False):
            depth = self.code(poses.a, poses.b, d + (part * until)[:, None] * v).depth
            deepest = np.maximum(deepest, np.where(np.isnan(depth), -np.inf, depth))
        at_end = self.code(poses.a, poses.b, d + until[:, None] * v).depth
        late = deepest > slack
        self.subject.found(
            late, lambda i: f"on the way to time {until[i]:.9g} they overlap by {deepest[i]:.6g} already", show, cure
        )
        off = hit & ~wrong & ~late & ~(np.abs(at_end) <= slack)
        self.subject.found(
            off, lambda i: f"at the sweep's time {time[i]:.9g} they do not touch: depth {at_end[i]:.6g}", show, cure
        )

    # -- help -------------------------------------------------------------------------------------

    def _evaluate(self, d: np.ndarray) -> Any:
        return self.code(self.poses.a, self.poses.b, d)

    def _said(self, r: Any, i: int) -> str:
        depth = float(r.depth[i])
        return f"({bool(r.hit[i])}, {depth!r}, {numbers_shown(r.normal[i])}, {numbers_shown(r.point[i])})"

    def _found(self, bad: np.ndarray, what: Any, cure: str) -> None:
        self.subject.found(bad, what, lambda i: pose_shown(self.poses, i), cure)

    def _found_one(self, at: int, what: str, cure: str) -> None:
        bad = np.zeros(len(self.d), bool)
        bad[at] = True
        self._found(bad, lambda _: what, cure)
        self.subject.findings[-1].share = ""
