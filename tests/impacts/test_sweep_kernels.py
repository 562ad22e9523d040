"""Search bounds against brute force: when a deflected body leaves its own."""

from __future__ import annotations

import math

import numpy as np
import pytest
from worlds import both_dimensions

from carom.framework.jit.records.plain_view import PlainView
from carom.framework.jit.records.record import make_record
from carom.systems.broad_phase import boxes
from carom.systems.ccd import search_bounds
from carom.systems.ccd.search_bounds import CONTINUOUS, DISCRETE, EVENT_DRIVEN, leaves_bounds_at
from carom.systems.integration import trajectory
from carom.systems.records import STATE

pytestmark = pytest.mark.plain

DT = 1 / 60


def fill(record, **fields):
    """Give a record these fields, as copies of the type it wants."""
    for name, values in fields.items():
        setattr(record, name, np.array(values, record.schema.fields[name].dtype, order="C"))


@pytest.fixture
def plain_zero(monkeypatch):
    """Parts of kernels run as plain Python here; the zero vector is all that only compiled code can make."""
    for module in (search_bounds, trajectory):
        monkeypatch.setattr(module, "zero_of", lambda state: (0.0,) * state.dimensions)


@both_dimensions
@pytest.mark.parametrize("mode", [CONTINUOUS, EVENT_DRIVEN, DISCRETE])
@pytest.mark.parametrize("degree", [1, 2])
def test_no_body_leaves_its_search_bounds_before_the_stated_time(mode, degree, d, plain_zero, monkeypatch):
    """100 bodies, slow to 50 sizes per step, each deflected at some time of the step, its new path sampled."""
    rng, state = np.random.default_rng(10 * mode + degree), make_record(STATE, d)
    n, bodies, view = 100, state.bodies, PlainView(state)
    size = 10 ** rng.uniform(-2, 0, n)
    path = rng.normal(size=(n, d)) * (size / DT * 10 ** rng.uniform(-2, 1.7, n))[:, None]
    second = rng.normal(size=(n, d)) * (size / DT**2)[:, None] * (degree > 1)
    origin, zeros = rng.uniform(-2, 2, (n, d)), np.zeros((n, d))
    fill(bodies, origin=origin, path_velocity=path, path_second=second, path_third=zeros, min_extent=size)
    fill(bodies, ccd=rng.random(n) < 0.5, shape=zeros[:, 0], inverse_mass=10 ** rng.uniform(-2, 2, n))
    fill(bodies, search_lower=origin, search_upper=zeros, search_margin=zeros[:, 0], lower=zeros, upper=zeros)
    fill(state, moving=n, mode=mode, path_degree=degree, frame=np.zeros(7), links=np.zeros(1))
    monkeypatch.setattr(boxes, "box_rows", lambda *_: 0)  # the boxes around the paths are not used
    boxes.bound_searches(view, 0.0, DT)
    asked, until = 0, state.neighbours_known_until
    assert until < DT  # so search_upper is where the bodies are then
    path, origin, lower, upper = bodies.path_velocity, bodies.origin, bodies.search_lower, bodies.search_upper
    for i in range(n):
        now = rng.uniform(0, until)
        dv = rng.normal(size=d) * np.linalg.norm(path[i]) * rng.uniform(0, 2)
        path[i] += dv
        origin[i] -= dv * now
        leaves = leaves_bounds_at(view, i, now, DT)
        assert leaves >= now
        speed = np.linalg.norm(path[i] + 2 * second[i] * now)
        swept = mode == EVENT_DRIVEN or speed * (DT - now) > 0.2 * size[i]
        if swept:
            asked += 1
            times = np.linspace(now, min(leaves, DT), 200)[:, None]
            places = origin[i] + path[i] * times + second[i] * times**2
            if ((lower[i] <= places[0]) & (places[0] <= upper[i])).all():
                assert ((lower[i] - 1e-12 <= places) & (places <= upper[i] + 1e-12)).all()
            else:
                assert leaves == now
        else:
            assert leaves == math.inf
    assert asked > 20
