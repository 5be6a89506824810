"""What a recording of light says of a display: PWM, response times, latency, and what it cannot say."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from evenlight.analysis.measurement.light.demodulation import without_ripple
from evenlight.analysis.measurement.light.light_edges import (
    LightEdges,
    Overlay,
    find_edges,
    latency_of,
    response_times,
)
from evenlight.analysis.measurement.light.light_recording import LightRecording
from evenlight.analysis.measurement.light.ripple import RippleFound, find_ripple
from evenlight.analysis.report_prose import prose
from evenlight.data_schema.arrays import Array
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.light import LightResults, Ripple

CLOCK_TOLERANCE = 1e-4  # of a clock with a crystal, where it was not compared well enough
STEADY_PARTS = 4  # of a steady white, whose means are compared
STEADY_AFTER, STEADY_BEFORE = 0.15, 0.01  # [s] of the white before the first change, left out


@dataclass(frozen=True, slots=True, eq=False)
class LightFindings:
    """What was found, with what the figures show.

    Attributes
    ----------
    recording : LightRecording
        What was recorded.
    results : LightResults
        All that is stated.
    ripple : RippleFound or None
        The PWM, or its absence.
    steady : (array, array)
        Times [s] and values of the steady light.
    edges, overlays : LightEdges or None, list of Overlay
        Edges of the flips; edges laid over each other.
    latencies : array, (F - 1,)
        Of each flip from the second on [s], NaN where it has no edge.
    """

    recording: LightRecording
    results: LightResults
    ripple: RippleFound | None
    steady: tuple[Array, Array]
    edges: LightEdges | None
    overlays: list[Overlay]
    latencies: Array


def analyse_light(recording: LightRecording, provenance: Provenance) -> LightFindings:
    """Return what a recording says.

    Parameters
    ----------
    recording : LightRecording
        What was recorded.
    provenance : Provenance
        How the results are made.
    """
    log, clock = recording.log, recording.clock
    steady = _steady(recording)
    dark = _dark(recording)
    ripple = find_ripple(*steady, log.sample_rate, dark, dc_coupled=log.dc_coupled)
    averaged = ripple.ripple.frequency if ripple else None
    edges, overlays, timed = None, [], None
    if clock is not None:
        flat = without_ripple(recording, ripple, dark) if ripple and averaged and dark is not None else None
        light, averaged = (flat, None) if flat else (recording, averaged)
        edges = find_edges(light, averaged)
        timed = latency_of(light, edges, clock)
        if log.dc_coupled and edges.settled:
            overlays = response_times(light, edges, averaged)
    gaps = np.rint(np.diff(recording.times) / recording.period) - 1
    results = LightResults(
        simulated=log.simulated,
        instrument=log.instrument,
        sample_rate=log.sample_rate,
        n_samples=len(recording.times),
        n_lost=int(np.maximum(gaps, 0).sum()),
        ripple=_on_the_computers_clock(ripple.ripple, recording) if ripple else None,
        n_flips=max(len(recording.flips) - 1, 0),
        n_edges=int(edges.found.sum()) if edges else 0,
        n_extra=edges.n_extra if edges else 0,
        response_times=tuple(overlay.response for overlay in overlays),
        averaged_over=1 / averaged if averaged and edges else None,
        latency=timed[0] if timed else None,
        clock=clock.record() if clock else None,
        notes=prose(
            "light_notes",
            recording=recording,
            ripple=ripple and ripple.ripple,
            edges=edges,
            moved=_moved(steady[1], dark),
        ),
        provenance=provenance,
    )
    each = timed[1] if timed else np.empty(0)
    return LightFindings(recording, results, ripple, steady, edges, overlays, each)


def _on_the_computers_clock(ripple: Ripple, recording: LightRecording) -> Ripple:
    """Return a ripple by the computer's clock, where pings tell it; else with an interval that holds it."""
    if ripple.frequency is None or ripple.frequency_ci_low is None or ripple.frequency_ci_high is None:
        return ripple
    rate, error = 1.0, CLOCK_TOLERANCE
    if recording.clock is not None and recording.clock.bound is not None:
        told = 2 * recording.clock.bound / float(recording.times[-1] - recording.times[0])
        if told < CLOCK_TOLERANCE:
            rate, error = 1 + recording.clock.line.drift, told
    return replace(
        ripple,
        frequency=ripple.frequency / rate,
        frequency_ci_low=ripple.frequency_ci_low / rate * (1 - error),
        frequency_ci_high=ripple.frequency_ci_high / rate * (1 + error),
    )


def _moved(values: Array, dark: float | None) -> float:
    """Return by which share of itself a steady light moves, on average over parts of the recording."""
    means = [float(part.mean()) - (dark or 0.0) for part in np.array_split(values, STEADY_PARTS)]
    return float(np.ptp(means) / max(abs(np.mean(means)), 1e-12))


def _steady(recording: LightRecording) -> tuple[Array, Array]:
    """Return the samples of a steady white: all, or those before the patch first turns black."""
    times, values = recording.times, recording.values
    if not len(recording.flips):
        return times, values
    white = (times > recording.flips[0] + STEADY_AFTER) & (times < recording.flips[1] - STEADY_BEFORE)
    return (times[white], values[white]) if white.sum() > 1 else (times, values)


def _dark(recording: LightRecording) -> float | None:
    """Return the value in darkness: as it was measured, or that of the black patch before it turns white."""
    if recording.log.dark is not None or not len(recording.flips) or not recording.log.dc_coupled:
        return recording.log.dark
    ends = recording.flips[2:][recording.lit[2:]]
    begins = recording.flips[1:-1][recording.lit[2:]]
    late = [
        recording.values[(recording.times > end - 0.3 * (end - begin)) & (recording.times < end)]
        for begin, end in zip(begins, ends, strict=True)
    ]
    return float(np.median(np.concatenate(late))) if late else None
