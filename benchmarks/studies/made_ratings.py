"""Made-up ratings: of people with cut points of their own, or just as listed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evenlight.analysis.session_loading import Session, TaskData
from evenlight.data_schema.display import Display
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.session import SessionManifest, SessionStatus
from evenlight.data_schema.recordings.viewing import PAPER_SEQUENCES, RatingDesign, RatingTrial, Version

DISPLAY = Display("d", peak_luminance=100.0, black_level=0.1, gamma=2.2, pixels_per_degree=30.0)


@dataclass(frozen=True, slots=True)
class Raters:
    """How people rate, on a logistic scale [log-odds].

    Attributes
    ----------
    effect : float
        Of ours against the baseline.
    effect_sd : float
        Between people.
    by_sequence : tuple of float
        What is added to the effect in each sequence.
    level_sd : float
        Between people, of how high they rate.
    place : float
        Of being shown second.
    carry_over : float
        Of a video after ours.
    cuts : tuple of float
        Between the ratings.
    """

    effect: float = 0.0
    effect_sd: float = 0.0
    by_sequence: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    level_sd: float = 1.5
    place: float = 0.0
    carry_over: float = 0.0
    cuts: tuple[float, ...] = (-4.0, -2.0, 0.0, 2.0)


def drawn_ratings(
    raters: Raters, n: int, rng: np.random.Generator, repetitions: int = 1
) -> list[RatingTrial]:
    """Return ratings of n people of the paper's sequences, in counterbalanced orders."""
    trials = []
    height = (0.5, -0.5, 1.0, -1.0)
    for person in range(n):
        level, slope = raters.level_sd * rng.normal(), raters.effect + raters.effect_sd * rng.normal()
        for number, sequence in enumerate(PAPER_SEQUENCES):
            for repetition in range(1, repetitions + 1):
                ours_first = (person + number + repetition) % 2 == 0
                for version in Version:
                    ours = version is Version.OURS
                    place = 1 if ours == ours_first else 2
                    scale = level + height[number] + (place - 1.5) * raters.place
                    scale += (slope + raters.by_sequence[number]) * (0.5 if ours else -0.5)
                    scale += raters.carry_over * (place == 2 and not ours)
                    rating = 1 + int(np.sum(scale + rng.logistic() > np.array(raters.cuts)))
                    trials.append(rating_trial(f"{person:03}", sequence, version, rating, place, repetition))
    return trials


def rating_trial(
    who: str, sequence: str, version: Version, rating: int, place: int = 0, repetition: int = 1
) -> RatingTrial:
    """Return an answered trial; without a place, ours is shown first."""
    return RatingTrial(
        participant_id=who,
        session_id="01",
        trial_index=0,
        sequence=sequence,
        version=version,
        repetition=repetition,
        place_in_pair=place or (1 if version is Version.OURS else 2),
        mean_factor=0.5,
        rating=rating,
        response_time=1.0,
        simulated=True,
    )


def rating_data(
    trials: Sequence[RatingTrial], sequences: tuple[str, ...] = PAPER_SEQUENCES
) -> TaskData[RatingTrial]:
    """Return trials as the sessions that they would be read from."""
    people: dict[str, list[RatingTrial]] = {}
    for trial in trials:
        people.setdefault(trial.participant_id, []).append(trial)
    sessions = tuple(
        Session(Path(f"sub-{who}"), _manifest(who, sequences, len(own)), tuple(own))
        for who, own in people.items()
    )
    return TaskData("rating", sessions, simulated=True, sha256="", warnings=())


def _manifest(who: str, sequences: tuple[str, ...], n: int) -> SessionManifest:
    """Return the manifest of a session."""
    return SessionManifest(
        participant_id=who,
        session_id="01",
        task="rating",
        simulated=True,
        status=SessionStatus.COMPLETE,
        n_trials=n,
        display=DISPLAY,
        design=RatingDesign(sequences=sequences),
        provenance=Provenance(),
    )
