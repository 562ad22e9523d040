"""``carom bench pairs``: equal contacts from both kernels, and a ratio; its size is left to the benchmark."""

from __future__ import annotations

import json

import numpy as np
import pytest
from click.testing import CliRunner

from carom.components import SphereCollider
from carom.lab.bench.benchmarks import plugin_pairs as bench_pairs
from carom.lab.bench.benchmarks.plugin_pairs import DiscCollider, PairCosts, disc_sphere, pair_costs
from carom.lab.cli import cli
from carom.lab.commands.usage_errors import Problem
from carom.plugins.standard_shapes import sphere_sphere

pytestmark = pytest.mark.slow  # many runs: half a minute or more together


@pytest.fixture(scope="module")
def result():
    return pair_costs(repeats=2, bodies=200)


def test_each_scene_has_both_times_and_their_ratio(result):
    assert [(cost.scene, cost.dimensions) for cost in result.costs] == [
        (scene, d) for scene in ("discs", "discs and spheres") for d in (2, 3)
    ]
    for cost in result.costs:
        assert cost.candidates > 100
        for ratio, own, other in zip(cost.ratio.values, cost.registered.values, cost.by_hand.values, strict=True):
            assert ratio == pytest.approx(own / other)
            assert own > 0


def test_it_can_be_kept_and_shown(result):
    assert PairCosts.from_dict(json.loads(json.dumps(result.as_dict()))) == result
    shown = bench_pairs.table(result)
    assert len(shown.rows) == 4
    assert f"{bench_pairs.largest(result):.2f}, target at most 1.3" in shown.title


def test_the_maths_is_that_of_two_spheres():
    disc, ball = DiscCollider.sample(), SphereCollider.sample()
    for d in ((0.3, 0.4), (0.0, 0.0, 0.0), (1.0, -2.0, 2.0)):
        by_hand, built_in = disc_sphere(disc, ball, d), sphere_sphere(ball, ball, d)
        assert by_hand[0] == built_in[0]
        for one, other in zip(by_hand[1:], built_in[1:], strict=True):
            np.testing.assert_allclose(one, other, rtol=1e-15)


def test_kernels_that_do_not_agree_are_not_timed():
    with pytest.raises(Problem, match="other contacts than the registered one"):
        bench_pairs._same(lambda x: x, lambda x: x + 1, [(1,)])


def test_the_command(monkeypatch, result, tmp_path):
    monkeypatch.setattr(bench_pairs, "pair_costs", lambda repeats, progress: result)
    page = tmp_path / "page.md"
    page.write_text("<!-- carom bench pairs -->\n<!-- end of carom bench pairs -->\n", encoding="utf-8")
    done = CliRunner().invoke(cli, ["bench", "pairs", "--json", "--into", str(page)])
    assert done.exit_code == 0, done.output
    assert PairCosts.from_dict(json.loads(done.stdout)) == result
    assert "| discs and spheres | 3D |" in page.read_text(encoding="utf-8")
