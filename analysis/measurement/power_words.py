"""What was measured of a played video, in a few lines for the terminal and the lead of the report."""

from __future__ import annotations

from evenlight.analysis.measurement.power_notes import METHODS, NAMES
from evenlight.data_schema.frame_energy import ClockFit, ClockMethod
from evenlight.data_schema.played_power import EqualPower, PlayedPower, VersionPower

FINEST = 0.001  # [ms] that is said of a clock: nobody knows a flip better


def closing_lines(power: PlayedPower) -> list[str]:
    """Return what came out, line by line.

    Parameters
    ----------
    power : PlayedPower
        What was measured.
    """
    lines = [f"{'SIMULATED ' if power.simulated else ''}power of {power.video}: {_powers(power)}"]
    lines += [savings_in_words(v) for v in power.versions if v.version == "ours" and v.saving is not None]
    if power.equal_power is not None:
        lines.append(difference_in_words(power.equal_power))
    lines.append(clock_in_words(power.clock))
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


def savings_in_words(one: VersionPower) -> str:
    """Return what a version saves against full brightness."""
    words = (
        f"{NAMES[one.version]} saves {one.saving:.3f} W against full brightness, {one.saving_percent:.2f} %"
    )
    if one.saving_percent_ci_low is None:
        return words
    return f"{words} (95 % interval {one.saving_percent_ci_low:.2f} to {one.saving_percent_ci_high:.2f} %)"


def difference_in_words(equal: EqualPower) -> str:
    """Return whether ours and baseline take the same power."""
    words = f"ours less baseline: {_mw(equal.difference)} mW"
    if equal.ci_low is not None and equal.ci_high is not None:
        words += f" (95 % interval {_mw(equal.ci_low)} to {_mw(equal.ci_high)} mW)"
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
