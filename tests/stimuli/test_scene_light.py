"""Light falls in scenes as closed forms say, in pictures as on paper."""

import math

import numpy as np
import pytest

from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import KNEE, PEAK, offscreen_context
from evenlight.stimuli.scenes.engine.light.bake import charts_of, texels_of
from evenlight.stimuli.scenes.engine.light.stitches import stitched
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Quality

SIZE = (64, 48)


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def paint(name, albedo):
    return Material(name, lambda rng, size: np.full((size, size, 3), albedo, dtype=np.float32), 1.0)


def square(model, material, half, height=0.0):
    model.quad(
        [[-half, -half, height], [half, -half, height], [half, half, height], [-half, half, height]], material
    )


def seen(scene, camera, quality=Quality.COARSE):
    with offscreen_context() as context:
        renderer = SceneRenderer(context, scene, SIZE, quality)
        renderer.render(camera)
        return renderer.luminance()


def middle(picture):
    """Mean of the 4 pixels in the middle."""
    return picture[23:25, 31:33].mean(axis=(0, 1))


LOOKING_DOWN = Camera((0.0, 0.0, 2.0), 0.0, -90.0, field_of_view=10.0)


@pytest.mark.parametrize("albedo", [0.2, 0.5, 1.0])
def test_an_even_sky_gives_a_level_plane_its_luminance_times_the_albedo(albedo):
    model = SceneModel("plane", 1)
    square(model, paint("grey", albedo), 20.0)
    model.sky((10.0, 20.0, 40.0), (10.0, 20.0, 40.0))
    expected = albedo * np.array([10.0, 20.0, 40.0])
    np.testing.assert_allclose(middle(seen(model.build(), LOOKING_DOWN)), expected, rtol=0.01)


def test_the_sun_gives_a_plane_its_illuminance_over_pi_times_the_sine_of_its_altitude():
    model = SceneModel("plane", 1)
    square(model, paint("grey", 0.5), 5.0)
    model.sun(120.0, 30.0, 200.0)
    expected = 0.5 * 200 / math.pi * math.sin(math.radians(30))
    np.testing.assert_allclose(middle(seen(model.build(), LOOKING_DOWN)), expected, rtol=0.01)


def test_a_roof_takes_the_sun_away():
    model = SceneModel("plane", 1)
    square(model, paint("grey", 0.5), 5.0)
    model.box([-3, -3, 2.5], [3, 3, 2.6], paint("roof", 0.5))
    model.sun(120.0, 80.0, 200.0)
    direct = 0.5 * 200 / math.pi * math.sin(math.radians(80))
    # What is left is the light that the sunlit floor around sends to the roof, and that back.
    assert middle(seen(model.build(), LOOKING_DOWN)).max() < 0.05 * direct


def parallel_squares(half, distance):
    """Share of light that a point gets from a square above, from the point below its middle.

    Four times the configuration factor of a differential element to a parallel rectangle with a corner above
    it (Howell, catalogue of configuration factors, B-3), each side `half` long.
    """
    x = half / distance
    root = math.sqrt(1 + x * x)
    return 4 * (2 * x / root * math.atan(x / root)) / (2 * math.pi)


@pytest.mark.parametrize("distance", [1.0, 2.0, 4.0])
def test_a_lamp_lights_paper_below_it_by_its_form_factor(distance):
    model = SceneModel("lamp", 1)
    square(model, paint("paper", 0.8), 0.3)
    half = 0.5
    corners = [
        [-half, half, distance],
        [half, half, distance],
        [half, -half, distance],
        [-half, -half, distance],
    ]
    model.lamp(corners, 100.0)
    camera = Camera((0.0, -0.5, 0.5), 0.0, -45.0, field_of_view=4.0)
    expected = 0.8 * 100 * parallel_squares(half, distance)
    np.testing.assert_allclose(middle(seen(model.build(), camera, Quality.FINE)), expected, rtol=0.03)


def test_a_lamp_has_the_luminance_it_was_given_in_its_colour():
    model = SceneModel("lamp", 1)
    model.lamp([[-1, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1]], 30.0, (1.0, 0.8, 0.5))
    picture = middle(seen(model.build(), Camera((0.0, 0.0, 0.0), 0.0, 0.0)))
    assert picture @ [0.2126, 0.7152, 0.0722] == pytest.approx(30.0, rel=2e-3)
    np.testing.assert_allclose(picture / picture[0], [1.0, 0.8, 0.5], rtol=2e-3)


def test_a_sunlit_floor_lights_what_is_above_it():
    model = SceneModel("floor", 1)
    square(model, paint("floor", 0.5), 30.0)
    paper, half, height = paint("paper", 0.9), 0.1, 2.0
    model.quad(
        [[-half, half, height], [half, half, height], [half, -half, height], [-half, -half, height]], paper
    )
    model.sun(90.0, 30.0, 400.0)
    # Facing down, it sees hardly anything but floor, of luminance 0.5 E sin(30 deg) / pi.
    expected = 0.9 * 0.5 * 400 * 0.5 / math.pi
    camera = Camera((0.0, -1.0, 1.0), 0.0, 45.0, field_of_view=2.0)
    np.testing.assert_allclose(middle(seen(model.build(), camera, Quality.FINE)), expected, rtol=0.03)


def shown_share(luminance: np.ndarray) -> np.ndarray:
    """The share of the peak that is shown: up to the knee as it is, above an exponential approach to 1."""
    share = np.maximum(luminance, 0) / PEAK
    over = np.maximum(share - KNEE, 0) / (1 - KNEE)
    return np.minimum(share, KNEE) + (1 - KNEE) * (1 - np.exp(-over))


def test_what_is_drawn_is_encoded_for_a_display_of_gamma_22():
    model = SceneModel("lamp", 1)
    model.lamp([[-1, 2, -1], [1, 2, -1], [1, 2, 1], [-1, 2, 1]], 30.0)
    with offscreen_context() as context:
        renderer = SceneRenderer(context, model.build(), SIZE, None)
        renderer.render(Camera((0.0, 0.0, 0.0), 0.0, 0.0))
        renderer.encode()
        light, codes = renderer.luminance(), renderer.pixel_values()
    expected = shown_share(light) ** (1 / 2.2) * 65535
    # Half a level of 10 bits, and the half floats that are read back for the check.
    np.testing.assert_allclose(codes, expected, atol=0.5 * 65535 / 1023 + 20)
    assert codes[24, 32, 0] == pytest.approx((30 / PEAK) ** (1 / 2.2) * 65535, abs=50)


def test_light_above_the_knee_is_compressed_smoothly_to_the_peak():
    light = np.linspace(0, 400, 4001)
    share = shown_share(light)
    assert (np.diff(share) >= 0).all()
    assert share[-1] == pytest.approx(1.0, abs=1e-5)
    slopes = np.diff(share) / np.diff(light) * PEAK
    assert np.abs(np.diff(slopes)).max() < 0.01  # no kink


def test_patches_side_by_side_in_one_plane_have_the_same_light_at_their_edge():
    """Of 10 and 12 cd/m^2 it is 11, wherever the texels are; where a shadow ends (30), it stays."""
    model, grey = SceneModel("row", 1), paint("grey", 0.5)
    for left, right, deep in ((0, 2, 3), (2, 3, 3), (3, 5, 2)):
        model.quad([[left, 0, 0], [right, 0, 0], [right, deep, 0], [left, deep, 0]], grey)
    patches = model.build().patches
    charts = charts_of(patches, np.zeros(3, dtype=bool))
    texels = texels_of(patches, charts)
    light = np.array([10.0, 12.0, 30.0])[texels.patch, None] * np.ones(3)
    at_edge = np.isclose(
        (patches.origin[:, 0][texels.patch] + texels.s * patches.along[:, 0][texels.patch]), 2, atol=0.05
    )
    expected = np.where(at_edge[:, None], 11.0, light)
    np.testing.assert_allclose(stitched(patches, charts, texels, light), expected)
