"""What the viewing tasks have in common: a fixed, counterbalanced order of trials, seeds, dropped frames.

A task of videos with one question after each trial is a `ClipTask` with `answers` and `row`.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterable, Sequence
from typing import Any, Generic, Protocol, TypeVar

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.viewing import ClipLog, Version
from evenlight.experiments.chance import Purpose, generator_for, williams_row
from evenlight.experiments.playback.clip_player import require_room
from evenlight.experiments.sessions.dropped_frames import (
    CHECK_SECONDS,
    FrameDemand,
    ShownStimulus,
    most_repeats,
    require_few_drops,
)
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.task import (
    ConductedTrial,
    Participant,
    PracticeRule,
    SessionSetting,
    TrialPlace,
)
from evenlight.experiments.stage import Clip, ShownClip, Stage
from evenlight.experiments.stimulus_folder import LoadedStimulus, neutral_luminance
from evenlight.stimuli.ramp import frame_count

LARGEST_SEED = 2**31
READING = 120.0  # [s] consent, instructions, practice pages
ANSWERING = 4.0  # [s] a question, and going on
MAX_SHOWINGS = 3  # of a trial that is flagged each time
FEWEST_SHOWINGS = 2  # one may be a hiccup of the computer
SAME = 1e-9  # relative, of a number that was computed and written


class PlannedTrial(Protocol):
    """A trial of a fixed order."""

    @property
    def block(self) -> int:
        """Of the session, from 1; 0 for practice."""

    @property
    def columns(self) -> dict[str, Any]:
        """What of its row is known before it is shown."""


class PlannedClips(PlannedTrial, Protocol):
    """A trial that shows a sequence in some versions."""

    @property
    def sequence(self) -> str:
        """Name of the sequence that is shown."""

    @property
    def versions(self) -> Sequence[Version]:
        """In which versions it is shown, one after the other."""

    @property
    def seconds(self) -> float | None:
        """How much of it is shown, from its beginning [s]; None for all."""


Planned = TypeVar("Planned", bound=PlannedTrial)
Clips = TypeVar("Clips", bound=PlannedClips)


class FixedOrder(Generic[Planned]):
    """Hands out trials in their order; a flagged one comes again at the end, if it is to.

    Parameters
    ----------
    trials : sequence of planned trials
        In their order.
    repeat_flagged : bool
        Whether a flagged trial is shown again, at most three times in all, until a quarter of the trials
        was shown again; none is where every showing so far was flagged, for it would be flagged too.
    """

    def __init__(self, trials: Sequence[Planned], repeat_flagged: bool) -> None:
        self._queue: list[tuple[Planned, int]] = [(trial, 1) for trial in trials]
        self._repeat_flagged = repeat_flagged
        self._place = self._dropped = 0
        self._last_block = max((trial.block for trial in trials), default=0)
        self.n_trials = len(self._queue)

    def next_trial(self) -> Planned | None:
        """Return the trial that comes next, the same until `take` is called; None when all are done."""
        return self._queued() if self.n_left else None

    @property
    def n_left(self) -> int:
        """Trials still to come, as far as is known."""
        hopeless = self._dropped == self._place >= FEWEST_SHOWINGS
        most = self.n_trials + (0 if hopeless else most_repeats(self.n_trials))
        return max(min(len(self._queue), most) - self._place, 0)

    def _queued(self) -> Planned | None:
        """Return the trial that is next in the queue, of which not all may be shown."""
        return self._queue[self._place][0] if self._place < len(self._queue) else None

    def take(self, trial: Any) -> None:
        """Take an answered trial, just given or read from an interrupted session.

        Raises
        ------
        InputError
            If it is not the trial that `next_trial` returned.
        """
        planned = self._queued()  # earlier versions showed more of them again
        different = ["no further trial"] if planned is None else _differences(trial, planned.columns)
        if planned is None or different:
            raise InputError(
                f"trial {trial.trial_index} of participant {trial.participant_id} is not the one that "
                f"design, stimuli and seed of the session say ({', '.join(different)}); a session goes on "
                "only with those it began with"
            )
        showings = self._queue[self._place][1]
        self._place += 1
        # What is left out for having been seen before would only be seen once more.
        dropped = trial.flag is TrialFlag.DROPPED_FRAMES
        self._dropped += dropped
        if dropped and self._repeat_flagged and showings < MAX_SHOWINGS:
            again = dataclasses.replace(planned, block=self._last_block + 1)  # type: ignore[type-var] # a dataclass
            self._queue.append((again, showings + 1))


def _differences(trial: Any, columns: dict[str, Any]) -> list[str]:
    """Return in which columns a trial is not as it was planned, in words."""
    return [
        f"{name} {_plain(getattr(trial, name))}, not {_plain(value)}"
        for name, value in columns.items()
        if not _same(getattr(trial, name), value)
    ]


def _same(got: Any, planned: Any) -> bool:
    """Return whether two values are the same, numbers but for their rounding."""
    if isinstance(planned, float):
        return math.isclose(got, planned, rel_tol=SAME, abs_tol=SAME)
    return bool(got == planned)


def _plain(value: Any) -> object:
    """Return a value as it is read in a message."""
    return getattr(value, "value", value)


class ViewingTask(Generic[Planned]):
    """What all viewing tasks answer alike; each adds its trials, how one is conducted, and its rows.

    Parameters
    ----------
    setting : SessionSetting
        Design, stimuli, session and rig. The design has `adaptation_duration`, `max_dropped_share`,
        `repeat_flagged` and `trials_between_breaks`.
    order, practice : sequence of planned trials
        Those of the session, and those for practice before it, in their order.
    """

    seconds = 0.0  # no trial has a time limit
    practice_rule: PracticeRule | None = None  # one round, whatever the answers

    def __init__(
        self, setting: SessionSetting, order: Sequence[Planned], practice: Sequence[Planned]
    ) -> None:
        self._session, self._rig, self._task = setting.session, setting.rig, setting.manifest.task
        self.stimuli = {stimulus.name: stimulus for stimulus in setting.stimuli}
        self._design = setting.design
        self._trials, self._practice = order, practice
        self._order = FixedOrder(order, self._design.repeat_flagged)
        self.instructions = f"instructions_{self._task}"
        self.neutral_luminance = neutral_luminance(setting.stimuli)
        self.n_trials = self._order.n_trials
        self.trials_between_breaks: int = self._design.trials_between_breaks
        self.minutes_between_breaks: float = getattr(self._design, "minutes_between_breaks", 0.0)
        self._refresh_rate, self._is_checked = setting.rig.refresh_rate, not setting.manifest.simulated

    def row(self, planned: Planned, answer: Any, columns: dict[str, Any]) -> Any:
        """Return the record of an answered trial; the columns are those that all viewing tasks have."""
        raise NotImplementedError  # each task has its own

    def practice(self) -> Sequence[Planned]:
        """Return the trials for practice."""
        return self._practice

    def is_right(self, trial: Any) -> bool | None:
        """Return None: no answer is right or wrong."""
        return None

    def next_trial(self) -> Planned | None:
        """Return the trial that comes next, or None at the end."""
        return self._order.next_trial()

    @property
    def n_left(self) -> int:
        """Trials still to come, as far as is known."""
        return self._order.n_left

    def take(self, trial: Any) -> None:
        """Take an answered trial."""
        self._order.take(trial)

    def is_flagged(self, trial: Any) -> bool:
        """Return whether a trial is left out of the analysis."""
        return bool(trial.flag is not TrialFlag.NONE)

    def feedback(self, trial: Any, pages: Pages) -> str:
        """Return nothing: no trial is commented on."""
        return ""


class ClipTask(ViewingTask[Clips]):
    """A task of videos, with one question after each trial: the page `question_TASK`."""

    def answers(self, keys: Keys) -> dict[str, Any]:
        """Return the answer that each key gives."""
        raise NotImplementedError  # each task has its own

    def key_answers(self) -> dict[str, Any]:
        """Return the answer that each key of the rig gives, for the test of the keys."""
        return self.answers(self._rig.keys)

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        shown = 0.0
        for planned in (*self._trials, *self._practice):
            seconds = planned.seconds or self.stimuli[planned.sequence].stimulus.duration
            shown += len(planned.versions) * (seconds + self._design.adaptation_duration)
        return viewing_minutes(shown, self.n_trials)

    def prepare(self, stage: Stage) -> None:
        """Refuse videos larger than the window, and a display that drops too many of their frames."""
        require_rooms(self.stimuli.values(), stage)
        if not self._is_checked:
            return
        clips = [stimulus_clip(each, Version.OURS, 0, CHECK_SECONDS) for each in self.stimuli.values()]
        lengths = (frame_count(clip.duration, self._refresh_rate) for clip in clips)
        share = self._design.max_dropped_share
        demand = FrameDemand(tuple((n, int(share * n)) for n in lengths), "max_dropped_share")

        def show() -> ShownClip:
            stage.prepare_clip(clips[0])
            stage.wait(self._design.adaptation_duration, self.neutral_luminance)
            return stage.play(clips[0])

        require_few_drops(show, demand, self._refresh_rate)

    def conduct(
        self, planned: Clips, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> ConductedTrial:
        """Show the versions of a sequence one after the other, and ask the question of the task."""
        stimulus, seed = self.stimuli[planned.sequence], noise_seed_of(self._session, place)
        shown = []
        for number, version in enumerate(planned.versions, start=1):
            clip = stimulus_clip(stimulus, version, seed + number - 1, planned.seconds)
            if len(planned.versions) > 1:
                clip = dataclasses.replace(clip, label=str(number))
            stage.prepare_clip(clip)
            stage.wait(self._design.adaptation_duration, self.neutral_luminance)
            shown.append(stage.play(clip))
        answers = self.answers(self._rig.keys)
        participant.see_trial(planned, place.trial_index)
        question = pages.text(f"question_{self._task}", self._rig.keys)
        press = stage.ask(question, list(answers), self.neutral_luminance)
        columns = shown_columns(place, shown, seed, self._design.max_dropped_share)
        trial = self.row(planned, answers[press.name], columns | {"response_time": press.time})
        logs = (clip_log(place, number, part) for number, part in enumerate(shown, start=1))
        return ConductedTrial(trial, tuple(logs))


def viewing_minutes(shown: float, n_trials: int) -> float:
    """Return the minutes of a session that shows something for some time [s] in some trials.

    >>> viewing_minutes(440.0, 10)
    10.0
    """
    return (READING + shown + ANSWERING * n_trials) / 60


def sequences_in_order(sequences: tuple[str, ...], order_index: int) -> list[str]:
    """Return the sequences in the order of a participant."""
    return [sequences[k] for k in williams_row(len(sequences), order_index)]


def versions_in_order(
    sequences: tuple[str, ...], sequence: str, order_index: int, repetition: int
) -> tuple[Version, Version]:
    """Return the two versions of a sequence in the order in which a participant sees them."""
    # After so many participants the rows of the Williams square repeat: from then on, the other way round.
    rows = len(sequences) * (1 + len(sequences) % 2)
    rounds = order_index // rows
    ours_first = (sequences.index(sequence) + order_index + rounds + repetition - 1) % 2 == 0
    return (Version.OURS, Version.BASELINE) if ours_first else (Version.BASELINE, Version.OURS)


def practice_sequences(sequences: tuple[str, ...], n: int, seed: int, order_index: int) -> list[str]:
    """Return the sequences of practice: each once before any comes twice."""
    chance = generator_for(seed, order_index, Purpose.EXCERPTS)
    order = [int(k) for _ in range(-(-n // len(sequences))) for k in chance.permutation(len(sequences))]
    return [sequences[k] for k in order[:n]]


def noise_seed_of(session: tuple[int, int], place: TrialPlace) -> int:
    """Return the seed of the dithering noise of a trial."""
    return int(generator_for(*session, Purpose.NOISE, place.trial_index).integers(LARGEST_SEED))


def shown_columns(
    place: TrialPlace, shown: Sequence[ShownStimulus], noise_seed: int, max_dropped_share: float
) -> dict[str, Any]:
    """Return the columns of a row that say whose it is, and how it was shown."""
    refreshes = sum(len(part.flip_times) for part in shown)
    dropped = sum(part.frames_dropped for part in shown)
    too_many = dropped > max_dropped_share * (refreshes + dropped)
    return {
        "participant_id": place.participant_id,
        "session_id": place.session_id,
        "trial_index": place.trial_index,
        "simulated": place.simulated,
        "attempt": place.attempt,
        "onset": shown[0].onset,
        "noise_seed": noise_seed,
        "n_frames": refreshes,
        "frames_dropped": dropped,
        "flag": TrialFlag.DROPPED_FRAMES if too_many else TrialFlag.NONE,
    }


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
    return ClipLog(
        trial_index=place.trial_index,
        attempt=place.attempt,
        interval=interval,
        flip_times=shown.flip_times,
        video_frames=shown.video_frames,
        factors=shown.factors,
        backlight_factors=shown.backlight_factors,
        probe_refreshes=shown.probe_refreshes,
        probe_luminance=shown.probe_luminance,
        probe_intended=shown.probe_intended,
        waited=shown.waited,
    )
