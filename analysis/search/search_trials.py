"""The trials of a search as arrays: who looked where, at which brightness, how long, and on which side."""

from __future__ import annotations

import enum
import math
from collections import Counter
from collections.abc import Hashable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.integrity.gate import SHORTEST_TIME
from evenlight.analysis.session_loading import TaskData
from evenlight.analysis.wording import spaced
from evenlight.data_schema.arrays import Array, Integers, Mask
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.search import SearchTrial
from evenlight.data_schema.recordings.viewing import Version

SAME_FACTOR = 1e-6  # of ln(factor): closer factors are one factor that was rounded in a file
ABOUT_EQUAL = 0.05  # factors that differ by at most so much are about equal (choice): neither gain nor loss


class BrightnessEffect(enum.Enum):
    """What the modulation does to the brightness of a location, against constant dimming."""

    BRIGHTENED = "brightened"
    ALIKE = "about equal"
    DIMMED = "dimmed"


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
    def in_words(self) -> str:
        """Path and point, as tables and figures have them."""
        return spaced(self.name).replace("/", ": ")

    @property
    def ln_ratio(self) -> float | None:
        """Logarithm of ours over the baseline: above 0 where the modulation brightens; None without both."""
        if self.ours is None or self.baseline is None:
            return None
        ratio = math.log(self.ours / self.baseline)
        return 0.0 if abs(ratio) < SAME_FACTOR else ratio

    @property
    def side(self) -> BrightnessEffect | None:
        """What the modulation does to its brightness; None without both factors.

        >>> [Location("gym", "door", ours, 1.0).side.value for ours in (1.06, 1.04, 0.96, 0.94)]
        ['brightened', 'about equal', 'about equal', 'dimmed']
        """
        if self.ln_ratio is None:
            return None
        if self.ln_ratio > math.log1p(ABOUT_EQUAL):
            return BrightnessEffect.BRIGHTENED
        dimmed = self.ln_ratio < math.log1p(-ABOUT_EQUAL)
        return BrightnessEffect.DIMMED if dimmed else BrightnessEffect.ALIKE


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
        Whether the key was pressed in time, rightly where the key was the answer; and whether the gap was
        then identified correctly (as found, where that is unknown).
    limits : array (n,)
        The time limit [s].
    visit : array (n,)
        How often that location had been seen before: the block, from 0.
    order : array (n,)
        Place in the block, from the middle of all [tens of trials].
    repetition : array (n,) of int
        Which search of the session at that location in that version, from 0.
    gaps_known : bool
        Whether it is known of all rings which way the gap pointed.
    repeated : bool
        Whether the design has several searches of a person at a location in a version.
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
    repetition: Integers
    gaps_known: bool = True
    repeated: bool = False

    @property
    def ln_ratios(self) -> Array:
        """ln(factor of ours / of the baseline) of each location; nan where one is not known."""
        return np.array([place.ln_ratio for place in self.locations], dtype=np.float64)

    @property
    def ln_ratio(self) -> Array:
        """That of each trial's location."""
        return self.ln_ratios[self.location]

    @property
    def sides(self) -> NDArray[np.object_]:
        """Side of each location; None where one of the factors is not known."""
        return np.array([place.side for place in self.locations], dtype=np.object_)

    @property
    def of_known_brightness(self) -> SearchTable:
        """The trials at locations where both factors are known."""
        return self.some(~np.isnan(self.ln_ratio))

    @property
    def wrong(self) -> Mask:
        """Which searches a wrong answer ended."""
        return ~self.found & (self.times < self.limits)

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


_ARRAYS = tuple(
    name for name, kind in SearchTable.__annotations__.items() if kind in ("Integers", "Mask", "Array")
)


def search_table(data: TaskData[SearchTrial]) -> tuple[SearchTable, tuple[str, ...]]:
    """Return the trials of a data set as arrays, and what is to be said about them.

    Raises
    ------
    InputError
        If only one of the two versions was searched in.
    """
    trials = _counted(data)
    if len({trial.version for trial in trials}) < len(Version):
        raise InputError(
            f"all {len(trials)} searches are of the version {trials[0].version.value!r}; a comparison needs "
            "searches in both, 'ours' and 'baseline'"
        )
    sequences = dict.fromkeys([*data.designed_sequences, *sorted({trial.sequence for trial in trials})])
    locations = _locations(trials, list(sequences))
    table = _table_of_trials(trials, locations)
    if not data.order_known:
        table = replace(table, order=np.zeros_like(table.order))
    return table, tuple(_warnings(data, trials, locations))


def first_sessions(table: SearchTable) -> SearchTable:
    """Return each person's searches of a location in the first session of theirs that has it.

    In rows of one location everybody then counts once: searches of one person are not of several people. All
    searches stay where they are repeated: those rows take a person's together then.
    """
    if table.repeated:
        return table
    key = table.participant * len(table.locations) + table.location
    first: dict[int, int] = {}
    for one, session in sorted(zip(key.tolist(), table.session.tolist(), strict=True)):
        first.setdefault(one, session)
    return table.some(table.session == np.array([first[one] for one in key.tolist()]))


def _table_of_trials(trials: Sequence[SearchTrial], locations: tuple[Location, ...]) -> SearchTable:
    people = [trial.participant_id for trial in trials]
    names = [place.name for place in locations]
    place = [names.index(f"{trial.sequence}/{trial.keypoint}") for trial in trials]
    visits = [(trial.participant_id, trial.session_id) for trial in trials]
    sessions = sorted(set(visits))  # of one person, in the order of their identifiers
    block = np.array([trial.block for trial in trials])
    index = np.array([trial.trial_index for trial in trials], dtype=np.float64)
    for one in np.unique(block):
        index[block == one] -= index[block == one].mean()
    return SearchTable(
        locations=locations,
        participants=tuple(dict.fromkeys(people)),
        participant=_numbered(people),
        location=np.array(place, dtype=np.int64),
        spot=_numbered(zip(place, (trial.ring_place for trial in trials), strict=True)),
        session=np.array([sessions.index(visit) for visit in visits], dtype=np.int64),
        ours=np.array([trial.version is Version.OURS for trial in trials]),
        times=np.array([trial.search_time for trial in trials]),
        found=np.array([trial.found for trial in trials]),
        correct=np.array([trial.correct for trial in trials]),
        limits=np.array([trial.time_limit for trial in trials]),
        visit=(block - block.min()).astype(np.float64),
        order=index / 10,
        repetition=_counts(zip(visits, place, (trial.version for trial in trials), strict=True)),
        gaps_known=all(trial.ring_orientation is not None for trial in trials),
        repeated=any(trial.repetition > 1 for trial in trials),
    )


def _numbered(keys: Iterable[Hashable]) -> Integers:
    """Return the number of each key among the different ones, in the order in which they come."""
    numbers: dict[Hashable, int] = {}
    return np.array([numbers.setdefault(key, len(numbers)) for key in keys], dtype=np.int64)


def _counts(keys: Iterable[Hashable]) -> Integers:
    """Return how often each key came before."""
    seen: Counter[Hashable] = Counter()
    before = []
    for key in keys:
        before.append(seen[key])
        seen[key] += 1
    return np.array(before, dtype=np.int64)


def _counted(data: TaskData[SearchTrial]) -> list[SearchTrial]:
    """Return the first search of each session, location, version and repetition.

    Another one that is no repetition of the design is of a ring whose place is known.
    """
    kept: dict[Hashable, SearchTrial] = {}
    for trial in sorted(data.trials, key=lambda trial: trial.trial_index):
        where = (trial.sequence, trial.keypoint, trial.version, trial.repetition)
        kept.setdefault((trial.participant_id, trial.session_id, *where), trial)
    return list(kept.values())


def _locations(trials: Sequence[SearchTrial], sequences: list[str]) -> tuple[Location, ...]:
    """Return where people searched, by sequence, from the most brightened to the most dimmed."""
    at: dict[tuple[str, str], dict[Version, list[SearchTrial]]] = {}
    for trial in trials:
        at.setdefault((trial.sequence, trial.keypoint), {}).setdefault(trial.version, []).append(trial)
    places = [
        Location(
            *key,
            _factor(own.get(Version.OURS, ())),
            _factor(own.get(Version.BASELINE, ())),
            len(own) == len(Version),
        )
        for key, own in at.items()
    ]

    def rank(place: Location) -> tuple[int, float, str]:
        ratio = place.ln_ratio
        return sequences.index(place.sequence), math.inf if ratio is None else -ratio, place.keypoint

    return tuple(sorted(places, key=rank))


def _factor(trials: Iterable[SearchTrial]) -> float | None:
    """Return the geometric mean of the factors of a version at a location; it is one factor, as a rule."""
    logs = [math.log(trial.factor) for trial in trials if trial.factor is not None]
    return math.exp(math.fsum(logs) / len(logs)) if logs else None


def _warnings(
    data: TaskData[SearchTrial], trials: Sequence[SearchTrial], locations: Iterable[Location]
) -> Iterator[str]:
    if again := len(data.trials) - len(trials):
        yield (
            f"search: {again} searches at a location and in a version that the session had before were left "
            "out; if the design repeats them, `repetition` is to number them, as a new import does"
        )
    people = {trial.participant_id for trial in trials}
    repeated = any(trial.repetition > 1 for trial in trials)
    if not repeated and len({(trial.participant_id, trial.session_id) for trial in trials}) > len(people):
        yield (
            "search: a participant took part in several sessions; rows of one location take the first "
            "session with it alone, and practice (halves, order) is that within a session"
        )
    middle = {place.name: {Version.OURS: place.ours, Version.BASELINE: place.baseline} for place in locations}
    other = set()
    for trial in trials:
        name = f"{trial.sequence}/{trial.keypoint}"
        mean = middle[name][trial.version]
        if mean and trial.factor and abs(math.log(trial.factor / mean)) > SAME_FACTOR:
            other.add(name)
    if other:
        yield (
            f"search: the brightness factors of a version differ between sessions at "
            f"{', '.join(sorted(other))}; their geometric mean stands for them"
        )
    limits = sorted({trial.time_limit for trial in trials})
    if len(limits) > 1:
        yield (
            f"search: time limits differ, {limits[0]:g} to {limits[-1]:g} s: shares undetected and averages "
            "mix them; curves, medians and models take each trial's own"
        )
    if short := sum(trial.search_time < SHORTEST_TIME for trial in trials):
        yield (
            f"search: {short} times are shorter than {SHORTEST_TIME:g} s, which nobody needs; models of "
            "ln(time) take that instead"
        )
