"""What is easily got wrong in a game: each is refused where it is written, or told with its cure."""

from __future__ import annotations

import os
import stat
import warnings

import numpy as np
import pytest
from worlds import ball, make_world

from carom.components import AABBCollider, RigidBody, SphereCollider, Transform
from carom.framework import CaromError, NoPhysicsError, PhysicsWarning, UnhandledPairError, World
from carom.plugins import Physics, capsule
from carom.plugins.springs import Springs

OTHERS = [
    (RigidBody(), "velocity", "linear_velocity"), (RigidBody(), "apply_forse", "apply_force"),
    (Transform((0, 0)), "pos", "position"), (SphereCollider(1.0), "bounce", "restitution"),
]  # fmt: skip


@pytest.mark.parametrize(("component", "wrong", "right"), OTHERS)
def test_a_wrong_name_is_answered_with_the_right_one(component, wrong, right):
    with pytest.raises(AttributeError, match=f"{wrong}.*did you mean '{right}'"):
        getattr(component, wrong)
    assert wrong not in dir(component)


@pytest.mark.parametrize(("component", "wrong", "right"), [other for other in OTHERS if other[1] != "apply_forse"])
def test_the_word_of_another_engine_cannot_be_set(component, wrong, right):
    with pytest.raises(AttributeError, match=f"did you mean '{right}'"):
        setattr(component, wrong, 1.0)


def test_a_body_in_no_layer_is_refused():
    world = make_world(2)
    collider = world.component_for_entity(ball(world, (0, 0)), SphereCollider)
    for make in (
        lambda: SphereCollider(1.0, layer=0), lambda: setattr(collider, "layer", 0),
        lambda: world.create_entities(
            2, Transform.many(np.zeros((2, 2))), AABBCollider.many((1.0, 1.0), layer=np.array([2, 0]))
        ),
    ):  # fmt: skip
        with pytest.raises(ValueError, match=r"layer must not be 0.*mask=0"):
            make()
    collider.layer, collider.mask = -(2**63), 0
    assert len(world.bodies) == 1


def test_frames_in_milliseconds_are_told_once():
    world = make_world(2)
    world.advance(3.0)  # somebody has dragged the window
    world.advance(0.016)
    world.advance(16)
    with pytest.warns(PhysicsWarning, match=r"advance takes seconds.*milliseconds / 1000"):
        world.advance(17)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        world.advance(16)
    assert len(world.faults) == 1


def test_a_shape_of_carom_without_its_plugin_names_it():
    world = make_world(2)
    world.create_entity(Transform((0, 0)), RigidBody(), capsule.CapsuleCollider(0.2, 0.2))
    with pytest.raises(UnhandledPairError, match=r"capsule\.plugin"):
        world.step()


def test_springs_before_physics_say_in_which_order():
    with pytest.raises(NoPhysicsError, match=r"before them: World\(Physics"):
        World(Springs(), Physics())


def test_arrays_keep_their_last_values_when_the_world_closes():
    world = make_world(2)
    for x in range(100):
        ball(world, (2.0 * x, 0), (1.0, 2.0))
    position, velocity = world.bodies.position, world.bodies.dynamic.linear_velocity
    before = position.copy()
    world.close()
    np.testing.assert_array_equal(position, before)
    assert (velocity == (1.0, 2.0)).all()


# -- files -----------------------------------------------------------------------------------------


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
