"""Playing with the keys: switching between the versions, ending, beginning again."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.recordings.rig import Rig
from evenlight.experiments.playback import clip_player, player
from evenlight.experiments.playback.player import (
    LOG_COLUMNS,
    Dimming,
    Pass,
    Playback,
    PlaybackDevices,
    Player,
    write_log,
)
from evenlight.experiments.stage import ShownClip
from evenlight.hardware.presentation.simulated_input import SimulatedKeyboard
from evenlight.hardware.simulated.clocks import RefreshClock, refresh_after

LAB = Display("lab", 100.0, 0.0, 2.0, pixels_per_degree=60.0)
RIG = Rig("lab", "lab.display.toml", viewing_distance=0.6, refresh_rate=50.0)
TIMES = np.arange(25) / 25
FACTORS = {
    Dimming.OURS: np.linspace(0.9, 0.5, 25),
    Dimming.BASELINE: np.full(25, 0.7),
    Dimming.FULL: np.ones(25),
}


class Gray:
    """A second of gray, perhaps damaged at a frame."""

    name = "gray"
    n_frames = 25

    def __init__(self, fails_at: int | None = None) -> None:
        self.fails_at = fails_at

    def frames(self) -> Iterator[Frame]:
        for k, time in enumerate(TIMES):
            if k == self.fails_at:
                raise InputError(f"gray.mkv is damaged at frame {k}")
            yield Frame(float(time), 0.04, np.full((20, 30, 3), 128, np.uint8))

    def sha256(self) -> str:
        return ""


class Renderer:
    """Notes the factors of the pictures, instead of drawing them."""

    takes_planes = False

    factors: list[float]

    def __init__(self, *_: object) -> None:
        type(self).factors = []

    def upload(self, levels: np.ndarray, _: int) -> np.ndarray:
        return levels

    def draw(self, framebuffer: object, shown: Any, frame: int = 0, seed: int = 0) -> None:
        self.factors.append(shown.factor)


class Window:
    """A window on a clock that counts its flips."""

    def __init__(self) -> None:
        self.clock = RefreshClock(50.0)
        self.now, self.flip = self.clock.now, self.clock.advance
        self.due = lambda period: refresh_after(self.now(), self.now(), period)  # the clock stands since

    def size(self) -> tuple[int, int]:
        return 30, 20

    def bits(self) -> int:
        return 8

    def context(self) -> None:
        return None

    def framebuffer(self) -> None:
        return None

    def read_codes(self, size: tuple[int, int] | None = None) -> np.ndarray:
        return np.full((20, 30, 3), 90)


@pytest.fixture(autouse=True)
def no_graphics(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(player, "field_renderer", Renderer)
    monkeypatch.setattr(clip_player, "image_renderer", Renderer)


def playing(video: Gray | None = None, **changes: Any) -> tuple[Player, SimulatedKeyboard, list[str]]:
    window, told = Window(), []
    keyboard = SimulatedKeyboard(window.now)
    what = Playback(video or Gray(), TIMES, 1.0, FACTORS, **({"order": (Dimming.OURS,)} | changes))
    return Player(PlaybackDevices(window, keyboard, None, RIG, LAB), what, told.append), keyboard, told


def test_keys_switch_between_the_versions_from_the_next_refresh_on() -> None:
    """The key pressed at 0.39 s is taken after the 20th refresh, at 0.4 s; that at 0.79 s after the 40th."""
    player, keyboard, told = playing()
    keyboard.queue("2", delay=0.39)
    keyboard.queue("3", delay=0.79)
    assert player.play()
    (one,) = player.passes
    assert one.versions == ("ours",) * 20 + ("baseline",) * 20 + ("full",) * 10
    ours = np.repeat(FACTORS[Dimming.OURS], 2)[:20]
    wanted = np.concatenate([ours, np.full(20, 0.7), np.ones(10)])
    np.testing.assert_allclose(one.shown.factors, wanted)
    np.testing.assert_allclose(Renderer.factors, wanted)
    assert told == ["ours", "baseline", "full"]


def test_a_loop_begins_again_as_it_began_until_escape() -> None:
    """1 s each: after the third begins, escape at 2.5 s leaves 25 of its 50 refreshes."""
    player, keyboard, told = playing(loop=True)
    keyboard.queue("3", delay=0.5)
    keyboard.queue("escape", delay=2.49)
    assert not player.play()
    assert [len(one.shown.flip_times) for one in player.passes] == [50, 50, 25]
    assert set(player.passes[1].versions) == {"ours"}
    assert told == ["ours", "full", "ours", "ours"]


def test_two_versions_follow_each_other() -> None:
    player, _, _ = playing(order=(Dimming.BASELINE, Dimming.FULL))
    assert player.play()
    assert [set(one.versions) for one in player.passes] == [{"baseline"}, {"full"}]


def test_what_was_shown_before_an_error_is_kept() -> None:
    player, _, _ = playing(Gray(fails_at=10))
    with pytest.raises(InputError, match=r"gray\.mkv is damaged at frame 10"):
        player.play()
    assert [one.shown.video_frames[-1] for one in player.passes] == [9]


def test_the_log_counts_what_was_dropped_before_each_refresh(tmp_path) -> None:
    """50 Hz: flips at 0, 0.02 and 0.08 s leave out two before the last."""
    shown = ShownClip(3.0, (0.0, 0.02, 0.08), (0, 0, 2), (0.9, 0.9, 0.8), frames_dropped=2)
    write_log(tmp_path / "log.csv", [Pass(shown, ("ours",) * 3)], 50.0)
    lines = (tmp_path / "log.csv").read_text().splitlines()
    assert lines[0] == ",".join(LOG_COLUMNS)
    assert lines[1:] == ["1,ours,0,0.0,0,0,0.9,,", "1,ours,1,0.02,0,0,0.9,,", "1,ours,2,0.08,2,2,0.8,,"]
