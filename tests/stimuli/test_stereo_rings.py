"""A ring for both eyes lies on its surface: it is seen there from wherever the head is."""

import math

import numpy as np
import pytest
from headset_frames import frame_of, projected
from scipy.spatial.transform import Rotation

from evenlight.data_schema.display import Display
from evenlight.hardware.presentation.headset_views import EyeFov
from evenlight.stimuli.eyes.eye_views import eye_views
from evenlight.stimuli.rings.landolt import Ring
from evenlight.stimuli.rings.ring_scene import RingScene, StereoRings
from evenlight.stimuli.scenes.engine.antialiasing import EYES
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.stereo import StereoRenderer

SIZE = (320, 240)
HERE = (1.0, 2.0, 1.65)
EVEN = EyeFov(-0.7, 0.7, 0.6, -0.6)
WALL = 1.5  # [m] north of the eye
SHINING = 60.0  # [cd/m^2]
# 320 pixels for 2 tan 0.7: 190 pixels away, or 3.3 pixels per degree.
HEADSET = Display("headset", 100.0, 0.0, 2.2, pixels_per_degree=320 / (2 * math.tan(0.7)) * math.pi / 180)


@pytest.fixture(scope="module")
def context():
    with offscreen_context() as context:
        yield context


@pytest.fixture(scope="module")
def scene():
    """A wall to the north that shines."""
    model = SceneModel("walls", 1)
    x, y, z = HERE
    model.lamp(
        [
            [x - 9, y + WALL, z - 9],
            [x + 9, y + WALL, z - 9],
            [x + 9, y + WALL, z + 9],
            [x - 9, y + WALL, z + 9],
        ],
        SHINING,
    )
    return model.build()


@pytest.fixture(scope="module")
def rings(context, scene):
    return StereoRings(context, StereoRenderer(context, scene, (SIZE, SIZE), None), scene, HEADSET)


def ring_of(orientation=0, azimuth=8.0, altitude=5.0):
    return Ring(azimuth, altitude, gap=40.0, contrast=-0.5, orientation=orientation)


def middles(rings, views):
    """Return where both eyes see the ring's middle [pixels]: between rings whose gaps are across."""
    found = np.zeros((2, 2))
    rows, columns = np.mgrid[:240, :320] + 0.5
    for orientation in (0, 180):
        painted = rings.paint(ring_of(orientation), HERE)
        rings.draw(views)
        without = [eye.pixel_values()[..., 1].astype(float) for eye in rings.eyes]
        rings.draw(views, painted)
        for k, eye in enumerate(rings.eyes):
            dark = without[k] - eye.pixel_values()[..., 1]
            found[k] += np.array([(dark * columns).sum(), (dark * rows).sum()]) / dark.sum() / 2
    return found


def test_a_ring_is_as_far_as_the_wall_in_its_direction(rings):
    painted = rings.paint(ring_of(), HERE)
    away = math.cos(math.radians(8)) * math.cos(math.radians(5))  # northwards, per metre
    assert painted.distance == pytest.approx(WALL / away)
    assert painted.seen_from == HERE
    assert painted.surroundings.luminance == pytest.approx(SHINING, rel=0.01)


def test_the_disparity_of_a_ring_is_that_of_the_wall(rings):
    """By hand: all of the wall is 1.5 m ahead, so the eyes see it 0.063 / 1.5 of the focal length apart."""
    left, right = middles(rings, eye_views(frame_of(fovs=(EVEN, EVEN)), HERE, 0.0))
    focal = 160 / math.tan(0.7)
    assert left[0] - right[0] == pytest.approx(0.063 / WALL * focal, abs=0.5)
    assert 0.063 / WALL * focal > 7
    # Towards 8 degrees to the right and 5 up.
    assert (left[0] + right[0]) / 2 == pytest.approx(160 + focal * math.tan(math.radians(8)), abs=0.5)
    up = math.tan(math.radians(5)) / math.cos(math.radians(8))
    below = 120 - 120 / math.tan(0.6) * up
    assert left[1] == pytest.approx(below, abs=0.5)
    assert right[1] == pytest.approx(below, abs=0.5)


def test_a_head_that_moves_and_tilts_sees_the_ring_stay_on_the_wall(rings):
    """The point of the wall is at 1.5 tan 8 m to the right; where each eye sees it, the projection says."""
    turn = Rotation.from_euler("yxz", [15, -6, 12], degrees=True)
    views = eye_views(frame_of(turn, place=(0.3, -0.2, -0.4)), HERE, 0.0)
    right, up = math.tan(math.radians(8)), math.tan(math.radians(5)) / math.cos(math.radians(8))
    point = np.array(HERE) + WALL * np.array([right, 1.0, up])
    for found, view in zip(middles(rings, views), views, strict=True):
        np.testing.assert_allclose(found, projected(view, [point], SIZE)[0], atol=0.5)


def test_from_where_it_was_painted_an_eye_sees_what_a_window_shows_to_the_code(context, scene, rings):
    window = RingScene(context, SceneRenderer(context, scene, SIZE, None, EYES), HEADSET)
    ring = ring_of(45)
    camera = Camera(HERE, 3.0, 2.0, focal_length=190.0)
    window.draw(camera, window.paint(ring, HERE))
    expected = window.pixel_values()
    rings.draw((camera, camera), rings.paint(ring, HERE))
    for eye in rings.eyes:
        np.testing.assert_array_equal(eye.pixel_values(), expected)
    assert len(np.unique(expected[..., 1])) > 10


def test_before_the_sky_a_ring_is_infinitely_far_and_behind_the_wall_not_seen(context, rings):
    assert rings.paint(ring_of(azimuth=8.0, altitude=5.0), (1.0, 40.0, 1.65)).distance == math.inf
    painted = rings.paint(ring_of(), HERE)
    beyond = eye_views(frame_of(place=(0.0, 0.0, -2.0)), HERE, 0.0)
    rings.draw(beyond)
    without = [eye.pixel_values() for eye in rings.eyes]
    rings.draw(beyond, painted)
    for eye, pixel_values in zip(rings.eyes, without, strict=True):
        np.testing.assert_array_equal(eye.pixel_values(), pixel_values)
