"""Four views: what the focus view of an eye shows is what its wide view has there, with more pixels.

Both are drawn; compared is the light of directions that lie amid them, of pictures without fine detail.
"""

import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither, Eye
from evenlight.hardware.presentation.headset_views import Pose
from evenlight.hardware.simulated.headset import HeadsetScript, SimulatedHeadset
from evenlight.stimuli.dithering import GRID_LEVELS
from evenlight.stimuli.eyes.eye_renderer import EyeFieldRenderer, EyeImageRenderer
from evenlight.stimuli.eyes.eye_views import eye_views
from evenlight.stimuli.eyes.surfaces import FlatScreen, Sphere
from evenlight.stimuli.field_renderer import Field
from evenlight.stimuli.image_renderer import DimmedImage, EyeImages, Image
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.stereo import StereoRenderer

LAB = Display("lab", 100.0, 0.0, 1.0, pixels_per_degree=20.0)  # a code is a luminance
WIDE, FOCUS = (90, 80), (120, 100)


@pytest.fixture
def headset():
    script = HeadsetScript(head=lambda _: Pose((0.1, 1.0, 0.2), (0.0, 0.1, 0.0, 0.995)), focus_size=FOCUS)
    with SimulatedHeadset(WIDE, script=script) as window:
        window.begin(Eye.LEFT)
        yield window


def waves(height, width, periods):
    """A grey picture whose levels rise and fall across, and more slowly down."""
    rows, columns = np.mgrid[:height, :width] / np.array([height, width])[:, None, None]
    levels = 128 + 70 * np.sin(2 * np.pi * periods * columns) + 40 * np.cos(2 * np.pi * rows)
    return np.repeat(levels.round().astype(np.uint8)[..., None], 3, axis=-1)


def of_scene(window):
    model = SceneModel("lamps", 1)
    for x, to, light in ((-3.0, -0.6, 20.0), (-0.6, 0.0, 80.0), (0.0, 0.9, 40.0), (0.9, 4.0, 90.0)):
        model.lamp([[x, 4, -9], [to, 4, -9], [to, 4, 9], [x, 4, 9]], light)
    stereo = StereoRenderer(window.context(), model.build(), window.view_sizes(), None)
    stereo.render(eye_views(window.eyes(), (0.0, 0.0, 1.0), 0.0))
    stereo.encode()
    images = [Image(eye.codes, GRID_LEVELS, from_below=True) for eye in stereo.eyes]
    renderer = EyeImageRenderer(window, LAB, Dither.NONE)
    renderer.draw(window.framebuffer(), DimmedImage(EyeImages(images), 0.8, 0.0))


def of_film(surface, periods):
    def draw(window):
        renderer = EyeImageRenderer(window, LAB, Dither.NONE, surface)
        film = np.concatenate([waves(200, 200, periods), 255 - waves(200, 200, periods)], axis=1)
        renderer.draw(window.framebuffer(), DimmedImage(renderer.image(film), 0.8, 0.0))

    return draw


def of_text(window):
    renderer = EyeFieldRenderer(window, LAB, Dither.NONE)
    coverage = np.ascontiguousarray(waves(960, 1280, 2)[..., 0])
    renderer.draw(window.framebuffer(), Field(80.0, 5.0, coverage))


DRAWN = {
    "text": of_text,
    "a flat film": of_film(FlatScreen(60.0), 2),
    "a half for each eye": of_film(FlatScreen(60.0, side_by_side=True), 3),
    "a sphere": of_film(Sphere(360.0), 6),
    "a scene": of_scene,
}


@pytest.mark.parametrize("kind", DRAWN)
def test_a_focus_view_shows_what_the_wide_view_has_there(headset, kind: str) -> None:
    DRAWN[kind](headset)
    whole, eyes = headset.read_codes()[..., 1], headset.eyes().eyes
    assert whole.shape == (100, 2 * (90 + 120))
    views = [
        whole[100 - high :, left : left + across] for left, _, across, high in (eye.part for eye in eyes)
    ]
    for wide, focus, of_wide, of_focus in zip(views[:2], views[2:], eyes[:2], eyes[2:], strict=True):
        (left, right, down, up), edge = of_wide.fov.tangents(), of_focus.fov.tangents()[1]
        columns = (np.linspace(left, right, 181)[1::2] + edge) / (2 * edge) * 120  # of the wide view's pixels
        rows = (edge - np.linspace(up, down, 161)[1::2]) / (2 * edge) * 100  # in the focus view
        inside = [np.flatnonzero((at > 0) & (at < n)) for at, n in ((rows, 100), (columns, 120))]
        here = focus[np.ix_(rows[inside[0]].astype(int), columns[inside[1]].astype(int))]
        there = wide[np.ix_(*inside)]
        assert np.ptp(there) > 60
        assert np.median(np.abs(there - here)) < 3
