"""``carom maps check``, and maps in ``carom run``."""

from __future__ import annotations

import helpers_cli
import helpers_maps_ldtk as ldtk
import numpy as np
import pytest
from helpers_cli import refusal, report_of
from helpers_maps import Ref, map_of, objects_of, thing, tiles_of, write

carom = helpers_cli.carom  # a fixture

GAME = """
import enum
from carom import Component, Prefab, RigidBody, SphereCollider, column

class Layers(enum.IntFlag):
    WALL, FOE = 1, 2

class Enemy(Component):
    health = column(default=1.0)

PREFABS = {"goom": Prefab(RigidBody(), SphereCollider(0.5))}
MATERIALS = {"ice": {"friction": 0.02}}
"""


@pytest.fixture
def level(tmp_path):
    cells = np.zeros((4, 6), int)
    cells[3] = 1
    drawn = [
        thing(1, 20, 10, 8, 8, kind="Enemy, goom", properties={"health": 2.0, "layer": "foe"}),
        thing(2, 60, 10, 8, 8, properties={"mas": 2.0, "spins": True}),
    ]
    tileset = {"firstgid": 1, "name": "t", "tilewidth": 16, "tileheight": 16, "tilecount": 1, "columns": 1}
    tileset["tiles"] = [{"id": 0, "type": "ice"}]
    return write(tmp_path / "level.tmx", map_of(6, 4, tiles_of(cells), objects_of(*drawn), tilesets=[tileset]))


def test_all_findings_are_listed(carom, level, tmp_path):
    (tmp_path / "game.py").write_text(GAME)
    with_game = carom("maps", "check", "level.tmx", "--with", "game.py")
    assert with_game.exit_code == 1
    (line,) = with_game.stdout.splitlines()
    assert line.startswith("level.tmx: layer 'things', object 2, property 'mas': ")
    assert "did you mean 'mass'?" in line
    alone = carom("maps", "check", "level.tmx")
    assert (alone.exit_code, alone.stdout) == (1, with_game.stdout)
    assert alone.stderr == "carom: level.tmx: not looked at without --with game.py: Enemy, goom, ice\n"
    level.write_text(level.read_text().replace('name="mas"', 'name="mass"'))
    assert carom("maps", "check", "level.tmx", "--with", "game.py").exit_code == 0
    (tmp_path / "other.tmj").write_text("{")
    write(tmp_path / "none.ldtk", {"levels": [], "defs": {}})
    none = carom("maps", "check", "none.ldtk")
    assert (none.exit_code, none.stdout) == (1, "none.ldtk: the project has 0 levels: there is nothing to load\n")
    several = carom("maps", "check", "level.tmx", "other.tmj", "--with", "game.py")
    assert several.exit_code == 1
    assert several.stdout.startswith("other.tmj: other.tmj is no JSON that can be read")
    assert "level.py" in refusal(carom("maps", "check", "level.tmx", "--with", "level.py"))


def test_a_map_runs_with_the_plugins_that_it_needs(carom, level):
    level.write_text(level.read_text().replace('name="mas"', 'name="mass"').replace('type="ice"', 'type="Solid"'))
    report = report_of(carom("run", "level.tmx", "--steps", "3", "--no-pictures", "--json"))
    assert report["bodies"] == {"dynamic": 1, "kinematic": 0, "static": 3, "total": 4}
    level.write_text("<map")
    assert "is no XML that can be read" in refusal(carom("run", "level.tmx"))
    assert "none.tmx is missing" in refusal(carom("run", "none.tmx"))


def test_levels_of_a_project_are_told_and_chosen(carom, tmp_path):
    wrong = ldtk.entity("a", "Player", 16, 16, fields=[ldtk.field("mas", "Float", 1.0)])
    crates = [ldtk.entity(k, "Crate", 16, 16, fields=[ldtk.field("mass", "Float", 1.0)]) for k in "bc"]
    levels = ldtk.level("one", ldtk.CELLS), ldtk.level("two", ldtk.CELLS, *crates)
    ldtk.write(tmp_path / "good.ldtk", ldtk.project(*levels))
    run = "run", "good.ldtk", "--steps", "1", "--no-pictures", "--json"
    first, second = carom(*run), carom(*run, "--level", "two")
    assert first.stderr == "carom: good.ldtk: level 'one', the first of 2: --level chooses one\n"
    assert [report_of(each)["bodies"]["dynamic"] for each in (first, second)] == [0, 2]
    assert "no level is named 'three'; there are one, two" in refusal(carom(*run, "--level", "three"))
    assert "--level is for maps of LDtk, 'billiards' is none" in refusal(carom("run", "billiards", "--level", "one"))
    ldtk.write(tmp_path / "bad.ldtk", ldtk.project(levels[0], ldtk.level("two", ldtk.CELLS, wrong)))
    (tmp_path / "tiles.png").touch()
    (tmp_path / "game.py").write_text("from carom import Component\nclass Player(Component): ...\n")
    (line,) = carom("maps", "check", "bad.ldtk", "--with", "game.py").stdout.splitlines()
    assert line.startswith("bad.ldtk: level 'two', layer 'Things', object a 'Player', property 'mas': it is no field")
    alone = carom("maps", "check", "bad.ldtk", "--with", "game.py", "--level", "two").stdout
    assert alone == line.replace("level 'two', ", "") + "\n"


@pytest.mark.parametrize("layers", [
    'from flags import Flags', 'from flags import Flags as Layers', 'LAYERS = {"wall": 1, "foe": 2}',
])  # fmt: skip
def test_layers_of_a_game_are_found(layers, carom, level, tmp_path):
    (tmp_path / "flags.py").write_text("import enum\nclass Flags(enum.IntFlag):\n    WALL, FOE = 1, 2\n")
    own = GAME[GAME.index("class Layers") : GAME.index("class Enemy")]
    (tmp_path / "game.py").write_text(GAME.replace(own, layers + "\n"))
    (line,) = carom("maps", "check", "level.tmx", "--with", "game.py").stdout.splitlines()
    assert "property 'mas': " in line


def test_a_joint_of_what_the_game_knows_is_not_looked_at_without_it(carom, tmp_path):
    """A point of a prefab; that it is none of this game is told."""
    drawn = [thing(1, 20, 10, kind="Hinge", point=True, properties={"a": Ref(2), "b": Ref(3)}),
             thing(2, 20, 10, kind="goom", point=True), thing(3, 20, 10, 8, 8, properties={"mass": 1.0})]  # fmt: skip
    (tmp_path / "basic.png").touch()
    write(tmp_path / "level.tmx", map_of(6, 4, objects_of(*drawn)))
    (tmp_path / "game.py").write_text(GAME)
    (tmp_path / "other.py").write_text(GAME.replace("Prefab(RigidBody(), SphereCollider(0.5))", "None"))
    alone = carom("maps", "check", "level.tmx")
    assert (alone.exit_code, alone.stdout) == (0, "")
    assert alone.stderr == "carom: level.tmx: not looked at without --with game.py: goom\n"
    assert carom("maps", "check", "level.tmx", "--with", "game.py").exit_code == 0
    told = carom("maps", "check", "level.tmx", "--with", "other.py").stdout
    assert "property 'Hinge.a': it refers to object 2 '', which has no entity" in told
