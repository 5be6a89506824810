"""Whether a video ten times as long takes more memory: by default, on two cores, and with luma first."""

from __future__ import annotations

from dataclasses import dataclass

from benchmarks.curves_memory import curves_size
from benchmarks.measured import RunSettings, claim, not_measured
from benchmarks.peak_memory import peak_memory
from benchmarks.records import BenchmarkClaim
from evenlight.data_schema.contrast_model import PixelToLuminance

MEMORY = "benchmarks.curves_memory:analyze_minutes"
SAME_MEMORY = 1.05  # two runs of the same differ by as much


@dataclass(frozen=True, slots=True)
class _Way:
    """One way to analyse a video, and how long the shorter one is [min]."""

    name: str
    jobs: int
    order: PixelToLuminance
    short: float


_WAYS = (
    _Way("default", 1, PixelToLuminance.LINEAR_FIRST, 1.0),
    _Way("2 jobs", 2, PixelToLuminance.LINEAR_FIRST, 1.0),
    _Way("luma first", 1, PixelToLuminance.LUMA_FIRST, 0.2),  # five times as slow
)


def memory_claims(settings: RunSettings) -> list[BenchmarkClaim]:
    """Return the targets of memory: a video ten times as long takes no more, whatever the way."""
    claims = []
    for way in _WAYS:
        settings.say(f"memory of long videos, {way.name}")
        if settings.quick and way.order is PixelToLuminance.LUMA_FIRST:
            claims.append(
                not_measured(_words(way, way.short), SAME_MEMORY, "", "a quick run leaves this out")
            )
        else:
            claims.append(_memory_claim(way, 0.1 if settings.quick else way.short))
    return claims


def _words(way: _Way, short: float) -> str:
    """Return the target of memory of one way, in words."""
    minutes = f"{10 * short:g} min over that of {short:g} min"
    return f"memory of a video of {minutes}, {way.name}, apart from the curves"


def _memory_claim(way: _Way, short: float) -> BenchmarkClaim:
    """Return the target of memory of one way."""
    words, long = _words(way, short), 10 * short
    least, most = (
        peak_memory(MEMORY, str(minutes), str(way.jobs), way.order.value) for minutes in (short, long)
    )
    if least is None or most is None:
        return not_measured(words, SAME_MEMORY, "", "the system does not tell how much memory a process used")
    of_curves = curves_size(long, way.order)
    left = most - of_curves, least - of_curves * short / long
    note = (
        f"{least:.1f} and {most:.1f} MiB; curves take {of_curves:.1f}, those at knots twice; what is left "
        f"differs by {left[0] - left[1]:.1f} MiB; frames of 384 x 270, made one by one"
    )
    return claim(words, SAME_MEMORY, left[0] / left[1], "", note)
