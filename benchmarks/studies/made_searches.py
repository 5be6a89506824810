"""Searches whose truth is known: log-normal times, people and locations that differ, a time limit.

The order is counterbalanced as in the experiment: each location is searched twice, once in each version, in
two halves, with two places for a ring; over four people each combination comes once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from evenlight.analysis.search.search_trials import Location, SearchTable
from evenlight.analysis.session_loading import Session, TaskData
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.search import SearchDesign, SearchTrial
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.recordings.viewing import Version
from evenlight.method.preset_files import load_display

BASELINES = {"library": 0.5, "gym": 0.4, "living_room": 0.7, "basement": 0.3}


@dataclass(frozen=True, slots=True)
class SearchTruth:
    """What is true of the people, the places and the two versions; effects are in ln(time).

    Attributes
    ----------
    participants, locations : int
        How many.
    version : float
        What ours adds to ln(time) everywhere.
    brightness : float
        What it adds for each unit of ln(factor ours / baseline) of a location.
    version_sd : float
        How much people differ in what ours adds.
    brightness_sd : float
        How much they differ in the effect of brightness.
    location_sd : float
        How much locations differ in what ours adds, beyond their brightness.
    time_limit : float
        [s]
    middle : float
        Median time at a middling place [s].
    spots_sd, people_sd, trial_sd : float
        How places of rings, people, and trials of the same kind scatter.
    second_half : float
        What the second half adds.
    brightest : float
        Largest |ln(factor ours / baseline)|.
    wrong : float
        Share of the rings found whose gap is identified wrongly.
    """

    participants: int = 17
    locations: int = 21
    version: float = 0.0
    brightness: float = 0.0
    version_sd: float = 0.0
    brightness_sd: float = 0.0
    location_sd: float = 0.0
    time_limit: float = 30.0
    middle: float = 12.0
    spots_sd: float = 0.35
    people_sd: float = 0.25
    trial_sd: float = 0.6
    second_half: float = -0.1
    brightest: float = 0.4
    wrong: float = 0.03

    @property
    def ln_ratios(self) -> NDArray[np.float64]:
        """ln(factor ours / baseline) of the locations, evenly from dimmed to brightened."""
        if self.locations == 1:
            return np.array([self.brightest])
        return np.linspace(self.brightest, -self.brightest, self.locations)


def made_locations(truth: SearchTruth) -> tuple[Location, ...]:
    """Return the locations, spread over the four sequences."""
    names = list(BASELINES)
    sequence = np.sort(np.arange(truth.locations) % len(names))
    ratios = truth.ln_ratios
    return tuple(
        Location(
            names[s], f"spot{k:02d}", BASELINES[names[s]] * float(np.exp(ratios[k])), BASELINES[names[s]]
        )
        for k, s in enumerate(sequence)
    )


def made_table(truth: SearchTruth, rng: np.random.Generator) -> SearchTable:
    """Return the searches of people drawn at random."""
    people, places = truth.participants, truth.locations
    p, k, half = (a.ravel() for a in np.meshgrid(range(people), range(places), (0, 1), indexing="ij"))
    ours = (p + k + half) % 2 == 0
    spot = 2 * k + (p // 2 + k + half) % 2
    place = _places_in_half(people, places, rng)[p, half, k]
    order = (place - (places - 1) / 2) / 10
    ln_ratio = truth.ln_ratios[k]
    effect = truth.version + truth.version_sd * rng.standard_normal(people)[p]
    effect = effect + truth.location_sd * rng.standard_normal(places)[k]
    effect = effect + (truth.brightness + truth.brightness_sd * rng.standard_normal(people)[p]) * ln_ratio
    ln_time = np.log(truth.middle) + truth.spots_sd * rng.standard_normal(2 * places)[spot]
    ln_time = ln_time + truth.people_sd * rng.standard_normal(people)[p] + truth.second_half * half
    ln_time = ln_time + effect * ours + truth.trial_sd * rng.standard_normal(p.size)
    found = np.exp(ln_time) <= truth.time_limit
    return SearchTable(
        locations=made_locations(truth),
        participants=tuple(f"{n + 1:02d}" for n in range(people)),
        participant=p.astype(np.int64),
        location=k.astype(np.int64),
        spot=spot.astype(np.int64),
        session=p.astype(np.int64),
        ours=ours,
        times=np.minimum(np.exp(ln_time), truth.time_limit),
        found=found,
        correct=found & (rng.random(p.size) >= truth.wrong),
        limits=np.full(p.size, truth.time_limit),
        visit=half.astype(np.float64),
        order=order,
        repetition=np.zeros(p.size, dtype=np.int64),
    )


def _places_in_half(people: int, places: int, rng: np.random.Generator) -> NDArray[np.int64]:
    """Return at which place of its half each location comes, for each person and half."""
    return np.array([[rng.permutation(places) for _ in range(2)] for _ in range(people)])


def trials_of(table: SearchTable) -> tuple[SearchTrial, ...]:
    """Return the searches as a session records them."""
    per_half = len(table.locations)
    return tuple(_trial(table, n, per_half) for n in range(table.times.size))


def _trial(table: SearchTable, n: int, per_half: int) -> SearchTrial:
    """Return one of them."""
    place = table.locations[int(table.location[n])]
    found, half = bool(table.found[n]), int(table.visit[n])
    factor = place.ours if table.ours[n] else place.baseline
    assert factor is not None
    return SearchTrial(
        participant_id=table.participants[int(table.participant[n])],
        session_id="01",
        trial_index=half * per_half + round(10 * float(table.order[n]) + (per_half - 1) / 2),
        sequence=place.sequence,
        keypoint=place.keypoint,
        version=Version.OURS if table.ours[n] else Version.BASELINE,
        factor=factor,
        ring_place=1 + int(table.spot[n]) % 2,
        ring_azimuth=20.0,
        ring_altitude=-5.0,
        ring_gap=10.0,
        ring_contrast=-0.15,
        shown_contrast=-0.15,
        ring_orientation=90,
        background_luminance=20.0,
        gap_pixels=6.0,
        time_limit=float(table.limits[n]),
        found=found,
        search_time=float(table.times[n]),
        reported_orientation=(90 if table.correct[n] else 45) if found else None,
        response_time=1.0 if found else None,
        simulated=True,
        block=half + 1,
    )


def task_data(trials: Sequence[SearchTrial]) -> TaskData[SearchTrial]:
    """Return trials as a data set that was loaded: one session for each person and session number."""
    keys = dict.fromkeys((trial.participant_id, trial.session_id) for trial in trials)
    sessions = tuple(
        Session(
            Path(f"sub-{person}/ses-{session}"),
            _manifest(person, session, sum((t.participant_id, t.session_id) == key for t in trials)),
            tuple(t for t in trials if (t.participant_id, t.session_id) == key),
        )
        for key in keys
        for person, session in (key,)
    )
    return TaskData("search", sessions, True, "0" * 64, ())


def _manifest(person: str, session: str, n_trials: int) -> SessionManifest:
    """Return the manifest of a simulated session."""
    return SessionManifest(
        participant_id=person,
        session_id=session,
        task="search",
        simulated=True,
        status=SessionStatus.COMPLETE,
        n_trials=n_trials,
        display=load_display("varjo-xr3"),
        design=SearchDesign(),
        provenance=Provenance(),
    )
