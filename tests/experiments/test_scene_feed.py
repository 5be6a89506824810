"""A walk drawn live: the same levels as the video that is rendered of it, through one path to the display."""

import json
import sys
import types
from collections.abc import Iterator
from pathlib import Path

import moderngl
import numpy as np
import pytest
from drawn_codes import image_codes

from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.experiments.playback.clip_feeds import SceneFeed
from evenlight.stimuli.dithering import thresholds_of
from evenlight.stimuli.image_renderer import DimmedImage, ImageRenderer
from evenlight.stimuli.scenes import scene
from evenlight.stimuli.scenes.graphics import offscreen_context
from evenlight.stimuli.scenes.model import SceneModel
from evenlight.stimuli.scenes.scene import Material, Quality, Scene
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.sequence_format import SequenceFormat

pytestmark = pytest.mark.slow

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


@pytest.fixture
def sequence(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> SceneSequence:
    """Two seconds straight on over the yard, turning."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    monkeypatch.setitem(scene.SCENES, "yard", ("a_yard", "yard"))
    monkeypatch.setitem(sys.modules, "evenlight.stimuli.scenes.a_yard", types.SimpleNamespace(yard=yard))
    points = [
        {"name": name, "time_s": time, "position_m": [x, 3, 1.65], "azimuth_deg": turn, "altitude_deg": -10}
        for name, time, x, turn in (("begin", 0, 2, 90), ("end", 2, 6, 150))
    ]
    file = tmp_path / "across.json"
    file.write_text(json.dumps({"scene": "yard", "duration_s": 2, "keypoints": points}))
    return SceneSequence(SequenceFormat(*SIZE, duration=2.0), str(file), Quality.COARSE)


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
        feed = SceneFeed(sequence, context)
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
