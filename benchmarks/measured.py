"""What the measurement of one subject gives, in the one shape in which every subject hands it on."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np
from scipy import stats

from benchmarks.records import BenchmarkClaim, BenchmarkGrowth, BenchmarkPoint, Role
from benchmarks.stopwatch import Times
from evenlight.data_schema.arrays import Array

# Of three sizes one degree of freedom is left: an interval of 13 standard errors to each side says nothing.
LEAST_SIZES = 4


@dataclass(frozen=True, slots=True)
class RunSettings:
    """How a benchmark runs.

    Attributes
    ----------
    quick : bool
        Small sizes and one run of each: to see that it works, and roughly how fast.
    seed : int
        Of everything that is drawn.
    say : function
        Called with what is being measured.
    """

    quick: bool = False
    seed: int = 1
    say: Callable[[str], None] = field(default=lambda _: None)

    def repeats(self, many: int) -> int:
        """Return how many timed runs to take, of `many` in a full benchmark."""
        return 1 if self.quick else many


@dataclass(frozen=True, slots=True)
class Chart:
    """A figure of a benchmark: the points of some tasks, time over error or time over size.

    Attributes
    ----------
    name : str
        Stem of its files.
    title : str
        What it shows, with the task.
    tasks : tuple of str
        Tasks whose points it shows.
    over_size : bool
        Time over size, with lines by approach; otherwise time over error.
    """

    name: str
    title: str
    tasks: tuple[str, ...]
    over_size: bool = False


@dataclass(frozen=True, slots=True)
class SubjectResults:
    """What the measurement of one subject gives.

    Attributes
    ----------
    name, title : str
        "curves", "optimizer", "fit", "online", "apply" or "scale"; and in words.
    lead : str
        What came out, in a sentence or two, from the numbers.
    points : tuple of BenchmarkPoint
        Time against error.
    charts : tuple of Chart
        Its figures.
    claims : tuple of BenchmarkClaim
        Targets, and what was measured.
    growth : tuple of BenchmarkGrowth
        How time grows with size.
    notes : tuple of str
        What a reader should know: how it was measured, what is missed and why.
    refused : dict of str to str
        What could not be measured here, and why.
    """

    name: str
    title: str
    lead: str
    points: tuple[BenchmarkPoint, ...]
    charts: tuple[Chart, ...]
    claims: tuple[BenchmarkClaim, ...] = ()
    growth: tuple[BenchmarkGrowth, ...] = ()
    notes: tuple[str, ...] = ()
    refused: dict[str, str] = field(default_factory=dict)


class Subject(Protocol):
    """Something whose speed and error can be measured."""

    def __call__(self, settings: RunSettings) -> SubjectResults:
        """Return what was measured."""


@dataclass(frozen=True, slots=True)
class Approach:
    """What a point says of itself beside its times: the fields of `BenchmarkPoint` with these names."""

    task: str
    approach: str
    role: Role
    size: int
    size_of: str


def point(
    approach: Approach,
    times: Times,
    error: float | None = None,
    error_of: str = "",
    note: str = "",
) -> BenchmarkPoint:
    """Return the point of an approach from its times; `dataclasses.replace` adds its memory."""
    low, middle, high = times.quartiles
    return BenchmarkPoint(
        task=approach.task,
        approach=approach.approach,
        role=approach.role,
        size=approach.size,
        size_of=approach.size_of,
        repeats=len(times.wall),
        time=middle,
        time_low=low,
        time_high=high,
        processor_time=float(np.median(times.processor)),
        ratio=float(np.median(times.ratio)),
        error=error,
        error_of=error_of,
        note=note,
    )


def claim(words: str, target: float, measured: float, unit: str, note: str = "") -> BenchmarkClaim:
    """Return a target and whether what was measured meets it: at most the target."""
    return BenchmarkClaim(words, target, measured, unit, measured <= target, note)


def not_measured(words: str, target: float, unit: str, why: str) -> BenchmarkClaim:
    """Return a target that nothing can be said of here, and why."""
    return BenchmarkClaim(words, target, None, unit, None, why)


def growth(points: tuple[BenchmarkPoint, ...], task: str = "") -> BenchmarkGrowth:
    """Return how time grows over points of one approach at several sizes: least squares of the logarithms.

    Parameters
    ----------
    points : tuple of BenchmarkPoint
        Of two sizes or more.
    task : str
        What all of them are points of, where their tasks name their sizes; else the task of the first.

    >>> made = [Approach("t", "ours", Role.DEFAULT, n, "frames") for n in (10, 100, 1000)]
    >>> times = [Times(np.array([n.size / 1e4]), np.zeros(1), np.ones(1)) for n in made]
    >>> round(growth(tuple(map(point, made, times))).exponent, 6)
    1.0
    """
    sizes = [p.size for p in points]
    exponent, half_width = _slope(np.log(np.array(sizes)), np.log(np.array([p.time for p in points])))
    return BenchmarkGrowth(
        task=task or points[0].task,
        approach=points[0].approach,
        size_of=points[0].size_of,
        smallest=min(sizes),
        largest=max(sizes),
        sizes=len(sizes),
        exponent=exponent,
        exponent_low=None if half_width is None else exponent - half_width,
        exponent_high=None if half_width is None else exponent + half_width,
    )


def _slope(x: Array, y: Array) -> tuple[float, float | None]:
    """Return a least-squares slope, and half of its 95 % confidence interval if there are enough points."""
    line = stats.linregress(x, y)
    n = len(x)
    if n < LEAST_SIZES:
        return float(line.slope), None
    return float(line.slope), float(stats.t.ppf(0.975, n - 2) * line.stderr)
