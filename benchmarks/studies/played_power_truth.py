"""A played video whose power is known in closed form, and what a meter with a bad clock makes of it.

The panel is that of `hardware.simulated_panel`: power is linear in a light that follows the brightness factor
with a lag. So its integral has a closed form, and a sample, the mean since the one before, is exact.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from evenlight.analysis.played_power.power_recording import (
    Flips,
    Recording,
    Samples,
    samples_once,
)
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.recordings.instrument_logs import (
    ClockPing,
    FlashMark,
    PlayedFlip,
    PowerLog,
    PowerSample,
)
from evenlight.data_schema.recordings.played_power import FrameEnergy
from evenlight.data_schema.storage.tables import write_rows
from evenlight.data_schema.storage.text_files import write_json_record
from evenlight.hardware.simulated.panel import PanelPhysics

MARKER = 0.5  # [s] bright, and as long dark
PAUSE = 0.7  # [s] between two passes
BRIGHT, DARK = 1.0, 0.05  # factors of the marker


@dataclass(frozen=True, slots=True)
class Conditions:
    """What is played, and how badly it is measured: by default as the target has it."""

    sample_rate: float = 1000.0
    content: str = "cuts"
    passes: tuple[str, ...] = ("ours", "baseline", "full")
    frames: int = 300
    frames_per_second: float = 60.0
    refresh_rate: float = 60.0
    drift_ppm: float = 50.0  # the meter's clock is slow
    lost: float = 0.01
    duplicated: float = 0.002
    jitter: float = 0.005  # of everything that passes between meter and computer [s]
    noise: float = 0.0  # of a sample [W]
    has_sync: bool = True
    inverted: bool = False
    has_pings: bool = True
    has_flashes: bool = True
    dropped: float = 0.0  # share of refreshes that fail
    power_drift: float = 0.0  # of base power [W/h]
    physics: PanelPhysics = field(default_factory=lambda: PanelPhysics(peak_luminance=750.0))


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """A recording, and the truth behind it.

    Attributes
    ----------
    recording : Recording
        As it would be loaded.
    arrived : Samples
        The samples as they came, some twice.
    energy : callable
        Energy from the beginning to some times of the computer [J].
    to_computer : callable
        From the meter's clock.
    """

    recording: Recording
    arrived: Samples
    energy: Callable[[ArrayLike], Array]
    to_computer: Callable[[ArrayLike], Array]


def track(content: str, frames: int, frames_per_second: float, rng: np.random.Generator) -> Array:
    """Return brightness factors that really vary, of frames of ours."""
    time = np.arange(frames) / frames_per_second
    if content == "ramps":  # as fast as a rate limit of 3 % per second lets it
        swing = np.abs((time / 4 + rng.random()) % 2 - 1)
        return np.asarray(0.4 * np.exp(0.03 * 4 * swing))
    if content == "cuts":  # every second or so, anything from 0.3 to 1.7 W
        scene = np.cumsum(rng.random(frames) < 1 / frames_per_second)
        return np.asarray(rng.uniform(0.02, 1.0, scene[-1] + 1)[scene] * np.exp(-0.03 * (time % 1.0)))
    raise ValueError(content)


def play(conditions: Conditions, rng: np.random.Generator) -> Truth:
    """Return a played and measured video."""
    c = conditions
    flips, flashes, steps = _shown(c, rng)
    energy = _energy(steps, c)
    start = rng.uniform(0.0, 1000.0)  # on the meter's clock
    slow = 1 - 1e-6 * c.drift_ppm
    first, last = steps[0][0], steps[0][-1] + 1.0

    def to_meter(computer: ArrayLike) -> Array:
        return np.asarray(start + slow * (np.asarray(computer, dtype=float) - first))

    def to_computer(device: ArrayLike) -> Array:
        return np.asarray(first + (np.asarray(device, dtype=float) - start) / slow)

    counted = (
        np.arange(1, int((last - first) * c.sample_rate * slow)) + rng.random()
    )  # any phase to the flips
    ends = start + counted / c.sample_rate
    seen = to_computer(ends)
    spent = energy(seen)
    power = np.diff(spent, prepend=energy(seen[:1] - 1 / c.sample_rate)) / np.diff(
        seen, prepend=seen[0] - 1 / c.sample_rate
    )
    place = np.searchsorted(flips.flip, seen, side="right") - 1
    level = np.where(place >= 0, flips.sync[np.maximum(place, 0)], False) ^ c.inverted
    samples = Samples(
        sequence=np.arange(len(ends)),
        device_time=ends,
        received=np.maximum.accumulate(seen + 0.001 + rng.uniform(0, c.jitter, len(ends))),
        power=power + c.noise * rng.normal(size=len(ends)),
        sync=level if c.has_sync else np.zeros(len(ends), dtype=bool),
    )
    kept = np.flatnonzero(rng.random(len(ends)) >= c.lost)
    arrived = chosen(samples, np.sort(np.append(kept, kept[rng.random(len(kept)) < c.duplicated])))
    once, duplicated = samples_once(arrived, "power.csv")
    pings = _pings(first, last, to_meter, c, rng) if c.has_pings else np.empty((0, 3))
    log = PowerLog(
        simulated=True,
        video="simulated clip",
        duration=c.frames / c.frames_per_second,
        passes=c.passes,
        refresh_rate=c.refresh_rate,
        sample_rate=c.sample_rate,
        mean_factor=0.5,
        baseline_factor=0.5,
        sync_connected=c.has_sync,
    )
    marks = flashes if c.has_flashes else []
    recording = Recording(log, once, duplicated, pings, flips, marks, "power.csv")
    return Truth(recording, arrived, energy, to_computer)


def chosen(samples: Samples, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Samples:
    """Return some of the samples."""
    return Samples(
        samples.sequence[rows],
        samples.device_time[rows],
        samples.received[rows],
        samples.power[rows],
        samples.sync[rows],
    )


def times_of(frames: Sequence[FrameEnergy]) -> tuple[Array, Array]:
    """Return when frames appeared, and when they had gone [s]."""
    begun = np.array([frame.begun for frame in frames])
    return begun, begun + [frame.duration for frame in frames]


def _shown(c: Conditions, rng: np.random.Generator) -> tuple[Flips, list[FlashMark], tuple[Array, Array]]:
    """Return flips, markers, and every change of the brightness: times and factors."""
    time = rng.uniform(10.0, 500.0)
    ours = track(c.content, c.frames, c.frames_per_second, rng)
    factors = {"ours": ours, "baseline": np.full(c.frames, ours.mean()), "full": np.ones(c.frames)}
    changes, marks = [(time, 0.3)], []
    time += 1.0
    time = _flash(time, marks, changes)
    rows: list[tuple[int, str, float, int, float, bool]] = []
    level = False
    for number, version in enumerate(c.passes):
        refreshes = np.arange(round(c.frames / c.frames_per_second * c.refresh_rate))
        frame = np.minimum(
            (refreshes / c.refresh_rate * c.frames_per_second + 1e-6).astype(int), c.frames - 1
        )
        failed = rng.random(len(refreshes)) < c.dropped
        failed[0] = False
        shown = -1
        for refresh in refreshes[~failed]:
            flip, new = time + refresh / c.refresh_rate, int(frame[refresh])
            level ^= new != shown
            shown = new
            factor = float(factors[version][new])
            rows.append((number, version, flip, new, factor, level))
            changes.append((flip, factor))
        time += len(refreshes) / c.refresh_rate
        changes.append((time, DARK))
        time += PAUSE
    time = _flash(time, marks, changes)
    flips = Flips(
        pass_index=np.array([row[0] for row in rows]),
        version=np.array([row[1] for row in rows]),
        flip=np.array([row[2] for row in rows]),
        video_frame=np.array([row[3] for row in rows]),
        achieved_factor=np.array([row[4] for row in rows]),
        sync=np.array([row[5] for row in rows]),
    )
    times, aims = np.array(changes).T
    return flips, marks, (times, aims)


def _flash(time: float, marks: list[FlashMark], changes: list[tuple[float, float]]) -> float:
    """Add a marker of three flashes, and return when it is over."""
    for factor in (BRIGHT, DARK) * 3:
        marks.append(FlashMark(time, factor))
        changes.append((time, factor))
        time += MARKER
    return time


def _energy(steps: tuple[Array, Array], c: Conditions) -> Callable[[ArrayLike], Array]:
    """Return the energy from the first change to any time, for factors that are held from each change on."""
    times, aims = steps
    physics, lag = c.physics, c.physics.lag
    slope = physics.power_per_luminance * physics.peak_luminance
    light, area = np.empty(len(times)), np.zeros(len(times))
    light[0] = aims[0]
    for k, lasts in enumerate(np.diff(times)):
        left = np.exp(-lasts / lag)
        area[k + 1] = area[k] + aims[k] * lasts + (light[k] - aims[k]) * lag * (1 - left)
        light[k + 1] = aims[k] + (light[k] - aims[k]) * left

    def energy(when: ArrayLike) -> Array:
        at = np.asarray(when, dtype=float)
        place = np.clip(np.searchsorted(times, at, side="right") - 1, 0, None)
        since = at - times[place]
        lagging = (light[place] - aims[place]) * lag * -np.expm1(-np.maximum(since, 0.0) / lag)
        base = physics.base_power * (at - times[0]) + c.power_drift / 3600 * (at - times[0]) ** 2 / 2
        return np.asarray(base + slope * (area[place] + aims[place] * since + lagging))

    return energy


def _pings(
    first: float, last: float, to_meter: Callable[[ArrayLike], Array], c: Conditions, rng: np.random.Generator
) -> Array:
    """Return a few pings before and after, and one every ten seconds; one in twenty is very slow."""
    ends = np.arange(5) * 0.02
    asked = np.concatenate([first + ends, np.arange(first + 10, last, 10.0), last + ends])
    legs = 0.0003 + rng.uniform(0, c.jitter, (len(asked), 2))
    legs[rng.random(len(asked)) < 0.05] += 0.1 * rng.random(2)
    told = asked + legs[:, 0]
    return np.column_stack([asked, to_meter(told), told + legs[:, 1]])


def write_folder(truth: Truth, folder: Path) -> Path:
    """Write a recording as `evenlight measure played` would."""
    recording, arrived, flips = truth.recording, truth.arrived, truth.recording.flips
    folder.mkdir(parents=True, exist_ok=True)
    write_json_record(folder / "power_log.json", recording.log)
    columns = (arrived.sequence, arrived.device_time, arrived.received, arrived.power, arrived.sync)
    samples = zip(*(column.tolist() for column in columns), strict=True)
    write_rows(folder / "power.csv", PowerSample, [PowerSample(*row) for row in samples])
    write_rows(folder / "clock.csv", ClockPing, [ClockPing(*row) for row in recording.pings.tolist()])
    write_rows(folder / "flashes.csv", FlashMark, recording.flashes)
    shown = [
        PlayedFlip(int(number), str(version), float(flip), int(frame), float(b), float(b), bool(level))
        for number, version, flip, frame, b, level in zip(
            flips.pass_index,
            flips.version,
            flips.flip,
            flips.video_frame,
            flips.achieved_factor,
            flips.sync,
            strict=True,
        )
    ]
    write_rows(folder / "flips.csv", PlayedFlip, shown)
    return folder
