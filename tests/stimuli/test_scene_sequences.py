"""Scenes as sequences: the same every time, as long as the path, from bright outdoors to dim rooms."""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from evenlight.data_schema.errors import InputError
from evenlight.stimuli.scenes.content.catalogue import path_named, scene_named
from evenlight.stimuli.scenes.engine.antialiasing import NONE
from evenlight.stimuli.scenes.engine.array_cache import cache_folder
from evenlight.stimuli.scenes.engine.camera import Camera
from evenlight.stimuli.scenes.engine.graphics import offscreen_context
from evenlight.stimuli.scenes.engine.model import Material, SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Quality
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.sequence_format import SequenceFormat
from evenlight.stimuli.sequences import WALKS, built_in_sequence

ROOT = Path(__file__).resolve().parents[2]
SIZE = (160, 90)
REC_709 = np.array([0.2126, 0.7152, 0.0722])


@pytest.fixture(scope="module", autouse=True)
def one_cache(tmp_path_factory):
    """Light of this file's own scene, baked once; the user's cache has none of it."""
    before = os.environ.get("XDG_CACHE_HOME")
    os.environ["XDG_CACHE_HOME"] = str(tmp_path_factory.mktemp("cache"))
    yield before
    if before is None:
        del os.environ["XDG_CACHE_HOME"]
    else:
        os.environ["XDG_CACHE_HOME"] = before


@pytest.fixture
def users_cache(one_cache, monkeypatch):
    """The light of the house and the school, which takes long to bake and serves every run of the tests."""
    if one_cache is None:
        monkeypatch.delenv("XDG_CACHE_HOME")
    else:
        monkeypatch.setenv("XDG_CACHE_HOME", one_cache)


def grained(rng, size):
    return rng.uniform(0.2, 0.9, (size, size, 3)).astype(np.float32)


def small_scene(seed=1):
    """A room with a lamp and a hole to a sunny lawn."""
    model = SceneModel("small", seed)
    wall = Material("wall", grained, 1.0, gloss=0.3)
    model.box([-10, -10, -0.2], [10, 10, 0], wall)
    model.box([-2, 1.9, 0], [2, 2, 2.5], wall)
    model.box([-2, -2, 0], [-1.9, 2, 2.5], wall)
    model.box([-2.2, -2.2, 2.5], [2.2, 2.2, 2.6], wall)
    model.cylinder([0.5, 1, 0], [0.5, 1, 1], 0.2, wall)
    model.lamp([[-0.5, 0, 2.45], [-0.5, 0.5, 2.45], [0.5, 0.5, 2.45], [0.5, 0, 2.45]], 60.0)
    model.sun(200.0, 40.0, 200.0)
    model.sky((10.0, 20.0, 40.0), (30.0, 30.0, 30.0))
    return model.build()


CAMERA = Camera((0.5, -1.5, 1.6), 340.0, -10.0)


def pixel_values(scene, cameras=(CAMERA,), quality=Quality.COARSE):
    with offscreen_context() as context:
        renderer = SceneRenderer(context, scene, SIZE, quality, NONE)
        pictures = []
        for camera in cameras:
            renderer.render(camera)
            renderer.encode()
            pictures.append(renderer.pixel_values())
        return pictures


def test_the_same_seed_bakes_and_renders_the_same_frame_twice(tmp_path, monkeypatch):
    pictures = []
    for name in ("first", "again"):
        monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / name))  # both are baked
        pictures += pixel_values(small_scene())
    first, again = (picture.astype(int) for picture in pictures)
    assert np.abs(first - again).max() <= 65535 // 1023 + 1  # one 10-bit code


def test_another_seed_has_another_grain():
    (first,), (other,) = (pixel_values(small_scene(seed), quality=None) for seed in (1, 2))
    assert (first != other).mean() > 0.3


def test_light_is_stored_and_found_again_and_a_broken_file_is_made_again(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    (fresh,) = pixel_values(small_scene())
    (file,) = cache_folder().glob("light-*.npy")
    stored = file.read_bytes()
    (found,) = pixel_values(small_scene())
    file.write_bytes(stored[:100])
    (mended,) = pixel_values(small_scene())
    np.testing.assert_array_equal(found, fresh)
    np.testing.assert_array_equal(mended, fresh)
    assert file.read_bytes() == stored


def test_a_cache_that_cannot_be_written_is_no_failure(tmp_path, monkeypatch):
    (tmp_path / "evenlight").write_text("in the way")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path))
    assert pixel_values(small_scene())[0].any()


@pytest.mark.parametrize("name", WALKS)
def test_a_walk_lasts_as_long_as_its_path_and_its_definition_is_its_hash(name):
    sequence = built_in_sequence(name)
    assert sequence.n_frames == round(path_named(name).duration * 25)
    assert sequence.name == name
    others = [built_in_sequence(name, duration=2.0), built_in_sequence(name, size=(64, 36))]
    assert len({s.sha256() for s in [sequence, *others]}) == 3
    assert built_in_sequence(name).sha256() == sequence.sha256()


def test_a_walk_longer_than_its_path_is_refused():
    with pytest.raises(
        InputError, match=r"cannot render library: need \d+ s at most, which is how long the path"
    ):
        built_in_sequence("library", duration=1000.0)


def test_a_shorter_walk_is_the_beginning_of_the_path_at_the_same_speed():
    """The frames of the first second are those of the whole walk."""
    path = path_named("living_room")
    short = built_in_sequence("living_room", duration=1.0)
    assert [path.camera(t) for t, _ in short.format.times()] == [
        path.camera(t) for t, _ in built_in_sequence("living_room").format.times()[:25]
    ]


def test_a_walk_yields_frames_on_the_10_bit_grid_and_outdoors_is_far_brighter_than_the_basement(users_cache):
    sequence = SceneSequence(SequenceFormat(64, 36, 0.08, 25.0), "basement")
    frames = list(sequence.frames())
    assert [frame.pixel_values.shape for frame in frames] == [(36, 64, 3)] * 2
    steps = frames[0].pixel_values * (1023 / 65535)
    assert np.abs(steps - np.rint(steps)).max() <= 0.5 * 1023 / 65535 + 1e-9
    path = path_named("basement")
    cameras = [path.camera(time) for time in np.arange(0, path.duration, 4.0)]
    shown = pixel_values(scene_named(path.scene), cameras, Quality.FINE)
    means = [float((((p / 65535) ** 2.2) * 100).mean(axis=(0, 1)) @ REC_709) for p in shown]
    assert math.log10(max(means) / min(means)) >= 1


IN_WINDOW = """
import sys
import numpy as np
sys.path[:0] = [{root!r}, {tests!r}]
from psychopy import visual
import moderngl
from test_scene_sequences import CAMERA, SIZE, pixel_values, small_scene
from evenlight.stimuli.scenes.engine.antialiasing import NONE
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.data_schema.display import Display
from evenlight.data_schema.recordings.rig import Dither
from evenlight.stimuli.field_renderer import Field, FieldRenderer

window = visual.Window((320, 200), units="pix", gammaErrorPolicy="warn", checkTiming=False, useFBO=False)
context = moderngl.create_context(require=330)
field = FieldRenderer(context, Display("plain", 100.0, 0.0, 2.2, 20.0), 8, Dither.NONE)
own = context.simple_framebuffer((8, 8))

def grey():
    field.draw(own, Field(25.0))
    return np.frombuffer(own.read(components=1), np.uint8).copy()

before = grey()
window.flip()
renderer = SceneRenderer(context, small_scene(), SIZE, None, NONE)
renderer.render(CAMERA)
renderer.encode()
picture = renderer.pixel_values()
assert (grey() == before).all() and before[0] == round(255 * 0.25 ** (1 / 2.2)), "field"
renderer.render(CAMERA)  # after what the field left behind
renderer.encode()
assert (renderer.pixel_values() == picture).all(), "again"
np.save({out!r}, picture)
window.close()
"""


def test_in_a_window_the_picture_is_the_same_and_fields_are_drawn_right_afterwards(virtual_screen, tmp_path):
    out = tmp_path / "picture.npy"
    code = IN_WINDOW.format(root=str(ROOT), tests=str(Path(__file__).parent), out=str(out))
    done = subprocess.run(
        [sys.executable, "-c", code],
        env=os.environ | {"DISPLAY": virtual_screen(24), "PSYCHOPYNOPACKAGES": "1", "HOME": str(tmp_path)},
        capture_output=True, text=True, timeout=200, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    (offscreen,) = pixel_values(small_scene(), quality=None)
    difference = np.abs(np.load(out).astype(int) - offscreen.astype(int))
    assert difference.max() <= 65535 // 1023 + 1  # one 10-bit code
