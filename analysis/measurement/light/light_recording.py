"""A recording of light, read and checked: samples, the patch's flips, and the sampler's clock."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evenlight.analysis.measurement.played_power.clock_fit import fit_arrivals, fit_pings
from evenlight.analysis.measurement.played_power.clock_line import ClockEstimate
from evenlight.analysis.measurement.played_power.power_recording import Samples
from evenlight.data_schema.arrays import Array, Mask
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.dataset_layout import CLOCK_PINGS
from evenlight.data_schema.recordings.instrument_logs import ClockPing
from evenlight.data_schema.recordings.light import (
    LIGHT_ARRIVALS,
    LIGHT_LOG,
    LIGHT_SAMPLES,
    PATCH_FLIPS,
    LightArrival,
    LightLog,
    PatchFlip,
    read_light_samples,
)
from evenlight.data_schema.storage.tables import read_rows
from evenlight.data_schema.storage.text_files import read_json_record

FEWEST_PINGS = 3
CLIPPED = 0.001  # share of samples at the end of a known scale that may be chance
FLAT_SHARE, FLAT_TOP, FLAT_PURITY = 0.01, 0.02, 0.9  # of an unknown scale: see `_clipped_share`
FEWEST_VALUES = 50  # different ones: a signal of fewer is flat at both ends anyhow


@dataclass(frozen=True, slots=True, eq=False)
class LightRecording:
    """What was recorded.

    Attributes
    ----------
    log : LightLog
        What with.
    times, values : array, (N,)
        On the sampler's clock [s], and on its scale.
    flips, lit : array, (F,), array of bool, (F,)
        When the patch changed, on the sampler's clock [s], and whether it was white from then on.
    clock : ClockEstimate or None
        The sampler's clock on the computer's; None without flips.
    """

    log: LightLog
    times: Array
    values: Array
    flips: Array
    lit: Mask
    clock: ClockEstimate | None

    @property
    def period(self) -> float:
        """Time from one sample to the next [s]."""
        return 1 / self.log.sample_rate


def load_light_recording(folder: Path) -> LightRecording:
    """Return what is in the folder of a recording of light.

    Raises
    ------
    InputError
        If a file is missing, or contradicts itself; if the sampler was saturated, or saw no light.
    """
    log = read_json_record(LightLog, folder / LIGHT_LOG)
    times, values = read_light_samples(folder / LIGHT_SAMPLES)
    if not values.any():
        raise InputError(f"{log.instrument}: all samples are 0, so no light reached it")
    share = _clipped_share(values, log.full_scale, dc_coupled=log.dc_coupled)
    if share:
        raise InputError(
            f"{log.instrument}: {share:.1%} of the samples are at the end of its scale, so there was more "
            "light than it measures: turn its gain down or move the photodiode away, and measure again"
        )
    if not (folder / PATCH_FLIPS).is_file():
        return LightRecording(log, times, values, np.empty(0), np.empty(0, dtype=bool), None)
    rows = read_rows(PatchFlip, folder / PATCH_FLIPS)
    flips, lit = np.array([row.flip for row in rows]), np.array([row.lit for row in rows], dtype=bool)
    if len(flips) < 3 or not (np.diff(flips) > 0).all() or not lit[0] or (lit[1:] == lit[:-1]).any():
        raise InputError(
            f"{folder / PATCH_FLIPS}: expected at least 3 changes between white and black by turns, white "
            "first, at times that rise"
        )
    clock = _clock(folder, times)
    return LightRecording(log, times, values, clock.line.to_meter(flips), lit, clock)


def _clock(folder: Path, times: Array) -> ClockEstimate:
    """Return the sampler's clock on the computer's: by pings, or by when its samples came."""
    path = folder / CLOCK_PINGS
    pings = read_rows(ClockPing, path) if path.is_file() else []
    if len(pings) >= FEWEST_PINGS:
        asked = np.array([(p.sent, p.device_time, p.received) for p in pings])
        return fit_pings(asked, (float(times[0]), float(times[-1])))
    came = read_rows(LightArrival, folder / LIGHT_ARRIVALS)
    if len(came) < 2:
        raise InputError(
            f"{folder / LIGHT_ARRIVALS}: holds {len(came)} arrivals; without {FEWEST_PINGS} pings of the "
            "clock they are needed"
        )
    device, received = np.array([(one.time, one.received) for one in came]).T
    count = np.arange(len(came))
    return fit_arrivals(Samples(count, device, received, np.zeros(len(came)), count < 0))


def _clipped_share(values: Array, full_scale: float | None, *, dc_coupled: bool) -> float:
    """Return the share of clipped samples, 0 where it may be chance.

    Where the scale is unknown, a signal is taken for clipped if its highest value comes again and again, and
    hardly any lies just below it: noise would spread them.

    >>> noisy = np.sin(np.arange(2000.0)) + 0.01 * np.cos(np.arange(2000.0) ** 2)
    >>> _clipped_share(noisy, None, dc_coupled=False)
    0.0
    >>> _clipped_share(np.clip(noisy, -1.0, 0.5), None, dc_coupled=False) > 0.3
    True
    """
    if full_scale is not None:
        size = values if dc_coupled else np.abs(values)
        share = float((size >= full_scale * (1 - 1e-4)).mean())
        return share if share > CLIPPED else 0.0
    if len(np.unique(values)) < FEWEST_VALUES:
        return 0.0
    share = float((values == values.max()).mean())
    near = float((values > values.max() - FLAT_TOP * np.ptp(values)).mean())
    return share if share > FLAT_SHARE and share > FLAT_PURITY * near else 0.0
