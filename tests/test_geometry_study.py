"""The geometry study: the oracle against closed forms, the engine against the oracle, and the command."""

from __future__ import annotations

import json
import math

import click
import numpy as np
import pytest
from click.testing import CliRunner
from oracles import convex_brute

from carom.lab.cli.group import Commands
from carom.lab.cli.usage_errors import Problem
from carom.lab.studies.geometry import command as geometry_command
from carom.lab.studies.geometry import report as geometry_report
from carom.lab.studies.geometry import study as geometry_measure
from carom.lab.studies.geometry.objects import OBJECTS, Object, area, smallest_circle
from carom.lab.studies.geometry.picture import BY_NAME, EXAMPLES, draw_geometry
from carom.lab.studies.geometry.records import GeometryStudy
from carom.lab.studies.geometry.reference import expected_area, overlaps, placed, touching
from carom.lab.studies.geometry.study import OPTIONS
from carom.plugins.convex_polygon import wrong_with

pytestmark = pytest.mark.slow  # many runs: half a minute or more together

SQUARE = np.array(((-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)))
CHEAP = ("sphere", "box", "sphere then box")  # shared with other tests; polygons take long to compile
ROUND_AND_TALL = tuple(thing for thing in OBJECTS if thing.name in ("asteroid", "humanoid"))
every_object = pytest.mark.parametrize("thing", OBJECTS, ids=lambda thing: thing.name)


def sampling_error(share, hits):
    """Four standard errors of a share of that many."""
    return 4 * math.sqrt(share * (1 - share) / hits)


# -- the objects ---------------------------------------------------------------------------------


@every_object
def test_objects_are_convex_of_one_square_metre_and_held_by_circle_and_box(thing):
    assert wrong_with(thing.corners) is None
    assert area(thing.corners) == pytest.approx(1.0)
    np.testing.assert_allclose(thing.corners.min(axis=0), -thing.half_extents, atol=1e-15)
    centre, radius = thing.circle
    distances = np.linalg.norm(thing.corners - centre, axis=1)
    assert distances.max() <= radius
    assert (distances > radius * (1 - 1e-9)).sum() >= 2  # the smallest circle is held by two corners or more


@pytest.mark.parametrize(("points", "centre", "radius"), [
    (SQUARE, (0, 0), math.sqrt(0.5)),
    (((0, 0), (4, 0), (1, 0.5)), (2, 0), 2.0),  # an obtuse triangle: its longest side
    (((0, 1), (math.sqrt(0.75), -0.5), (-math.sqrt(0.75), -0.5)), (0, 0), 1.0),
    (((0, 0), (1, 0), (3, 0)), (1.5, 0), 1.5),  # on a line
])  # fmt: skip
def test_smallest_circles(points, centre, radius):
    found, size = smallest_circle(np.array(points, float))
    np.testing.assert_allclose(found, centre, atol=1e-12)
    assert size == pytest.approx(radius)
    with pytest.raises(ValueError, match="two or more, got 1"):
        smallest_circle(np.array(points, float)[:1])


# -- the oracle ----------------------------------------------------------------------------------


@pytest.mark.parametrize(("offset", "turn", "depth"), [
    ((0.9, 0.0), 0.0, 0.1), ((1.1, 0.0), 0.0, -0.1), ((0.9, 0.3), 0.0, 0.1),
    ((1.2, 0.0), math.pi / 4, 0.5 + math.sqrt(0.5) - 1.2), ((0.0, -1.3), math.pi / 4, 0.5 + math.sqrt(0.5) - 1.3),
])  # fmt: skip
def test_two_unit_squares(offset, turn, depth):
    one = placed(SQUARE, np.zeros((1, 2)), np.zeros(1))
    other = placed(SQUARE, np.array([offset]), np.array([turn]))
    assert overlaps(one, other) == pytest.approx(depth)
    assert overlaps(other, one) == pytest.approx(depth)


def test_unit_squares_in_circles():
    """Circles of radius sqrt(1/2) hit at offsets of area 2 pi; upright squares at 4, turned ones at 2 + 16 / (2 pi)."""
    square = Object("square", "", tuple(map(tuple, SQUARE)))
    assert expected_area(square, ("sphere",), False) == pytest.approx(2 * math.pi)
    assert expected_area(square, ("box",), False) == pytest.approx(4)
    assert expected_area(square, ("precise",), False) == pytest.approx(4)
    assert expected_area(square, ("precise",), True) == pytest.approx(2 + 8 / math.pi)
    assert expected_area(square, ("box",), True) == pytest.approx(2 + 4 / math.pi + 32 / math.pi**2)
    assert expected_area(square, ("sphere", "box"), True) is None


@every_object
@pytest.mark.parametrize("turned", [False, True])
def test_shares_of_random_offsets_are_ratios_of_areas(thing, turned):
    """Among circle hits, polygons hit in proportion to the areas of the offsets."""
    rng, count = np.random.default_rng(7), 20_000
    reach = 2 * thing.circle[1]
    distance, angle = reach * np.sqrt(rng.uniform(size=count)), rng.uniform(-math.pi, math.pi, count)
    centre = thing.circle[0]
    turns = rng.uniform(-math.pi, math.pi, (2, count)) if turned else np.zeros((2, count))
    offsets = distance[:, None] * np.stack((np.cos(angle), np.sin(angle)), axis=1)  # uniform in the circles' sum
    one, other = (
        placed(thing.corners - centre, np.zeros((count, 2)), turns[0]),
        placed(thing.corners - centre, offsets, turns[1]),
    )
    share = expected_area(thing, ("precise",), turned) / expected_area(thing, ("sphere",), turned)
    assert (overlaps(one, other) >= 0).mean() == pytest.approx(share, abs=sampling_error(share, count))


def test_separating_axes_agree_with_brute_force_over_corners_and_edges():
    rng = np.random.default_rng(2)
    for thing in OBJECTS:
        turns = rng.uniform(-math.pi, math.pi, (2, 2000))
        one = placed(thing.corners, np.zeros((2000, 2)), turns[0])
        other = placed(thing.corners, rng.normal(size=(2000, 2)), turns[1])
        depths, (expected, _) = overlaps(one, other), convex_brute.meet(one, other)
        hit = expected >= 0
        assert 200 < hit.sum() < 1900
        np.testing.assert_array_equal(depths >= 0, hit)
        np.testing.assert_allclose(depths[hit], expected[hit], atol=1e-12)


def test_touching_looks_at_every_pair():
    rng = np.random.default_rng(4)
    corners, positions, turns = OBJECTS[3].corners, rng.uniform(0, 12, (60, 2)), rng.uniform(-3, 3, 60)
    polygons = placed(corners, positions, turns)
    first, second = np.triu_indices(60, 1)
    depths = overlaps(polygons[first], polygons[second])
    pairs, found = touching(corners, positions, turns)
    np.testing.assert_array_equal(pairs, np.stack((first, second), axis=1)[depths >= 0])
    np.testing.assert_allclose(found, depths[depths >= 0])
    assert len(pairs) > 20
    assert touching(corners, positions[:1], turns[:1])[0].shape == (0, 2)


# -- the engine ----------------------------------------------------------------------------------


def study(**options):
    given = {"count": 1500, "repeats": 2, "worlds": 2, "things": ROUND_AND_TALL, "options": CHEAP}
    return geometry_measure.geometry_study(**{**given, **options})


def counts(result):
    names = ("thing", "turned", "option", "touching", "tested", "first_hits", "hits", "misses")
    return [tuple(getattr(cost, name) for name in names) for cost in result.costs]


@pytest.fixture(scope="module")
def result():
    return study()


def check_counts(result):
    """No misses, and the false positives predicted by the areas."""
    assert len(result.costs) == len(result.cases) * len(result.options)
    for cost in result.costs:
        assert cost.misses == 0
        assert cost.touching > 400
        assert cost.hits == cost.touching + cost.false_positives
        assert cost.hits <= cost.first_hits <= cost.tested
        assert cost.nanoseconds.low > 0
        assert cost.finding.median > 0
        assert len(cost.nanoseconds.values) == result.repeats
        if cost.expected_share is not None:
            expected = cost.expected_share
            edge = 0.01  # objects at the edge of the crowd have fewer neighbours
            assert cost.share == pytest.approx(expected, abs=edge + sampling_error(expected, cost.hits))


def test_no_misses_and_shares_as_the_areas_say(result):
    check_counts(result)
    sphere, box = (result.cost("asteroid", True, option).share for option in ("sphere", "box"))
    assert sphere < 0.15 < 0.4 < box  # a circle fits round objects
    sphere, box = (result.cost("humanoid", False, option).share for option in ("sphere", "box"))
    assert box < 0.2 < 0.5 < sphere  # a box fits upright boxes
    for thing in ("asteroid", "humanoid"):
        both, box = (result.cost(thing, True, option).share for option in ("sphere then box", "box"))
        assert both < box  # the circle cuts off the corners of the enlarged box


def test_the_share_does_not_depend_on_the_density(result):
    sparse = study(room=8.0, options=("sphere", "box"))
    for cost in sparse.costs:
        dense = result.cost(cost.thing, cost.turned, cost.option)
        assert cost.hits < 0.7 * dense.hits
        assert cost.share == pytest.approx(dense.share, abs=2 * sampling_error(dense.share, cost.hits))


def test_a_seed_gives_the_same_counts():
    first, again, other = (study(count=300, seed=seed, repeats=1) for seed in (1, 1, 2))
    assert counts(first) == counts(again) != counts(other)


def test_levels_before_the_precise_shape(result):
    """The precise level reports the true overlaps; the first level accepts what it would report alone."""
    whole = study(options=tuple(OPTIONS))
    check_counts(whole)
    assert [cost for cost in counts(whole) if cost[2] in CHEAP] == counts(result)
    for case in whole.cases:
        for option in ("precise", "sphere then precise", "box then precise"):
            cost = whole.cost(*case, option)
            assert (cost.hits, cost.false_positives, cost.share) == (cost.touching, 0, 0)
        for level in ("sphere", "box"):
            alone, first = whole.cost(*case, level), whole.cost(*case, f"{level} then precise")
            assert (first.first_hits, first.first_share) == (alone.hits, alone.share)


def test_an_engine_that_disagrees_with_the_oracle_is_not_measured(monkeypatch):
    def one_less(*crowd):
        pairs, depths = touching(*crowd)
        return pairs[1:], depths[1:]

    monkeypatch.setattr(geometry_measure, "touching", one_less)
    with pytest.raises(Problem, match="other contacts than the separating axes"):
        study(options=("precise",), count=300)


@pytest.mark.parametrize(("wrong", "message"), [
    ({"count": 1}, "count must be a whole number from 2, got 1"),
    ({"repeats": 0}, "repeats must be a whole number from 1, got 0"),
    ({"worlds": 0}, "worlds must be a whole number from 1"),
    ({"seed": -1}, "seed must be a whole number from 0, got -1"),
    ({"room": 0.0}, "room must be positive, got 0.0"),
    ({"room": math.nan}, "room must be positive, got nan"),
    ({"options": ("spere",)}, "options has 'spere'; did you mean 'sphere'"),
    ({"options": ()}, "things and options must not be empty"),
    ({"things": ()}, "things and options must not be empty"),
])  # fmt: skip
def test_what_cannot_be_studied(wrong, message):
    with pytest.raises(ValueError, match=message):
        study(**wrong)


# -- records, tables, picture, command -----------------------------------------------------------


def test_it_can_be_kept_and_shown(result, tmp_path):
    kept = json.loads(json.dumps(result.as_dict()))
    assert GeometryStudy.from_dict(kept) == result
    assert kept["costs"][0]["share"] == result.costs[0].share
    with pytest.raises(KeyError, match="no 'tree', turned=True, with 'box'"):
        result.cost("tree", True, "box")
    shares, pairs, costs = geometry_report.tables(result)
    assert [row[:2] for row in shares.rows] == [
        ("asteroid", "upright"), ("asteroid", "turned"), ("humanoid", "upright"), ("humanoid", "turned")
    ]  # fmt: skip
    assert [row[-1] for row in shares.rows] == ["sphere", "sphere", "box", "box"]
    assert shares.headings == ("object", "", *CHEAP, "better alone")
    cost = result.cost("asteroid", False, "sphere then box")
    expected = " / ".join(f"{100 * n / 3000:.0f}" for n in (cost.tested, cost.first_hits, cost.hits))
    assert pairs.rows[0][4] == expected
    assert len(costs.rows) == 4
    text = geometry_report.remarks(result)[0]
    total = sum(cost.touching for cost in result.costs) // len(CHEAP)
    assert text.startswith(f"misses: 0 of the {total:,} overlapping pairs")
    assert draw_geometry(result, tmp_path).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("turned", [False, True])
def test_the_false_positive_in_the_picture_is_one(turned):
    name, level, offset, turns = EXAMPLES[turned]
    thing = BY_NAME[name]
    one, other = (
        placed(thing.corners, np.array([at]), np.array([turn]))
        for at, turn in zip((offset, (0, 0)), turns, strict=True)
    )
    assert overlaps(one, other) < -0.02  # visibly apart
    if level == "sphere":
        assert turns == (0, 0)
        assert math.hypot(*offset) < 1.9 * thing.circle[1]
    else:
        cosine, sine = np.abs(np.cos(turns)), np.abs(np.sin(turns))
        half = thing.half_extents
        sizes = cosine.sum() * half + sine.sum() * half[::-1]
        assert (np.abs(offset) < 0.95 * sizes).all()


@pytest.fixture
def carom(monkeypatch, result):
    """The command with a finished study; returns a function to call with arguments."""
    cli = Commands("carom")
    cli.add_command(geometry_command.geometry_command)
    asked = []

    def done(count, repeats, progress):
        asked.append((count, repeats))
        return result

    monkeypatch.setattr(geometry_command, "geometry_study", done)

    def call(*arguments):
        answer = CliRunner().invoke(cli, ["geometry", *map(str, arguments)])
        answer.asked = asked
        return answer

    return call


def test_the_command(carom, result, tmp_path):
    page = tmp_path / "page.md"
    page.write_text("above\n<!-- studies geometry -->\nold\n<!-- end of studies geometry -->\nbelow\n")
    done = carom("--objects", 50, "--repeats", 3, "--json", "--into", page, "--out", tmp_path / "pictures")
    assert done.exit_code == 0, done.output
    assert done.asked == [(50, 3)]
    assert GeometryStudy.from_dict(json.loads(done.stdout)) == result
    text = page.read_text(encoding="utf-8")
    assert "| humanoid | upright |" in text
    assert "old" not in text
    assert text.endswith("below\n")
    assert (tmp_path / "pictures" / "geometry.png").stat().st_size > 10_000

    done = carom("--markdown")
    assert done.stdout.startswith("**false positives")
    assert done.asked[-1] == (geometry_measure.COUNT, geometry_measure.REPEATS)
    assert "better alone" in carom().stdout


@pytest.mark.parametrize(("arguments", "message"), [
    (("--json", "--markdown"), "--json and --markdown exclude each other"),
    (("--objects", 1), "1 is not in the range x>=2"),
    (("--repeats", 0), "0 is not in the range x>=1"),
    (("--into", "missing.md"), "--into missing.md: No such file or directory"),
    (("--out", "/dev/null/x"), "--out /dev/null/x: Not a directory"),
])  # fmt: skip
def test_what_the_command_refuses(carom, arguments, message):
    done = carom(*arguments)
    assert done.exit_code == 2
    assert message in done.stderr
    assert done.asked == []
    assert isinstance(done.exception, (SystemExit, click.ClickException))
