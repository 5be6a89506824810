"""What a session needs of an experiment, and of its participant, so that all share one mechanism."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields
from typing import Any, Protocol, TypeVar, cast

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.data_schema.recordings.rig import Keys, Rig
from evenlight.data_schema.recordings.session import SessionManifest
from evenlight.experiments.chance import Purpose, generator_for
from evenlight.experiments.sessions.dropped_frames import ShownStimulus
from evenlight.experiments.sessions.fixed_order import FixedOrder, PlannedTrial
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.stage import Stage
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.stimuli.scenes.engine.camera import steps_to

LARGEST_SEED = 2**31
READING_TIME = 0.5  # [s] a simulated participant looks at a page
ANSWERING_TIME = (0.4, 0.9)  # [s] shortest, and mean of what comes on top (choice: practised people)
PressKey = Callable[[str, float], None]
Log = TypeVar("Log")


@dataclass(frozen=True, slots=True)
class TrialPlace:
    """Where in a data set an answered trial goes."""

    participant_id: str
    session_id: str
    trial_index: int  # place among the session's answered trials, from 0
    attempt: int  # 1, or more where the trial was shown before and interrupted
    simulated: bool  # whether a simulated observer answers


@dataclass(frozen=True, slots=True)
class ConductedTrial:
    """A trial that was shown and answered."""

    trial: Any  # its row
    frames: tuple[Any, ...]  # what the display showed, one for each interval; empty without a display


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


def shown_log(kind: type[Log], place: TrialPlace, interval: int, shown: ShownStimulus) -> Log:
    """Return what the display showed of an interval, as a record of a kind with fields of the same names."""
    made: Any = kind
    names, there = ({field.name for field in fields(each)} for each in (made, cast(Any, shown)))
    same = {name: getattr(shown, name) for name in names & there}
    log: Log = made(trial_index=place.trial_index, attempt=place.attempt, interval=interval, **same)
    return log


@dataclass(frozen=True, slots=True)
class PracticeRule:
    """When practice ends before its last trial: after a round with enough right answers."""

    trials: int  # of a round
    correct: int  # answers of a round that must be right

    def passed(self, right: Sequence[bool | None]) -> bool:
        """Return whether the last of the answers so far end a round that has enough right ones.

        >>> PracticeRule(trials=2, correct=2).passed([False, True, True, True])
        True
        """
        ends = bool(right) and len(right) % self.trials == 0
        return ends and sum(map(bool, right[-self.trials :])) >= self.correct


class Participant:
    """Who sits at the keys: a person, of whom the program knows nothing; or a simulated observer."""

    def see_page(self, keys: Sequence[str]) -> None:
        """Be shown a page that waits for one of some keys, the usual one first."""

    def see_trial(self, planned: Any, trial_index: int) -> None:
        """Have been shown a trial, right before the question."""

    def begin_search(self, planned: Any, trial_index: int) -> None:
        """Be about to search a scene."""


class Task:
    """An experiment: its trials in order, how one is conducted, and what is said about it.

    A task has `conduct`, and what it needs of `minutes`, `prepare`, `is_right`, `feedback`, `key_answers` and
    `row`. One whose next trial depends on the answers so far hands in an order of its own.

    Parameters
    ----------
    setting : SessionSetting
        What the session is made from.
    order, practice : sequence of PlannedTrial
        Those of the session, and those for practice, in their order.
    neutral_luminance : float
        Of pages, and of uniform fields that are no stimulus [cd/m^2].

    Attributes
    ----------
    n_trials : int
        Usable trials that the design asks for.
    instructions : str
        Name of the page with the instructions.
    seconds : float
        How long a trial may take at most; 0 where it has no limit [s].
    trials_between_breaks, minutes_between_breaks : int, float
        Whichever is over first brings a break; 0 for none.
    practice_rule : PracticeRule or None
        When practice is passed; None where all trials for practice are shown, whatever the answers.
    """

    seconds = 0.0
    practice_rule: PracticeRule | None = None

    def __init__(
        self,
        setting: SessionSetting,
        order: FixedOrder | Sequence[PlannedTrial],
        practice: Sequence[PlannedTrial] = (),
        *,
        neutral_luminance: float,
    ) -> None:
        self.setting, self.design, self.rig = setting, setting.design, setting.rig
        self._practice = practice
        if not isinstance(order, FixedOrder):
            order = FixedOrder(order, getattr(self.design, "repeat_flagged", True))
        self._order = order
        self.n_trials = self._order.n_trials
        self.neutral_luminance = neutral_luminance
        self.name = setting.manifest.task
        self.instructions = f"instructions_{self.name}"
        self.trials_between_breaks: int = getattr(self.design, "trials_between_breaks", 0)
        self.minutes_between_breaks: float = getattr(self.design, "minutes_between_breaks", 0.0)

    @property
    def minutes(self) -> float:
        """How long the session takes, about."""
        raise NotImplementedError  # each task has its own

    def conduct(
        self, planned: PlannedTrial, place: TrialPlace, stage: Stage, participant: Participant, pages: Pages
    ) -> ConductedTrial:
        """Show a trial and take the answer. Raises `PausePressed` if the pause key was pressed."""
        raise NotImplementedError  # each task has its own

    def row(self, planned: PlannedTrial, answer: Any, columns: dict[str, Any]) -> Any:
        """Return the record of an answered trial; the columns are those of `shown_columns`, and the time.

        `evenlight simulate` makes trials with it.
        """
        raise InputError(f"the task {self.name!r} has no method row, which simulations need")

    def prepare(self, stage: Stage) -> None:
        """Make ready what takes long, and refuse what the stage cannot show; before the session begins.

        A session with a person tries the design's own stimulus, and refuses a display that drops its frames.

        Raises
        ------
        InputError
            If something cannot be shown.
        """

    def key_answers(self) -> dict[str, Any]:
        """Return the answer that each key gives, for the test of the keys; none for no test."""
        return {}

    def is_right(self, trial: Any) -> bool | None:
        """Return whether a trial was answered rightly, None where no answer is right or wrong."""
        return None

    def feedback(self, trial: Any, pages: Pages) -> str:
        """Return what a participant is told about a trial of practice; empty for nothing."""
        return ""

    def is_flagged(self, trial: Any) -> bool:
        """Return whether a trial is left out of the analysis."""
        return bool(trial.flag is not TrialFlag.NONE)

    def practice(self) -> Sequence[PlannedTrial]:
        """Return the trials for practice, of all rounds."""
        return self._practice

    def next_trial(self) -> PlannedTrial | None:
        """Return the trial to be shown next, or None at the end; the same until `take` is called."""
        return self._order.next_trial()

    def take(self, trial: Any) -> None:
        """Take an answered trial, just given or read from an interrupted session."""
        self._order.take(trial)

    @property
    def n_left(self) -> int:
        """Trials still to come, as far as is known."""
        return self._order.n_left

    def noise_seed(self, place: TrialPlace) -> int:
        """Return the seed of the dithering noise of a trial."""
        chance = generator_for(*self.setting.session, Purpose.NOISE, place.trial_index)
        return int(chance.integers(LARGEST_SEED))


class Answers(Protocol):
    """What a simulated observer answers in the trials of one session."""

    def key(self, planned: Any, trial_index: int) -> str:
        """Return the key that is pressed when a trial is asked about."""

    def search_time(self, planned: Any, trial_index: int) -> float | None:
        """Return when a ring is found, since the scene appeared [s]; None if it is not."""


AnswersOf = Callable[[tuple[int, int]], Answers]  # for the seed and place of a session, which come last


@dataclass(frozen=True, slots=True)
class SessionSetting:
    """What a session is made from, beside its manifest."""

    manifest: SessionManifest  # design, display, seed, place in the data set
    rig: Rig  # what it runs on now
    stimuli: Sequence[LoadedStimulus] = ()  # of a viewing experiment
    smallest_factor: float = 0.0  # the lowest that the backlight can be asked for

    @property
    def session(self) -> tuple[int, int]:
        """Seed, and place in the data set."""
        return self.manifest.provenance.seed or 0, self.manifest.order_index

    @property
    def display(self) -> Display:
        """The display; a session that is run has one."""
        return cast("Display", self.manifest.display)

    @property
    def design(self) -> Any:
        """The design, of the task's class; a session that is run has one."""
        return self.manifest.design


class SimulatedParticipant(Participant):
    """A simulated observer at the keys.

    Parameters
    ----------
    answers : Answers
        What the observer answers: functions of the trial and its place, so that a session that was
        interrupted goes on exactly as it would have.
    press : callable
        Presses a key, by name, after a time [s].
    keys : Keys
        Which key means what.
    session : (int, int)
        Seed of the session and place of the participant, of which response times are functions.
    """

    def __init__(self, answers: Answers, press: PressKey, keys: Keys, session: tuple[int, int]) -> None:
        self._answers, self._press, self._keys, self._session = answers, press, keys, session

    def see_page(self, keys: Sequence[str]) -> None:
        """Read a page and press the usual key."""
        self._press(keys[0], READING_TIME)

    def see_trial(self, planned: Any, trial_index: int) -> None:
        """Press the key of the answer, a while after the question will be there."""
        shortest, mean = ANSWERING_TIME
        rng = generator_for(*self._session, Purpose.ANSWERING_TIMES, trial_index)
        self._press(self._answers.key(planned, trial_index), shortest + float(rng.exponential(mean)))

    def begin_search(self, planned: Any, trial_index: int) -> None:
        """Turn to the ring by then, and press the key when it will be found, if it will."""
        after = self._answers.search_time(planned, trial_index)
        if after is not None:
            turns = self._turns_to(planned)
            for k, key in enumerate(turns, start=1):
                self._press(key, after * k / (len(turns) + 1))
            self._press(self._keys.found, after)

    def _turns_to(self, planned: Any) -> list[str]:
        columns, keys = planned.columns, self._keys
        right, up = steps_to(columns["ring_azimuth"], columns["ring_altitude"], planned.camera.altitude)
        sideways = keys.turn_right if right > 0 else keys.turn_left
        return [sideways] * abs(right) + [keys.turn_up if up > 0 else keys.turn_down] * abs(up)
