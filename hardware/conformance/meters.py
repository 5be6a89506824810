"""Promises of meters: they tell the light and the power of the moment that they say, each value anew."""

from __future__ import annotations

import random
import statistics
from itertools import pairwise

import numpy as np

from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.conformance.subject import GREY, Bench, promised
from evenlight.hardware.protocols import Fault, InstrumentError, Reading

SHARES = (1.0, 0.3, 0.6, 0.001, 1.0, 0.1, 0.3, 0.0, 0.6, 0.005, 0.001)  # of the light: most are seen twice
SAME, DARK = 0.03, 0.02  # within which readings of the same grey lie: share, and [cd/m^2]
LEVELS, HOLD = (0.2, 1.0), (0.3, 0.7)  # shares of the power, and how long each lasts [s]: 6 samples at least
DITHER = 0.1  # share by which it changes all the while, so that no two samples are equal
RATE = 20.0  # [Hz]
LASTS, LONGEST = 8.0, 50.0  # [s] of sampling, 60 samples at least; a simulated panel remembers 60 s
AT_ONCE = 0.5  # [s] in which `samples` returns
SLACK, UNDER_WAY = 0.05, 1.0  # [s] that a clock may be off, and that a sample may be under way
UNEVEN, REPEATED = 0.04, 0.1  # shares of samples: far more than chance, less than one in ten
ALIKE = 0.9  # correlation of samples with the power, at the best lag


def luminance_is_timed(bench: Bench) -> None:
    """Read luminances that can be, with unit and times."""
    first, second = _reading(bench), _reading(bench)
    promised(second.begun >= first.ended, "a reading begins before the one before it has ended")


def luminance_follows(bench: Bench) -> None:
    """Read each luminance as it is then, dark ones too, or say that it is out of range."""
    assert bench.panel is not None
    seen: dict[float, float] = {}
    for share in SHARES:
        bench.panel.show(share**GREY)
        try:
            value = _reading(bench).value
        except InstrumentError as error:
            promised(error.fault in (Fault.UNDER_RANGE, Fault.OVER_RANGE), str(error))
            continue
        bench.require_near(value, bench.panel.luminance(), "cd/m^2")
        before = seen.setdefault(share, value)
        same = abs(value - before) <= SAME * before + DARK
        promised(same, f"gave {before:.5g} and {value:.5g} cd/m^2 for the same grey: not of the light now")
    for (less, low), (more, high) in pairwise(sorted(seen.items())):
        promised(low < high, f"gave {low:.5g} and {high:.5g} cd/m^2 for {less:g} and {more:g} of the light")
    promised(len(seen) > 1, "has no value for any luminance")


def _reading(bench: Bench) -> Reading:
    """Return a reading whose times lie between question and answer."""
    asked = bench.clock()
    reading: Reading = bench.checked.read_luminance()
    took, begun, ended = bench.clock() - asked, reading.begun - asked, reading.ended - asked
    words = f"says that it read from {begun:.4g} to {ended:.4g} s after it was asked, and took {took:.3g} s"
    promised(-SLACK <= begun <= ended <= took + SLACK, words)
    return reading


class Sampled:
    """Samples of a power meter over some seconds, in which the power changes all the while, or does not."""

    def __init__(self, bench: Bench, *, changing: bool) -> None:
        meter, draw = bench.checked, random.Random(5)
        self.rate, self.begun = meter.start(RATE), bench.clock()
        self.samples: list[PowerSample] = []
        self.looks = [self.begun]  # when it had been asked for samples [s]
        first, base, until = meter.ping(), 1.0, self.begun
        end = self.begun + min(max(LASTS, 60 / self.rate), LONGEST)
        while bench.clock() < end:
            if changing and bench.clock() >= until:
                base, until = draw.uniform(*LEVELS), bench.clock() + max(6 / self.rate, draw.uniform(*HOLD))
            if changing and bench.panel:
                bench.panel.set_backlight(base * draw.uniform(1 - DITHER, 1))
            bench.wait(min(0.01, 0.2 / self.rate))
            asked = bench.clock()
            self.samples += meter.samples()
            self.looks.append(bench.clock())
            promised(self.looks[-1] - asked < AT_ONCE, "samples() waits: return what came, at once")
        last = meter.ping()
        meter.stop()
        said = f"{len(self.samples)} samples in {end - self.begun:.3g} s at {self.rate:g} Hz"
        promised(len(self.samples) > 0.2 * LASTS * RATE * min(1.0, self.rate / RATE), said)
        self.times = np.array([one.device_time for one in self.samples])  # on the computer's clock [s]
        if first is not None:
            ours = [(one.sent + one.received) / 2 for one in (first, last)]
            pace = (ours[1] - ours[0]) / (last.device_time - first.device_time)
            self.times = ours[0] + (self.times - first.device_time) * pace

    def evenly_asked(self, begun: float, ended: float) -> bool:
        """Return whether the computer was never too late to ask between two times [s]."""
        late = [(one, two) for one, two in pairwise(self.looks) if two - one > 0.5 / self.rate]
        return not any(one < ended and two > begun for one, two in late)


def power_keeps_time(bench: Bench) -> None:
    """Sample at the rate that it states, by its clock, wait for none, and count what is lost."""
    run, pairs = Sampled(bench, changing=False), []
    late = max(np.diff(run.looks)) + 2 / run.rate + UNDER_WAY
    for at, sample in zip(run.times, run.samples, strict=True):
        came = sample.received
        within = came - late <= at <= came + SLACK and run.begun - SLACK <= came <= run.looks[-1] + SLACK
        times = f"{came - run.begun:.4g} s after the start that it is of {at - run.begun:.4g} s"
        promised(within, f"says of a sample that came {times}")
    for (begun, one), (ended, two) in pairwise(zip(run.times, run.samples, strict=True)):
        if two.sequence > one.sequence and run.evenly_asked(begun, two.received):
            pairs.append((ended - begun, two.sequence - one.sequence))
    if not pairs:
        return  # the computer was too busy to tell
    usual = 1 / statistics.median(distance / steps for distance, steps in pairs)
    promised(abs(usual / run.rate - 1) < 0.1, f"states {run.rate:g} samples a second, and has {usual:.3g}")
    uneven = statistics.fmean(abs(distance * run.rate - steps) > 0.6 for distance, steps in pairs)
    promised(uneven < UNEVEN, f"{uneven:.0%} of its samples come after a gap that their count does not have")


def power_follows(bench: Bench) -> None:
    """Sample the power of the moment that it says, each sample anew."""
    assert bench.panel is not None
    run = Sampled(bench, changing=True)
    look, powers = np.vectorize(bench.panel.power, otypes=[float]), np.array([s.power for s in run.samples])
    true, period = look(run.times), 1 / run.rate
    other = np.abs(np.diff(true)) > 0.05 * np.ptp(true)
    repeated = np.mean(np.diff(powers)[other] == 0) if other.any() else 0.0
    promised(repeated < REPEATED, f"{repeated:.0%} of its samples repeat the one before, of another power")
    lags = np.arange(0.0, 2.01, 0.025) * max(1.0, RATE * period)
    inside = run.times - lags[-1] > run.begun
    powers, times = powers[inside], run.times[inside]
    found = []  # how alike samples are to the power some time before: of a moment, or of a whole period
    for lag in lags:
        steps = (np.arange(6) + 0.5) / 6 * period
        for mean in (look(times - lag), np.mean([look(times - lag - step) for step in steps], 0)):
            alike = np.corrcoef(mean, powers)[0, 1] if np.ptp(mean) and np.ptp(powers) else 0.0
            found.append((alike, lag, mean))
    alike, lag, mean = max(found, key=lambda one: one[0])
    promised(alike > ALIKE, f"does not follow the power: a correlation of {alike:.2f} at best")
    promised(lag <= period + SLACK, f"its samples are of the power {lag:.2f} s before the time that they say")
    bench.require_near(float(np.median(powers)), float(np.median(mean)), "W")
