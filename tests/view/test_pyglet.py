"""The second backend: the same list as triangles, and a window of pyglet, in a process of its own without a screen."""

import subprocess
import sys

import numpy as np
import pytest

from carom import AABBCollider, Physics, RigidBody, Rotation, SphereCollider, Spin, Transform, World
from carom.drawing import Drawing, Style
from carom.view.backends import view_class
from carom.view.plane.triangles import disc_corners, polygon_corners, polygon_edges


def area(corners):
    a, b, c = np.moveaxis(corners["place"].reshape(-1, 3, 2).astype(float), 1, 0)
    return ((b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]) / 2


def test_triangles_cover_the_shapes():
    with World(Physics(2), Rotation()) as world:
        world.create_entity(Transform((1.0, 2.0)), RigidBody(), AABBCollider((0.5, 0.25)))
        world.create_entity(Transform((-2.0, 0.0)), RigidBody(), AABBCollider((1.0, 1.0), sensor=True))
        world.create_entity(Transform((3.0, 0.0), 0.7), RigidBody(), SphereCollider(0.5), Spin())
        shown = Drawing(world).update()
        corners, discs = polygon_corners(shown.polygons), disc_corners(shown.circles)
    areas = area(corners)
    assert (areas > 0).all()
    assert areas.sum() == pytest.approx(0.5 + 4.0)
    assert len(polygon_edges(shown.polygons)) == 16
    assert area(discs).sum() == pytest.approx(1.0)
    inside = np.linalg.norm(discs["place"] - (3.0, 0.0), axis=1) / 0.5
    assert np.linalg.norm(discs["local"], axis=1) == pytest.approx(inside, rel=1e-6)
    right = discs[np.argmax(discs["local"][:, 0] - 10 * np.abs(discs["local"][:, 1] + 1))]
    turned = np.array(((np.cos(0.7), -np.sin(0.7)), (np.sin(0.7), np.cos(0.7))))
    assert right["place"] - (3.0, 0.0) == pytest.approx(turned @ right["local"] * 0.5, abs=1e-6)
    sensors = np.concatenate([group.style for group in shown.polygons]) == Style.SENSOR
    assert sensors.sum() == 1
    assert (corners["fill"][:, 3] < 255).sum() == 6


def test_pyglet_is_taken_where_pygame_is_missing(monkeypatch):
    from carom.view import backends

    with World(Physics(2)) as world:
        assert view_class(world).__name__ == "View"
        monkeypatch.setattr(backends, "find_spec", lambda name: None if name == "pygame" else object())
        assert view_class(world).__name__ == "PygletView"
        assert view_class(world, filmed=True).__name__ == "View"  # and says what to install
    world.close()


def test_without_a_display_pyglet_has_one_line(monkeypatch):
    """The import of pyglet.window looks for a display, before there is a window."""
    from carom.view import pyglet_window
    from carom.view.window import DisplayError

    def package(name, what, part=""):
        if part:
            raise RuntimeError("cannot connect")

    monkeypatch.setattr(pyglet_window, "package", package)
    with World(Physics(2)) as world, pytest.raises(DisplayError, match=r"no display .* cannot connect; .*--record"):
        pyglet_window.PygletView(world)
    world.close()


PROGRAM = """
import numpy as np, pyglet
pyglet.options.headless = True
from carom import AABBCollider, Physics, RigidBody, SphereCollider, Transform, World
from carom.view import Camera, PygletView
from carom.view.window import DisplayError
world = World(Physics(2, gravity=(0.0, -10.0)))
world.create_entity(Transform((0.0, -0.5)), AABBCollider((5.0, 0.5)))
ball = world.create_entity(Transform((1.0, 0.5)), RigidBody(), SphereCollider(0.5))
try:
    view = PygletView(world, (300, 200), real_time=False)
except DisplayError as error:
    print("SKIP", error)
    raise SystemExit
symbols, frames = pyglet.window.key, iter(view)
def frame(count=1):
    for _ in range(count):
        seconds = next(frames)
        world.advance(seconds)
    return seconds
def pixels():
    data = pyglet.image.get_buffer_manager().get_color_buffer().get_image_data()
    flat = np.frombuffer(data.get_data("RGB", data.width * 3), np.uint8)
    return flat.reshape(data.height, data.width, 3)[::-1].astype(int)
def at(place):
    x, y = view.camera.to_screen(place)
    return int(x), int(y)
def mouse(event, place, *rest):
    x, y = at(place)
    view.window.dispatch_event(event, x, view.camera.size[1] - y, *rest)
    frame()
def key(symbol, modifiers=0):
    view.window.dispatch_event("on_key_press", symbol, modifiers)
    view.window.dispatch_event("on_key_release", symbol, modifiers)
    return frame()
assert abs(frame(3) - 1 / 60) < 1e-12
seen, (x, y) = pixels(), at((1.0, 0.4))
assert seen[y, x][2] > seen[y, x][0] + 50, seen[y, x]                       # blue
x, y = at((1.0, 2.0))
assert seen[y, x].max() < 50
x, y = at((0.0, -0.5))
assert abs(seen[y, x][2] - seen[y, x][0]) < 30 and seen[y, x].min() > 60    # grey
assert key(symbols.SPACE) == 0.0 and view.paused
key(symbols.PERIOD)
key(symbols.SPACE)
mouse("on_mouse_press", (1.0, 0.5), 1, 0)
assert view.picked == ball
for height in np.linspace(0.5, 3.0, 20):
    mouse("on_mouse_drag", (1.0, height), 0, 0, 1, 0)
frame(30)
assert abs(world.component_for_entity(ball, Transform).y - 3.0) < 0.4
mouse("on_mouse_release", (1.0, 3.0), 1, 0)
for symbol in (symbols.C, symbols.V, symbols.N, symbols.T, symbols.F1, symbols.Z):
    before = pixels()
    key(symbol)
    frame()
assert view.show["contacts"] and view.show["names"]
scale = view.camera.scale
mouse("on_mouse_scroll", (0.0, 0.0), 0, 1)
assert view.camera.scale > scale
steps = world.step_count
key(symbols.BACKSPACE)
assert world.step_count < steps and view.paused
view.window.dispatch_event("on_close")
try:
    frame()
except StopIteration:
    print("CLOSED", view.open, view.window)
"""


@pytest.mark.slow
def test_a_window_of_pyglet():
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True)
    if done.stdout.startswith("SKIP"):
        pytest.skip(done.stdout)
    assert done.returncode == 0, done.stderr
    assert done.stdout == "CLOSED False None\n"
