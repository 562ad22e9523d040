"""``carom plugins check``: compile a plugin's functions and try the laws on thousands of random and extreme inputs."""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import repeat
from typing import Any

import numpy as np

from ...components import RigidBody, SphereCollider, Transform
from ...framework import CaromError, Convex, Plugin, PluginError, Settings, World
from ...framework.jit.lazy import is_of_compiler
from ...framework.plugins.checks import HELPERS, PlainFunction, laws_of_outline
from ...framework.plugins.laws import Law, Trial, pair_laws, shape_laws, sweep_laws
from ...framework.plugins.registry import Pair, Registry, Shape
from ...plugins import Physics
from ..cli.usage_errors import Problem, one_line
from .joint_checks import ALIKE, joint_laws_of
from .kernels import PairCode, RaisedError, compiler_message, support_of
from .samples import Numbers, all_examples, poses, rows, simplest

BOXES = 400  # boxes given to a broad phase
STEPS = 3
PLAIN = 240  # inputs that are also tried as plain Python, which is slow
COMPILES = (
    "use what numba compiles: numbers and tuples, math, carom.framework.vectors, helpers marked @plugin.kernel; return "
    "the same types on every way"
)
RAISED = "return a result for every input; a miss is (False, -gap, normal, point)"
# Laws on examples, and the text that shows one of their inputs.
Tried = tuple[Iterable[Law], Callable[[int], str]]


@dataclass
class Checked:
    """A shape, pair or other function, in one dimension; what is wrong, for which input, and the cure."""

    kind: str
    name: str
    dimensions: int | None = None
    inputs: int = 0
    finding: tuple[str, str, str] | None = None
    note: str = ""

    @property
    def place(self) -> str:
        return f"{self.kind} {self.name}" + (f", {self.dimensions}D" if self.dimensions else "")

    def try_laws(self, tried: Callable[[np.ndarray], Tried]) -> None:
        """Find a law that examples break, and the simplest input that breaks it."""
        laws, shown = tried(all_examples())
        law = self._broken(laws)
        if law is None:
            return
        what, share = law.what, f"{law.broken.sum()} of {len(law.broken)}"
        example = simplest(lambda example: self._broken(tried(example)[0], what))
        if example is not None:
            laws, shown = tried(example)
            law = self._broken(laws, what) or law
        row = int(np.argmax(law.broken))
        self.finding = f"{law.said(row)} ({share})", shown(row), law.cure

    def _broken(self, laws: Iterable[Law], what: str = "") -> Law | None:
        """The first law that is broken; the one that says that, if anything breaks it."""
        with np.errstate(all="ignore"):
            try:
                for law in laws:
                    self.inputs = max(self.inputs, len(law.broken))
                    if law.what == what:
                        return law if law.broken.any() else None
                    if not what and law.is_broken:
                        return law
            except RaisedError as error:
                self.inputs = max(self.inputs, len(error.texts))
                at = np.arange(len(error.texts)) == error.at
                law = Law(at, "the compiled function raised {}", RAISED, (error.texts,))
                return law if what in ("", law.what) else None
        return None


def check_plugin(plugin: Plugin, others: list[Plugin], progress: Callable[[str], None] = lambda what: None) -> Any:
    """Check all shapes, pairs and other functions of a plugin; a list of :class:`Checked`.

    others: plugins whose shapes its pairs need, besides the built-in ones
    progress: called with the name of each check before it runs
    """
    report: list[Checked] = []
    registry = Registry()
    built_in = bool(set(Physics().shapes) & set(plugin.shapes))
    for each in (*([] if built_in else [Physics()]), *others, plugin):
        registry.add(each)

    def check(kind: str, name: str, dimensions: Iterable[int], run: Callable[[Checked], None]) -> None:
        for d in dimensions:
            report.append(Checked(kind, name, d))
            progress(report[-1].place)
            _attempt(report[-1], run)

    shapes: dict[Any, Shape] = dict(plugin.shapes)
    for component, shape in shapes.items():
        check("shape", component.__name__, component.dimensions, partial(_check_shape, shape))
    for pair in _pairs(plugin, registry):
        common = sorted({*pair.first.dimensions} & {*pair.second.dimensions})
        check("pair", pair.names, common, partial(_check_pair, registry, plugin, pair))
    for pair in plugin.pairs.values():
        strangers = [c.__name__ for c in (pair.first, pair.second) if c is not Convex and c not in registry.shapes]
        if strangers:
            note = f"not checked: no plugin here has the shape {' or '.join(strangers)}"
            report.append(Checked("pair", pair.names, note=note))
    for component in plugin.shapes:  # no error: such shapes may be meant never to meet
        lacking = [other.__name__ for other in registry.shapes if registry.pair(component, other) is None]
        if lacking:
            report.append(Checked("shape", component.__name__, note=f"no pair with {', '.join(lacking)}"))
    joints: dict[Any, Any] = dict(plugin.joints)
    for component, joint in joints.items():
        check("joint", component.__name__, component.dimensions, partial(_check_joint, joint))
    for name, made in plugin.broad_phases.items():
        check("broad phase", name, (2, 3), partial(_check_broad_phase, made))
    if not built_in and not any(each.finding for each in report):  # a world would only tell the same in other words
        known = {d for component in shapes for d in component.dimensions} or {2, 3}
        for integrator in plugin.integrators or ("",):
            what = f"with integrator {integrator}" if integrator else "with it"
            check("world", what, sorted(known), partial(_check_world, plugin, others, integrator))
    return report


def _attempt(checked: Checked, check: Callable[[Checked], None]) -> None:
    """Run a check; convert any exception of plugin code to a finding."""
    try:
        check(checked)
    except Problem:
        raise
    except PluginError as error:
        checked.finding = one_line(error), "the values above", "return what the message asks for"
    except Exception as error:  # plugin code may raise anything; the report shows it
        if is_of_compiler(error):
            checked.finding = f"it does not compile: {compiler_message(error)}", "every input", COMPILES
            return
        checked.finding = f"it raised {one_line(error)}", "see the message", "correct what raises"


# -- shapes and pairs -----------------------------------------------------------------------------


def _pairs(plugin: Plugin, registry: Registry) -> list[Pair]:
    """The registered pairs, and all pairs of its shapes with each other and with all others here, each once."""
    found: dict[Any, Pair] = {}
    for first in registry.shapes:
        for second in registry.shapes:
            pair = registry.pair(first, second)
            if pair is not None and (pair.plugin == plugin.name or {first, second} & set(plugin.shapes)):
                found.setdefault(frozenset((first, second)), pair)
    return list(found.values())


def _check_pair(registry: Registry, plugin: Plugin, pair: Pair, checked: Checked) -> None:
    dimensions: Any = checked.dimensions
    shapes = registry.shapes[pair.first], registry.shapes[pair.second]
    own = pair.plugin == plugin.name
    if pair.helpers:
        checked.note = "as one of the convex" if own else "by its support function"
    code = PairCode(pair, *shapes, dimensions)

    def tried(examples: np.ndarray) -> Tried:
        p = poses(*shapes, dimensions, examples)
        convex = all(shape.support is not None for shape in shapes)
        trial = Trial(
            code, code.sweep if pair.sweep else None, p.a, p.b, p.d, (p.a.half, p.b.half), p.steps, p.ways,
            (partial(support_of, p.a), partial(support_of, p.b)) if convex else None,
            pair.first is pair.second, own,
        )  # fmt: skip
        return _laws_of_pair(trial, pair), p.shown

    checked.try_laws(tried)


def _laws_of_pair(trial: Trial, pair: Pair) -> Iterator[Law]:
    yield from pair_laws(trial)
    if not trial.own:
        return
    n, d, slack = min(len(trial.d), PLAIN), trial.d.shape[1], trial.tolerance[:PLAIN, None]
    names = ("a", "b", "d", *HELPERS[len(pair.helpers) // 2])
    called = PlainFunction("as plain Python", pair.function, names, "(hit, depth, normal, point)", bool, float, d, d)
    a, b = ([rows.at(row) for row in range(n)] for rows in (trial.a, trial.b))
    there = called(a, b, trial.d[:n], *map(repeat, pair.helpers))
    here = [part[:n] for part in trial.contacts(trial.d)]
    apart, turned, off = (np.abs(one - other).reshape(n, -1) for one, other in zip(here[1:], there[1:], strict=True))
    alike = (apart <= slack).all(axis=1) & (turned <= 1e-9).all(axis=1) & (off <= slack).all(axis=1)
    what = "compiled it returns ({}, {}, {}, {}), as plain Python ({}, {}, {}, {})"
    yield Law(~alike & (here[0] | there[0] | np.isfinite(here[1])), what, ALIKE, (*here, *there))
    if trial.sweep is not None:
        yield from sweep_laws(trial)


def _check_shape(shape: Shape, checked: Checked) -> None:
    dimensions: Any = checked.dimensions

    def tried(examples: np.ndarray) -> Tried:
        sizes = np.tile((1.0, 1e-9, 1e9), len(examples))
        numbers = Numbers(np.repeat(examples, 3, axis=0))
        made = rows(shape, sizes, dimensions, numbers)
        support = None if shape.support is None else partial(support_of, made)
        look, other = numbers.directions(dimensions), numbers.directions(dimensions)

        def laws() -> Iterator[Law]:
            yield from shape_laws(made.half, support, look, other)
            component: Any = shape.component
            there = np.array([component.bounds(made.at(row), dimensions) for row in range(len(sizes[:PLAIN]))], float)
            alike: Any = np.isclose(there, made.half[:PLAIN], rtol=1e-9, atol=0, equal_nan=True).all(axis=1)
            yield Law(~alike, "compiled, bounds are {}, as plain Python {}", ALIKE, (made.half, there))
            axes = {"axes": tuple(map(tuple, np.eye(dimensions)))} if shape.rotates else {}
            upright = [made.at(row)._replace(**axes) for row in range(len(there))]
            yield from laws_of_outline(checked.place, component, upright, dimensions)

        return laws(), made.shown

    checked.try_laws(tried)


# -- other things ---------------------------------------------------------------------------------


def _check_joint(joint: Any, checked: Checked) -> None:
    checked.try_laws(partial(joint_laws_of, joint, checked.dimensions or 2))


def _check_broad_phase(make: Any, checked: Checked) -> None:
    """Compare with all pairs, tested one by one."""
    rng, d = np.random.default_rng(4), checked.dimensions or 2
    for count in (0, 1, 2, BOXES):
        centre = rng.uniform(-10, 10, (count, d)) * rng.choice((0.1, 1.0), (count, 1))
        half = 10.0 ** rng.uniform(-2, 0.5, (count, d))
        lower, upper, moving = centre - half, centre + half, (count + 1) // 2
        if count == BOXES:
            lower[7] = np.nan
        checked.inputs += count
        over = ((lower[:, None] <= upper[None]) & (lower[None] <= upper[:, None])).all(axis=2)
        expected = {(int(i), int(j)) for i, j in np.argwhere(np.triu(over, 1)) if i < moving}
        made = Counter(zip(*np.sort(make().pairs(lower, upper, moving), axis=0).tolist(), strict=True))
        wrong = [pair for pair in expected if made[pair] != 1]
        wrong += [(i, j) for (i, j), times in made.items() if times > 1 or i >= moving or i == j]
        if wrong:
            i, j = min(wrong)
            boxes = f"{lower[i].tolist()} to {upper[i].tolist()} and {lower[j].tolist()} to {upper[j].tolist()}"
            cure = "return each pair of rows whose boxes overlap once, at least one of both below moving"
            what = f"it makes the pair of rows {i} and {j} {made[i, j]} times ({len(wrong)} pairs)"
            checked.finding = what, f"{count} boxes, {moving} of them moving; {boxes}", cure
            return


def _check_world(plugin: Plugin, others: list[Plugin], integrator: str, checked: Checked) -> None:
    """A world with the plugin takes steps; bodies of all its shapes meet in it if all pairs are handled."""
    d = checked.dimensions or 2
    settings = Settings(integrator=integrator) if integrator else Settings()
    shapes: list[Any] = [SphereCollider, *(c for c in plugin.shapes if d in c.dimensions)]  # type: ignore[attr-defined]
    where = f"bodies with {', '.join(shape.__name__ for shape in shapes)}"
    physics = Physics(d, gravity=(0.0, -9.81, 0.0)[:d])
    with contextlib.closing(World(physics, *others, plugin, settings=settings)) as world:
        strange = any(world.registry.pair(a, b) is None for a in shapes for b in shapes)
        for index, shape in enumerate(shapes):
            for height in (0.0, 1.0):
                body = RigidBody(kind="dynamic" if height else "static")
                collider = shape.sample(restitution=0.5, mask=0 if strange else -1)
                world.create_entity(Transform((3.0 * index, height, 0.0)[:d]), body, collider)
        problems = []
        try:
            for _ in range(STEPS):
                world.step()
        except CaromError as error:
            problems.append(f"a step failed: {one_line(error)}")
        problems += [fault for fault in world.faults if "no room" not in fault]  # shapes without end overlap all others
    checked.inputs = STEPS
    if problems:
        checked.finding = "; ".join(problems), where, "see the message"
