"""The ripple of a steady light: frequency, depth and duty of a backlight's PWM, or how small one may be.

The strongest line of the periodogram that stands out of the noise around it (Hann window; chance of a false
one 1 in 1000) is refined by how its phase moves from part to part of the recording. Folded at that
frequency, the samples show one period of the light, whatever the sampling rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy.signal import detrend, periodogram
from scipy.stats import t as student

from evenlight.data_schema.arrays import Array, Integers, Mask
from evenlight.data_schema.recordings.light import Ripple

LOWEST = 20.0  # [Hz] slower changes are no ripple of a backlight
FEWEST_PERIODS = 20  # of the lowest frequency in a recording
PADDING = 4  # times as many frequencies as samples ask for
FALSE_ALARM = 1e-3
NOISE_BANDS = 48  # of equal width in log frequency, in which the noise is told by the median
PARTS = 16  # whose phases tell the frequency
SEED = 1  # of the samples that choose where the light is highest and lowest
FEWEST_LEFT = 10  # of them, and of the others, at a phase
WIDEST_GAP = 0.1  # of a period between two phases, where the duty is still known
FEWEST_IN_BIN, FEWEST_BINS, MOST_BINS = 60, 12, 100
CONFIDENCE = 0.975


@dataclass(frozen=True, slots=True)
class RippleFound:
    """A ripple, with what its figure shows."""

    ripple: Ripple
    frequencies: Array  # (M,) [Hz]
    amplitudes: Array  # (M,) of a sine of that frequency, on the sampler's scale
    smallest: Array  # (M,) amplitude that would have been found
    phases: Array  # (B,) of a period, from 0 to 1; empty without a ripple
    waveform: Array  # (B,) the light at those phases, on the sampler's scale


def find_ripple(
    times: Array, values: Array, rate: float, dark: float | None, *, dc_coupled: bool
) -> RippleFound | None:
    """Return the ripple of a steady light; None where the recording is too short for one.

    Parameters
    ----------
    times, values : array, (N,)
        On the sampler's clock [s], and on its scale.
    rate : float
        Of the samples [Hz].
    dark : float or None
        The value in darkness; None if it was not measured.
    dc_coupled : bool
        Whether steady light reads as such.
    """
    lowest = max(LOWEST, FEWEST_PERIODS / float(times[-1] - times[0]))
    if lowest > 0.25 * rate:
        return None
    frequencies, amplitudes, smallest = _spectrum(times, values, rate, lowest)
    mean = abs(float(values.mean()) - (dark or 0.0)) if dc_coupled else 0.0
    changes = np.ptp(values) > 0  # else the least that can be seen is a step, which nothing tells
    seen = float(smallest.max()) / mean if mean > 0 and changes else None
    clear = np.where(amplitudes > smallest, amplitudes, 0.0)
    empty = np.empty(0)
    if not clear.any() or not changes:
        nothing = Ripple(None, None, None, None, None, None, False, None, seen, lowest, rate / 2)
        return RippleFound(nothing, frequencies, amplitudes, smallest, empty, empty)
    frequency, error = _refined(times, values, _peak(frequencies, amplitudes, int(np.argmax(clear))))
    phases, waveform = folded(times, values, frequency)
    depth, low, high = _depth(times, values, frequency, dark or 0.0) if dc_coupled else (None, None, None)
    gaps = float(np.diff(phases, append=phases[0] + 1).max()) > WIDEST_GAP
    found = Ripple(
        frequency=frequency,
        frequency_ci_low=frequency - error,
        frequency_ci_high=frequency + error,
        depth=depth,
        depth_ci_low=low,
        depth_ci_high=high,
        depth_is_least=depth is not None and (dark is None or gaps),
        duty=None if gaps else float((waveform > (waveform.max() + waveform.min()) / 2).mean()),
        smallest_seen=None,
        lowest_frequency=lowest,
        highest_frequency=rate / 2,
    )
    return RippleFound(found, frequencies, amplitudes, smallest, phases, waveform)


def folded(times: Array, values: Array, frequency: float) -> tuple[Array, Array]:
    """Return phases (of a period) and the mean light at them, at a frequency [Hz]."""
    place, n_bins = _places(times, frequency)
    count = np.bincount(place, minlength=n_bins)
    filled = count > 0
    waveform = np.bincount(place, values, n_bins)[filled] / count[filled]
    return (np.flatnonzero(filled) + 0.5) / n_bins, waveform


def _places(times: Array, frequency: float) -> tuple[Integers, int]:
    """Return in which part of a period each sample is, and how many parts there are."""
    n_bins = int(np.clip(len(times) // FEWEST_IN_BIN, FEWEST_BINS, MOST_BINS))
    return ((times - times[0]) * frequency % 1 * n_bins).astype(int), n_bins


def _spectrum(times: Array, values: Array, rate: float, lowest: float) -> tuple[Array, Array, Array]:
    """Return frequencies [Hz], amplitudes of sines, and the smallest that stand out of the noise."""
    light = detrend(np.interp(np.arange(times[0], times[-1], 1 / rate), times, values))
    frequencies, power = periodogram(light, rate, "hann", PADDING * len(light), scaling="spectrum")
    kept = frequencies >= lowest
    frequencies, power = frequencies[kept], power[kept]
    edges = np.geomspace(frequencies[0], frequencies[-1] * 1.0001, NOISE_BANDS + 1)
    ends = np.unique(np.searchsorted(frequencies, edges))
    bands = [slice(begin, end) for begin, end in pairwise(ends.tolist())]
    middles = [float(np.sqrt(frequencies[band][0] * frequencies[band][-1])) for band in bands]
    medians = [float(np.median(power[band])) for band in bands]
    # Of noise, power is exponentially distributed: its mean is the median over ln 2.
    noise = np.asarray(np.interp(np.log(frequencies), np.log(middles), medians) / np.log(2))
    chance = np.log(len(frequencies) / PADDING / FALSE_ALARM)
    return frequencies, np.sqrt(2 * power), np.sqrt(2 * noise * chance)


def _peak(frequencies: Array, amplitudes: Array, place: int) -> float:
    """Return the frequency of a peak, between the three highest places of it [Hz]."""
    if not 0 < place < len(frequencies) - 1:
        return float(frequencies[place])
    left, top, right = np.log(amplitudes[place - 1 : place + 2])
    shift = 0.5 * (left - right) / (left - 2 * top + right)
    return float(frequencies[place] + shift * (frequencies[1] - frequencies[0]))


def _refined(times: Array, values: Array, frequency: float) -> tuple[float, float]:
    """Return a frequency, refined by how the phase moves over the recording, and its 95 % half-width [Hz]."""
    since = times - times[0]
    turned = (values - values.mean()) * np.exp(-2j * np.pi * frequency * since)
    parts = np.array_split(np.arange(len(times)), PARTS)
    at = np.array([since[part].mean() for part in parts])
    phase = np.unwrap([float(np.angle((turned[part] * np.hanning(len(part))).sum())) for part in parts])
    (slope, _), covariance = np.polyfit(at, phase, 1, cov=True)
    error = float(student.ppf(CONFIDENCE, PARTS - 2) * np.sqrt(covariance[0, 0]))
    return frequency + float(slope) / (2 * np.pi), error / (2 * np.pi)


def _depth(
    times: Array, values: Array, frequency: float, dark: float
) -> tuple[float | None, float | None, float | None]:
    """Return the depth and its interval; None where the light is below darkness, so not what it seems.

    Some samples, drawn at random, choose the phases where the light is highest and lowest, and the others
    tell what it is there: the highest of what was chosen would be so by its noise, too.
    """
    place, n_bins = _places(times, frequency)
    choosing = np.random.default_rng(SEED).random(len(times)) < 0.5

    def means(part: Mask) -> tuple[Integers, Array]:
        count = np.bincount(place[part], minlength=n_bins)
        return count, np.bincount(place[part], values[part] - dark, n_bins) / np.maximum(count, 1)

    (n_choosing, chosen), (n_told, told) = means(choosing), means(~choosing)
    known = (n_choosing >= FEWEST_LEFT) & (n_told >= FEWEST_LEFT)
    if not known.any():
        return None, None, None
    top, bottom = np.argmax(np.where(known, chosen, -np.inf)), np.argmin(np.where(known, chosen, np.inf))
    high, low = float(told[top]), float(told[bottom])
    whole = abs((high - low) / (high + low))
    if whole > 1.1:  # above 1 by more than errors of the dark level: an AC-coupled input
        return None, None, None
    errors = [float(np.std(values[~choosing & (place == k)]) / np.sqrt(n_told[k])) for k in (top, bottom)]
    spread = 2 * float(np.hypot(low * errors[0], high * errors[1])) / (high + low) ** 2
    half = float(student.ppf(CONFIDENCE, min(n_told[top], n_told[bottom]) - 1)) * spread
    between = 2 * abs(low * _above(told[known], int(chosen[known].argmax()))) / (high + low) ** 2
    between += 2 * abs(high * _above(told[known], int(chosen[known].argmin()))) / (high + low) ** 2
    whole = min(whole, 1.0)
    return whole, max(whole - half, 0.0), min(whole + half + between, 1.0)


def _above(waveform: Array, place: int) -> float:
    """Return how far the extreme of a round waveform may lie beyond its extreme phase.

    That is at most a sixth of the second difference there, on the side where no edge is.
    """
    sides = [waveform.take([place, place + side, place + 2 * side], mode="wrap") for side in (-1, 1)]
    return min(abs(float(a - 2 * b + c)) for a, b, c in sides) / 6
