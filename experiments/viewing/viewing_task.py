"""What the viewing tasks have in common: a fixed, counterbalanced order of trials, seeds, dropped frames.

A task of videos with one question after each trial is a `ClipTask` with `answers` and `row`.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.viewing import ClipLog, ComparisonDesign, RatingDesign, Version
from evenlight.experiments.chance import Purpose, drawn_halves, drawn_row, generator_for, williams_row
from evenlight.experiments.playback.clip_player import require_room
from evenlight.experiments.sessions.dropped_frames import CHECK_SECONDS, FrameDemand, require_few_drops
from evenlight.experiments.sessions.fixed_order import PlannedTrial
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.task import (
    ConductedTrial,
    Participant,
    SessionSetting,
    Task,
    TrialPlace,
    shown_columns,
    shown_log,
)
from evenlight.experiments.stage import Clip, ShownClip, Stage
from evenlight.experiments.stimulus_folder import LoadedStimulus, neutral_luminance
from evenlight.stimuli.ramp import frame_count

READING = 120.0  # [s] consent, instructions, practice pages
ANSWERING = 4.0  # [s] a question, and going on


def planned_clips(versions: Sequence[Version], seconds: float | None = None, **columns: Any) -> PlannedTrial:
    """Return a trial that shows a sequence in some versions, one after the other; block 0 is practice.

    Parameters
    ----------
    versions : sequence of Version
        In their order.
    seconds : float, optional
        How much of it is shown, from its beginning [s]; all if not given.
    **columns
        Of its row, `sequence` and `block` among them.
    """
    return PlannedTrial({"versions": versions, "seconds": seconds}, practice=columns["block"] == 0, **columns)


class ClipTask(Task):
    """A task of videos, with one question after each trial: the page `question_TASK`.

    Parameters
    ----------
    setting : SessionSetting
        Design, stimuli, session and rig. The design has `adaptation_duration` and `max_dropped_share`.
    order, practice : sequence of planned trials
        As of `Task`.
    """

    def __init__(
        self, setting: SessionSetting, order: Sequence[PlannedTrial], practice: Sequence[PlannedTrial]
    ) -> None:
        self._planned = order
        super().__init__(setting, order, practice, neutral_luminance=neutral_luminance(setting.stimuli))
        self.stimuli = {stimulus.name: stimulus for stimulus in setting.stimuli}

    def answers(self, keys: Keys) -> dict[str, Any]:
        """Return the answer that each key gives."""
        raise NotImplementedError  # each task has its own

    def key_answers(self) -> dict[str, Any]:
        """Return the answer that each key of the rig gives, for the test of the keys."""
        return self.answers(self.rig.keys)

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        shown = 0.0
        for planned in (*self._planned, *self.practice()):
            seconds = planned.seconds or self.stimuli[planned.sequence].stimulus.duration
            shown += len(planned.versions) * (seconds + self.design.adaptation_duration)
        return viewing_minutes(shown, self.n_trials)

    def prepare(self, stage: Stage) -> None:
        """Refuse videos larger than the window, and a display that drops too many of their frames."""
        require_rooms(self.stimuli.values(), stage)
        if self.setting.manifest.simulated:
            return
        clips = [stimulus_clip(each, Version.OURS, 0, CHECK_SECONDS) for each in self.stimuli.values()]
        lengths = (frame_count(clip.duration, self.rig.refresh_rate) for clip in clips)
        share = self.design.max_dropped_share
        demand = FrameDemand(tuple((n, int(share * n)) for n in lengths), "max_dropped_share")

        def show() -> ShownClip:
            stage.prepare_clip(clips[0])
            stage.wait(self.design.adaptation_duration, self.neutral_luminance)
            return stage.play(clips[0])

        require_few_drops(show, demand, self.rig.refresh_rate)

    def conduct(
        self, planned: PlannedTrial, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> ConductedTrial:
        """Show the versions of a sequence one after the other, and ask the question of the task."""
        stimulus, seed = self.stimuli[planned.sequence], self.noise_seed(place)
        shown = []
        for number, version in enumerate(planned.versions, start=1):
            clip = stimulus_clip(stimulus, version, seed + number - 1, planned.seconds)
            if len(planned.versions) > 1:
                clip = dataclasses.replace(clip, label=str(number))
            stage.prepare_clip(clip)
            stage.wait(self.design.adaptation_duration, self.neutral_luminance)
            shown.append(stage.play(clip))
        answers = self.answers(self.rig.keys)
        participant.see_trial(planned, place.trial_index)
        question = pages.text(f"question_{self.name}", self.rig.keys)
        press = stage.ask(question, list(answers), self.neutral_luminance)
        columns = shown_columns(place, shown, seed, self.design.max_dropped_share)
        trial = self.row(planned, answers[press.name], columns | {"response_time": press.time})
        logs = (clip_log(place, number, part) for number, part in enumerate(shown, start=1))
        return ConductedTrial(trial, tuple(logs))


def viewing_minutes(shown: float, n_trials: int) -> float:
    """Return the minutes of a session that shows something for some time [s] in some trials.

    >>> viewing_minutes(440.0, 10)
    10.0
    """
    return (READING + shown + ANSWERING * n_trials) / 60


def pairs_in_order(
    design: RatingDesign | ComparisonDesign, order_index: int
) -> list[list[tuple[str, tuple[Version, Version]]]]:
    """Return the sequences and their versions in the order of a participant, by repetition."""
    n, both = len(design.sequences), (Version.OURS, Version.BASELINE)
    seed = getattr(design, "order_seed", 1)  # designs of tasks from elsewhere may have none
    ours_first = drawn_halves(n, order_index, seed, design.repetitions)
    rows = (drawn_row(n, order_index, seed, k + 1) for k in range(design.repetitions))
    return [
        [(design.sequences[k], both if first[k] else both[::-1]) for k in williams_row(n, row)]
        for first, row in zip(ours_first.tolist(), rows, strict=True)
    ]


def practice_sequences(sequences: tuple[str, ...], n: int, seed: int, order_index: int) -> list[str]:
    """Return the sequences of practice: each once before any comes twice."""
    chance = generator_for(seed, order_index, Purpose.EXCERPTS)
    order = [int(k) for _ in range(-(-n // len(sequences))) for k in chance.permutation(len(sequences))]
    return [sequences[k] for k in order[:n]]


def stimulus_clip(stimulus: LoadedStimulus, version: Version, noise_seed: int, seconds: float | None) -> Clip:
    """Return a version of a sequence, to be played."""
    times = stimulus.track.times
    return Clip(
        video=stimulus.video,
        times=times - times[0],
        duration=stimulus.stimulus.duration,
        factors=stimulus.factors(version),
        noise_seed=noise_seed,
        seconds=seconds,
        scale=None if stimulus.geometry is None else stimulus.geometry.scale,
    )


def require_rooms(stimuli: Iterable[LoadedStimulus], stage: Stage) -> None:
    """Refuse videos that are shown as a whole, pixel by pixel, and are larger than the stage."""
    room = stage.room()
    for stimulus in stimuli:
        if room is None or stimulus.geometry is None or stimulus.geometry.scale is not None:
            continue
        try:
            require_room(stimulus.geometry.size, room)
        except InputError as error:
            raise InputError(f"{stimulus.folder}: {error}") from error


def clip_log(place: TrialPlace, interval: int, shown: ShownClip) -> ClipLog:
    """Return what the display showed of a video, as a record."""
    return shown_log(ClipLog, place, interval, shown)
