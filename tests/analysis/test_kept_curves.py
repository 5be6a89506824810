"""Loss curves are kept by content: another budget analyses nothing, and an interrupted run goes on."""

from __future__ import annotations

import ast
import itertools
import os
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import evenlight
from evenlight.analysis.player.picture_recorder import PictureCache, PictureRecorder
from evenlight.analysis.player.proxy_video import Tiles
from evenlight.analysis.tracks import curves_cache, optimization_job, track_results
from evenlight.analysis.tracks.frame_samples import FrameSamples
from evenlight.analysis.tracks.optimization_job import OptimizationJob, loss_curves_of
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.frame import Frame
from evenlight.data_schema.provenance import sha256_of_bytes
from evenlight.data_schema.recordings.rig import Actuator
from evenlight.data_schema.tracks.brightness_track import BudgetUnit
from evenlight.data_schema.tracks.film_reading import Damaged, FilmReading
from evenlight.data_schema.tracks.loss_curves import write_loss_curves
from evenlight.method.contrast import checkpoints
from evenlight.method.contrast.checkpoints import AnalysedFrames
from evenlight.method.optimizer.request import Request
from evenlight.method.preset_files import load_contrast_model, load_display, load_power_model, load_rate_limit

SECONDS = 4.0  # that each frame is shown: a minute is 15 frames, of 12 contents
SIZE = 16, 24, 3


@dataclass
class Slides:
    """Slowly moving noise in which every fifth frame stays; the reading of it may be interrupted."""

    count: int = 64
    breaks_at: int | None = None
    seconds: float = SECONDS
    seed: int = 1
    name: str = "slides"
    read: list[int] = field(default_factory=list)  # numbers of the frames that were asked for

    @property
    def n_frames(self) -> int:
        return self.count

    def sha256(self) -> str:
        return sha256_of_bytes(f"{self.count} {self.seed}".encode())

    def frames(self) -> Iterator[Frame]:
        return self.frames_at(range(self.count))

    def frames_at(self, numbers: Sequence[int]) -> Iterator[Frame]:
        noise = np.random.default_rng(self.seed).integers(0, 120, SIZE, dtype=np.uint8)
        for k in numbers:
            if k == self.breaks_at:
                raise KeyboardInterrupt
            self.read.append(k)
            pixels = np.roll(noise, k - (k % 5 == 4), axis=1) + np.uint8(2 * (k // 5))
            yield Frame(k * self.seconds, self.seconds, pixels)


def job_of(slides: Slides, **changes: Any) -> OptimizationJob:
    request = Request(0.5, BudgetUnit.FACTOR, load_power_model("surace2025"), load_rate_limit("surace2025"))
    job = OptimizationJob(slides, load_display("varjo-xr3"), request, cached=True, quiet=True)
    return replace(job, **changes)


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where the curves of a test are kept."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("EVENLIGHT_CURVES_CACHE_MB", "100")
    return tmp_path / "cache" / "evenlight" / "curves"


@pytest.fixture
def steady(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that tells contents, and a checkpoint after each twelve: they are shown in 15 frames."""
    monkeypatch.setattr(optimization_job, "monotonic", itertools.count().__next__)
    monkeypatch.setattr(checkpoints, "EVERY", 12)


def written(job: OptimizationJob, path: Path) -> tuple[bytes, list[tuple[int, bytes]]]:
    """What an analysis comes to: the bytes of its file, and the frames that figures are made of."""
    samples = FrameSamples()
    write_loss_curves(path, loss_curves_of(job, samples))
    return path.read_bytes(), [(number, pixels.tobytes()) for number, pixels in samples.held]


# What is read is further than what is kept, by three contents.
@pytest.mark.slow
@pytest.mark.usefixtures("steady")
@pytest.mark.parametrize(
    ("actuator", "breaks_at", "begun"),
    [(Actuator.BACKLIGHT, 45, 30), (Actuator.BACKLIGHT, 62, 45), (Actuator.PIXELS, 63, 60)],
)
def test_an_interrupted_run_goes_on_where_it_was_and_ends_with_the_same_bytes(
    actuator: Actuator, breaks_at: int, begun: int, tmp_path: Path, folder: Path
) -> None:
    whole = written(job_of(Slides(), actuator=actuator, cached=False), tmp_path / "whole.npz")
    assert not folder.exists()
    with pytest.raises(KeyboardInterrupt):
        loss_curves_of(job_of(Slides(breaks_at=breaks_at), actuator=actuator), FrameSamples())
    slides = Slides()
    assert written(job_of(slides, actuator=actuator), tmp_path / "resumed.npz") == whole
    assert slides.read[:3] == [0, begun, begun + 1]
    assert [path.suffix for path in folder.iterdir()] == [".npz"]


def test_another_budget_reads_the_sampled_frames_alone(tmp_path: Path) -> None:
    first = written(job_of(Slides()), tmp_path / "first.npz")
    slides = Slides()
    job = job_of(slides)
    other = replace(job, request=replace(job.request, budget=0.7))
    assert written(other, tmp_path / "again.npz") == first
    assert slides.read == [0, *range(0, 64, 2)]
    curves = replace(other, source=(known := Slides()), curves=tmp_path / "first.npz", cached=False)
    assert written(curves, tmp_path / "known.npz") == first
    assert known.read == slides.read


@pytest.mark.slow
@pytest.mark.parametrize(
    "changed",
    [
        lambda job: replace(job, source=Slides(count=2, seed=2)),
        lambda job: replace(job, source=Slides(count=2, seconds=2.0)),
        lambda job: replace(job, display=replace(job.display, peak_luminance=90.0)),
        lambda job: replace(job, model=load_contrast_model("as-printed")),
        lambda job: replace(job, field_of_view=20.0),
        lambda job: replace(job, min_factor=0.3),
        lambda job: replace(job, actuator=Actuator.PIXELS),
    ],
    ids=["content", "rate", "display", "model", "geometry", "knots", "actuator"],
)
def test_curves_of_anything_else_are_not_taken(
    changed: Callable[[OptimizationJob], OptimizationJob], folder: Path
) -> None:
    job = job_of(Slides(count=2))
    loss_curves_of(job, FrameSamples())
    loss_curves_of(changed(job), FrameSamples())
    assert len(list(folder.iterdir())) == 2


def test_the_picture_of_another_stream_or_policy_is_not_taken() -> None:
    curves, keys = loss_curves_of(job_of(Slides(count=2)), FrameSamples()), set()
    for reading in (FilmReading(), FilmReading(stream=1), FilmReading(damaged=Damaged.SKIP)):
        slides = Slides(count=2)
        slides.reading = reading
        keys.add(PictureRecorder(slides, cached=True, quiet=True)._cache(curves).key)
    assert len(keys) == 3


def test_curves_of_other_code_are_not_taken(
    folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "model").mkdir()
    monkeypatch.setattr(curves_cache.CurvesCache, "sources", (tmp_path / "model",))
    for code in ("BETA = 0.2", "BETA = 0.3"):
        (tmp_path / "model" / "masking.py").write_text(code)
        curves_cache.source_sha256.cache_clear()
        loss_curves_of(job_of(Slides(count=1)), FrameSamples())
    curves_cache.source_sha256.cache_clear()
    assert len(list(folder.iterdir())) == 2


@pytest.mark.usefixtures("steady")
def test_damaged_files_are_made_again(tmp_path: Path, folder: Path) -> None:
    with pytest.raises(KeyboardInterrupt):
        loss_curves_of(job_of(Slides(breaks_at=63)), FrameSamples())
    last = max(folder.iterdir())
    last.write_bytes(last.read_bytes()[:-100])
    slides = Slides()
    first = written(job_of(slides), tmp_path / "first.npz")
    assert slides.read[1] == 45  # the parts before
    (kept,) = folder.iterdir()
    kept.write_bytes(kept.read_bytes()[:1000])
    slides = Slides()
    assert written(job_of(slides), tmp_path / "again.npz") == first
    assert slides.read == list(range(64))
    assert kept.stat().st_size > 1000


@pytest.mark.parametrize(
    ("second", "left"),
    [
        ({}, 4),
        ({"times": [7.0, 8.0], "shown": [3, 4]}, 2),  # the part between is another run's
        ({"times": [0.0, 1.0]}, 2),
        ({"rows": np.zeros((2, 9))}, 2),
        ({"floor": np.zeros((2, 3))}, 2),
    ],
)
def test_a_run_goes_on_after_parts_that_follow_each_other(
    second: dict[str, Any], left: int, folder: Path
) -> None:
    cache, known = curves_cache.CurvesCache(folder, "key", print), {"durations": [1.0, 1.0]}
    cache.keep(part_of(known | {"times": [0.0, 1.0], "shown": [0, 1], "rows": np.zeros((2, 8))}))
    follows = {"times": [2.0, 3.0], "shown": [2, 3], "rows": np.zeros((2, 8))}
    cache.keep(part_of(known | follows | second))
    begun = cache.begun()
    assert begun is not None
    assert begun.n_frames == left


def part_of(columns: dict[str, Any]) -> AnalysedFrames:
    return AnalysedFrames(
        **{name: np.asarray(values) for name, values in ({"bends": np.zeros((4, 2))} | columns).items()}
    )


RECORDS = "says what is in a file, and checks it: no number is made there"
FILES = "reads or writes files whole: their bytes are those of the video, or are checked as records"
SCENES = "in the source's own hash, of built-in walks (`scenes_sha256`)"
# Modules that the analysis of a video imports, and why a change of theirs need not change the key.
NOT_IN_KEY = {
    "evenlight.data_schema.recordings.ramp": RECORDS,
    "evenlight.data_schema.recordings.rig": RECORDS,
    "evenlight.data_schema.storage.input_files": FILES,
    "evenlight.data_schema.storage.input_sizes": FILES,
    "evenlight.data_schema.storage.tables": FILES,
    "evenlight.data_schema.storage.text_files": FILES,
    "evenlight.data_schema.storage.whole_files": FILES,
    "evenlight.data_schema.tracks.brightness_track": RECORDS,
    "evenlight.data_schema.tracks.film_reading": RECORDS,
    "evenlight.data_schema.tracks.loss_bends": RECORDS,
    "evenlight.data_schema.tracks.loss_curves": RECORDS,
    "evenlight.stimuli.sequence_format": SCENES,
}


def test_all_source_that_curves_are_made_of_is_in_the_key() -> None:
    package, seen = Path(evenlight.__file__).parent, set()
    waiting = [f"evenlight.stimuli.video.{name}" for name in ("video_analysis", "video_file", "image_folder")]
    while waiting:
        name = waiting.pop()
        file = package.joinpath(*name.split(".")[1:]).with_suffix(".py")
        if name not in seen and file.is_file():
            seen.add(name)
            for node in ast.walk(ast.parse(file.read_text())):
                if isinstance(node, ast.ImportFrom) and node.module is not None:
                    waiting += [node.module, *(f"{node.module}.{alias.name}" for alias in node.names)]
    sources = {folder.resolve() for folder in curves_cache.SOURCES}
    folders = {name: package.joinpath(*name.split(".")[1:-1]).resolve() for name in seen}
    assert {name for name, folder in folders.items() if folder not in sources} == set(NOT_IN_KEY)
    assert "evenlight.method.contrast.one_pass" in seen


def test_what_was_not_used_for_longest_goes_first(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    jobs = [job_of(Slides(count=1, seed=seed)) for seed in (1, 2, 3)]
    names = []
    for job in jobs[:2]:
        loss_curves_of(job, FrameSamples())
        names += [path.name for path in folder.iterdir() if path.name not in names]
    for age, name in enumerate(reversed(names), start=1):  # the first is older; clocks of files tick slowly
        os.utime(folder / name, (-60.0 * age + time.time(),) * 2)
    loss_curves_of(jobs[0], FrameSamples())
    size = (folder / names[0]).stat().st_size
    monkeypatch.setenv("EVENLIGHT_CURVES_CACHE_MB", str(2.5e-6 * size))
    loss_curves_of(jobs[2], FrameSamples())
    left = [path.name for path in folder.iterdir()]
    assert len(left) == 2
    assert names[0] in left
    assert names[1] not in left


def test_pictures_go_before_curves_and_one_that_was_read_goes_last(
    folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def place(name: str) -> PictureCache:
        return PictureCache(folder, name, print)

    stills = Tiles(bytes(5000), 4, 4, 1, np.array([0]))
    curves_cache.CurvesCache(folder, "curves", print).keep(
        part_of({name: [1.0] for name in ("durations", "times", "shown", "rows")})
    )
    for name in ("read", "unread"):
        place(name).store_picture(stills)
    for age, name in enumerate(("unread.picture", "read.picture", "curves.part-00000"), start=1):
        os.utime(folder / name, (time.time() - 60.0 * age,) * 2)
    assert place("read").read_picture() is not None
    monkeypatch.setenv("EVENLIGHT_CURVES_CACHE_MB", "0.015")
    place("new").store_picture(stills)  # room for two pictures and the curves
    assert {path.name for path in folder.iterdir()} == {"read.picture", "new.picture", "curves.part-00000"}


def test_where_nothing_can_be_kept_the_run_says_so_once_and_goes_on(
    tmp_path: Path, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    whole = written(job_of(Slides(), cached=False), tmp_path / "whole.npz")
    folder.parents[1].write_text("a file in the place of the folder")
    assert written(job_of(Slides(), quiet=False), tmp_path / "kept.npz") == whole
    assert capsys.readouterr().err.count("loss curves are not kept for later runs: cannot write") == 1


def test_the_command_keeps_curves_unless_it_is_told_not_to(
    command: Callable[..., Any], tmp_path: Path, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def analysed(job: OptimizationJob, _: Path) -> None:
        loss_curves_of(job, FrameSamples())
        raise InputError("no more is asked")

    monkeypatch.setattr(track_results, "run_optimization", analysed)
    (frames := tmp_path / "frames").mkdir()
    np.save(frames / "1.npy", np.full((16, 16, 3), 100, np.uint8))
    asked = "optimize", frames, "--budget", "0.5", "--out", tmp_path / "out"
    assert "no more is asked" in command(*asked, "--no-cache").err
    assert not folder.exists()
    assert "earlier run" not in command(*asked).err
    assert len(list(folder.iterdir())) == 1
    assert "loss curves of an earlier run (--no-cache makes them again)" in command(*asked).err
    monkeypatch.setenv("EVENLIGHT_CURVES_CACHE_MB", "many")
    refused = command(*asked)
    assert refused.code == 2
    assert "EVENLIGHT_CURVES_CACHE_MB is 'many': give the megabytes" in refused.err


@pytest.mark.parametrize("count", [1, 4, 5, 16, 17, 33, 250])
def test_samples_that_are_taken_are_those_that_watching_keeps(count: int) -> None:
    frames = [Frame(k, 1.0, np.full((8, 8, 3), k, np.uint8)) for k in range(count)]
    watched, taken = FrameSamples(), FrameSamples()
    list(watched.watch(frames))
    taken.take(frames[0], lambda numbers: (frames[k] for k in numbers), count)
    assert [(k, int(pixels[0, 0, 0])) for k, pixels in taken.held] == [
        (k, int(pixels[0, 0, 0])) for k, pixels in watched.held
    ]
