"""Worlds in files: they go on elsewhere with the same bits; what is no whole saved world is refused."""

from __future__ import annotations

import gc
import itertools
import json
import os
import stat
import subprocess
import sys
import weakref
from pathlib import Path

import esper
import numpy as np
import pytest
from data.helpers_snapshots import Bullet, Tag, fill, log_events, make, plugins, springs_of
from worlds import MODES, ball, make_world

from carom.components import RigidBody, SphereCollider, Transform
from carom.framework import CaromError, Component, Plugin, World, column
from carom.plugins import Physics
from carom.plugins.springs import Springs

pytestmark = [pytest.mark.plain, pytest.mark.usefixtures("invariants")]

HERE = Path(__file__).resolve().parents[1]
STEPS = 30
ELSEWHERE = """
import itertools
import sys
sys.path[:0] = {here!r}, {here!r} + "/data"
from data.helpers_snapshots import *
from test_saving import MODES, go_on
for d, mode in itertools.product((2, 3), MODES):
    world = World.load({folder!r} + f"/{{mode}} {{d}}", *plugins(d), components=[Bullet])
    world.add_system(Churn())
    print(go_on(world))
"""


def go_on(world):
    """Hashes and events of the next steps."""
    log, hashes = [], []
    log_events(world, log)
    for _ in range(STEPS):
        world.advance(1.05 / 60)
        hashes.append(world.state_hash())
    springs = [repr(spring) for spring in springs_of(world)]
    return json.dumps([hashes, log, springs, world.step_count, world.alpha, world.stats().counters])


@pytest.mark.slow
@pytest.mark.compiled
def test_loaded_worlds_go_on_with_the_same_bits_in_another_process(tmp_path):
    futures = []
    for d, mode in itertools.product((2, 3), MODES):
        world = make(d, mode, substeps=3)
        fill(world)
        for _ in range(50):
            world.advance(1.05 / 60)
        pushed = next(iter(springs_of(world))).b
        world.component_for_entity(pushed, RigidBody).apply_force((3.0, 4.0, 5.0)[:d])
        world.delete_entity(world.get_entities()[-3])
        world.gravity = (0.5, -9.0, 0.2)[:d]
        world.save(tmp_path / f"{mode} {d}", leave_out=[Tag])
        futures.append(go_on(world))
    script = ELSEWHERE.format(here=str(HERE), folder=str(tmp_path))
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, env=os.environ, check=False)
    assert done.returncode == 0, done.stderr
    assert done.stdout.splitlines() == futures


def small(path):
    """A world of springs, a polygon and a component of its own, saved."""
    springs = Springs()
    world = World(*plugins(2, springs=False), springs)
    a, b = ball(world, 0.0), ball(world, 3.0)
    springs.connect(a, b, stiffness=2.0)
    world.add_component(a, Bullet(4.0))
    world.step()
    world.save(path)
    return world


def with_entry(path, change):
    """The same file with another text in it."""
    with np.load(path) as entries:
        arrays = dict(entries)
    contents = json.loads(arrays["carom"].tobytes())
    change(contents)
    arrays["carom"] = np.frombuffer(json.dumps(contents).encode(), np.uint8)
    with path.open("wb") as file:
        np.savez(file, **arrays)


def written(path, data):
    path.write_bytes(data(path.read_bytes()))


class OldSprings(Springs):
    def __init__(self):
        super().__init__()
        self.version = "0.9"


def _other_bullet():
    class Bullet(Component):
        expires = column(default=0, dtype=int)
        power = column(default=1.0)

    return Bullet


OTHER_BULLET = _other_bullet()
GOOD = [Physics(), *plugins(2, springs=False)[1:]]
REFUSED = {
    "text": (lambda path: path.write_text("once upon a time"), {}, "is no saved world"),
    "empty": (lambda path: path.write_bytes(b""), {}, "is no saved world"),
    "other arrays": (lambda path: np.savez(path.open("wb"), a=np.ones(3)), {}, "is no saved world"),
    "truncated": (lambda path: written(path, lambda data: data[: len(data) // 2]), {}, "damaged or not complete"),
    "damaged": (lambda path: written(path, lambda d: d[:2000] + b"\x00\x01\x02" + d[2003:]), {}, "damaged"),
    "a part is missing": (lambda path: with_entry(path, lambda c: c.pop("table")), {}, "damaged"),
    "newer": (lambda path: with_entry(path, lambda c: c.update(format=99)), {}, "by a newer carom, in format 99; .*"),
    "setting": (lambda path: with_entry(path, lambda c: c["settings"].update(colour=1)), {}, "no field 'colour'"),
    "missing plugin": (None, {"plugins": GOOD}, r"needs plugin 'springs' 1\.0"),
    "older plugin": (None, {"plugins": [*GOOD, OldSprings()]}, r"plugin 'springs' 1\.0, this one is 0\.9"),
    "dimension": (None, {"plugins": [Physics(3), *GOOD[1:], Springs()]}, "2 dimensions, and plugin 'physics' is for 3"),
    "missing component": (None, {"components": []}, r"class Bullet of data.helpers_snapshots: .*components=\[Bullet\]"),
    "missing components": (
        lambda path: with_entry(path, lambda c: [c["components"][i].update(name=f"Own{i}") for i in (0, 1)]), {},
        r"component classes Own0 of \S+, Own1 of \S+: .*components=\[Own0, Own1\]",
    ),
    "other fields": (None, {"components": [OTHER_BULLET]}, "Bullet had other fields .*: expires, power"),
    "two of a name": (None, {"components": [Bullet, OTHER_BULLET]}, "two component classes are named Bullet"),
}


@pytest.mark.slow
@pytest.mark.parametrize("case", REFUSED)
def test_what_cannot_be_loaded_is_refused_in_one_line_and_leaves_nothing_behind(case, tmp_path):
    change, given, message = REFUSED[case]
    path, springs = tmp_path / "game.carom", Springs()
    small(path).close()
    if change is not None:
        change(path)
    worlds = esper.list_worlds()
    with pytest.raises(CaromError, match=message) as error:
        World.load(path, *given.get("plugins", [*GOOD, springs]), components=given.get("components", [Bullet]))
    assert "\n" not in str(error.value)
    assert set(esper.list_worlds()) <= set(worlds)
    small(path).close()
    assert len(World.load(path, *GOOD, springs, components=[Bullet]).bodies) == 2  # plugins are as free as before


MISTAKEN = {  # in a world of its own, which nothing is wrong with
    "a component": (lambda: World.load("none", Physics(), components=[Bullet()]), r"components takes .*, got Bullet\("),
    "one class": (lambda: World.load("none", Physics(), components=Bullet), r"got Bullet \(did you mean \[Bullet\]\?"),
    "a text": (lambda: World.load("none", Physics(), components="x"), "components takes component types, got 'x'"),
    "plugin class": (lambda: World.load("none", Physics), r"load takes plugins, got .*\(did you mean Physics\(\)"),
    "layers": (lambda: World.load("none", Physics(), layers={"a": 1}), "layers must be an enum.IntFlag class"),
    "from no path": (lambda: World.load(3, Physics()), "World.load takes the path of a file, got 3"),
    "to no path": (lambda: make_world().save(None), "world.save takes the path of a file, got None"),
    "left class": (lambda: make_world().save("none", leave_out=Tag), r"leave_out .*\(did you mean \[Tag\]"),
}


@pytest.mark.parametrize("case", MISTAKEN)
def test_wrong_arguments_are_told_before_a_file_is_opened(case, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    act, message = MISTAKEN[case]
    with pytest.raises(TypeError, match=message):
        act()
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
@pytest.mark.compiled
def test_a_file_of_which_an_array_was_edited_is_refused(tmp_path):
    """Whatever the array is, and whether it is shorter or holds other numbers: no step meets it."""
    path = tmp_path / "game.carom"
    small(path).close()
    with np.load(path) as entries:
        arrays = dict(entries)
    for name in arrays.keys() - {"carom"}:
        for edited in (arrays[name][:-1], arrays[name] + 1, arrays[name].astype(np.float32)):
            if edited.tobytes() != arrays[name].tobytes():
                with path.open("wb") as file:
                    np.savez(file, **{**arrays, name: edited})
                with pytest.raises(CaromError, match="damaged or not complete"):
                    World.load(path, *GOOD, Springs(), components=[Bullet])


@pytest.mark.slow
@pytest.mark.compiled
def test_no_damaged_byte_makes_another_world_or_another_error(tmp_path):
    path = tmp_path / "game.carom"
    world = small(path)
    whole, digest, refused = path.read_bytes(), world.state_hash(), 0
    rng = np.random.default_rng(5)
    for place in rng.choice(len(whole), 150, replace=False).tolist():
        path.write_bytes(whole[:place] + bytes([whole[place] ^ int(rng.integers(1, 256))]) + whole[place + 1 :])
        try:
            loaded = World.load(path, *GOOD, Springs(), components=[Bullet])
        except CaromError:
            refused += 1
        else:  # a date of the archive, say
            assert loaded.state_hash() == digest
            loaded.close()
    assert refused > 75


def test_what_a_file_cannot_hold_is_refused_and_the_old_file_stays(tmp_path):
    path = tmp_path / "game.carom"
    world = make_world()
    e = ball(world, 0.0)
    world.save(path)
    before = path.read_bytes()
    world.add_component(e, Tag("red"))
    with pytest.raises(CaromError, match=rf"entity {e} has a Tag, .*leave_out=\[Tag\]"):
        world.save(path)
    assert path.read_bytes() == before
    assert [file.name for file in tmp_path.iterdir()] == [path.name]
    world.save(path, leave_out=[Tag])
    again = World.load(path, Physics())
    assert [type(component) for component in again.components_for_entity(e)] == [Transform, RigidBody, SphereCollider]
    assert again.settings == world.settings
    assert again.create_entity() == world.create_entity()


class Weather(Plugin):
    def __init__(self, wind=None):
        super().__init__("weather")
        self.wind = wind

    def saved(self, world):
        return self.wind

    def take_back(self, world, saved):
        self.wind = {**saved, "seen": saved["speed"]}


def test_the_state_of_a_plugin_is_in_the_file(tmp_path):
    wind = {"speed": 1.5, "gusts": np.arange(3.0), "#array": "a0", "##": [{"#": np.float32(0.1), "ok": np.True_}, None]}
    World(Physics(), Weather(wind)).save(tmp_path / "w")
    weather = Weather()
    World.load(tmp_path / "w", Physics(), weather)
    assert weather.wind.pop("gusts").tolist() == [0.0, 1.0, 2.0]
    assert weather.wind == {
        "speed": 1.5, "#array": "a0", "##": [{"#": float(np.float32(0.1)), "ok": True}, None], "seen": 1.5,
    }  # fmt: skip


@pytest.mark.parametrize("wind", [{1: 2}, {"speed": object()}, [np.array([None])], {"a": {2, 3}}])
def test_what_a_plugin_keeps_and_no_file_can_hold_is_refused(wind, tmp_path):
    with pytest.raises(CaromError, match="plugin 'weather' keeps what no file can hold"):
        World(Physics(), Weather(wind)).save(tmp_path / "w")
    assert not list(tmp_path.iterdir())


def test_an_error_of_a_plugin_is_not_taken_for_damage(tmp_path):
    World(Physics(), Weather({"calm": True})).save(tmp_path / "w")
    worlds = esper.list_worlds()
    with pytest.raises(KeyError, match="speed"):
        World.load(tmp_path / "w", Physics(), Weather())
    assert set(esper.list_worlds()) <= set(worlds)


def test_components_of_carom_are_not_left_out(tmp_path):
    with pytest.raises(TypeError, match="Bullet is a Component"):
        make_world().save(tmp_path / "w", leave_out=[Bullet])


@pytest.mark.slow
@pytest.mark.compiled
def test_a_world_that_is_dropped_is_collected_with_its_context():
    world = make(2, "discrete")
    fill(world)
    log_events(world, [])
    snapshot = world.snapshot()
    for _ in range(20):
        world.step()
    with world:
        esper.process(world.settings.dt)
    world.restore(snapshot)
    world.query_point((0.0, 0.0))
    world.plan()
    reference, name = weakref.ref(world), world.name
    gc.collect()
    assert reference() is world
    assert name in esper.list_worlds()
    del world, snapshot
    gc.collect()
    assert reference() is None
    assert name not in esper.list_worlds()
    esper.switch_world("default")  # esper is none the worse for it


def test_the_context_of_a_world_outlives_switching_while_somebody_holds_the_world():
    world = make_world()
    e = ball(world, 0.0)
    gc.collect()
    esper.switch_world(world.name)
    assert esper.entity_exists(e)
    esper.switch_world("default")
    gc.collect()
    assert world.entity_exists(e)
    world.close()
    assert world.name not in esper.list_worlds()


# -- the file itself ---------------------------------------------------------------------------------


def test_a_saved_world_takes_the_place_and_mode_of_the_file(tmp_path):
    world, real, link = make_world(2), tmp_path / "real", tmp_path / "link"
    real.write_bytes(b"")
    real.chmod(0o640)
    try:
        link.symlink_to(real)
    except OSError:
        pytest.skip("no links here")
    world.save(link)
    assert link.is_symlink()
    assert real.stat().st_size > 0
    assert os.name == "nt" or stat.S_IMODE(real.stat().st_mode) == 0o640
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "real"]


def test_the_longest_name_can_be_saved(tmp_path):
    path = tmp_path / ("x" * 255)
    make_world(2).save(path)
    World.load(path, Physics(2)).close()


def test_a_folder_that_is_missing_is_told_by_the_file_that_was_given(tmp_path):
    (tmp_path / "file").write_bytes(b"")
    for path in (tmp_path / "none" / "w", tmp_path / "file" / "w"):
        with pytest.raises((FileNotFoundError, NotADirectoryError)) as told:
            make_world(2).save(path)
        assert told.value.filename == str(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes here")
def test_what_is_no_file_stays(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(CaromError, match="no file that can be replaced"):
        make_world(2).save(tmp_path / "pipe")
    with pytest.raises(CaromError, match="no file that can be replaced"):
        make_world(2).save(tmp_path)


def test_what_a_killed_process_has_left_goes_with_a_later_save(tmp_path):
    old, new = tmp_path / ".carom-part-1", tmp_path / ".carom-part-2"
    for path in (old, new):
        path.write_bytes(b"half")
    os.utime(old, (0, 0))
    make_world(2).save(tmp_path / "world")
    assert sorted(path.name for path in tmp_path.iterdir()) == [".carom-part-2", "world"]
