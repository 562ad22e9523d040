"""Camera: pixels and metres, without a drawing library."""

import subprocess
import sys

import numpy as np
import pytest

from carom.view import Camera

random = np.random.default_rng(0)


@pytest.mark.parametrize("y_up", [False, True])
def test_pixels_lead_back_to_metres(y_up):
    for _ in range(20):
        middle, scale = random.normal(0, 100, 2), 10.0 ** random.uniform(-3, 4)
        camera = Camera((random.integers(1, 2000), random.integers(1, 2000)), middle, scale, y_up=y_up)
        points = middle + random.normal(0, 50, (7, 2)) / scale
        rounding = 1e-12 * (np.abs(middle).max() + 1e3 / scale)
        assert np.abs(camera.to_world(camera.to_screen(points)) - points).max() < rounding
        up = camera.to_screen(points + np.array((0, 1 / scale))) - camera.to_screen(points)
        assert np.abs(up - (0, 1 if y_up else -1)).max() < 2 * rounding * scale
        low, high = camera.visible
        assert sorted([*camera.to_screen(low), *camera.to_screen(high)]) == pytest.approx(
            sorted((0, 0, *camera.size)), abs=1e-6
        )


def test_zooming_keeps_what_is_under_the_mouse_and_fitting_shows_all():
    camera = Camera((800, 600), (3, -2), 40)
    under = camera.to_world((123, 456))
    camera.zoom(1.7, (123, 456))
    assert camera.to_world((123, 456)) == pytest.approx(under)
    assert camera.scale == pytest.approx(68)
    camera.fit((-50, 1), (20, 3))
    corners = camera.to_screen(np.array([(-50, 1), (20, 3)]))
    assert (corners >= 0).all()
    assert (corners <= (800, 600)).all()
    assert abs(corners[1] - corners[0])[0] == pytest.approx(760)
    camera.zoom(1e30)
    assert camera.scale == 1e6
    camera.pan((10, 5))
    assert camera.to_screen(camera.middle) == pytest.approx((400, 300))


def test_following_takes_as_long_at_any_frame_rate_and_stays_in_the_level():
    ends = []
    for frames in (15, 60, 240):
        camera = Camera((800, 600), scale=100.0)
        for _ in range(frames):
            camera.follow((10, 0), 1 / frames, half_life=0.25)
        ends.append(camera.middle[0])
    assert ends == pytest.approx([10 * (1 - 2**-4)] * 3)
    camera.bounds = (-6, -4), (6, 4)  # the picture is 8 m by 6 m
    camera.follow((100, -100))
    assert camera.middle == pytest.approx((2, -1))
    camera.bounds = (0, 0), (1, 1)
    camera.follow((100, 100))
    assert camera.middle == pytest.approx((0.5, 0.5))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"scale": 0}, "Camera.scale must be a finite number above 0, got 0"),
        ({"middle": (0, np.nan)}, "Camera.middle must be two finite numbers"),
        ({"size": 7}, "Camera.size must be two finite numbers, got 7"),
    ],
)
def test_what_is_no_camera_is_refused(change, text):
    with pytest.raises(ValueError, match=text):
        Camera(**change)


@pytest.mark.slow
def test_a_camera_needs_no_drawing_library_and_sprites_say_what_they_need():
    code = (
        "import sys; sys.modules['pygame'] = None\n"
        "from carom.view import Camera, MissingPackageError, Sprites, View\n"
        "print(Camera((10, 10)).to_screen((0, 0)).tolist())\n"
        "from carom import Physics, World\n"
        "for make in (Sprites, View):\n"
        "    try: make(World(Physics(2)))\n"
        "    except MissingPackageError as error: print(error)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    lines = done.stdout.splitlines()
    assert lines[0] == "[5.0, 5.0]"
    assert [line.partition(" needs ")[2] for line in lines[1:]] == ["pygame-ce: pip install 'carom[view]'"] * 2
