"""``carom plugins check``: compile a plugin's functions and call them with thousands of random and extreme inputs."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable
from typing import Any

import numpy as np

from ...components import RigidBody, SphereCollider, Transform
from ...framework import CaromError, Convex, Plugin, PluginError, Settings, World
from ...framework.jit.lazy import errors
from ...framework.plugins.checks import check_mixed
from ...framework.plugins.registry import Pair, Registry, Shape
from ...plugins import Physics
from ..cli.usage_errors import one_line
from .joint_checks import check_joint
from .kernels import RaisedError, SupportCode, compiler_message
from .pair_checks import TOLERANCE, PairChecks
from .samples import ORDINARY, Finding, Report, Rows, Subject, directions, poses, row_shown, rows

BOXES = 400  # boxes given to a broad phase
STEPS = 3
ALIKE = "use what both know: numbers and tuples, math, carom.framework.vectors; no global that changes"


def check_plugin(plugin: Plugin, others: list[Plugin], progress: Callable[[str], None] = lambda what: None) -> Report:
    """Check all shapes, pairs and other functions of a plugin.

    others: plugins whose shapes its pairs need, besides the built-in ones
    progress: called with the name of each check before it runs
    """
    report = Report(plugin.name)
    registry = Registry()
    built_in = bool(set(Physics().shapes) & set(plugin.shapes))
    for each in (*([] if built_in else [Physics()]), *others, plugin):
        registry.add(each)
    for component, shape in plugin.shapes.items():
        for dimensions in _dimensions(component):
            _attempt(report.subject("shape", component.__name__, dimensions), progress,
                     lambda subject, s=shape, d=dimensions: _check_shape(subject, s, d))  # fmt: skip
    for first, second in _pairs(plugin, registry):
        for dimensions in sorted(set(_dimensions(first)) & set(_dimensions(second))):
            _attempt(report.subject("pair", f"{first.__name__} and {second.__name__}", dimensions), progress,
                     lambda subject, a=first, b=second: _check_pair(subject, registry, plugin, a, b))  # fmt: skip
    for first, second in plugin.pairs:
        strangers = [c.__name__ for c in (first, second) if c is not Convex and c not in registry.shapes]
        if strangers:
            subject = report.subject("pair", f"{first.__name__} and {second.__name__}")
            subject.note = f"not checked: no plugin here has the shape {' or '.join(strangers)}"
    _missing(report, plugin, registry)
    for name, rule in plugin.mixing_rules.items():
        _attempt(report.subject("mixing rule", name), progress, lambda subject, f=rule: _check_mixing(subject, f))
    for component, joint in plugin.joints.items():
        for dimensions in _dimensions(component):
            _attempt(report.subject("joint", component.__name__, dimensions), progress,
                     lambda subject, j=joint, d=dimensions: check_joint(subject, j, d))  # fmt: skip
    for name, made in plugin.broad_phases.items():
        for dimensions in (2, 3):
            _attempt(report.subject("broad phase", name, dimensions), progress,
                     lambda subject, m=made: _check_broad_phase(subject, m))  # fmt: skip
    if not built_in and not report.findings:  # a world would only report the same findings in other words
        known = {d for component in plugin.shapes for d in _dimensions(component)} or {2, 3}
        for integrator in plugin.integrators or (None,):
            for dimensions in sorted(known):
                what = f"with integrator {integrator}" if integrator else "with it"
                _attempt(report.subject("world", what, dimensions), progress,
                         lambda subject, i=integrator: _check_world(subject, plugin, others, i))  # fmt: skip
    return report


def _attempt(subject: Subject, progress: Callable[[str], None], check: Callable[[Subject], None]) -> None:
    """Run a check; convert any exception of plugin code to a finding."""
    progress(subject.place)
    try:
        check(subject)
    except errors.NumbaError as error:
        subject.findings.append(
            Finding(f"it does not compile: {compiler_message(error)}", "every input",
                    "use what numba compiles: numbers and tuples, math, carom.framework.vectors, helpers marked "
                    "@plugin.kernel; return the same types on every way")
        )  # fmt: skip
    except PluginError as error:
        subject.findings.append(Finding(one_line(error), "the values above", "return what the message asks for"))
    except Exception as error:  # plugin code may raise anything; the report shows it
        subject.findings.append(Finding(f"it raised {one_line(error)}", "see the message", "correct what raises"))


def _pairs(plugin: Plugin, registry: Registry) -> list[tuple[type[Any], type[Any]]]:
    """The registered pairs, and all pairs of its shapes with each other and with all others here, each once."""
    found: dict[Any, tuple[type[Any], type[Any]]] = {}
    for first in registry.shapes:
        for second in registry.shapes:
            pair = registry.pair(first, second)
            if pair is not None and (pair.plugin == plugin.name or {first, second} & set(plugin.shapes)):
                found.setdefault(frozenset((first, second)), (pair.first, pair.second))
    return list(found.values())


def _dimensions(component: Any) -> tuple[int, ...]:
    return tuple(getattr(component, "dimensions", (2, 3)))


# -- shapes and pairs -----------------------------------------------------------------------------


def _check_pair(subject: Subject, registry: Registry, plugin: Plugin, first: Any, second: Any) -> None:
    pair = registry.pair(first, second)
    assert isinstance(pair, Pair)
    assert subject.dimensions is not None
    shapes = registry.shapes[pair.first], registry.shapes[pair.second]
    by_hand = pair.plugin == plugin.name
    if pair.helpers:
        subject.note = "by its support function" if not by_hand else "as one of the convex"
    PairChecks(subject, pair, shapes, poses(*shapes, subject.dimensions, 1), by_hand).run()


def _check_shape(subject: Subject, shape: Shape, dimensions: int) -> None:
    """Bounds enclose the shape; support is the farthest point; rounding is a radius."""
    rng = np.random.default_rng((2, dimensions))
    scale = np.repeat((1.0, 1e-9, 1e9), (ORDINARY, ORDINARY // 10, ORDINARY // 10))
    made = rows(shape, scale, rng.random(len(scale)) < 0.2, dimensions, rng)
    subject.inputs = len(scale)
    cure = "half extents are numbers of at least 0, or inf where the shape has no end"
    wrong = ~(made.half >= 0).min(axis=1)  # also true for nan
    subject.found(wrong, "bounds returned {}", lambda i: row_shown(made, i), cure, made.half)
    said = made.half.copy()
    for i in range(0, len(said), 100):
        said[i] = shape.component.bounds(made.at(i), dimensions)  # type: ignore[attr-defined]
    other = ~np.isclose(said, made.half, rtol=TOLERANCE, atol=0, equal_nan=True).min(axis=1)
    what = "compiled, bounds are {}, as plain Python {}"
    subject.found(other, what, lambda i: row_shown(made, i), ALIKE, made.half, said)
    if shape.support is not None:
        _check_support(subject, made, rng)


def _check_support(subject: Subject, made: Rows, rng: np.random.Generator) -> None:
    n, dimensions = made.half.shape
    code = SupportCode(made.shape, dimensions)
    look, other = directions(n, dimensions, rng), directions(n, dimensions, rng)
    upright = rng.random(n) < 0.2
    look[upright] = np.eye(dimensions)[rng.integers(dimensions, size=int(upright.sum()))]
    try:
        (point, beyond), (elsewhere, _), (long, _) = (code(made, way) for way in (look, other, 1e6 * look))
    except RaisedError as error:
        what, cure = f"support or rounding raised {error}", "support takes any direction, of any length but 0"
        subject.findings.append(Finding(what, row_shown(made, error.at), cure))
        return

    def found(bad: np.ndarray, what: str, cure: str, *values: np.ndarray) -> None:
        show = lambda i: f"{row_shown(made, i)}, direction = {tuple(look[i].tolist())}"  # noqa: E731
        subject.found(bad, what, show, cure, *values)

    finite = np.isfinite(point).all(axis=1) & np.isfinite(beyond) & (beyond >= 0)
    found(~finite, "support is {}, rounding {}", "both are finite, and rounding is at least 0", point, beyond)
    slack = TOLERANCE * (np.abs(point).max(axis=1) + beyond)
    out = (np.abs(point) + beyond[:, None] > made.half + slack[:, None]).any(axis=1)
    what = "support {} and rounding {:.6g} reach beyond the bounds {}"
    cure = "make bounds enclose the whole shape (for turned shapes: use shape.axes), or correct support"
    found(finite & out, what, cure, point, beyond, made.half)
    here, there, far = ((end * look).sum(axis=1) for end in (point, elsewhere, long))
    what = "support is {}, but for another direction it is {}, which is farther this way too"
    cure = "return the point whose product with the direction is largest"
    found(finite & (there > here + slack), what, cure, point, elsewhere)
    what = "support is {}, for a direction of another length {}"
    cure = "the direction has any length: do not use it as a unit vector"
    found(finite & (np.abs(far - here) > slack), what, cure, point, long)


# -- other things ---------------------------------------------------------------------------------


def _check_mixing(subject: Subject, rule: Any) -> None:
    """As at its registration, with many more values."""
    rng = np.random.default_rng(3)
    values = np.concatenate((rng.uniform(0, 1, (1000, 2)), 10.0 ** rng.uniform(-9, 9, (200, 2))))
    subject.inputs = len(values)
    check_mixed("it", rule, values.tolist())


def _check_broad_phase(subject: Subject, make: Any) -> None:
    """Compare with all pairs, tested one by one."""
    assert subject.dimensions is not None
    rng = np.random.default_rng(4)
    for count in (0, 1, 2, BOXES):
        centre = rng.uniform(-10, 10, (count, subject.dimensions)) * rng.choice((0.1, 1.0), (count, 1))
        half = 10.0 ** rng.uniform(-2, 0.5, (count, subject.dimensions))
        lower, upper, moving = centre - half, centre + half, (count + 1) // 2
        if count == BOXES:
            lower[7] = np.nan
        subject.inputs += count
        over = ((lower[:, None] <= upper[None]) & (lower[None] <= upper[:, None])).all(axis=2)
        expected = {(int(i), int(j)) for i, j in np.argwhere(np.triu(over, 1)) if i < moving}
        first, second = make().pairs(lower, upper, moving)
        made = Counter(zip(*(np.sort((np.asarray(first), np.asarray(second)), axis=0).tolist()), strict=True))
        for what, wrong in (
            ("misses", expected - set(made)),
            ("makes twice", {pair for pair, times in made.items() if times > 1}),
            ("makes of bodies at rest, or of one body,", {p for p in made if p[0] >= moving or p[0] == p[1]}),
        ):
            if wrong:
                i, j = min(wrong)
                boxes = f"{lower[i].tolist()} to {upper[i].tolist()} and {lower[j].tolist()} to {upper[j].tolist()}"
                subject.findings.append(
                    Finding(f"it {what} the pair of rows {i} and {j}",
                            f"{count} boxes, {moving} of them moving; {boxes}",
                            "return each pair of rows whose boxes overlap once, at least one of both below moving",
                            f"{len(wrong)} pairs")
                )  # fmt: skip


def _check_world(subject: Subject, plugin: Plugin, others: list[Plugin], integrator: str | None) -> None:
    """A world with the plugin takes steps; bodies of all its shapes meet in it if all pairs are handled."""
    assert subject.dimensions is not None
    d = subject.dimensions
    settings = Settings(integrator=integrator) if integrator else Settings()
    shapes: list[Any] = [SphereCollider, *(c for c in plugin.shapes if d in _dimensions(c))]
    where = f"bodies with {', '.join(shape.__name__ for shape in shapes)}"
    physics = Physics(d, gravity=(0.0, -9.81, 0.0)[:d])
    with contextlib.closing(World(physics, *others, plugin, settings=settings)) as world:
        pairs = [(a, b) for a in shapes for b in shapes if world.registry.pair(a, b) is None]
        for index, shape in enumerate(shapes):
            for height in (0.0, 1.0):
                body = RigidBody(kind="dynamic" if height else "static")
                collider = shape.sample(restitution=0.5, mask=0 if pairs else -1)
                world.create_entity(Transform((3.0 * index, height, 0.0)[:d]), body, collider)
        problems = []
        try:
            for _ in range(STEPS):
                world.step()
        except CaromError as error:
            problems.append(f"a step failed: {one_line(error)}")
        problems += [fault for fault in world.faults if "no room" not in fault]  # shapes without end overlap all others
    subject.inputs = STEPS
    subject.findings += [Finding(problem, where, "see the message") for problem in problems]


def _missing(report: Report, plugin: Plugin, registry: Registry) -> None:
    """Note pairs of its shapes that have no handler: no error, because such shapes may be meant never to meet."""
    for component in plugin.shapes:
        lacking = [other.__name__ for other in registry.shapes if registry.pair(component, other) is None]
        if lacking:
            report.subject("shape", component.__name__).note = f"no pair with {', '.join(lacking)}"
