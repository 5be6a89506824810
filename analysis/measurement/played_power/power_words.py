"""What was measured of a played video, in words: for the terminal, the report and its warnings."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from evenlight.analysis.measurement.played_power.pass_power import ENOUGH, VERSIONS
from evenlight.data_schema.recordings.instrument_logs import PowerLog
from evenlight.data_schema.recordings.played_power import (
    ClockFit,
    ClockFlag,
    ClockMethod,
    EqualPower,
    FrameEnergy,
    FrameFlag,
    PassPower,
    PlayedPower,
    SampleCount,
    VersionPower,
)

FINEST = 0.001  # [ms] that is said of a clock: no flip is known better
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
        "The edges fit the flips as well a frame earlier or later, and nothing else showed which it is: "
        "energies may be those of the neighbouring frames"
    ),
    ClockFlag.INVERTED: "The synchronisation input is upside down; it was turned over",
    ClockFlag.DISAGREES: (
        "Pings or flash markers disagree with the edges, which were believed; look at the wiring"
    ),
    ClockFlag.NOT_LINEAR: "No line is within all pings: the meter's clock is not steady, or pings went wrong",
    ClockFlag.OFFSET_ONLY: "The drift of the meter's clock could not be separated from its offset",
    ClockFlag.FLASHES_NOT_FOUND: "The flash markers were not found in the power",
    ClockFlag.UNKNOWN_LATENCY: (
        "How late the meter's samples are timed is not known, so energies of single frames are not to be "
        "relied on; averages over a pass are hardly touched by it"
    ),
}


def closing_lines(power: PlayedPower) -> list[str]:
    """Return what came out, line by line.

    Parameters
    ----------
    power : PlayedPower
        What was measured.
    """
    lines = [f"{'SIMULATED ' if power.simulated else ''}power of {power.video}: {_powers(power)}"]
    lines += [*_comparisons(power), clock_in_words(power.clock)]
    count = power.samples
    lines.append(
        f"samples: {count.n_samples} came, {count.n_lost} were lost, {count.n_duplicated} came again; "
        f"{100 * count.bridged_share:.2g} % of the time was bridged"
    )
    return lines + [f"note: {note}" for note in power.notes]


def _powers(power: PlayedPower) -> str:
    """Return the mean powers of the versions."""
    words = []
    for one in power.versions:
        passes = "1 pass" if one.n_passes == 1 else f"{one.n_passes} passes"
        words.append(f"{NAMES[one.version]} {one.mean_power:.3f} W ({passes})")
    return ", ".join(words)


def main_findings(power: PlayedPower) -> str:
    """Return what came out, in a sentence or two: the lead of the report."""
    words = _comparisons(power)
    if not words:
        words = [f"{NAMES[one.version]} takes {one.mean_power:.4g} W" for one in power.versions]
    return " ".join(f"{part[0].upper()}{part[1:]}." for part in words).replace(" %", "\u00a0%")


def heading_in_words(power: PlayedPower) -> str:
    """Return what came out as the subtitle of a figure."""
    words = "; ".join(_comparisons(power)) or "one version was measured, and compared with no other"
    return words[0].upper() + words[1:]


def _comparisons(power: PlayedPower) -> list[str]:
    """Return what ours saves, and whether it takes the same power as the baseline."""
    words = [
        savings_in_words(one) for one in power.versions if one.version == "ours" and one.saving is not None
    ]
    return words if power.equal_power is None else [*words, difference_in_words(power.equal_power)]


def savings_in_words(one: VersionPower) -> str:
    """Return what a version saves against full brightness."""
    words = (
        f"{NAMES[one.version]} saves {one.saving:.3f} W against full brightness, {one.saving_percent:.2f} %"
    )
    if one.saving_percent_ci_low is None:
        return words
    ends = f"{one.saving_percent_ci_low:.2f} to {one.saving_percent_ci_high:.2f} %"
    return f"{words} (95 % confidence interval {ends})"


def difference_in_words(equal: EqualPower) -> str:
    """Return whether ours and baseline take the same power."""
    words = f"ours less baseline: {_mw(equal.difference)} mW"
    if equal.ci_low is not None and equal.ci_high is not None:
        words += f" (95 % confidence interval {_mw(equal.ci_low)} to {_mw(equal.ci_high)} mW)"
    if equal.margin is None or equal.equal is None:
        return f"{words}, not tested for equality"
    margin = f"{_mw(equal.margin)} mW, 1 % of full brightness"
    if equal.equal:
        return f"{words}, equal within {margin}"
    return f"{words}, not shown to be equal within {margin}"


def _mw(power: float) -> str:
    """Return a power in mW, with two decimals where it is small.

    >>> _mw(-0.000236), _mw(0.01718), _mw(0.1718), _mw(-0.000001)
    ('-0.24', '17.2', '172', '0.00')
    """
    value = 1000 * power
    decimals = 2 if abs(value) < 10 else 1 if abs(value) < 100 else 0
    return f"{round(value, decimals) + 0.0:.{decimals}f}"  # 0.0 is added for -0.0, which reads as less than 0


def clock_in_words(clock: ClockFit) -> str:
    """Return how the meter's clock was put on the computer's."""
    words = f"clock: by {METHODS[clock.method]}"
    if clock.n_used:
        words += f", {clock.n_used} used, {clock.n_rejected} left out"
    words += f"; drift {clock.drift_ppm:.3g} ppm"
    if clock.residual_sd is not None:
        words += f", residual SD {1000 * clock.residual_sd:.2g} ms"
    if clock.bound is not None:
        what = "the flips' own times" if clock.method is ClockMethod.EDGES else "the computer's clock"
        words += f", within {max(1000 * clock.bound, FINEST):.2g} ms of {what}"
    return words


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
