"""What a cluster costs and gives: speed-up, overhead for each video, memory, and the scheduling by itself."""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.decoding_points import encoded
from benchmarks.measured import Approach, RunSettings, SubjectResults, claim, point
from benchmarks.records import BenchmarkClaim, BenchmarkPoint, Role
from benchmarks.stopwatch import Times, timed_in_turn
from benchmarks.video_points import film
from evenlight.analysis.catalogue.catalogue_results import run_catalogue
from evenlight.analysis.catalogue.entries import videos_of
from evenlight.analysis.tracks.track_request import TrackRequest
from evenlight.cluster import Workers, opened_cluster
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.tracks.loss_curves import LossCurves, write_loss_curves
from evenlight.method.contrast.loss_curves import brightness_factors
from evenlight.method.preset_files import load_display
from evenlight.progress import shown_progress

SIZE, RATE = (320, 180), 25
ONE, TWO = "one worker", "two workers"
LOOP = "a shell loop of `evenlight optimize`"
GROWTH_TARGET = 100.0  # MiB that the client may grow by over a catalogue of curves
MOST = TrackRequest(budget=0.5, no_cache=True, no_player=True)


@dataclass(frozen=True, slots=True)
class ScaleSizes:
    """How much is measured."""

    clips: int  # of two seconds, for the speed-up
    catalogue: int  # of two seconds, against a loop
    loop: int  # of the loop
    curves: int  # entries whose loss curves are given


def measure(settings: RunSettings) -> SubjectResults:
    """Return what a cluster costs and gives."""
    sizes = ScaleSizes(4, 6, 2, 12) if settings.quick else ScaleSizes(24, 200, 20, 2000)
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        several = _speed_up(settings, sizes, folder)
        loop, memory = _against_a_loop(settings, sizes, folder)
        curves, grown = _of_curves(settings, sizes, folder)
    claims = [
        claim(
            "growth of the client's memory over a catalogue of loss curves", GROWTH_TARGET, grown, "MiB",
            f"{sizes.curves} entries of 50 frames",
        ),
        _speed_claim("time of two workers, to that of one", 0.58, several, TWO),
    ]  # fmt: skip
    ratio = next(p.ratio for p in several if p.approach == TWO) or 1.0
    each = {p.approach: p.time for p in loop}
    return SubjectResults(
        name="scale",
        title="Many videos",
        lead=f"Two workers take {ratio:.2f} of the time of one. In a catalogue on two, a clip of two seconds "
        f"takes {each[TWO]:.2f} s, in a shell loop {each[LOOP]:.2f} s. A worker holds {memory:.0f} MiB.",
        points=(*several, *loop, *curves),
        charts=(),
        claims=tuple(claims),
        notes=(
            "The cluster is one of processes on this computer, started before the clock; a first clip, which "
            "loads the compiled loops, does not count.",
            f"Memory of a worker is the largest of a process that made {sizes.catalogue} clips.",
            "Of the loop, each run is a process that loads Python, Evenlight and its loops anew.",
        ),
    )


def _speed_claim(
    words: str, target: float, points: Iterable[BenchmarkPoint], approach: str
) -> BenchmarkClaim:
    """Return the target of a ratio of times."""
    ratio = next(p.ratio for p in points if p.approach == approach)
    assert ratio is not None
    return claim(words, target, ratio, "", "wall time; both cores are the machine's only ones")


def _clips(folder: Path, count: int, seed: int) -> Path:
    """Return a folder of so many clips of two seconds; each is a copy of one, which costs the same work."""
    folder.mkdir()
    first = encoded(folder / "0000.mp4", film(*SIZE, 2 * RATE, seed))
    for k in range(1, count):
        shutil.copy(first, folder / f"{k:04d}.mp4")
    return folder


@contextmanager
def _warm(workers: int, clip: Path, folder: Path) -> Iterator[Workers]:
    """Yield so many workers, each of which has made a result already."""
    with opened_cluster(f"local:{workers}", quiet=True) as cluster:
        for k in range(2 * workers):
            _made(cluster, str(clip), folder / f"warm-{workers}-{k}")
        yield cluster


def _made(workers: Workers, source: str, out: Path) -> float:
    """Make a catalogue, and return how long it took [s]."""
    shutil.rmtree(out, ignore_errors=True)
    out.mkdir(parents=True)
    videos = videos_of(source, MOST, out)
    began = time.perf_counter()
    with shown_progress(quiet=True) as progress:
        rows = run_catalogue(videos, workers, progress)
    assert not any(row.error for row in rows), [row.error for row in rows if row.error][:1]
    return time.perf_counter() - began


def _points(task: str, times: dict[str, Times], size: int, of: str) -> list[BenchmarkPoint]:
    """Return the points of approaches to a task, timed in turn."""
    roles = {TWO: Role.DEFAULT}
    return [
        point(Approach(task, name, roles.get(name, Role.VARIANT), size, of), taken)
        for name, taken in times.items()
    ]


def _speed_up(settings: RunSettings, sizes: ScaleSizes, folder: Path) -> list[BenchmarkPoint]:
    """Return the times of a catalogue on one worker and on two."""
    settings.say("a catalogue on one worker and on two")
    films = _clips(folder / "speed", sizes.clips, settings.seed)
    clip = films / "0000.mp4"
    with _warm(1, clip, folder) as one, _warm(2, clip, folder) as two:
        runs: dict[str, Callable[[], object]] = {
            ONE: lambda: _made(one, str(films), folder / "out"),
            TWO: lambda: _made(two, str(films), folder / "out"),
        }
        times = timed_in_turn(runs, settings.repeats(3))
    return _points(f"{sizes.clips} clips of two seconds, {SIZE[0]} x {SIZE[1]}", times, sizes.clips, "videos")


def _against_a_loop(
    settings: RunSettings, sizes: ScaleSizes, folder: Path
) -> tuple[list[BenchmarkPoint], float]:
    """Return the time of each clip in a catalogue and in a loop of processes, and a worker's memory [MiB]."""
    settings.say("a catalogue of short clips, and a loop of processes")
    films = _clips(folder / "many", sizes.catalogue, settings.seed)
    with _warm(2, films / "0000.mp4", folder) as two:
        taken = _made(two, str(films), folder / "out") / sizes.catalogue
        memory = max(two.client.run(_peak).values())
    began = time.perf_counter()
    for k in range(sizes.loop):
        words = [str(films / f"{k:04d}.mp4"), "--budget", "0.5", "--out", str(folder / "loop" / str(k))]
        subprocess.run(
            [sys.executable, "-m", "evenlight", "optimize", *words, "--no-cache", "--no-player", "--quiet"],
            check=True,
        )
    loop = (time.perf_counter() - began) / sizes.loop
    each = {LOOP: loop, TWO: taken}
    times = {name: Times(np.array([t]), np.zeros(1), np.array([t / loop])) for name, t in each.items()}
    task = f"each of {sizes.catalogue} clips of two seconds; of the loop, of {sizes.loop}"
    return _points(task, times, sizes.catalogue, "videos"), memory


def _peak() -> float:
    """Return the largest memory of this process [MiB]."""
    return _status("VmHWM")


def _resident() -> float:
    """Return the memory of this process now [MiB]."""
    return _status("VmRSS")


def _status(name: str) -> float:
    """Return what Linux says of this process [MiB]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith(name)) / 1024


def _of_curves(settings: RunSettings, sizes: ScaleSizes, folder: Path) -> tuple[list[BenchmarkPoint], float]:
    """Return the time of a catalogue whose loss curves are given, and by how much its client grew [MiB]."""
    settings.say(f"a catalogue of {sizes.curves} loss curves")
    given = folder / "curves"
    given.mkdir()
    rng, factors, frames = np.random.default_rng(settings.seed), brightness_factors(), 50
    table = ["path"]
    for k in range(sizes.curves):
        strength = 0.05 + 0.1 * np.sin(np.arange(frames) / 9 + 7 * rng.random()) ** 2
        level = np.full(frames, 0.4)
        curves = LossCurves(
            f"{k:04d}", load_display("varjo-xr3"), np.arange(frames) / RATE, np.full(frames, 1 / RATE),
            factors, strength[:, None] * (1 - factors), level, 100 * level, np.repeat(level[:, None], 3, 1),
            Provenance(),
        )  # fmt: skip
        write_loss_curves(given / f"{k:04d}.npz", curves)
        table.append(f"{k:04d}.npz")
    listed = given / "curves.csv"
    listed.write_text("\n".join(table) + "\n")
    with opened_cluster("local:2", quiet=True) as two:
        before = _resident()
        taken = _made(two, str(listed), folder / "out")
        grown = _resident() - before
        again = _again(two, listed, folder / "out")
    task = f"{sizes.curves} entries with loss curves given"
    names = {TWO: taken, "the same again: nothing to do": again}
    times = {name: Times(np.array([t]), np.zeros(1), np.array([t / taken])) for name, t in names.items()}
    return _points(task, times, sizes.curves, "videos"), max(grown, 0.0)


def _again(workers: Workers, source: Path, out: Path) -> float:
    """Return how long a catalogue takes of which all is there [s]."""
    videos = videos_of(str(source), MOST, out)
    began = time.perf_counter()
    with shown_progress(quiet=True) as progress:
        run_catalogue(videos, workers, progress)
    return time.perf_counter() - began
