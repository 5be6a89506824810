"""Flicker: a square whose luminance goes up and down at some frequency, and the question whether it was seen.

It shows no video of a file, so it conducts its trials itself.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from evenlight import Frame, TaskDeclaration
from evenlight.tasks import (
    Clip,
    ComparisonTrial,
    ConductedTrial,
    Pages,
    Participant,
    PlannedTrial,
    Purpose,
    RampDesign,
    RampTrial,
    Response,
    SessionSetting,
    Stage,
    Task,
    Trial,
    TrialFlag,
    TrialPlace,
    Viewing,
    as_in,
    clip_log,
    described,
    dimmed_luminance,
    generator_for,
    quantity,
    record,
    shown_columns,
)

SIDE = 256  # [pixels] of the square
MAX_DROPPED_SHARE = 0.01  # of a trial's refreshes
MEAN_FACTOR = 0.5  # of a white square: what flickers around it stays below full brightness


# What is shown, how often, how: the fields are the keys of a design's file.
@record
class FlickerDesign:
    """Which flicker is shown, and how often."""

    frequency: float = quantity("Hz", "of the flicker", above=0.0, maximum=60.0, default=10.0)
    depths: tuple[float, ...] = quantity(
        "1",
        "amplitudes, as shares of the mean luminance",
        above=0.0,
        maximum=0.9,
        default=(0.01, 0.02, 0.04, 0.08),
    )
    repetitions: int = quantity("1", "trials of each depth, and without flicker", minimum=1, default=5)
    duration: float = quantity("s", "how long the square is shown", above=0.0, default=1.0)
    pause_duration: float = as_in(RampDesign, "pause_duration")
    practice_trials: int = as_in(RampDesign, "practice_trials")
    trials_between_breaks: int = as_in(RampDesign, "trials_between_breaks")


# A line of trials.jsonl, and the columns of an export.
@record
class FlickerTrial(Trial):
    """One flicker, and whether it was seen."""

    participant_id: str = as_in(RampTrial, "participant_id")
    session_id: str = as_in(RampTrial, "session_id")
    trial_index: int = as_in(RampTrial, "trial_index")
    frequency: float = quantity("Hz", "of the flicker", above=0.0)
    depth: float = quantity(
        "1", "amplitude, as a share of the mean luminance; 0 in a catch trial", minimum=0.0
    )
    response: Response = described("was there flicker: yes, no")
    response_time: float | None = as_in(RampTrial, "response_time")
    simulated: bool = as_in(RampTrial, "simulated")
    practice: bool = as_in(RampTrial, "practice")
    block: int = as_in(RampTrial, "block")
    attempt: int = as_in(RampTrial, "attempt")
    onset: float | None = as_in(RampTrial, "onset")
    noise_seed: int | None = as_in(RampTrial, "noise_seed")
    n_frames: int | None = as_in(ComparisonTrial, "n_frames")
    frames_dropped: int | None = as_in(ComparisonTrial, "frames_dropped")
    flag: TrialFlag = described("why it is left out; empty for none", default=TrialFlag.NONE)


def planned_flicker(design: FlickerDesign, depth: float, block: int = 1) -> PlannedTrial:
    """Return a trial that is to come: what of its row is known before it is shown; block 0 is practice."""
    return PlannedTrial(frequency=design.frequency, depth=depth, block=block, practice=block == 0)


@dataclass(frozen=True, slots=True)
class WhiteSquare:
    """A video of nothing but white; its brightness factors make the flicker."""

    n_frames: int
    refresh_rate: float
    name: str = "white"

    def frames(self) -> Iterator[Frame]:
        """Yield its frames."""
        white = np.full((SIDE, SIDE, 3), 255, np.uint8)
        for k in range(self.n_frames):
            yield Frame(k / self.refresh_rate, 1 / self.refresh_rate, white)

    def sha256(self) -> str:
        """Return nothing: it is no file."""
        return ""


class FlickerTask(Task):
    """A session: each depth, and none, equally often and in random order; the strongest for practice."""

    def __init__(self, setting: SessionSetting) -> None:
        design: FlickerDesign = setting.design
        depths = [0.0, *design.depths] * design.repetitions
        order = generator_for(*setting.session, Purpose.ORDER).permutation(depths).tolist()
        strongest = planned_flicker(design, max(design.depths), block=0)
        super().__init__(
            setting,
            [planned_flicker(design, depth) for depth in order],
            [strongest] * design.practice_trials,
            neutral_luminance=float(
                dimmed_luminance(setting.display.peak_luminance, MEAN_FACTOR, setting.display)
            ),
        )

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        return 2 + self.n_trials * (self.design.pause_duration + self.design.duration + 2) / 60

    def conduct(
        self, planned: PlannedTrial, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> ConductedTrial:
        """Show the square, and ask."""
        seed = self.noise_seed(place)
        stage.wait(self.design.pause_duration, self.neutral_luminance)
        shown = stage.play(self._clip(planned, seed))
        participant.see_trial(planned, place.trial_index)
        keys = {self.rig.keys.yes: Response.YES, self.rig.keys.no: Response.NO}
        question = pages.text("question_flicker", self.rig.keys)
        press = stage.ask(question, list(keys), self.neutral_luminance)
        columns = shown_columns(place, [shown], seed, MAX_DROPPED_SHARE) | {"response_time": press.time}
        return ConductedTrial(self.row(planned, keys[press.name], columns), (clip_log(place, 1, shown),))

    def row(self, planned: PlannedTrial, answer: Response, columns: dict[str, Any]) -> FlickerTrial:
        """Return the record of an answered trial."""
        return FlickerTrial(**planned.columns, **columns, response=answer)

    def is_right(self, trial: FlickerTrial) -> bool:
        """Return whether flicker was seen, or none where there was none."""
        return (trial.response is Response.YES) == (trial.depth > 0)

    def _clip(self, planned: PlannedTrial, seed: int) -> Clip:
        """Return the square as it flickers: a sine of luminance, which is linear in the brightness factor."""
        rate = self.rig.refresh_rate
        times = np.arange(max(1, round(self.design.duration * rate))) / rate
        wave = np.sin(2 * np.pi * planned.frequency * times)
        factors = MEAN_FACTOR * (1 + planned.depth * wave)
        return Clip(WhiteSquare(len(times), rate), times, len(times) / rate, factors, seed)


class Watchers(Viewing):
    """Simulated participants, each with a depth that half of the flicker is seen at."""

    def __init__(self, setting: SessionSetting) -> None:
        """See nothing: the depth of a trial says all."""

    def draw(self, rng: np.random.Generator) -> float:
        """Return a participant."""
        return float(rng.lognormal(np.log(0.02), 0.2))

    def truth(self, person: float) -> dict[str, Any]:
        """Return what is true of a participant."""
        return {"depth": person}

    def answer(self, person: float, planned: PlannedTrial, rng: np.random.Generator) -> Response:
        """Return whether flicker is seen; now and then where there is none."""
        share = 0.05 + 0.9 / (1 + (person / planned.depth) ** 4) if planned.depth else 0.05
        return Response.YES if rng.random() < share else Response.NO


INSTRUCTIONS = """\
# Your task

Each time you see a bright square for a short while. Sometimes it flickers. Then you are asked whether it did.

Press {yes} for yes, {no} for no. Press {proceed} to begin with practice.
"""
FLICKER = TaskDeclaration(
    name="flicker",
    title="Seeing flicker",
    design=FlickerDesign,
    trial=FlickerTrial,
    task=FlickerTask,
    observer=Watchers,
    pages={
        "en": {
            "instructions": INSTRUCTIONS,
            "question": "Did it flicker?\n\nPress {yes} for yes, {no} for no.",
        }
    },
)
