"""What a player page is fed with: each clip its own, the same from the cache, whole after an interruption."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import av
import numpy as np
import pytest
from PIL import Image

from evenlight.analysis.player import proxy_video
from evenlight.analysis.player.picture_recorder import PictureRecorder
from evenlight.analysis.player.player_page import PlayerContent, contrast_tiles
from evenlight.analysis.player.proxy_video import Proxy, Tiles
from evenlight.analysis.tracks import track_results
from evenlight.analysis.tracks.contrast_map_figure import contrast_maps
from evenlight.analysis.tracks.control_run import ControlJob
from evenlight.analysis.tracks.optimization_job import OptimizationJob
from evenlight.analysis.tracks.track_results import run_control, run_optimization
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.tracks.brightness_track import BudgetUnit, read_track
from evenlight.method.online.controller import ControllerSettings
from evenlight.method.optimizer.request import Request
from evenlight.method.power import power
from evenlight.method.preset_files import load_display, load_power_model, load_rate_limit

SECONDS = 4.0  # that each frame is shown: an analysis is kept every 16 frames


@dataclass
class Slides:
    """Noise that gets lighter; the reading of it may be interrupted."""

    count: int = 40
    breaks_at: int | None = None
    name: str = "slides"
    reads: int = 0  # frames that were asked for

    @property
    def n_frames(self) -> int:
        return self.count

    def sha256(self) -> str:
        return sha256_of_bytes(f"{self.name} {self.count}".encode())

    def frames(self) -> Iterator[Frame]:
        return self.frames_at(range(self.count))

    def frames_at(self, numbers: Sequence[int]) -> Iterator[Frame]:
        noise = np.random.default_rng(1).integers(0, 120, (24, 32, 3), dtype=np.uint8)
        for k in numbers:
            if k == self.breaks_at:
                raise KeyboardInterrupt
            self.reads += 1
            yield Frame(k * SECONDS, SECONDS, noise + np.uint8(3 * k))


def job_of(*slides: Slides, **changes: Any) -> OptimizationJob:
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), load_rate_limit("surace2025"))
    job = OptimizationJob(
        slides[0], load_display("varjo-xr3"), request, others=slides[1:], cached=True, player=True,
        quiet=True,
    )  # fmt: skip
    return replace(job, **changes)


def lightness(picture: Proxy) -> list[float]:
    """The mean pixel value of each frame."""
    with av.open(io.BytesIO(picture.data)) as container:
        return [float(frame.to_ndarray(format="gray").mean()) for frame in container.decode(video=0)]


@pytest.fixture(autouse=True)
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where curves and pictures are kept."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("EVENLIGHT_CURVES_CACHE_MB", "100")
    return tmp_path / "cache" / "evenlight" / "curves"


@pytest.fixture
def pages(monkeypatch: pytest.MonkeyPatch) -> dict[str, PlayerContent]:
    """What is written on pages, by their folders, in place of page and figures."""
    written: dict[str, PlayerContent] = {}
    monkeypatch.setattr(
        track_results, "write_player_page", lambda path, content: written.update({path.parent.name: content})
    )
    monkeypatch.setattr(track_results, "_draw", lambda *_: None)
    return written


def page_of(job: OptimizationJob, folder: Path, pages: dict[str, PlayerContent]) -> PlayerContent:
    """The page that the controller writes, which is there sooner than the optimizer."""
    folder.mkdir()
    run_control(ControlJob(job, ControllerSettings(0.03)), folder)
    return pages[folder.name]


def test_each_clip_has_a_page_of_its_own(tmp_path: Path, pages: dict[str, PlayerContent]) -> None:
    folder = tmp_path / "out"
    folder.mkdir()
    run_optimization(job_of(Slides(1, name="a"), Slides(2, name="b")), folder)
    assert {name: len(content.picture.frames) for name, content in pages.items()} == {"01-a": 1, "02-b": 2}
    for name, content in pages.items():
        track = read_track(folder / name / "track.csv")
        np.testing.assert_allclose(content.data.track.factors, track.factors, atol=1e-9)
        np.testing.assert_allclose(content.picture.times, track.times, atol=1.2e-5)


def test_power_is_that_of_constant_dimming_and_of_full_brightness(
    tmp_path: Path, pages: dict[str, PlayerContent]
) -> None:
    """The default panel has a backlight, whose power does not depend on content."""
    job = job_of(Slides(4))
    content = page_of(job, tmp_path / "out", pages)
    factors = np.array([content.data.summary.baseline_factor, 1.0])
    constant, full = power(job.request.power_model, factors, np.ones((2, 3)))
    np.testing.assert_allclose(content.constant_power, np.full(4, constant), rtol=1e-9)
    assert content.data.summary.full_power == pytest.approx(float(full))


def test_curves_and_picture_of_an_earlier_run_give_the_same_page_and_decode_a_few_frames_alone(
    tmp_path: Path, pages: dict[str, PlayerContent], kept: Path
) -> None:
    first = page_of(job_of(Slides()), tmp_path / "first", pages)
    assert sorted(path.suffix for path in kept.iterdir()) == [".npz", ".picture"]
    slides = Slides()
    again = page_of(job_of(slides), tmp_path / "again", pages)
    assert slides.reads == 1 + 20  # the first, and the samples: every second of 40
    curves = tmp_path / "first" / "loss_curves.npz"
    given = page_of(job_of(Slides(), curves=curves, cached=False), tmp_path / "given", pages)
    for other in (again, given):
        assert isinstance(other.picture, Proxy)
        assert other.picture.data == first.picture.data
        assert other.picture.times.tobytes() == first.picture.times.tobytes()
        assert other.contrast.data == first.contrast.data
        assert (other.notes, other.details) == (first.notes, first.details)


def test_without_a_cache_none_is_used_or_made(
    tmp_path: Path, pages: dict[str, PlayerContent], kept: Path
) -> None:
    page_of(job_of(Slides(4), cached=False), tmp_path / "out", pages)
    assert not kept.exists()


def test_a_damaged_picture_is_made_again(tmp_path: Path, pages: dict[str, PlayerContent], kept: Path) -> None:
    first = page_of(job_of(Slides(4)), tmp_path / "first", pages)
    (picture,) = kept.glob("*.picture")
    for damaged in (picture.read_bytes()[:-200], b"", b"no archive"):
        picture.write_bytes(damaged)
        again = page_of(job_of(Slides(4)), tmp_path / f"after-{len(damaged)}", pages)
        assert again.picture.data == first.picture.data


def test_after_an_interruption_the_picture_is_whole(tmp_path: Path, pages: dict[str, PlayerContent]) -> None:
    whole = page_of(job_of(Slides(), cached=False), tmp_path / "whole", pages)
    with pytest.raises(KeyboardInterrupt):
        page_of(job_of(Slides(breaks_at=39)), tmp_path / "broken", pages)
    slides = Slides()
    resumed = page_of(job_of(slides), tmp_path / "resumed", pages)
    assert resumed.picture.data == whole.picture.data
    assert isinstance(resumed.picture, Proxy)
    assert (np.diff(lightness(resumed.picture)) > 0).all()


def test_a_video_too_long_to_move_is_shown_in_stills(
    tmp_path: Path, pages: dict[str, PlayerContent], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(proxy_video, "PAGE_BYTES", proxy_video.PAGE_REST_BYTES + 48 * 40 + 100)
    monkeypatch.setattr(proxy_video, "STILLS", 8)
    content = page_of(job_of(Slides()), tmp_path / "out", pages)
    assert isinstance(content.picture, Tiles)
    assert content.picture.frames.tolist() == list(range(0, 40, 5))
    assert any("8 stills, one every 20 s" in note for note in content.notes)
    slides = Slides()
    again = page_of(job_of(slides), tmp_path / "again", pages)
    assert again.picture.data == content.picture.data
    curves = tmp_path / "out" / "loss_curves.npz"
    given = page_of(job_of(Slides(), curves=curves, cached=False), tmp_path / "given", pages)
    assert (
        given.picture.data == content.picture.data
    )  # the frames that were sought are those that streamed by


def test_the_controllers_page_has_its_track(tmp_path: Path, pages: dict[str, PlayerContent]) -> None:
    content = page_of(job_of(Slides(8)), tmp_path / "out", pages)
    track = read_track(tmp_path / "out" / "track.csv")
    np.testing.assert_allclose(content.data.track.factors, track.factors, atol=1e-9)


def test_a_built_in_sequence_and_simulated_people_are_called_that(
    tmp_path: Path, pages: dict[str, PlayerContent]
) -> None:
    from evenlight.stimuli.sequences import built_in_sequence

    sunrise = built_in_sequence("sunrise", size=(32, 18), duration=1.0, frames_per_second=4.0)
    job = job_of(sunrise)  # type: ignore[arg-type] # a video, no slides
    limit = replace(job.request.rate_limit, simulated=True)
    notes = " ".join(page_of(replace(job, request=replace(job.request, rate_limit=limit)),
                             tmp_path / "out", pages).notes)  # fmt: skip
    assert "sunrise is a built-in sequence" in notes
    assert "simulated participants" in notes
    plain = " ".join(page_of(job_of(Slides(4)), tmp_path / "plain", pages).notes)
    assert "built-in" not in plain
    assert "simulated" not in plain


# --- contrast tiles


def test_tiles_are_the_contrast_map_averaged(tmp_path: Path, pages: dict[str, PlayerContent]) -> None:
    """Frames of 320 by 240: a tile's pixel is the share of the visible pixels of 2 by 2 that are lost."""
    job = job_of(Slides(2))
    content = page_of(job, tmp_path / "out", pages)
    display = replace(job.display, pixels_per_degree=10.0)  # the finest detail is visible
    rng = np.random.default_rng(3)
    held = [(k, rng.integers(0, 40, (240, 320, 3), dtype=np.uint8)) for k in (0, 1)]
    tiles, said = contrast_tiles(replace(content.data, samples=held), display, job.model)
    assert (tiles.width, tiles.height, tiles.columns, tiles.frames.tolist()) == (160, 120, 2, [0, 1])
    assert said == "The maps are of details of 5 cycles per degree."  # Nyquist
    with Image.open(io.BytesIO(tiles.data)) as picture:
        sheet = np.asarray(picture).astype(float) / 255
    for k, pixels in held:
        tile = sheet[:, 160 * k : 160 * (k + 1)]
        for channel, factor in enumerate(
            (content.data.track.factors[k], content.data.summary.baseline_factor)
        ):
            (at,) = contrast_maps(pixels, [(float(factor), None)], display, job.model)
            visible, lost = (
                mask.reshape(120, 2, 160, 2).sum(axis=(1, 3)) for mask in (at.reference, at.lost)
            )
            assert lost.any()
            expected = np.where(visible > 0, lost / np.maximum(visible, 1), 0.0)
            np.testing.assert_allclose(tile[..., channel], expected, atol=0.02)  # 8 bits, twice
        assert not tile[..., 2].any()


# --- the commands


def test_the_command_writes_the_same_page_again_and_validate_accepts_it(
    command: Callable[..., Any], make_video: Callable[..., Any], tmp_path: Path
) -> None:
    make_video(tmp_path / "film.mkv", [0.4, 0.6], (48, 32), 2.0)
    asked = ("optimize", tmp_path / "film.mkv", "--budget", "0.5", "--out", tmp_path / "out", "--quiet")
    assert command(*asked).code == 0
    page = (tmp_path / "out" / "player.html").read_bytes()
    assert command(*asked).code == 0
    assert (tmp_path / "out" / "player.html").read_bytes() == page
    told = command("validate", tmp_path / "out")
    assert told.code == 0
    assert "player.html" in told.out


def test_a_recorder_that_is_left_in_the_middle_ends_its_thread() -> None:
    import threading

    recorder, slides = PictureRecorder(Slides(), cached=False, quiet=True), Slides()
    watched = recorder.watch(slides.frames())
    for _ in range(5):
        next(watched)
    assert any("player page" in thread.name for thread in threading.enumerate())
    watched.close()  # type: ignore[attr-defined] # a generator
    assert not any("player page" in thread.name for thread in threading.enumerate())
