"""One session from consent to thanks: pages, practice, trials, breaks, pauses; the same for every task."""

from __future__ import annotations

import dataclasses
import gc
import json
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import provenance_now
from evenlight.data_schema.recordings.ramp import TrialFlag
from evenlight.data_schema.recordings.rig import Keys
from evenlight.data_schema.recordings.session import EventKind, SessionStatus
from evenlight.experiments.headset.frame_logs import headset_logs
from evenlight.experiments.sessions.dropped_frames import WHAT_TO_DO, drop_counts, too_many_flagged
from evenlight.experiments.sessions.key_test import try_keys
from evenlight.experiments.sessions.pages import Pages
from evenlight.experiments.sessions.session_store import SessionStore
from evenlight.experiments.sessions.task import Participant, Task, TrialPlace
from evenlight.experiments.stage import PausePressed, SessionStopped, SkipPressed, Stage


@contextmanager
def no_garbage_collected() -> Iterator[None]:
    """Let Python collect no garbage meanwhile: that takes longer than a frame lasts."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()


@dataclass(frozen=True, slots=True)
class SessionParts:
    """Who and what takes part in a session."""

    task: Task  # the experiment
    stage: Stage  # where it is shown
    participant: Participant  # who answers
    pages: Pages  # what is said
    keys: Keys  # what is pressed


def conduct_session(
    store: SessionStore,
    parts: SessionParts,
    report: Callable[[int], None] = lambda usable: None,
) -> SessionStatus:
    """Conduct a session, new or resumed, and return how far it got.

    Parameters
    ----------
    store : SessionStore
        Its files; the trials already in it are not shown again.
    parts : SessionParts
        Who and what takes part.
    report : callable, optional
        Called with the usable trials so far, before the first and after each one, practice included.
    """
    session = _Session(store, parts, report)
    store.use_clock(parts.stage.now)
    if not store.manifest.apparatus:
        store.describe(parts.stage.apparatus())
    _note_changes(store, parts)
    try:
        status = session.run()
    except SessionStopped as stopped:
        store.note(EventKind.STOPPED, str(stopped))
        status = SessionStatus.ABORTED
    except BaseException as error:
        # Whatever ends the program, the log says so if it still can be written; what ended it is told anyway.
        with suppress(InputError):
            store.note_failure(error)
            store.finish(SessionStatus.ABORTED)
        raise
    store.finish(status)
    return status


def _note_changes(store: SessionStore, parts: SessionParts) -> None:
    """Note what is not as the manifest of a resumed session says: devices, software, pages."""
    manifest = store.manifest
    keys = manifest.rig.keys if manifest.rig else parts.keys
    now = {
        "keys": repr(parts.keys),
        **{f"apparatus: {key}": value for key, value in parts.stage.apparatus().items()},
        **{f"page {name}": digest for name, digest in parts.pages.digests.items()},
        "software_revision": provenance_now().software_revision,
    }
    then = {
        "keys": repr(keys),
        **{f"apparatus: {key}": value for key, value in manifest.apparatus.items()},
        **{f"page {name}": digest for name, digest in manifest.pages.items()},
        "software_revision": manifest.provenance.software_revision,
    }
    changed = {key: value for key, value in now.items() if then.get(key) != value}
    if changed and store.happened(EventKind.RESUMED):
        store.note(EventKind.CHANGED, json.dumps(changed))


class _Session:
    """The course of one session."""

    def __init__(self, store: SessionStore, parts: SessionParts, report: Callable[[int], None]) -> None:
        self.store, self.parts, self._report = store, parts, report
        self._practised = sum(trial.practice for trial in store.trials)
        for trial in store.trials:
            if not trial.practice:
                parts.task.take(trial)
        self._earlier = len(store.trials)
        usable, every = self._usable(), parts.task.trials_between_breaks
        # The last break: usable trials then, and when it was [s], once trials begin.
        self._rested = usable - (usable % every if every else 0), 0.0

    def run(self) -> SessionStatus:
        """Show everything that is left of the session."""
        resumed = self.store.happened(EventKind.CONSENT_GIVEN)
        if not resumed:
            self.store.note(EventKind.STARTED)
            if not self._consent():
                return SessionStatus.DECLINED
        begun = any(not trial.practice for trial in self.store.trials)
        if resumed:
            self._page("resume")  # on another day, perhaps at other keys
        try_keys(self.parts, self.store.note, self._pause)
        if not begun:
            self._practise()
        self._report(self._usable())
        self._rested = self._rested[0], self.parts.stage.now()
        while (planned := self.parts.task.next_trial()) is not None:
            self._rest()
            trial = self._trial(planned)
            self.parts.task.take(trial)
            self._report(self._usable())
        self._page("end")
        self.store.note(EventKind.COMPLETED)
        return SessionStatus.COMPLETE

    def _consent(self) -> bool:
        """Ask for consent; the pause key declines."""
        keys = (self.parts.keys.proceed, self.parts.keys.pause)
        agreed = self._shown("consent", keys) == self.parts.keys.proceed
        self.store.note(EventKind.CONSENT_GIVEN if agreed else EventKind.CONSENT_DECLINED)
        return agreed

    def _practise(self) -> None:
        """Give the instructions, and the trials for practice that are left, with feedback."""
        task, rule = self.parts.task, self.parts.task.practice_rule
        self._page(task.instructions)
        for planned in task.practice()[self._practised :]:
            answers = self._practice_answers()
            if rule and rule.passed(answers):
                break
            if rule and answers and len(answers) % rule.trials == 0:
                self._page("practice_again", **self._practice_result())
            trial = self._trial(planned)
            self._report(self._usable())
            if told := task.feedback(trial, self.parts.pages):
                self._page_of_text("feedback", told)
        answers = self._practice_answers()
        if rule:
            result = self._practice_result()
            words = "passed" if rule.passed(answers) else "not passed"
            self.store.note(
                EventKind.PRACTISED,
                "{}: {right} of {practised} right, {wanted} needed".format(words, **result),
            )
            if not rule.passed(answers):
                self._page("practice_failed", **result)
        if answers:
            self._page("practice_end")

    def _practice_answers(self) -> list[bool | None]:
        return [self.parts.task.is_right(trial) for trial in self.store.trials if trial.practice]

    def _practice_result(self) -> dict[str, int]:
        """Return how many answers of the practice, or of its last round, were right, and how many must be."""
        answers, rule = self._practice_answers(), self.parts.task.practice_rule
        begun = (len(answers) - 1) // rule.trials * rule.trials if rule and answers else 0
        last = answers[begun:]
        wanted = rule.correct if rule else 0
        return {"right": sum(map(bool, last)), "practised": len(last), "wanted": wanted}

    def _rest(self) -> None:
        """Take a break where one is due: after some trials or some minutes, whichever is first."""
        task, now = self.parts.task, self.parts.stage.now()
        trials, seconds = self._usable() - self._rested[0], now - self._rested[1]
        by_trials = 0 < task.trials_between_breaks <= trials
        if by_trials or 0 < 60 * task.minutes_between_breaks <= seconds:
            self._page("break")
            self._rested = self._usable(), self.parts.stage.now()

    def _trial(self, planned: Any) -> Any:
        while True:
            place = self._place()
            self.store.note(EventKind.TRIAL_BEGUN, trial_index=place.trial_index, attempt=place.attempt)
            try:
                self.parts.stage.seen_in_headset()  # what was shown before is no part of this trial
                with self._triggers_noted(place.trial_index, place.attempt), no_garbage_collected():
                    done = self.parts.task.conduct(
                        planned, place, self.parts.stage, self.parts.participant, self.parts.pages
                    )
            except PausePressed as pressed:
                words = f"{pressed}; it is shown again"
                self.store.note(EventKind.TRIAL_INTERRUPTED, words, place.trial_index, place.attempt)
                self._write_in_headset(place)
                if not isinstance(pressed, SkipPressed):
                    self._pause()
                continue
            onset = self.store.since_beginning(done.trial.onset)
            trial = dataclasses.replace(done.trial, onset=onset)
            self._write_in_headset(place)
            self.store.write_trial(trial, done.frames)
            if self.parts.task.is_flagged(trial):
                detail = trial.flag.value
                self.store.note(EventKind.TRIAL_FLAGGED, detail, place.trial_index, place.attempt)
                self._require_frames()
                self._warn_of_drops()
            return trial

    def _write_in_headset(self, place: TrialPlace) -> None:
        """Record what a headset showed in each interval of a trial; nothing outside a headset."""
        self.store.write_in_headset(headset_logs(place, self.parts.stage, self.store.since_beginning))

    def _warn_of_drops(self) -> None:
        """Tell the experimenter of dropped frames: of the first trials flagged, and ever less often."""
        counts = drop_counts(self._now_shown())
        if counts and counts["flagged"].bit_count() == 1:  # 1, 2, 4, 8, ...
            where = "in {flagged} of {answered} trials, {dropped} of {frames} in one".format(**counts)
            print(f"evenlight: the display dropped too many frames {where}: {WHAT_TO_DO}", file=sys.stderr)

    def _now_shown(self) -> list[Any]:
        return self.store.trials[self._earlier :]

    def _require_frames(self) -> None:
        """Stop the session if its trials, since it began or went on, show that the display is too slow."""
        flags = [t.flag is TrialFlag.DROPPED_FRAMES for t in self._now_shown()]
        if too_many_flagged(flags):
            self._shown_text(
                "frames_dropped",
                self._text("frames_dropped", flagged=sum(flags), answered=len(flags)),
                [self.parts.keys.proceed],
            )
            raise SessionStopped(
                f"{sum(flags)} of {len(flags)} trials had too many dropped frames: {WHAT_TO_DO}"
            )

    def _place(self) -> TrialPlace:
        manifest, index = self.store.manifest, len(self.store.trials)
        who = manifest.participant_id, manifest.session_id
        return TrialPlace(*who, index, self.store.attempt_at(index), manifest.simulated)

    def _page(self, name: str, **values: object) -> None:
        """Show a page until the participant goes on; the pause key pauses."""
        self._page_of_text(name, self._text(name, **values))

    def _page_of_text(self, name: str, text: str) -> None:
        keys = (self.parts.keys.proceed, self.parts.keys.pause)
        while self._shown_text(name, text, keys) == self.parts.keys.pause:
            self._pause()

    def _pause(self) -> None:
        """Pause; from there the pause key stops the session."""
        self.store.note(EventKind.PAUSED)
        keys = (self.parts.keys.proceed, self.parts.keys.pause)
        if self._shown("pause", keys) == self.parts.keys.pause:
            raise SessionStopped(f"with the key {self.parts.keys.pause}")
        self.store.note(EventKind.CONTINUED)

    def _shown(self, name: str, keys: Sequence[str]) -> str:
        return self._shown_text(name, self._text(name), keys)

    def _shown_text(self, name: str, text: str, keys: Sequence[str]) -> str:
        self.store.note(EventKind.PAGE_SHOWN, name)
        self._report(self._usable())
        self.parts.participant.see_page(keys)
        footer = self.parts.pages.text("footer", self.parts.keys) if name == "feedback" else ""
        with self._triggers_noted():
            return self.parts.stage.show_page(text, keys, footer).name

    def _text(self, name: str, **values: object) -> str:
        """Return a page with its numbers filled in, those of some pages handed in."""
        task, counts = self.parts.task, drop_counts(self._now_shown())
        slow = self.parts.pages.text("slow_display", self.parts.keys, **counts) if counts else ""
        mark = "mark" if getattr(self.store.manifest.design, "fixation_mark", False) else "middle"
        return self.parts.pages.text(
            self.parts.pages.name_for(name, self.store.manifest.task),
            self.parts.keys,
            minutes=max(1, round(task.minutes)),
            seconds=f"{task.seconds:g}",
            look=self.parts.pages.text(f"look_{mark}", self.parts.keys),
            trials=self._answered() + task.n_left,
            done=self._answered(),
            slow=slow,
            trials_between_breaks=task.trials_between_breaks or task.n_trials,
            **values,
        )

    def _answered(self) -> int:
        """Return how many trials of the session were answered, flagged ones too."""
        return sum(not trial.practice for trial in self.store.trials)

    def _usable(self) -> int:
        return sum(trial.usable for trial in self.store.trials)

    @contextmanager
    def _triggers_noted(self, trial_index: int | None = None, attempt: int | None = None) -> Iterator[None]:
        """Note the triggers that a block sends at its end, for writing takes time that frames need."""
        try:
            yield
        finally:
            for sent in self.parts.stage.triggers_sent():
                self.store.note_trigger(sent, trial_index, attempt)
                for failure in sent.failures:
                    print(f"evenlight: {failure}; no more triggers go there", file=sys.stderr)
