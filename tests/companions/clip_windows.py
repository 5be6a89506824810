"""Videos that are made, and a window that draws nothing, for tests of how clips are played."""

import threading
from collections.abc import Iterator
from typing import Any

import numpy as np
from drawn_codes import image_codes

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.recordings.rig import Rig
from evenlight.experiments.sessions.window_stage import WindowStage
from evenlight.experiments.stage import Clip, ShownClip
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.simulated.clocks import RefreshClock, refresh_after
from evenlight.hardware.simulated.panel import SimulatedBacklight
from evenlight.stimuli.dithering import thresholds_of

LAB = Display("lab", 100.0, 0.0, 2.0, pixels_per_degree=60.0)
RIG = Rig("lab", "lab.display.toml", viewing_distance=0.6, refresh_rate=50.0)
SIZE = (64, 48)


class Video:
    """Noise on gray, brighter from frame to frame."""

    name = "walk"

    def __init__(self, times: np.ndarray, size: tuple[int, int] = SIZE, fails_at: int | None = None) -> None:
        self.times, self.size, self.fails_at = times, size, fails_at
        self.n_frames: int | None = len(times)

    def pixels(self, k: int) -> np.ndarray:
        rng = np.random.default_rng(k)
        return (rng.integers(0, 40, (self.size[1], self.size[0], 3)) + 100 + k).astype(np.uint8)

    def frames(self) -> Iterator[Frame]:
        for k, time in enumerate(self.times):
            if k == self.fails_at:
                raise InputError(f"walk.mkv is damaged at frame {k}")
            yield Frame(float(time), 0.04, self.pixels(k))

    def sha256(self) -> str:
        return ""


def clip_of(times: Any, video: Video | None = None, **changes: Any) -> Clip:
    """A clip of frames that get darker; the last one lasts 0.04 s."""
    times = np.asarray(times, dtype=float)
    plain = {
        "video": video or Video(times),
        "times": times,
        "duration": float(times[-1]) + 0.04,
        "factors": np.linspace(1.0, 0.5, len(times)),
        "noise_seed": 9,
    }
    return Clip(**(plain | changes))


STEADY = clip_of(np.arange(50) / 25)  # 2 s


class Renderer:
    """Notes pictures and fields instead of drawing them."""

    takes_planes = False

    drawn: list[Any]

    def __init__(self, *_: object) -> None:
        type(self).drawn = []

    def upload(self, levels: np.ndarray, count: int) -> np.ndarray:
        assert count == 256
        return levels

    def draw(self, framebuffer: object, shown: Any, frame: int = 0, seed: int = 0) -> None:
        Renderer.drawn.append((shown, frame, seed))


class Window:
    """A window whose flips take as many refreshes as a list says, then one each."""

    def __init__(self, late: dict[int, int] | None = None, dims: bool = True) -> None:
        self.clock, self.flips, self.late, self.dims = RefreshClock(50.0), 0, late or {}, dims
        self.last: float | None = None

    def size(self) -> tuple[int, int]:
        return 401, 300

    def bits(self) -> int:
        return 8

    def now(self) -> float:
        return self.clock.now()

    def context(self) -> None:
        return None

    def framebuffer(self) -> None:
        return None

    def flip(self) -> float:
        self.flips += 1
        self.last = self.clock.advance(self.late.get(self.flips - 1, 1))
        return self.last

    def due(self, period: float) -> float:
        return refresh_after(self.last, self.now(), period)

    def eyes(self) -> None:
        return None

    def read_codes(self, size: tuple[int, int] | None = None) -> np.ndarray:
        """Return the codes of the image, which the part that is read back is as large as."""
        assert size == SIZE
        picture, frame, seed = Renderer.drawn[-1]
        factor = picture.factor if self.dims else 1.0
        thresholds = thresholds_of(RIG.dither, SIZE[::-1], frame, seed)
        return image_codes(picture.image, factor, thresholds, LAB, 8)

    def apparatus(self) -> dict[str, str]:
        return {"window": "none"}

    def close(self) -> None:
        pass


def readers() -> int:
    return sum(thread.name == "frames of walk" for thread in threading.enumerate())


def staged(window: Window, rig: Rig = RIG, backlight: SimulatedBacklight | None = None):
    keyboard = SimulatedKeyboard(window.now)
    return WindowStage(window, keyboard, rig, LAB, 20.0, backlight), keyboard


def played(clip: Clip, window: Window | None = None) -> ShownClip:
    return staged(window or Window())[0].play(clip)
