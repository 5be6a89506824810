"""A walk drawn live: the same levels as the video that is rendered of it, through one path to the display."""

import json
import sys
import types
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
import pytest
from clip_windows import RIG, Video, clip_of
from drawn_codes import image_codes

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.experiments.playback.clip_feeds import ClipFeeds, SceneFeed
from evenlight.stimuli.dithering import thresholds_of
from evenlight.stimuli.image_renderer import DimmedImage, ImageRenderer
from evenlight.stimuli.scenes.content import catalogue
from evenlight.stimuli.scenes.engine.antialiasing import OFFLINE
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.scene import Material, Quality, Scene
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.sequence_format import SequenceFormat

SIZE = (48, 28)
LAB = Display("lab", 100.0, 0.1, 2.2, pixels_per_degree=60.0)


def squares(_: np.random.Generator, size: int) -> np.ndarray:
    """A checkerboard of two colours, 4 squares to a tile."""
    place = np.indices((size, size)).sum(axis=0, where=True) // (size // 4)
    return np.where((place % 2)[..., np.newaxis], [0.8, 0.5, 0.3], [0.1, 0.2, 0.3]).astype(np.float32)


def yard(seed: int) -> Scene:
    model = SceneModel("yard", seed)
    model.quad([(0, 0, 0), (10, 0, 0), (10, 6, 0), (0, 6, 0)], Material("squares", squares, tile=2.0))
    model.sky((20.0, 30.0, 50.0), (60.0, 60.0, 50.0))
    model.walkable((0.0, 0.0), (10.0, 6.0))
    return model.build()


@pytest.fixture(scope="module")
def sequence(tmp_path_factory: pytest.TempPathFactory) -> Iterator[SceneSequence]:
    """Two seconds straight on over the yard, turning."""
    tmp_path = tmp_path_factory.mktemp("yard")
    points = [
        {"name": name, "time_s": time, "position_m": [x, 3, 1.65], "azimuth_deg": turn, "altitude_deg": -10}
        for name, time, x, turn in (("begin", 0, 2, 90), ("end", 2, 6, 150))
    ]
    file = tmp_path / "across.json"
    file.write_text(json.dumps({"scene": "yard", "duration_s": 2, "keypoints": points}))
    with pytest.MonkeyPatch.context() as monkeypatch:
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
        monkeypatch.setitem(catalogue.SCENES, "yard", ("a_yard", "yard"))
        module = types.SimpleNamespace(yard=yard)
        monkeypatch.setitem(sys.modules, "evenlight.stimuli.scenes.content.a_yard", module)
        yield SceneSequence(SequenceFormat(*SIZE, duration=2.0), str(file), Quality.COARSE)


@pytest.fixture
def context() -> Iterator[moderngl.Context]:
    with offscreen_context() as context:
        yield context


def test_live_and_rendered_frames_have_the_same_levels_and_codes(
    sequence: SceneSequence, context: moderngl.Context
) -> None:
    rendered = [frame.pixel_values.copy() for frame in sequence.frames()]
    assert np.ptp(rendered[0].astype(int)) > 10000  # there is something to be seen
    assert (rendered[0] != rendered[30]).mean() > 0.2  # and it moves
    with context:
        feed = SceneFeed(sequence, context, antialiasing=OFFLINE)
        assert feed.size() == SIZE
        renderer = ImageRenderer(context, LAB, 8, Dither.NOISY_BIT)
        target = context.framebuffer([context.renderbuffer(SIZE, 4)])
        for index in (0, 0, 17, 49):
            image = feed.image(index)
            levels, count = feed.levels()
            assert count == 1024
            assert (levels == rendered[index] >> 6).all()
            renderer.draw(target, DimmedImage(image, 0.6, ground=1.0), index, 5)
            codes = np.frombuffer(target.read(components=3, alignment=1), "u1")
            thresholds = thresholds_of(Dither.NOISY_BIT, SIZE[::-1], index, 5)
            wanted = image_codes(rendered[index], 0.6, thresholds, LAB, 8)
            assert (codes.reshape(SIZE[1], SIZE[0], 3)[::-1] == wanted).all()


def test_at_true_size_the_window_shows_the_middle_of_a_picture_of_more_pixels(
    sequence: SceneSequence, context: moderngl.Context
) -> None:
    """Twice as large, 48 x 28 pixels of 90 degrees are 96 x 56, of which the middle 60 x 40 fits.

    At the edge of a picture its pixels are smoothed with fewer neighbours.
    """
    large = replace(sequence, format=SequenceFormat(96, 56, duration=2.0))
    rendered = next(iter(large.frames())).pixel_values[8:48, 18:78] >> 6
    with context:
        feed = SceneFeed(sequence, context, scale=2.0, room=(60, 40), antialiasing=OFFLINE)
        assert feed.size() == (60, 40)
        feed.image(0)
        levels, _ = feed.levels()
        assert np.ptp(levels.astype(int)) > 150
        off = np.abs(levels.astype(int) - rendered)[2:-2, 2:-2]
        assert (off <= 1).mean() > 0.99


def test_a_video_is_scaled_and_what_is_read_of_it_is_what_is_drawn(context: moderngl.Context) -> None:
    """Two gray halves, five times as large in a window of 41 x 31: black left, gray right of the middle."""
    video = Video(np.arange(3) / 25, size=(16, 12))
    halves = np.zeros((12, 16, 3), np.uint8)
    halves[:, 8:] = 200
    video.pixels = lambda k: halves + np.uint8(k)
    clip = clip_of(np.arange(3) / 25, video, scale=5.0)
    window = types.SimpleNamespace(size=lambda: (41, 31))
    with context:
        renderer = ImageRenderer(context, LAB, 8, Dither.NONE)
        showing: Any = types.SimpleNamespace(window=window, rig=RIG, display=LAB)
        feeds = ClipFeeds(context, renderer, showing)
        with feeds.taken(clip) as feed:
            assert feed.ready(10.0)
            assert feed.size() == (41, 31)
            for index in (0, 0, 2):
                image = feed.image(index)
                levels, count = feed.levels()
                assert (count, image.levels, image.texture.size) == (1024, 1024, (41, 31))
                assert levels[:, :17] == pytest.approx(index / 255 * 1023, abs=0.51)
                assert levels[:, 24:] == pytest.approx((200 + index) / 255 * 1023, abs=0.51)
