"""Average power over some seconds: weighted by time, with lost and duplicated samples counted."""

from __future__ import annotations

import contextlib
import itertools
import statistics
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from data_schema.errors import InputError
from data_schema.power_log import PowerSample
from hardware.protocols import Fault, InstrumentError, PowerMeter

POLL = 0.05  # [s] between two looks at the meter, or the time between two samples if that is shorter,
SHORTEST_POLL = 0.001  # [s] but no shorter than this
FEWEST = 2  # samples: an average has a spread
MOST_LOST = 0.5  # share: what is left of fewer says too little of the whole


@dataclass(frozen=True, slots=True)
class PowerAverage:
    """The mean power of a panel over some seconds.

    Attributes
    ----------
    power : float
        Time-weighted mean [W].
    power_sd : float
        Standard deviation of the samples [W].
    duration : float
        From the first to the last sample, on the meter's clock [s].
    n_samples, n_lost, n_duplicated : int
        Samples that came, did not come, came more than once, by the meter's own count.
    begun, ended : float
        Right before the meter was started, and right after it was stopped, on the computer's clock [s].
    status : str
        What was wrong with it, in words; empty where nothing was.
    """

    power: float
    power_sd: float
    duration: float
    n_samples: int
    n_lost: int
    n_duplicated: int
    begun: float
    ended: float
    status: str = ""


def average_power(
    meter: PowerMeter,
    seconds: float,
    sample_rate: float,
    clock: Callable[[], float],
    wait: Callable[[float], None],
) -> PowerAverage:
    """Return the average power over some seconds; starts and stops the meter.

    Parameters
    ----------
    meter : PowerMeter
        Open, and not sampling.
    seconds : float
        How long [s].
    sample_rate : float
        At which the meter is asked to sample [Hz].
    clock : callable
        The computer's clock [s].
    wait : callable
        Waits for some time [s].

    Raises
    ------
    InputError
        If the time holds fewer than two samples.
    InstrumentError
        If the meter fails, or loses more than half of the samples; it is stopped then.
    """
    begun = clock()
    rate = meter.start(sample_rate)
    try:
        if seconds * rate < FEWEST:
            raise InputError(
                f"power must be averaged over at least {FEWEST} samples: {FEWEST / rate:g} s at {rate:g} Hz, "
                f"got {seconds:g} s"
            )
        poll = max(min(POLL, 1 / rate), SHORTEST_POLL)
        samples = _collect(meter, clock() + seconds, poll, clock, wait)
        samples += meter.stop()
    except BaseException:
        with contextlib.suppress(InstrumentError):  # the first fault is the one to tell
            meter.stop()
        raise
    return averaged(samples, begun, clock())


def averaged(samples: Sequence[PowerSample], begun: float, ended: float) -> PowerAverage:
    """Return the time-weighted average of samples, each counted once.

    A sample is the mean since the one before. Where samples between the two were lost, the time that they
    belong to takes the mean of its neighbours.

    Raises
    ------
    InstrumentError
        If there are fewer than two, or more than half are lost.

    >>> rows = [PowerSample(0, 0.0, 0.0, 9.0), PowerSample(1, 1.0, 1.0, 1.0), PowerSample(2, 2.0, 2.0, 3.0)]
    >>> averaged(rows, 0.0, 2.0).power  # the first belongs to the time before 0 s
    2.0
    """
    once = sorted({sample.sequence: sample for sample in samples}.values(), key=lambda row: row.sequence)
    if len(once) < FEWEST:
        raise InstrumentError(
            f"the power meter sent {len(once)} samples, and an average needs {FEWEST}", Fault.NO_REPLY
        )
    expected = once[-1].sequence - once[0].sequence + 1
    lost, duplicated = expected - len(once), len(samples) - len(once)
    if lost > MOST_LOST * expected:
        raise InstrumentError(
            f"the power meter lost {lost} of {expected} samples; is the line too slow, or disturbed?",
            Fault.GARBLED,
        )
    return PowerAverage(
        power=_time_weighted(once),
        power_sd=statistics.stdev(sample.power for sample in once),
        duration=once[-1].device_time - once[0].device_time,
        n_samples=len(once),
        n_lost=lost,
        n_duplicated=duplicated,
        begun=begun,
        ended=ended,
        status=_in_words(lost, duplicated),
    )


def _collect(
    meter: PowerMeter, end: float, poll: float, clock: Callable[[], float], wait: Callable[[float], None]
) -> list[PowerSample]:
    """Return the samples that come until a time, with some time between two looks [s]."""
    samples: list[PowerSample] = []
    while (left := end - clock()) > 0:
        wait(min(poll, left))
        samples += meter.samples()
    return samples


def _time_weighted(samples: list[PowerSample]) -> float:
    """Return the mean of samples over the time from the first to the last [W]."""
    energy, time = 0.0, 0.0
    for before, after in itertools.pairwise(samples):
        step = after.device_time - before.device_time
        if step <= 0:
            raise InstrumentError(
                f"the power meter's clock went from {before.device_time:g} to {after.device_time:g} s "
                f"between its samples {before.sequence} and {after.sequence}",
                Fault.GARBLED,
            )
        own = step / (after.sequence - before.sequence)  # the part that the later sample is the mean of
        energy += after.power * own + (before.power + after.power) / 2 * (step - own)
        time += step
    return energy / time


def _in_words(lost: int, duplicated: int) -> str:
    """Return what was wrong with the samples.

    >>> _in_words(2, 0)
    '2 lost'
    """
    found = ((lost, "lost"), (duplicated, "came twice"))
    return ", ".join(f"{count} {what}" for count, what in found if count)
