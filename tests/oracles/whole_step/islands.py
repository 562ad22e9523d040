"""The oracle's rigid contacts. The solver repeats its passes over their islands until these agree; here the result is
calculated: normal impulses that only push, and only where the speed of their contact is what it has to be.

That is a linear complementarity problem. The solver stops when a pass
changes an impulse by less than a tolerance. How far it may then be from the result follows from the matrix: ``slack``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from carom.lab.measure.body_shapes import Floats

from .bodies import Body
from .rest import OPPOSED, RATIO, ROUNDING, SAG, Moving, Resting

Flags = np.ndarray[Any, np.dtype[np.bool_]]

MOST_SAG, MOST_DEEP_SAG = 0.02, 0.004  # of the size: contacts that would sag more are rigid; those that are deep
CONVERGED, STEADY = 1e-5, 1e-3  # of the size per substep, of the speed by forces in it: the smaller is the tolerance
SURE = 4.0  # times the slack that follows from the matrix for one pass
SINGULAR = 1e-12  # of a diagonal of 1: what is smaller is rounding
ZERO = 1e-11  # of the largest speed: contacts that neither push nor open


def choose_rigid(contacts: Sequence[Resting], bodies: dict[Body, Moving], h: float) -> None:
    """Decide which contacts are rigid, and number the islands that have some; others have the island -1."""
    islands = _connected(contacts)
    uneven = [island for island in islands if any(map(_is_uneven, island))]
    for contact in (contact for island in uneven for contact in island):
        sag = SAG * contact.impulse * h / contact.pair.mass
        most = (MOST_DEEP_SAG if contact.deep else MOST_SAG) * contact.pair.size
        near = ROUNDING + SAG * contact.slack * h / contact.pair.mass / most
        contact.doubtful |= abs(sag - most) <= near * most and not contact.rigid
        contact.rigid |= sag > most
    number = 0
    for contact in contacts:
        contact.island = -1
    for island in islands:
        if any(contact.rigid for contact in island) and not _is_squeezed(island):
            for contact in island:
                contact.island = number
            number += 1


def _connected(contacts: Sequence[Resting]) -> list[list[Resting]]:
    """The contacts in groups that share bodies which can be moved, in the order of the first of each."""
    groups, left = [], list(contacts)
    while left:
        reached, group, todo = set(), [], [left[0]]
        while todo:
            one = todo.pop()
            left.remove(one)
            group.append(one)
            reached |= {body for body in one.pair.bodies if body.inverse_mass > 0.0}
            todo = [c for c in left if reached.intersection(c.pair.bodies)]
        groups.append([contact for contact in contacts if any(contact is each for each in group)])
    return groups


def _is_uneven(contact: Resting) -> bool:
    heavy, light = sorted(body.inverse_mass for body in contact.pair.bodies)
    return heavy > 0.0 and light >= RATIO * heavy


def _is_squeezed(island: Sequence[Resting]) -> bool:
    """Whether something that moves by itself pushes against something else that cannot be moved."""
    fixed = []
    for contact in island:
        for body, out in zip(contact.pair.bodies, (contact.normal, -contact.normal), strict=True):
            if body.inverse_mass == 0.0:
                fixed.append((out, float(body.velocity @ out)))
    pushing = [out for out, speed in fixed if speed > 0.0]
    return bool(pushing) and any(float(out @ pushing[0]) < OPPOSED for out, _ in fixed)


def islands_of(contacts: Sequence[Resting]) -> list[list[Resting]]:
    """The contacts of each island with rigid ones."""
    numbers = sorted({contact.island for contact in contacts} - {-1})
    return [[contact for contact in contacts if contact.island == number] for number in numbers]


def agree(chosen: Sequence[Resting], bodies: dict[Body, Moving], h: float, biased: bool, softness: float) -> None:
    """Give the chosen contacts of an island the impulses that solve all of them at once, the others keep theirs.

    softness: speed that a soft contact gives way by, times its mass, per impulse; none in blocks, which are rigid.
    """
    if not chosen:
        return
    give = [softness / c.pair.mass if biased and c.soft and not c.in_block else 0.0 for c in chosen]
    problem = Problem(chosen, bodies, np.array(give))
    old = np.array([contact.impulse for contact in chosen])
    speed = np.empty(len(chosen))
    for k, contact in enumerate(chosen):
        a, b = (bodies[body] for body in contact.pair.bodies)
        speed[k] = float((b.velocity - a.velocity) @ contact.normal) + (contact.pushing if biased else contact.opening)
    pull = speed + problem.give * old - problem.matrix @ old  # what the contacts ask without any impulse
    # all contacts alike: 1 on the diagonal
    even, pull = problem.matrix * np.outer(problem.scale, problem.scale), problem.scale * pull
    new, pushes, exists = _complementary(even, pull, old > 0.0)
    change = problem.velocities(problem.scale * new - old)
    for body, dv in zip(problem.movable, change, strict=True):
        bodies[body].velocity = bodies[body].velocity + dv
    for contact, impulse in zip(chosen, problem.scale * new, strict=True):
        contact.impulse = float(impulse)
    rows = _rows(pushes | (even @ new + pull <= ZERO * float(np.abs(pull).max())))
    if not exists or np.linalg.matrix_rank(even[np.ix_(rows, rows)], 1e-9) < len(rows):
        for row in rows:
            chosen[row].doubtful = True  # other impulses give the same motion, or none is right
    _note_slack(problem, even, _rows(pushes), h)


class Problem:
    """How impulses at contacts change the speeds along their normals."""

    def __init__(self, contacts: Sequence[Resting], bodies: dict[Body, Moving], give: Floats) -> None:
        self.contacts, self.bodies, self.give = contacts, bodies, give
        self.movable = [body for body in {b: None for c in contacts for b in c.pair.bodies} if body.inverse_mass > 0.0]
        d, place = len(contacts[0].normal), {body: k for k, body in enumerate(self.movable)}
        effect = np.zeros((len(contacts), len(self.movable), d))  # of the bodies' velocities on those speeds
        for k, contact in enumerate(contacts):
            for body, sign in zip(contact.pair.bodies, (-1.0, 1.0), strict=True):
                if body in place:
                    effect[k, place[body]] = sign * contact.normal
        self.of_impulse = effect * np.array([body.inverse_mass for body in self.movable])[:, None]
        self.matrix = np.tensordot(self.of_impulse, effect, ([1, 2], [1, 2])) + np.diag(give)
        self.scale = 1.0 / np.sqrt(np.diag(self.matrix))

    def velocities(self, impulses: Floats) -> Floats:
        """What impulses at the contacts add to the velocities of the movable bodies."""
        return np.tensordot(impulses, self.of_impulse, 1)


def _note_slack(problem: Problem, even: Floats, rows: list[int], h: float) -> None:
    """If the last pass still changes the impulses by x, it leaves an error of matrix^-1 (what is above its diagonal) x,
    for the contacts that push: ``rows``."""
    contacts, bodies, scale = problem.contacts, problem.bodies, problem.scale
    last = np.empty(len(rows))
    for k, contact in enumerate(contacts[row] for row in rows):
        forces = max(float(np.linalg.norm(bodies[body].acceleration)) for body in contact.pair.bodies)
        speed = min(CONVERGED * contact.pair.size / h, STEADY * forces * h)
        last[k] = speed * contact.pair.mass / scale[rows[k]]
    within = even[np.ix_(rows, rows)]
    wrong = scale[rows, None] * (np.linalg.pinv(within) @ (within - np.diag(np.diag(within))))
    for row, slack in zip(rows, np.abs(wrong) @ last, strict=True):
        contacts[row].slack = max(contacts[row].slack, SURE * float(slack))
    speeds = np.abs(np.tensordot(wrong, problem.of_impulse[rows], ([0], [0])))  # (rows, bodies, d)
    for body, slack in zip(problem.movable, np.tensordot(last, speeds, 1).max(axis=1), strict=True):
        bodies[body].slack = max(bodies[body].slack, SURE * float(slack))


def _complementary(matrix: Floats, pull: Floats, likely: Flags) -> tuple[Floats, Flags, bool]:
    """x >= 0 with matrix x + pull >= 0, one of each pair 0; where x > 0; whether there is such an x. likely: where x
    may be above 0.

    The most violated x grows until its row is satisfied, while the rows of the others stay so; an x that becomes 0 on
    the way leaves these.
    """
    n = len(pull)
    limit = 1e-14 * n * float(np.abs(pull).max())
    held = _rows(likely)
    x = _solution(matrix, pull, held)
    excess = matrix @ x + pull
    if (x >= 0.0).all() and (excess >= -limit).all() and (np.abs(excess[held]) <= limit).all():
        return x, likely, True
    x, rows = np.zeros(n), list[int]()
    for _ in range(20 * n):
        excess = matrix @ x + pull
        excess[rows] = 0.0
        k = int(excess.argmin())
        rate = float(excess[k])
        if rate >= -limit:
            break
        while True:
            way = np.linalg.solve(matrix[np.ix_(rows, rows)], -matrix[rows, k])
            curvature = float(matrix[k, k] + matrix[k, rows] @ way)
            full = -rate / curvature if curvature > SINGULAR else math.inf
            ends = [x[row] / -step if step < 0.0 else math.inf for row, step in zip(rows, way, strict=True)]
            far = min([full, *ends])
            if math.isinf(far):
                return x, x > 0.0, False
            x[k], x[rows], rate = x[k] + far, np.maximum(0.0, x[rows] + far * way), rate + far * curvature
            if far == full:
                rows.append(k)
                x = np.maximum(0.0, _solution(matrix, pull, rows))
                break
            x[rows.pop(ends.index(far))] = 0.0
    pushes = np.zeros(n, bool)
    pushes[rows] = True
    return x, pushes, True


def _rows(flags: Flags) -> list[int]:
    return [row for row, flag in enumerate(flags.tolist()) if flag]


def _solution(matrix: Floats, pull: Floats, rows: list[int]) -> Floats:
    """x with matrix x + pull = 0 in these rows, 0 in the others."""
    x = np.zeros(len(pull))
    if len(rows):
        x[rows] = np.linalg.lstsq(matrix[np.ix_(rows, rows)], -pull[rows], rcond=SINGULAR)[0]
    return x
