"""A meter's clock from the edges of its synchronisation input, which changes with every frame shown."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.played_power.clock_line import ClockLine, ClockWindows, fit_of, line_of
from evenlight.analysis.played_power.power_recording import Samples
from evenlight.data_schema.arrays import Array, Mask
from evenlight.data_schema.recordings.played_power import ClockFit, ClockFlag, ClockMethod

BLIND_REACH = 0.5  # [s] how far from the seed edges are looked for
FEWEST_EDGES = 3
SMALLEST_SHARE = 0.5  # of edges or of changes that must fit each other
CLEARLY_BETTER = 0.02  # share of the edges by which an alignment must be better to overrule the seed
NEAR_TIE = 2  # a single edge more or less decides between two alignments: too little
LATE_FLIP = 0.001  # [s] how far a flip's own time may be off
VAGUE_SLOPE = 5e-4  # standard error of a drift that says nothing
FEW_ODD = 0.1  # share of the edges that may be left out as odd
LONG_RUN = 0.05  # share of the changes that may be missing in a row, and
SHORT_RUN = 10  # so many in any case


class _Edges(NamedTuple):
    """Changes of level in the samples: each lies between two samples, on the meter's clock [s]."""

    early: Array
    late: Array
    level: Mask

    @property
    def middle(self) -> Array:
        return (self.early + self.late) / 2

    @property
    def width(self) -> Array:
        return self.late - self.early


class SyncEdges(NamedTuple):
    """Changes of the synchronisation line with the frames, on the computer's clock."""

    time: Array  # (N,) [s]
    level: Mask  # (N,): from then on

    @property
    def step(self) -> float:
        """The shortest time from one to the next [s]."""
        return float(np.diff(self.time).min())


class _Alignment(NamedTuple):
    """How edges may lie on changes: shifted, upright or inverted, near the seed or not."""

    shift: float
    inverted: bool
    score: int
    near: bool

    @property
    def quality(self) -> tuple[int, float]:
        return self.score, -abs(self.shift)


def fit_edges(samples: Samples, changes: SyncEdges, seed: ClockFit) -> ClockFit | ClockFlag:
    """Return the meter's clock by edges of its synchronisation input, or why they are of no use.

    An edge was between the sample that has the new level and the sample before. Which edge is which change is
    found first: of all shifts and both polarities, the one is taken under which most edges have a change and
    most changes an edge; the seed decides where several are about as good. Then a line is laid that goes
    between the two samples of each edge, in the middle of all lines that do; an edge that is far from where
    its change should be is left out. Where there is none, as flips have errors of their own, it is the
    weighted line through the middles.

    Parameters
    ----------
    samples, changes : Samples, SyncEdges
        Each sample once, and the changes of the synchronisation line.
    seed : ClockFit
        The clock by pings, markers or arrivals.
    """
    at = np.flatnonzero(samples.sync[1:] != samples.sync[:-1])
    edges = _Edges(samples.device_time[at], samples.device_time[at + 1], samples.sync[at + 1])
    if min(len(edges.level), len(changes.time)) < FEWEST_EDGES:
        return ClockFlag.NO_EDGES
    if samples.interval > 0.9 * changes.step:
        return ClockFlag.SAMPLED_TOO_SLOWLY
    clear = edges.width < 0.95 * changes.step  # between wider ones, two changes may hide
    edges = _Edges(edges.early[clear], edges.late[clear], edges.level[clear])
    if len(edges.level) < FEWEST_EDGES:
        return ClockFlag.EDGES_UNUSABLE
    found = list(_alignments(edges, changes, seed))
    if not found:
        return ClockFlag.EDGES_UNUSABLE
    best, is_ambiguous, disagrees = _best(found, len(edges.level))
    line = replace(line_of(seed), offset=seed.offset - best.shift)
    refined = _refined(edges, changes, line, best.inverted)
    if refined is None:
        return ClockFlag.EDGES_UNUSABLE
    line, matched, certain = refined
    fewest = max(FEWEST_EDGES, SMALLEST_SHARE * min(len(matched), len(changes.time)))
    if (matched >= 0).sum() < fewest:
        return ClockFlag.EDGES_UNUSABLE
    used, line, bound = _through_windows(edges, changes, matched, line)
    flags = {
        ClockFlag.INVERTED: best.inverted,
        ClockFlag.AMBIGUOUS: is_ambiguous,
        ClockFlag.DISAGREES: disagrees,
        ClockFlag.OFFSET_ONLY: not certain,
        ClockFlag.EDGES_MISSING: _longest_run(samples, changes, line, matched)
        > max(SHORT_RUN, LONG_RUN * len(changes.time)),
    }
    residuals = edges.middle[used] - line.to_meter(changes.time[matched[used]])
    return fit_of(
        line,
        ClockMethod.EDGES,
        int(used.sum()),
        residual_sd=float(residuals.std()),
        bound=bound,
        n_rejected=int((~clear).sum() + (~used).sum()),
        flags=tuple(flag for flag, is_so in flags.items() if is_so),
    )


def _alignments(edges: _Edges, changes: SyncEdges, seed: ClockFit) -> Iterator[_Alignment]:
    """Yield the alignments that many edges speak for, at least half a frame apart."""
    width = float(np.median(edges.width))
    near = BLIND_REACH if seed.bound is None else seed.bound + width / 2 + LATE_FLIP
    times = line_of(seed).to_computer(edges.middle)
    first, end = np.searchsorted(changes.time, [times[0] - BLIND_REACH, times[-1] + BLIND_REACH])
    for inverted in (False, True):
        for shift in _frequent_shifts(times, edges.level ^ inverted, changes, width):
            matched = _matched(times - shift, edges.level ^ inverted, changes, 0.45 * changes.step)
            score = 2 * int((matched >= 0).sum()) - len(times) - int(end - first)
            if (matched >= 0).any():
                yield _Alignment(shift, inverted, score, abs(shift) <= near)


def _best(found: Sequence[_Alignment], n_edges: int) -> tuple[_Alignment, bool, bool]:
    """Return the alignment to be believed, whether another is as good, and whether the seed contradicts it.

    The seed decides between alignments that fit about as well; one that fits far better overrules it.
    """
    top = max(found, key=lambda one: one.quality)
    good = [one for one in found if top.score - one.score <= max(NEAR_TIE, CLEARLY_BETTER * n_edges)]
    allowed = [one for one in good if one.near]
    best = max(allowed or [top], key=lambda one: one.quality)
    rivals = [one for one in (allowed or found) if one is not best and best.score - one.score <= NEAR_TIE]
    return best, bool(rivals), not allowed


def _frequent_shifts(times: Array, level: Mask, changes: SyncEdges, width: float) -> list[float]:
    """Return the shifts that many edges have against a change of their level, the most frequent first."""
    shifts = []
    for rising in (False, True):
        own, others = times[level == rising], changes.time[changes.level == rising]
        first, end = (np.searchsorted(others, own + reach) for reach in (-BLIND_REACH, BLIND_REACH))
        counts = end - first
        places = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
        shifts.append(np.repeat(own, counts) - others[np.repeat(first, counts) + places])
    every = np.sort(np.concatenate(shifts))
    if len(every) == 0:
        return []
    within = max(width, LATE_FLIP)
    number = np.searchsorted(every, every + within, side="right") - np.arange(len(every))
    left, found = np.ones(len(every), dtype=bool), []
    while (number[left] > SMALLEST_SHARE * number.max()).any():
        top = int(np.argmax(np.where(left, number, 0)))
        found.append(float(np.median(every[top : top + number[top]])))
        left &= np.abs(every - found[-1]) > changes.step / 2
    return found


def _matched(times: Array, level: Mask, changes: SyncEdges, tolerance: Array | float) -> NDArray[np.int64]:
    """Return the change that belongs to each edge, -1 where there is none: the nearest one of its level."""
    matched = np.full(len(times), -1)
    for rising in (False, True):
        own, others = np.flatnonzero(level == rising), np.flatnonzero(changes.level == rising)
        if len(others) == 0:
            continue
        after = np.clip(np.searchsorted(changes.time[others], times[own]), 0, len(others) - 1)
        before = np.maximum(after - 1, 0)
        distances = [np.abs(times[own] - changes.time[others[k]]) for k in (before, after)]
        nearest = np.where(distances[0] <= distances[1], others[before], others[after])
        near = np.minimum(*distances) <= np.broadcast_to(tolerance, len(times))[own]
        matched[own[near]] = nearest[near]
    return matched


def _refined(
    edges: _Edges, changes: SyncEdges, line: ClockLine, inverted: bool
) -> tuple[ClockLine, NDArray[np.int64], bool] | None:
    """Return the line through the edges, their changes, and whether it knows the drift; None if it fails."""
    tolerance: Array | float = 0.45 * changes.step
    for _ in range(4):
        matched = _matched(line.to_computer(edges.middle), edges.level ^ inverted, changes, tolerance)
        used = matched >= 0
        if used.sum() < FEWEST_EDGES:
            return None
        line, certain = _line_through(
            changes.time[matched[used]], edges.middle[used], edges.width[used], line.drift
        )
        tolerance = np.minimum(edges.width / 2 + LATE_FLIP, 0.45 * changes.step)
    return line, matched, certain


def _line_through(computer: Array, device: Array, widths: Array, drift: float) -> tuple[ClockLine, bool]:
    """Return the weighted line through times of two clocks, and whether it knows the drift; else as given."""
    weights = widths**-2
    means = [float(np.average(times, weights=weights)) for times in (computer, device)]
    since, told = computer - means[0], device - means[1]
    spread = float((weights * since**2).sum())
    certain = spread > 0 and (12 * spread) ** -0.5 < VAGUE_SLOPE  # an edge's variance is width² / 12
    if certain:
        drift = spread / float((weights * since * told).sum()) - 1
    return ClockLine(means[1], means[0] - means[1], drift), certain


def _through_windows(
    edges: _Edges, changes: SyncEdges, matched: NDArray[np.int64], line: ClockLine
) -> tuple[Mask, ClockLine, float]:
    """Return which edges are used, the line between the samples of all of them, and its bound [s].

    The line through the middles is returned where there is no other; half a sample is then its bound.
    """
    used = matched >= 0
    half = float(np.median(edges.width[used]) / 2)
    expected = line.to_meter(changes.time[matched])
    # That line is off by a third of half a sample where flips and samples keep step, and by its drift.
    near = used & (np.abs(edges.middle - expected) < edges.width / 2 + half / 2)
    times = changes.time[matched[near]]
    windows = ClockWindows(times, edges.early[near], edges.late[near])
    if windows.middle()[1] < 0 or near.sum() < (1 - FEW_ODD) * used.sum():
        return used, line, half
    stretch = (float(changes.time[0]), float(changes.time[-1]))
    centre = windows.centre(stretch)
    # The centre goes from the computer's clock to the meter's.
    inverse = ClockLine(centre.reference + centre.offset, -centre.offset, 1 / (1 + centre.drift) - 1)
    return near, inverse, windows.bound(centre, stretch)


def _longest_run(samples: Samples, changes: SyncEdges, line: ClockLine, matched: NDArray[np.int64]) -> int:
    """Return how many changes in a row, while samples were taken, have no edge."""
    first, last = line.to_computer(samples.device_time[[0, -1]])
    expected = np.flatnonzero((changes.time > first) & (changes.time < last))
    found = np.isin(expected, matched)
    ends = np.flatnonzero(np.concatenate([[True], found, [True]]))
    return int(np.diff(ends).max() - 1)
