"""The trials of a search as arrays: who looked where, at which brightness, how long, and on which side."""

from __future__ import annotations

import enum
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.session_loading import TaskData
from evenlight.data_schema.arrays import Array, Integers, Mask
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.search import SearchTrial
from evenlight.data_schema.recordings.viewing import Version

SHORTEST_TIME = 0.1  # [s] nobody sees and presses faster (choice); 0 s would have no logarithm
SAME_FACTOR = 1e-6  # of ln(factor): closer factors are one factor that was rounded in a file
ABOUT_EQUAL = 0.05  # factors that differ by at most so much are about equal (choice): neither gain nor loss


class BrightnessEffect(enum.Enum):
    """What the modulation does to the brightness of a location, against constant dimming."""

    BRIGHTENED = "brightened"
    ALIKE = "about equal"
    DIMMED = "dimmed"


def side_of(ln_ratio: float) -> BrightnessEffect:
    """Return the side of a location.

    Parameters
    ----------
    ln_ratio : float
        ln(factor of ours / of the baseline).

    >>> [side_of(math.log(ratio)).value for ratio in (1.06, 1.04, 0.96, 0.94)]
    ['brightened', 'about equal', 'about equal', 'dimmed']
    """
    if ln_ratio > math.log1p(ABOUT_EQUAL):
        return BrightnessEffect.BRIGHTENED
    return BrightnessEffect.DIMMED if ln_ratio < math.log1p(-ABOUT_EQUAL) else BrightnessEffect.ALIKE


@dataclass(frozen=True, slots=True)
class Location:
    """A keypoint at which people searched.

    Attributes
    ----------
    sequence, keypoint : str
        Camera path, and the point on it.
    ours, baseline : float or None
        Brightness factor b of either version there; None if unknown, or nobody saw that version there.
    in_both : bool
        Whether both versions were searched there.
    """

    sequence: str
    keypoint: str
    ours: float | None
    baseline: float | None
    in_both: bool = True

    @property
    def name(self) -> str:
        """Path and point, as the design has them."""
        return f"{self.sequence}/{self.keypoint}"

    @property
    def ln_ratio(self) -> float | None:
        """Logarithm of ours over the baseline: above 0 where the modulation brightens; None without both."""
        if self.ours is None or self.baseline is None:
            return None
        ratio = math.log(self.ours / self.baseline)
        return 0.0 if abs(ratio) < SAME_FACTOR else ratio


@dataclass(frozen=True, slots=True)
class SearchTable:
    """The trials of a search.

    Attributes
    ----------
    locations : tuple of Location
        By sequence in the design's order, within a sequence from the most brightened to the most dimmed.
    participants : tuple of str
        Who took part.
    participant, location, spot : array (n,) of int
        Of each trial: who, where, and which of all places of a ring (each location has two).
    session : array (n,) of int
        Which visit of which participant.
    ours : array (n,) of bool
        Whether it had the modulated brightness.
    times : array (n,)
        Until found, or the time limit [s].
    found, correct : array (n,) of bool
        Whether the key was pressed in time, and whether the gap was then identified correctly (as
        found, where that is unknown).
    limits : array (n,)
        The time limit [s].
    visit : array (n,)
        How often that location had been seen before: the block, from 0.
    order : array (n,)
        Place in the block, from the middle of all [tens of trials].
    gaps_known : bool
        Whether it is known of all rings which way the gap pointed.
    """

    locations: tuple[Location, ...]
    participants: tuple[str, ...]
    participant: Integers
    location: Integers
    spot: Integers
    session: Integers
    ours: Mask
    times: Array
    found: Mask
    correct: Mask
    limits: Array
    visit: Array
    order: Array
    gaps_known: bool = True

    @property
    def ln_ratio(self) -> Array:
        """ln(factor of ours / of the baseline) at each trial's location; nan where one is not known."""
        return np.array([place.ln_ratio for place in self.locations], dtype=np.float64)[self.location]

    @property
    def sides(self) -> NDArray[np.object_]:
        """Side of each location; None where one of the factors is not known."""
        ratios = [place.ln_ratio for place in self.locations]
        return np.array([None if ratio is None else side_of(ratio) for ratio in ratios], dtype=np.object_)

    @property
    def of_known_brightness(self) -> SearchTable:
        """The trials at locations where both factors are known."""
        return self.some(~np.isnan(self.ln_ratio))

    @property
    def model_times(self) -> Array:
        """The times, none shorter than a person can be [s]."""
        return np.maximum(self.times, SHORTEST_TIME)

    def some(self, chosen: Mask) -> SearchTable:
        """Return the table of some of the trials; lists of people and locations stay whole."""
        return replace(self, **{name: getattr(self, name)[chosen] for name in _ARRAYS})

    def without_wrong(self) -> SearchTable:
        """Return the table in which a ring whose gap was identified wrongly counts as undetected."""
        times = np.where(self.correct, self.times, self.limits)
        return replace(self, times=times, found=self.correct)


_ARRAYS = ("participant", "location", "spot", "session", "ours", "times", "found", "correct", "limits",
           "visit", "order")  # fmt: skip


def search_table(data: TaskData[SearchTrial]) -> tuple[SearchTable, tuple[str, ...]]:
    """Return the trials of a data set as arrays, and what is to be said about them.

    Raises
    ------
    InputError
        If only one of the two versions was searched in.
    """
    trials, warnings = _first_of_each(data)
    if len({trial.version for trial in trials}) < len(Version):
        raise InputError(
            f"all {len(trials)} searches are of the version {trials[0].version.value!r}; a comparison needs "
            "searches in both, 'ours' and 'baseline'"
        )
    locations = _locations(trials, _sequence_order(data, trials))
    warnings += _factor_warnings(trials, locations)
    limits = sorted({trial.time_limit for trial in trials})
    if len(limits) > 1:
        warnings.append(
            f"search: time limits differ, {limits[0]:g} to {limits[-1]:g} s: shares undetected and averages "
            "mix them; curves, medians and models take each trial's own"
        )
    short = sum(trial.search_time < SHORTEST_TIME for trial in trials)
    if short:
        warnings.append(
            f"search: {short} times are shorter than {SHORTEST_TIME:g} s, which nobody needs; models of "
            "ln(time) take that instead"
        )
    table = table_of_trials(trials, locations)
    if not data.order_known:
        table = replace(table, order=np.zeros_like(table.order))
    return table, tuple(warnings)


def first_sessions(table: SearchTable) -> SearchTable:
    """Return each person's searches of a location in the first session of theirs that has it.

    In rows of one location everybody then counts once: searches of one person are not of several people.
    """
    key = table.participant * len(table.locations) + table.location
    first: dict[int, int] = {}
    for one, session in sorted(zip(key.tolist(), table.session.tolist(), strict=True)):
        first.setdefault(one, session)
    return table.some(table.session == np.array([first[one] for one in key.tolist()]))


def table_of_trials(trials: Sequence[SearchTrial], locations: tuple[Location, ...]) -> SearchTable:
    """Return trials as arrays."""
    people = tuple(dict.fromkeys(trial.participant_id for trial in trials))
    names = [place.name for place in locations]
    place = [names.index(f"{trial.sequence}/{trial.keypoint}") for trial in trials]
    block = np.array([trial.block for trial in trials])
    index = np.array([trial.trial_index for trial in trials], dtype=np.float64)
    for one in np.unique(block):
        index[block == one] -= index[block == one].mean()
    return SearchTable(
        locations=locations,
        participants=people,
        participant=np.array([people.index(trial.participant_id) for trial in trials], dtype=np.int64),
        location=np.array(place, dtype=np.int64),
        spot=_numbered(zip(place, (trial.ring_place for trial in trials), strict=True)),
        session=_sessions(trials),
        ours=np.array([trial.version is Version.OURS for trial in trials]),
        times=np.array([trial.search_time for trial in trials]),
        found=np.array([trial.found for trial in trials]),
        correct=np.array([trial.correct for trial in trials]),
        limits=np.array([trial.time_limit for trial in trials]),
        visit=(block - block.min()).astype(np.float64),
        order=index / 10,
        gaps_known=all(trial.ring_orientation is not None for trial in trials),
    )


def _first_of_each(data: TaskData[SearchTrial]) -> tuple[list[SearchTrial], list[str]]:
    """Return the first search of each session, location and version: after it the ring's place is known."""
    kept: dict[tuple[str, str, str, str, Version], SearchTrial] = {}
    for trial in sorted(data.trials, key=lambda trial: trial.trial_index):
        key = (trial.participant_id, trial.session_id, trial.sequence, trial.keypoint, trial.version)
        kept.setdefault(key, trial)
    again = len(data.trials) - len(kept)
    warnings = []
    if again:
        warnings.append(
            f"search: {again} searches at a location and in a version that the session had before were left "
            "out"
        )
    if len({key[:2] for key in kept}) > len({key[0] for key in kept}):
        warnings.append(
            "search: a participant took part in several sessions; rows of one location take the first "
            "session with it alone, and practice (halves, order) is that within a session"
        )
    return list(kept.values()), warnings


def _sequence_order(data: TaskData[SearchTrial], trials: Iterable[SearchTrial]) -> list[str]:
    """Return the sequences in the order of the design, then others by name."""
    searched = sorted({trial.sequence for trial in trials})
    return list(dict.fromkeys([*data.designed_sequences, *searched]))


def _locations(trials: Sequence[SearchTrial], sequences: list[str]) -> tuple[Location, ...]:
    """Return where people searched, by sequence, from the most brightened to the most dimmed."""
    keys = dict.fromkeys((trial.sequence, trial.keypoint) for trial in trials)
    places = [
        Location(
            *key,
            _factor(trials, key, Version.OURS),
            _factor(trials, key, Version.BASELINE),
            len({t.version for t in trials if (t.sequence, t.keypoint) == key}) == len(Version),
        )
        for key in keys
    ]

    def rank(place: Location) -> tuple[int, float, str]:
        ratio = place.ln_ratio
        return sequences.index(place.sequence), math.inf if ratio is None else -ratio, place.keypoint

    return tuple(sorted(places, key=rank))


def _factor(trials: Sequence[SearchTrial], key: tuple[str, str], version: Version) -> float | None:
    """Return the geometric mean of a version's factors at a location; it is one factor, as a rule."""
    own = (t for t in trials if (t.sequence, t.keypoint) == key and t.version is version)
    logs = [math.log(trial.factor) for trial in own if trial.factor is not None]
    return math.exp(math.fsum(logs) / len(logs)) if logs else None


def _factor_warnings(trials: Sequence[SearchTrial], locations: Iterable[Location]) -> list[str]:
    """Return a warning if a version had different factors at one location, in different sessions."""
    middle = {(place.name, Version.OURS): place.ours for place in locations}
    middle |= {(place.name, Version.BASELINE): place.baseline for place in locations}
    other = set()
    for trial in trials:
        name = f"{trial.sequence}/{trial.keypoint}"
        mean = middle[name, trial.version]
        if mean and trial.factor and abs(math.log(trial.factor / mean)) > SAME_FACTOR:
            other.add(name)
    if not other:
        return []
    return [
        f"search: the brightness factors of a version differ between sessions at {', '.join(sorted(other))}; "
        "their geometric mean stands for them"
    ]


def _sessions(trials: Sequence[SearchTrial]) -> Integers:
    """Return the number of each trial's session; of one person, in the order of their identifiers."""
    keys = [(trial.participant_id, trial.session_id) for trial in trials]
    numbers = {key: number for number, key in enumerate(sorted(set(keys)))}
    return np.array([numbers[key] for key in keys], dtype=np.int64)


def _numbered(keys: Iterable[object]) -> Integers:
    """Return for each key the number at which it first came.

    >>> _numbered("abca").tolist()
    [0, 1, 2, 0]
    """
    numbers: dict[object, int] = {}
    return np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.int64)
