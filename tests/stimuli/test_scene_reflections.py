"""Smooth surfaces and metals show what is around them, where geometry says, and never more than arrives."""

import numpy as np
import pytest

from evenlight.stimuli.scenes.content.house.plan import hollow
from evenlight.stimuli.scenes.engine import renderer as drawing
from evenlight.stimuli.scenes.engine.antialiasing import OFFLINE
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.light.bake_lights import sky_picture
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.reflections import SIDES, lobe, octahedron
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Quality
from evenlight.stimuli.scenes.engine.shapes import BOX_SIDES

SIZE = 128
GLOW = 30.0  # [cd/m^2]


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))


def paint(name, albedo, **kind):
    return Material(name, lambda rng, size: np.full((size, size, 3), albedo, dtype="f4"), 1.0, **kind)


def seen(scene, camera, quality=None):
    with offscreen_context() as context:
        renderer = SceneRenderer(context, scene, (SIZE, SIZE), quality, OFFLINE)
        renderer.render(camera)
        return renderer.luminance()


def glowing_room(plate, side=0.5):
    """A room all of whose walls shine alike, with a plate in the middle that faces up."""
    model = SceneModel("furnace", 1)
    for corners in BOX_SIDES.values():
        model.lamp((np.array(corners) * 4 - 2)[::-1], GLOW)
    model.quad([[-side, -side, 0], [side, -side, 0], [side, side, 0], [-side, side, 0]], plate)
    return model.build()


@pytest.mark.parametrize(
    ("place", "azimuth", "altitude"),
    [((-1, 0.5, 1.2), 40, 5), ((0.5, -1, 1.8), 5, 3), ((-1.5, -0.5, 2), 25, -8)],
)
def test_a_metal_wall_shows_a_lamp_opposite_where_geometry_says(place, azimuth, altitude):
    model, metal = SceneModel("mirror", 1), paint("metal", 0.8, gloss=1.0, metal=1.0)
    hollow(model, (-3, -2, 0), (3, 2, 3), paint("wall", 0.3), skip="Y")
    model.quad([(-3, 2, 0), (3, 2, 0), (3, 2, 3), (-3, 2, 3)], metal)
    model.lamp([(1.5, -1.99, 1.5), (1, -1.99, 1.5), (1, -1.99, 2), (1.5, -1.99, 2)], 90.0)
    camera = Camera(place, azimuth, altitude, 90.0)
    picture = seen(model.build(), camera)[..., 1]
    row, column = np.nonzero(picture > 45)
    # The lamp's middle, mirrored at y = 2; texels of what is around are 0.8 degrees apart.
    right, up, ahead = camera.axes() @ (np.array([1.25, 2 + 3.99, 1.75]) - place)
    middle, focal = SIZE / 2, camera.focal_pixels(SIZE)
    assert column.mean() + 0.5 == pytest.approx(middle + focal * right / ahead, abs=1.2)
    assert row.mean() + 0.5 == pytest.approx(middle - focal * up / ahead, abs=1.2)
    assert picture.max() == pytest.approx(0.8 * 90, rel=0.01)


@pytest.mark.parametrize("gloss", [0.0, 0.5, 1.0])
def test_metal_in_a_room_of_one_luminance_has_its_base_colour_times_that(gloss):
    """The furnace test: seen straight on, share base colour of the light from all sides (Schlick 1994)."""
    scene = glowing_room(paint("gold", (0.9, 0.6, 0.2), gloss=gloss, metal=1.0))
    picture = seen(scene, Camera((0.0, 0.0, 1.0), 0.0, -90.0, field_of_view=10.0))
    np.testing.assert_allclose(picture.mean(axis=(0, 1)), GLOW * np.array([0.9, 0.6, 0.2]), rtol=0.01)


@pytest.mark.parametrize("gloss", [0.3, 1.0])
def test_no_more_light_leaves_a_surface_than_arrives(gloss):
    model = SceneModel("plain", 1)
    model.quad([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0]], paint("white", 1.0, gloss=gloss))
    model.sky((GLOW, GLOW, GLOW), (GLOW, GLOW, GLOW))
    scene = model.build()
    picture = seen(scene, Camera((0.0, 0.0, 0.5), 0.0, -20.0), Quality.COARSE)[SIZE // 2 :]
    assert picture.max() <= 1.002 * sky_picture(scene).max()  # there are clouds
    assert picture.min() >= 0.99 * GLOW  # it is white: none is lost


def test_what_is_matt_is_the_same_bit_by_bit_and_draws_no_surroundings(monkeypatch):
    def room(gloss):
        model = SceneModel("two", 1)
        model.quad([[-2, -2, 0], [2, -2, 0], [2, 2, 0], [-2, 2, 0]], paint("floor", 0.5))
        model.quad([[-2, 2.5, 0], [2, 2.5, 0], [2, 2.5, 2], [-2, 2.5, 2]], paint("wall", 0.5, gloss=gloss))
        model.sky((9, 12, 20), (20, 20, 20))
        return model.build()

    down = Camera((0.0, 0.0, 1.5), 0.0, -90.0, field_of_view=60.0)
    beside_smooth = seen(room(0.8), down)
    monkeypatch.setattr(drawing, "reflections", lambda *arguments: pytest.fail("drawn for matt surfaces"))
    np.testing.assert_array_equal(seen(room(0.0), down), beside_smooth)


def test_what_hides_most_is_drawn_first_and_the_picture_is_the_same(monkeypatch):
    """Rows of walls, matt and smooth by turns, one behind the other: few samples are drawn of hidden ones."""
    model, kinds = SceneModel("rows", 1), (paint("matt", 0.5), paint("smooth", 0.5, gloss=0.8))
    for k in range(64):
        model.quad([(x, 1 + k / 10, z) for x, z in ((-9, -9), (9, -9), (9, 9), (-9, 9))], kinds[1 - k % 2])
    model.sky((9, 12, 20), (20, 20, 20))
    scene, drawn, pictures = model.build(), [], []
    for parts in (1, drawing.PARTS):
        monkeypatch.setattr(drawing, "PARTS", parts)
        with offscreen_context() as context:
            renderer = SceneRenderer(context, scene, (SIZE, SIZE), None, OFFLINE)
            with (counted := context.query(samples=True)):
                renderer.render(Camera((0.0, 0.0, 0.0), 0.0))
            drawn.append(counted.samples)
            pictures.append(renderer.luminance())
    np.testing.assert_array_equal(*pictures)
    assert drawn[1] < drawn[0]


def test_a_picture_of_all_around_goes_on_beyond_its_edges():
    whole, inner = octahedron(8, 1), octahedron(8)
    np.testing.assert_allclose(whole[1:-1, 1:-1], inner)
    np.testing.assert_allclose(whole[0, 1:-1], inner[0, ::-1])  # on the other half of the same edge
    np.testing.assert_allclose(whole[1:-1, -1], inner[::-1, -1])


@pytest.mark.parametrize("grade", range(1, len(SIDES)))
def test_a_lobe_is_as_wide_as_its_roughness_says(grade):
    """Half of GGX's half vectors are within atan(alpha), alpha = roughness^2 (Walter et al. 2007)."""
    half = np.degrees(np.arccos(lobe(grade)[:, 2])) / 2
    assert np.median(half) == pytest.approx(np.degrees(np.arctan((grade / 5) ** 2)), rel=0.06)
