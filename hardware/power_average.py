"""Average power over some seconds: weighted by time, with lost and duplicated samples counted."""

from __future__ import annotations

import contextlib
import itertools
import statistics
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.instrument_logs import PowerSample
from evenlight.hardware.protocols import Fault, InstrumentError, PowerMeter

POLL = 0.05  # [s] between two looks at the meter, or the time between two samples if that is shorter,
SHORTEST_POLL = 0.001  # [s] but no shorter than this
FEWEST = 2  # samples: an average has a spread
MOST_LOST = 0.5  # share: what is left of fewer says too little of the whole
LARGEST_DRIFT = 0.01  # of a meter's clock: microcontrollers without a quartz are off by as much
LOOSE_ENDS = 2.0  # samples that may be missing at the ends since start and stop fall between two


@dataclass(frozen=True, slots=True)
class PowerAverage:
    """The mean power of a panel over some seconds."""

    power: float  # time-weighted mean [W]
    power_sd: float  # standard deviation of the samples [W]
    duration: float  # from the first to the last sample, on the meter's clock [s]
    # samples that came, did not come, came more than once: by the meter's own count between those that came,
    # and by the time asked for before the first and after the last
    n_samples: int
    n_lost: int
    n_duplicated: int
    # right before the meter was started, and right after it was stopped, on the computer's clock [s]
    begun: float
    ended: float
    status: str = ""  # what was wrong with it, in words; empty where nothing was


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
    samples: list[PowerSample] = []
    try:
        if seconds * rate < FEWEST:
            raise InputError(
                f"power must be averaged over at least {FEWEST} samples: {FEWEST / rate:g} s at {rate:g} Hz, "
                f"got {seconds:g} s"
            )
        for batch in sampled(meter, seconds, rate, clock, wait):
            samples += batch
    except BaseException:
        with contextlib.suppress(InstrumentError):  # the first fault is the one to report
            meter.stop()
        raise
    return averaged(samples, begun=begun, ended=clock(), seconds=seconds, sample_rate=rate)


def sampled(
    meter: PowerMeter,
    seconds: float,
    sample_rate: float,
    clock: Callable[[], float],
    wait: Callable[[float], None],
) -> Iterator[Sequence[PowerSample]]:
    """Yield what comes within some seconds [s] from a meter that was started, at its rate [Hz]; stop it."""
    end, poll = clock() + seconds, max(min(POLL, 1 / sample_rate), SHORTEST_POLL)
    while (left := end - clock()) > 0:
        wait(min(poll, left))
        yield meter.samples()
    yield meter.stop()


def averaged(
    samples: Sequence[PowerSample], *, begun: float, ended: float, seconds: float, sample_rate: float
) -> PowerAverage:
    """Return the time-weighted average of samples, each counted once.

    A sample is the mean since the one before. Where samples between the two were lost, the time that they
    belong to takes the mean of its neighbours.

    Parameters
    ----------
    samples : sequence of PowerSample
        All that came since the meter was started.
    begun, ended : float
        Right before the meter was started, and right after it was stopped, on the computer's clock [s].
    seconds : float
        For how long it was to sample [s].
    sample_rate : float
        At which it said that it does [Hz].

    Raises
    ------
    InstrumentError
        If there are fewer than two, or more than half are lost.

    >>> rows = [PowerSample(0, 0.0, 0.0, 9.0), PowerSample(1, 1.0, 1.0, 1.0), PowerSample(2, 2.0, 2.0, 3.0)]
    >>> average = averaged(rows, begun=0.0, ended=3.0, seconds=3.0, sample_rate=1.0)
    >>> average.power  # the first belongs to the time before 0 s
    2.0
    """
    once = sorted({sample.sequence: sample for sample in samples}.values(), key=lambda row: row.sequence)
    if len(once) < FEWEST:
        raise InstrumentError(
            f"the power meter sent {len(once)} samples, and an average needs {FEWEST}", Fault.NO_REPLY
        )
    power = _time_weighted(once)
    at_ends = _lost_at_the_ends(once, seconds, 1 / sample_rate)
    lost = once[-1].sequence - once[0].sequence + 1 - len(once) + at_ends
    _require_enough(len(once), lost, at_ends)
    duplicated = len(samples) - len(once)
    return PowerAverage(
        power=power,
        power_sd=statistics.stdev(sample.power for sample in once),
        duration=once[-1].device_time - once[0].device_time,
        n_samples=len(once),
        n_lost=lost,
        n_duplicated=duplicated,
        begun=begun,
        ended=ended,
        status=_in_words(lost, duplicated, at_ends),
    )


def _lost_at_the_ends(once: list[PowerSample], seconds: float, period: float) -> int:
    """Return how many samples did not come before the first and after the last that did.

    Meters count from 0. What is missing besides is missing time: that is all there is to go by after the
    last sample, and before the first of a meter that is asked for each. Its samples may be further apart
    than it said, which is no loss; so the time is divided by the distance that they had.
    """
    first, last = once[0], once[-1]
    spacing = max(period, (last.device_time - first.device_time) / (last.sequence - first.sequence))
    covered = last.device_time - first.device_time + (first.sequence + 1) * spacing
    missing = (seconds - covered) / spacing
    is_loss = missing > LOOSE_ENDS + LARGEST_DRIFT * seconds / spacing
    return first.sequence + (int(missing) if is_loss else 0)


def _require_enough(came: int, lost: int, at_ends: int) -> None:
    if lost <= MOST_LOST * (came + lost):
        return
    if at_ends > lost / 2:
        raise InstrumentError(
            f"the power meter lost {lost} of {came + lost} samples, {at_ends} of them at the beginning or "
            "the end: it fell silent; is it still plugged in?",
            Fault.NO_REPLY,
        )
    raise InstrumentError(
        f"the power meter lost {lost} of {came + lost} samples; is the line too slow, or disturbed?",
        Fault.GARBLED,
    )


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


def _in_words(lost: int, duplicated: int, at_ends: int) -> str:
    """Return what was wrong with the samples.

    >>> _in_words(2, 0, 0), _in_words(40, 1, 38)
    ('2 lost', '40 lost (38 at the ends), 1 came twice')
    """
    ends = f" ({at_ends} at the ends)" if at_ends else ""
    found = ((lost, f"lost{ends}"), (duplicated, "came twice"))
    return ", ".join(f"{count} {what}" for count, what in found if count)
