"""A yard to walk in, what a headset is given for each refresh, and what it was to be given."""

import json
import sys
import types
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import moderngl
import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.frame import Frame
from evenlight.experiments.playback.clip_feeds import EyeSceneFeed
from evenlight.experiments.playback.player import Dimming, Pass, Playback, PlaybackDevices, Player
from evenlight.hardware.presentation.headset_views import HeadsetFrame
from evenlight.hardware.presentation.headset_window import HeadsetWindow
from evenlight.method.contrast.luminance import displayed_luminance, drawn_luminance
from evenlight.stimuli.eyes.eye_views import eye_views
from evenlight.stimuli.eyes.surfaces import FlatScreen
from evenlight.stimuli.image_renderer import EyeImages
from evenlight.stimuli.scenes.content import catalogue
from evenlight.stimuli.scenes.engine.antialiasing import EYES
from evenlight.stimuli.scenes.engine.model import SceneModel
from evenlight.stimuli.scenes.engine.renderer import SceneRenderer
from evenlight.stimuli.scenes.engine.scene import Material, Quality, Scene
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.sequence_format import SequenceFormat

TRANSFERS = {
    moderngl.Buffer: ("write", "read", "read_into", "orphan"),
    moderngl.Texture: ("write", "read", "read_into"),
    moderngl.TextureArray: ("write",),
    moderngl.Framebuffer: ("read", "read_into"),
    moderngl.Context: ("buffer", "texture", "texture_array", "framebuffer", "program"),
    moderngl.VertexArray: ("render",),
}
BLOCK = 8  # [pixels] of which the mean is compared, for the noise of the dithering


def yard(seed: int) -> Scene:
    """A floor of squares between a white wall in the north and a black one in the south, under the sky."""

    def squares(_: np.random.Generator, size: int) -> np.ndarray:
        place = np.indices((size, size)).sum(axis=0) // (size // 4)
        return np.where((place % 2)[..., np.newaxis], [0.8, 0.5, 0.3], [0.1, 0.2, 0.3]).astype(np.float32)

    def even(share: float) -> Material:
        return Material(f"gray {share}", lambda _, n: np.full((n, n, 3), share, np.float32), tile=1.0)

    model = SceneModel("yard", seed)
    model.quad([(0, 0, 0), (10, 0, 0), (10, 6, 0), (0, 6, 0)], Material("squares", squares, tile=2.0))
    model.quad([(0, 6, 0), (10, 6, 0), (10, 6, 6), (0, 6, 6)], even(0.95))
    model.quad([(10, 0, 0), (0, 0, 0), (0, 0, 6), (10, 0, 6)], even(0.02))
    model.sky((20.0, 30.0, 50.0), (60.0, 60.0, 50.0))
    model.walkable((0.0, 0.0), (10.0, 6.0))
    return model.build()


def make_yard(patched: pytest.MonkeyPatch, folder: Path) -> SceneSequence:
    """Put the yard among the scenes, and return two seconds straight on over it, turning."""
    points = [
        {"name": name, "time_s": time, "position_m": [x, 3, 1.65], "azimuth_deg": turn, "altitude_deg": -10}
        for name, time, x, turn in (("begin", 0, 2, 90), ("end", 2, 6, 150))
    ]
    file = folder / "across.json"
    file.write_text(json.dumps({"scene": "yard", "duration_s": 2, "keypoints": points}))
    patched.setenv("XDG_CACHE_HOME", str(folder))
    patched.setitem(catalogue.SCENES, "yard", ("a_yard", "yard"))
    module = types.SimpleNamespace(yard=yard)
    patched.setitem(sys.modules, "evenlight.stimuli.scenes.content.a_yard", module)
    return SceneSequence(SequenceFormat(48, 28, duration=2.0), str(file), Quality.COARSE)


class Squares:
    """A video of squares that become brighter from frame to frame, by default at 25 Hz."""

    name, n_frames = "squares", 5

    def __init__(self, step: float = 0.04) -> None:
        self._step = step

    def pixels(self, k: int) -> np.ndarray:
        squares = np.kron(np.indices((4, 8)).sum(axis=0) % 2, np.ones((8, 8)))
        return np.repeat((60 + 20 * k + 90 * squares)[..., np.newaxis], 3, axis=2).astype(np.uint8)

    def frames(self) -> Iterator[Frame]:
        for k in range(5):
            yield Frame(k * self._step, self._step, self.pixels(k))

    def sha256(self) -> str:
        return ""


def of_squares(surface: FlatScreen, step: float = 0.04) -> Playback:
    factors = {dimming: factor * np.ones(5) for dimming, factor in zip(Dimming, (0.8, 0.5, 1.0), strict=True)}
    times = step * np.arange(5)
    return Playback(Squares(step), times, 5 * step, factors, (Dimming.OURS,), surface=surface)


@dataclass(frozen=True)
class Given:
    """What a headset is given for a refresh: views, codes, and how often the graphics card was asked."""

    frame: HeadsetFrame
    time: float  # that a scene was drawn for, since the first refresh [s]
    codes: np.ndarray | None
    counts: Counter[str]


def watch(patched: pytest.MonkeyPatch, *, read: bool = True) -> list[Given]:
    """Return a list to which every refresh is added, as it is handed over."""
    given: list[Given] = []
    counts: Counter[str] = Counter()
    watching, drawn_for = True, 0.0
    flip, image = HeadsetWindow.flip, EyeSceneFeed.image

    def counted(kind: type, name: str) -> None:
        plain = getattr(kind, name)

        def call(*arguments: object, **options: object) -> object:
            if watching:
                counts[f"{kind.__name__}.{name}"] += 1
            return plain(*arguments, **options)

        patched.setattr(kind, name, call)

    def watched(window: HeadsetWindow) -> float:
        nonlocal watching
        watching = False
        codes = window.read_codes() if read else None
        given.append(Given(window.eyes(), drawn_for, codes, counts.copy()))
        counts.clear()
        watching = True
        return flip(window)

    def drawn(feed: EyeSceneFeed, index: int, time: float) -> EyeImages:
        nonlocal drawn_for
        drawn_for = time
        return image(feed, index, time)

    for kind, names in TRANSFERS.items():
        for name in names:
            counted(kind, name)
    patched.setattr(EyeSceneFeed, "image", drawn)
    patched.setattr(HeadsetWindow, "flip", watched)
    return given


def play_yard(devices: PlaybackDevices, sequence: SceneSequence, factors: np.ndarray, seconds: float) -> Pass:
    """Play the beginning of the walk with factors of frames at 25 Hz."""
    versions = {Dimming.OURS: factors, Dimming.BASELINE: 0.7 * factors, Dimming.FULL: np.ones_like(factors)}
    times = np.arange(len(factors)) / 25
    playback = Playback(sequence, times, seconds, versions, (Dimming.OURS,))
    player = Player(devices, playback, lambda _: None)
    player.play()
    return player.passes[0]


def assert_factor_times_frames(
    devices: PlaybackDevices, sequence: SceneSequence, given: list[Given], factors: Sequence[float]
) -> None:
    """Compare the codes of refreshes with pictures of the same views that are dimmed with numpy."""
    width, height = given[0].codes.shape[1] // 2, given[0].codes.shape[0]
    scene, context = catalogue.scene_of(sequence.path()), devices.window.context()
    renderer = SceneRenderer(context, scene, (width, height), sequence.quality, EYES)
    display = devices.display
    for one, factor in zip(given, factors, strict=True):
        camera = sequence.path().camera(one.time)
        for eye, view in enumerate(eye_views(one.frame, camera.position, camera.azimuth)):
            renderer.render(view)
            renderer.encode()
            wanted = dimmed(renderer.pixel_values() / 65535, factor, display)
            codes = one.codes[:, eye * width : (eye + 1) * width]
            assert np.ptp(codes) > 20  # there is something to be seen
            drawn = displayed_luminance(codes / 255, display)
            off = np.abs(block_means(drawn) - block_means(wanted)).max()
            assert off <= 2 / 255 * (display.peak_luminance - display.black_level)
            assert np.abs(codes - ideal_codes(wanted, display)).max() <= 1 + 1e-3


def dimmed(pixel_values: np.ndarray, factor: float, display: Display) -> np.ndarray:
    """The luminance of each channel with the other two alike, dimmed in linear light [cd/m^2]."""
    emitted = displayed_luminance(pixel_values, display) - display.reflected_luminance
    return drawn_luminance(emitted, factor, display)


def ideal_codes(luminance: np.ndarray, display: Display) -> np.ndarray:
    """The codes, not rounded, that show a luminance: Eq. 1 the other way round."""
    emitted = luminance - display.reflected_luminance - display.black_level
    share = np.clip(emitted / (display.peak_luminance - display.black_level), 0, 1)
    return np.asarray(255 * share ** (1 / display.gamma))


def block_means(values: np.ndarray) -> np.ndarray:
    """Means of squares of pixels, each channel for itself."""
    height, width = (side // BLOCK * BLOCK for side in values.shape[:2])
    blocks = values[:height, :width].reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK, 3)
    return np.asarray(blocks.mean(axis=(1, 3)))
