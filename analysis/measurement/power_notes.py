"""What a reader of a measured power should be warned of, in words."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from evenlight.analysis.measurement.pass_comparison import VERSIONS
from evenlight.analysis.measurement.pass_power import ENOUGH
from evenlight.data_schema.frame_energy import (
    ClockFit,
    ClockFlag,
    ClockMethod,
    FrameEnergy,
    FrameFlag,
    SampleCount,
)
from evenlight.data_schema.played_power import PassPower
from evenlight.data_schema.power_log import PowerLog

MANY_LOST = 0.05  # share of the time that had to be bridged
KNOWN = 0.01  # to which a frame's energy should be known
NAMES = {"ours": "ours", "baseline": "baseline", "full": "full brightness"}

METHODS = {
    ClockMethod.EDGES: "edges of the synchronisation input",
    ClockMethod.PINGS: "pings",
    ClockMethod.FLASHES: "flash markers in the power",
    ClockMethod.COMPUTER_TIME: "the computer's time in the samples",
    ClockMethod.ARRIVALS: "the arrival of the samples",
}
FLAGS = {
    ClockFlag.NO_EDGES: "The synchronisation input is said to be connected, but shows too few edges to go by",
    ClockFlag.EDGES_UNUSABLE: "Edges of the synchronisation input do not fit the flips, and were not used",
    ClockFlag.SAMPLED_TOO_SLOWLY: (
        "Frames change faster than the meter samples, so edges of the synchronisation input could not be used"
    ),
    ClockFlag.EDGES_MISSING: "For a while the synchronisation input shows no edges; the line was laid across",
    ClockFlag.AMBIGUOUS: (
        "The edges fit the flips as well a frame earlier or later, and nothing else told which it is: "
        "energies may be those of the neighbouring frames"
    ),
    ClockFlag.INVERTED: "The synchronisation input is upside down; it was turned over",
    ClockFlag.DISAGREES: (
        "Pings or flash markers say otherwise than the edges, which were believed; look at the wiring"
    ),
    ClockFlag.NOT_LINEAR: "No line is within all pings: the meter's clock is not steady, or pings went wrong",
    ClockFlag.OFFSET_ONLY: "The drift of the meter's clock could not be told from what its offset rests on",
    ClockFlag.FLASHES_NOT_FOUND: "The flash markers were not found in the power",
    ClockFlag.UNKNOWN_LATENCY: (
        "How late the meter's samples are timed is not known, so energies of single frames are not to be "
        "relied on; averages over a pass are hardly touched by it"
    ),
}


def notes_of(
    log: PowerLog,
    clock: ClockFit,
    samples: SampleCount,
    energies: Sequence[FrameEnergy],
    passes: Sequence[PassPower],
) -> tuple[str, ...]:
    """Return what a reader should be warned of, as sentences.

    Parameters
    ----------
    log : PowerLog
        What it was measured on.
    clock : ClockFit
        The meter's clock.
    samples : SampleCount
        Which samples came.
    energies : sequence of FrameEnergy
        The frames.
    passes : sequence of PassPower
        The passes.
    """
    return (
        *(f"{FLAGS[flag]}." for flag in clock.flags),
        *_of_samples(samples),
        *_of_frames(log, clock, energies),
        *_of_passes(log, passes),
    )


def _of_samples(samples: SampleCount) -> Iterator[str]:
    """Yield what to say of lost samples."""
    if samples.bridged_share > MANY_LOST:
        yield (
            f"{100 * samples.bridged_share:.1f} % of the time has no samples; power was interpolated there "
            f"(the longest gap: {samples.longest_gap:.3g} s)."
        )


def _of_frames(log: PowerLog, clock: ClockFit, energies: Sequence[FrameEnergy]) -> Iterator[str]:
    """Yield what to say of frames without an energy of their own."""
    n = len(energies)
    count = {flag: sum(frame.flag is flag for frame in energies) for flag in FrameFlag}
    if count[FrameFlag.OUTSIDE]:
        yield f"{count[FrameFlag.OUTSIDE]} of {n} frames were shown while the meter did not sample; left out."
    if count[FrameFlag.GAP]:
        yield f"{count[FrameFlag.GAP]} of {n} frames lie in a gap between samples; they are left out."
    if count[FrameFlag.UNRESOLVED] > n / 2:
        yield (
            "The meter samples more slowly than frames change: the energy of a single frame is its share of "
            "a longer mean; averages over a pass hold."
        )
    elif clock.bound is not None:
        lasts = sorted(frame.duration for frame in energies)[n // 2]
        off = (0.25 / log.sample_rate + clock.bound) / lasts
        if off > KNOWN:
            yield (
                "Where power doubles or halves at once, the energy of the frame there may be off by up to "
                f"{100 * off:.2g} %, from the time between samples ({1000 / log.sample_rate:.3g} ms) and the "
                f"bound of the clock ({max(1000 * clock.bound, 0.001):.2g} ms)."
            )


def _of_passes(log: PowerLog, passes: Sequence[PassPower]) -> Iterator[str]:
    """Yield what to say of passes that do not count, and of versions without one."""
    for one in passes:
        if not one.used:
            yield (
                f"Pass {one.pass_index + 1} ({NAMES[one.version]}) does not count: "
                f"{100 * one.measured_share:.0f} % of the video was measured, and {100 * ENOUGH:.0f} % are "
                "needed."
            )
    missing = len(log.passes) - len(passes)
    if missing > 0:
        yield f"{missing} of {len(log.passes)} passes were not played."
    for version in VERSIONS:
        if not any(one.used and one.version == version for one in passes):
            yield f"{NAMES[version].capitalize()} was not measured."
    dropped = sum(one.n_dropped for one in passes)
    if dropped:
        yield (
            f"{dropped} refreshes of the display were dropped: the frames before them were shown longer, and "
            "count for longer."
        )
    if not any(sum(one.used and one.version == v for one in passes) > 1 for v in VERSIONS):
        yield "One pass of a version says nothing of how much passes differ, or drift: no interval, no test."
