"""The panel: fields of the settings and of a body are shown, set by typing and by clicks, and refused with reasons."""

from dataclasses import dataclass

import pygame
import pytest
from helpers_view import Player

from carom import AABBCollider, Component, Physics, RigidBody, SphereCollider, Transform, World, column


class Charge(Component):
    value = column(0.5, minimum=0.0)
    sign = column(1.0)


@dataclass
class Name:
    text: str = "ball"


@pytest.fixture
def player():
    world = World(Physics(2, gravity=(0.0, -10.0)))
    world.register(Charge)
    ball = world.create_entity(Transform((0.0, 1.0)), RigidBody(), SphereCollider(0.5), Charge(), Name())
    world.create_entity(Transform((0.0, -1.0)), AABBCollider((4.0, 0.5)))
    made = Player(world, (900, 2000))
    made.world, made.ball = world, ball
    made.frame()
    made.key(pygame.K_SPACE)
    made.key(pygame.K_TAB, "\t")
    made.view.picked = ball
    made.frame(2)
    yield made
    made.view.close()
    world.close()


def rows(player):
    """Rectangle and row by (component, field)."""
    return {row.key if row.key[0] else row.name: (area, row) for area, row in player.view._panel._shown}


def click(player, of, name, button=1):
    area, _ = rows(player)[of, name]
    player.mouse(pygame.MOUSEBUTTONDOWN, (area.right - 30, area.centery), button)


def enter(player, of, name, text, key=pygame.K_RETURN):
    click(player, of, name)
    assert player.view._panel.typing
    while player.view._panel._typed:
        player.key(pygame.K_BACKSPACE)
    player.type(text)
    player.key(key)
    player.frame()


@pytest.mark.slow
def test_settings_are_typed_and_chosen(player):
    world = player.world
    enter(player, "settings", "dt", "1/120")
    assert world.settings.dt == 1 / 120
    enter(player, "settings", "slop", "0.25")
    assert world.settings.slop == 0.25
    enter(player, "settings", "slop", "none")
    assert world.settings.slop is None
    enter(player, "settings", "substeps", "9", pygame.K_ESCAPE)
    assert world.settings.substeps == 4
    click(player, "settings", "collision")
    assert world.settings.collision == "continuous"
    click(player, "settings", "collision", button=3)
    assert world.settings.collision == "discrete"
    click(player, "settings", "integrator")
    assert world.settings.integrator != "semi_implicit_euler"
    click(player, "settings", "sleeping")
    assert world.settings.sleeping
    enter(player, "world", "gravity", "1, -2")
    assert world.gravity.tolist() == [1.0, -2.0]
    assert not player.view._panel.error


@pytest.mark.slow
def test_fields_of_the_picked_body_are_typed(player):
    world, ball = player.world, player.ball
    enter(player, "Transform", "position", "1, 2.5")
    assert world.component_for_entity(ball, Transform).position.tolist() == [1.0, 2.5]
    enter(player, "RigidBody", "mass", "7")
    assert world.component_for_entity(ball, RigidBody).mass == 7
    click(player, "RigidBody", "ccd")
    assert world.component_for_entity(ball, RigidBody).ccd
    enter(player, "Charge", "value", "2")
    assert world.component_for_entity(ball, Charge).value == 2
    enter(player, "Name", "text", "egg")
    assert world.component_for_entity(ball, Name).text == "egg"
    shown = {row.name for _, row in player.view._panel._shown}
    assert {"SphereCollider", "radius", "force", "inverse_mass", "kind", "row", "asleep"} <= shown


@pytest.mark.slow
@pytest.mark.parametrize(
    ("of", "name", "text", "reason"),
    [
        ("settings", "substeps", "-1", "Settings.substeps must be a whole number from 1, got -1"),
        ("settings", "dt", "soon", "Settings.dt must be a finite number above 0, got 'soon'"),
        ("world", "gravity", "1, 2, 3", "gravity must be 2 finite numbers"),
        ("RigidBody", "mass", "-3", "entity 1: RigidBody.mass must be positive, got -3"),
        ("Transform", "position", "1, 2, 3", "entity 1: Transform.position"),
        ("Charge", "value", "-1", "entity 1: Charge.value must be at least 0.0, got -1"),
    ],
)
def test_bad_values_are_refused_with_the_reason_of_the_library(player, of, name, text, reason):
    before = rows(player)[of, name][1].value
    enter(player, of, name, text)
    assert reason in player.view._panel.error
    assert str(rows(player)[of, name][1].value) == str(before)
    enter(player, "settings", "substeps", "3")
    assert not player.view._panel.error


def test_keys_that_are_typed_are_not_the_views(player):
    click(player, "settings", "dt")
    player.type("v c")
    assert not any(player.view.show[name] for name in ("velocities", "contacts"))
    assert player.view.paused
    player.key(pygame.K_ESCAPE)
    assert player.view.open
    player.key(pygame.K_ESCAPE)
    assert player.view.open  # it has closed the panel
    assert not player.view._panel.open


def test_the_body_may_go_while_a_field_of_it_is_typed(player):
    click(player, "RigidBody", "mass")
    player.type("3")
    player.world.delete_entity(player.ball, immediate=True)
    player.frame()
    player.key(pygame.K_RETURN)
    player.frame(2)
    assert "no body is picked" in str(rows(player).keys())


def test_a_low_window_scrolls(player):
    pygame.display.set_mode((400, 100), pygame.RESIZABLE)
    pygame.event.post(pygame.event.Event(pygame.VIDEORESIZE, size=(400, 100), w=400, h=100))
    player.frame(2)
    first = [row.name for _, row in player.view._panel._shown]
    player.mouse(pygame.MOUSEMOTION, (350, 50), buttons=(0, 0, 0), rel=(0, 0))
    for _ in range(60):
        pygame.event.post(pygame.event.Event(pygame.MOUSEWHEEL, y=-1, x=0))
    player.frame(2)
    assert [row.name for _, row in player.view._panel._shown][-1] == "asleep"
    assert first[0] == "settings"
