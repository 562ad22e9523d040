"""Equal contacts from all kernels, and ratios; their size is left to the benchmark."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from carom.components import SphereCollider
from carom.lab.cli.usage_errors import Problem
from carom.lab.studies.__main__ import cli
from carom.lab.studies.bench import plugin_pairs as bench_pairs
from carom.lab.studies.bench.plugin_pairs import DiscCollider, PairCosts, disc_sphere, pair_costs
from carom.plugins.standard_shapes import sphere_sphere

pytestmark = pytest.mark.slow  # many runs: half a minute or more together


@pytest.fixture(scope="module")
def result():
    return pair_costs(repeats=2, bodies=200)


def test_each_scene_has_its_times_and_ratios(result):
    assert [(cost.scene, cost.dimensions) for cost in result.costs] == [
        (scene, d) for scene in ("discs", "discs and spheres") for d in (2, 3)
    ]
    for cost in result.costs:
        assert cost.candidates > 100
        assert min(cost.unchecked.values) > 0
        assert ratios(cost.registered, cost.by_hand) == pytest.approx(cost.to_by_hand.values)
        if cost.scene == "discs":
            assert ratios(cost.registered, cost.built_in) == pytest.approx(cost.to_built_in.values)
        else:
            assert cost.built_in is None is cost.to_built_in


def ratios(one, other):
    return [own / its for own, its in zip(one.values, other.values, strict=True)]


def test_it_can_be_kept_and_shown(result):
    assert PairCosts.from_dict(json.loads(json.dumps(result.as_dict()))) == result
    shown = bench_pairs.table(result)
    assert len(shown.rows) == 4
    assert all(len(row) == len(shown.headings) for row in shown.rows)
    assert f"{bench_pairs.largest(result):.2f}, target at most 1.1" in shown.title


def test_the_maths_is_that_of_two_spheres():
    disc, ball = DiscCollider.sample(), SphereCollider.sample()
    for d in ((0.3, 0.4), (0.0, 0.0, 0.0), (1.0, -2.0, 2.0)):
        by_hand, built_in = disc_sphere(disc, ball, d), sphere_sphere(ball, ball, d)
        assert by_hand[0] == built_in[0]
        for one, other in zip(by_hand[1:], built_in[1:], strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-15)


def test_kernels_that_do_not_agree_are_not_timed():
    with pytest.raises(Problem, match="by_hand: other contacts than those of the registered pair"):
        bench_pairs._same({"registered": (lambda x: x, [(1,)]), "by_hand": (lambda x: x + 1, [(1,)])})


def test_kernels_take_turns():
    names = ["a", "b", "c", "d"]
    turns = [bench_pairs._turned(names, turn) for turn in range(8)]
    assert all(sorted(turn) == names for turn in turns)
    assert sorted(turn[0] for turn in turns) == sorted(names * 2)


def test_the_command(monkeypatch, result, tmp_path):
    monkeypatch.setattr(bench_pairs, "pair_costs", lambda repeats, progress: result)
    page = tmp_path / "page.md"
    page.write_text("<!-- studies plugin-pairs -->\n<!-- end of studies plugin-pairs -->\n", encoding="utf-8")
    done = CliRunner().invoke(cli, ["plugin-pairs", "--json", "--into", str(page)])
    assert done.exit_code == 0, done.output
    assert PairCosts.from_dict(json.loads(done.stdout)) == result
    assert "| discs and spheres | 3D |" in page.read_text(encoding="utf-8")
