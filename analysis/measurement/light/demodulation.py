"""Light without its PWM: each sample divided by what the PWM does at its phase.

So an edge keeps its shape, which averaging over a period of the PWM would not. The phase is told anew by the
end of every white, as a PWM need not keep step with anything. One that goes nearly dark leaves nothing to be
divided.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from evenlight.analysis.measurement.light.light_recording import LightRecording
from evenlight.analysis.measurement.light.ripple import RippleFound
from evenlight.data_schema.arrays import Array

FAINTEST = 0.15  # of the mean light, that is left at the PWM's minimum
FLAT = 0.1  # share of the ripple that may be left in the whites
STEEP = 0.3  # of the ripple, by which an edge of the PWM changes from one phase to the next
BESIDE = 1.5  # phases, or half a sample, beside such an edge: light there is that of its neighbours
END = 0.5  # share of a white, from its end, in which its phase is told


def without_ripple(recording: LightRecording, found: RippleFound, dark: float) -> LightRecording | None:
    """Return a recording without its PWM; None where it cannot be taken out.

    Parameters
    ----------
    recording, found : LightRecording, RippleFound
        The light, with flips, and its ripple.
    dark : float
        The value in darkness.
    """
    frequency = found.ripple.frequency
    waveform = (found.waveform - dark) / (found.waveform.mean() - dark)
    if frequency is None or waveform.min() < FAINTEST:
        return None
    times, flips = recording.times, recording.flips
    own = np.sum((found.waveform - dark) * np.exp(-2j * np.pi * found.phases))
    whites = np.flatnonzero(recording.lit)
    begins, ends = flips[whites], np.append(flips, times[-1])[whites + 1]
    # The light of a white begins and ends later than its frames; between two whites, either's phase will do.
    borders = np.concatenate([[-np.inf], (ends[:-1] + begins[1:]) / 2, [np.inf]])
    turned = np.exp(-2j * np.pi * frequency * times)

    def strength(light: Array, part: slice) -> complex:
        return complex(np.sum((light[part] - light[part].mean()) * turned[part]))

    jumps = np.abs(waveform - np.roll(waveform, 1)) > STEEP * np.ptp(waveform)
    steep = found.phases[jumps] - 0.5 / len(found.phases)
    beside = max(BESIDE / len(found.phases), 0.5 * frequency * recording.period)
    divided, left, masked = recording.values - dark, [], np.zeros(len(times), dtype=bool)
    for begin, end, first, last in zip(begins, ends, borders, borders[1:], strict=False):
        near = slice(*np.searchsorted(times, [first, last]).tolist())
        told = slice(*np.searchsorted(times, [end - END * (end - begin), end]).tolist())
        before = strength(divided, told)
        phase = frequency * times[near] + np.angle(before / own) / (2 * np.pi)
        divided[near] /= np.interp(phase % 1, found.phases, waveform, period=1.0)
        for edge in steep:
            masked[near] |= np.abs((phase - edge + 0.5) % 1 - 0.5) < beside
        left.append(abs(strength(divided, told)) / abs(before))
    if np.median(left) > FLAT:
        return None
    divided[masked] = np.interp(times[masked], times[~masked], divided[~masked])
    return dataclasses.replace(recording, values=dark + divided)
