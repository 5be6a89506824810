"""Cameras look where they say, in numbers and in pictures."""

import math

import numpy as np
import pytest
from seen_points import project

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import direction_of

SIZE = (320, 180)


def test_a_wall_a_metre_wide_a_metre_away_covers_the_focal_length():
    # By similar triangles: width in pixels = focal length * width / distance.
    camera = Camera((0.0, 0.0, 1.5), 90.0, focal_length=200.0)
    left, right = project(camera, [[1.0, 0.5, 1.5], [1.0, -0.5, 1.5]], SIZE)
    np.testing.assert_allclose([left, right], [[160 - 100, 90], [160 + 100, 90]])


def test_the_field_of_view_ends_at_the_edges():
    camera = Camera((0.0, 0.0, 0.0), 0.0, field_of_view=80.0)
    half = math.radians(40)
    np.testing.assert_allclose(project(camera, [[math.sin(half), math.cos(half), 0]], SIZE)[0], [320, 90])


def test_what_lies_behind_has_no_place():
    assert np.isnan(project(Camera((0.0, 0.0, 0.0), 0.0), [[0.0, -1.0, 0.0]], SIZE)).all()


@pytest.mark.slow
@pytest.mark.parametrize(("azimuth", "altitude"), [(0, 0), (37, -20), (201, 35), (300, 80)])
def test_a_lit_square_is_drawn_where_the_projection_says(azimuth, altitude):
    camera = Camera((3.0, -2.0, 1.6), azimuth, altitude, focal_length=250.0)
    ahead, right, up = direction_of(azimuth, altitude), camera.axes()[0], camera.axes()[1]
    centre = np.array(camera.position) + 4 * ahead + 0.8 * right - 0.5 * up
    half = 0.2
    model = SceneModel("square", 1)
    model.lamp([centre + half * (a * right + b * up) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))], 50.0)
    with offscreen_context() as context:
        renderer = SceneRenderer(context, model.build(), SIZE, None)
        renderer.render(camera)
        light = renderer.luminance()[..., 1]
    rows, columns = np.mgrid[:180, :320] + 0.5
    found = np.array([(light * columns).sum(), (light * rows).sum()]) / light.sum()
    np.testing.assert_allclose(found, project(camera, [centre], SIZE)[0], atol=0.5)
    # By hand: 4 m ahead, 0.8 m to the right, 0.5 m below, at a focal length of 250 pixels.
    np.testing.assert_allclose(found, [160 + 250 * 0.8 / 4, 90 + 250 * 0.5 / 4], atol=0.5)


@pytest.mark.parametrize(
    "wrong",
    [{"altitude": 91.0}, {"field_of_view": 0.0}, {"focal_length": -1.0}, {"azimuth": math.nan}],
)
def test_impossible_cameras_are_refused(wrong):
    with pytest.raises(ValueError, match="need a"):
        Camera(**({"position": (0.0, 0.0, 0.0), "azimuth": 0.0} | wrong))


def test_without_graphics_there_is_one_clear_line(monkeypatch):
    import moderngl

    def none(**options):
        raise Exception("cannot create\na context")

    monkeypatch.setattr(moderngl, "create_context", none)
    with pytest.raises(InputError, match=r"scenes need OpenGL 3.3, .*\(cannot create\): install") as refused:
        offscreen_context()
    assert "\n" not in str(refused.value)
