"""A display that drops frames: refused before the session, stopped in its first trials, capped in all."""

import dataclasses
from collections.abc import Callable
from functools import cache
from pathlib import Path

import conducted_sessions as course
import numpy as np
import pytest
from example_tracks import example_track
from ramp_tasks import ramp_task

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.provenance import Provenance
from evenlight.data_schema.recordings.ramp import IntervalGap, Procedure, RampDesign, TrialFlag
from evenlight.data_schema.recordings.session import EventKind, SessionManifest, SessionStatus
from evenlight.data_schema.recordings.viewing import RatingDesign, Stimulus
from evenlight.experiments.run_command import _close
from evenlight.experiments.run_session import SessionOutcome
from evenlight.experiments.sessions.dropped_frames import FrameDemand, require_few_drops, too_many_flagged
from evenlight.experiments.sessions.session_store import resume_session
from evenlight.experiments.sessions.task import SessionSetting
from evenlight.experiments.stage import (
    Clip,
    PausePressed,
    RampInterval,
    SessionStopped,
    ShownClip,
    ShownInterval,
)
from evenlight.experiments.stimulus_folder import LoadedStimulus
from evenlight.experiments.viewing.rating_task import RatingTask

# 20 frames of which none may be dropped: flagged with probability 1 - (1 - p)^20.
DEMAND = FrameDemand(((20, 0),), "max_dropped_frames")
DESIGN = RampDesign(
    procedure=Procedure.TWO_INTERVAL, screens=("white",), factors=(0.5,), relative_rates=(0.01, 0.04),
    interval_gap_kind=IntervalGap.STEADY, fixation_mark=True,
)  # fmt: skip


def shown(dropped: int, frames: int = 100, period: float = 0.02, longest: float = 0.05) -> ShownInterval:
    times = (*(period * k for k in range(frames - 1)), period * (frames - 2) + longest)
    return ShownInterval(0.0, times, (50.0,) * frames, frames_dropped=dropped)


def test_the_share_of_flagged_trials_is_binomial_and_averaged_over_their_kinds() -> None:
    """At one frame of ten: 1 - 0.9^2 = 0.19 of two frames, 1 - 0.9^3 - 3 · 0.1 · 0.9^2 = 0.028 of three."""
    assert FrameDemand(((2, 0),), "").flagged_share(1, 10) == pytest.approx(0.19)
    assert FrameDemand(((2, 0), (3, 1)), "").flagged_share(1, 10) == pytest.approx((0.19 + 0.028) / 2)
    assert FrameDemand(((3, 3),), "").flagged_share(5, 10) == 0.0  # no trial has more than three frames


def test_a_window_that_drops_frames_is_refused_with_the_numbers_and_what_to_do() -> None:
    """4 of 104: 1 - (100/104)^20 = 54 % of the trials would be flagged."""
    with pytest.raises(InputError) as refused:
        require_few_drops(lambda: shown(4), DEMAND, refresh_rate=50.0)
    told = str(refused.value)
    assert (
        "4 of 104 frames in 2.1 s (measured 50.0 Hz, the longest frame 50 ms), with 50 Hz in the rig" in told
    )
    assert "54% of the trials would be flagged, and at most 25% may be: close other programs" in told
    assert told.endswith("or raise max_dropped_frames in the design")
    assert "\n" not in told


def test_few_drops_pass_and_one_hiccup_is_forgiven_where_a_second_showing_has_none() -> None:
    """1 of 101: 1 - (100/101)^20 = 18 %."""
    require_few_drops(lambda: shown(1), DEMAND, refresh_rate=50.0)
    showings = iter([shown(30), shown(0)])
    require_few_drops(lambda: next(showings), DEMAND, refresh_rate=50.0)
    assert not list(showings)


@pytest.mark.parametrize(
    ("pressed", "by"),
    [(PausePressed(), "the pause key"), (SessionStopped("by the operator"), "the operator")],
)
def test_a_key_ends_the_check_in_one_line(pressed: Exception, by: str) -> None:
    def interrupted() -> ShownInterval:
        raise pressed

    with pytest.raises(InputError, match=f"interrupted by {by}; start again"):
        require_few_drops(interrupted, DEMAND, refresh_rate=50.0)


class Trying(course.Stage):
    """Notes the intervals that are shown, each with so many frames dropped."""

    def __init__(self, dropped: int) -> None:
        super().__init__({})
        self.dropped, self.tried = dropped, list[RampInterval]()

    def show_ramp(self, interval: RampInterval) -> ShownInterval:
        self.tried.append(interval)
        return dataclasses.replace(super().show_ramp(interval), frames_dropped=self.dropped)


def test_a_ramp_session_tries_two_seconds_of_its_fastest_ramp() -> None:
    """4 % per second from 50 cd/m^2: 46 after 2 s, of the 5 s that it lasts."""
    stage = Trying(dropped=0)
    ramp_task(DESIGN, course.DISPLAY, course.RIG, simulated=False).prepare(stage)
    (tried,) = stage.tried
    assert (tried.initial_luminance, tried.final_luminance) == (pytest.approx(50.0), pytest.approx(46.0))
    assert (tried.adaptation, tried.duration, tried.hold) == (0.0, 2.0, 0.0)
    assert tried.mark_contrast == pytest.approx(-0.2)


def test_a_trial_of_14_s_is_flagged_by_more_than_3_of_840_frames_so_one_in_120_is_too_many() -> None:
    """7 are to be expected, and more than 3 come in 92 % of the trials (Poisson: 1 - 0.082)."""
    with pytest.raises(InputError, match=r"1 of 121 frames in 2.0 s .* so 92% of the trials"):
        ramp_task(DESIGN, course.DISPLAY, course.RIG, simulated=False).prepare(Trying(dropped=1))


def test_a_rehearsal_is_not_checked() -> None:
    stage = Trying(dropped=60)
    ramp_task(DESIGN, course.DISPLAY, course.RIG).prepare(stage)
    assert stage.tried == []


@pytest.mark.parametrize(
    ("flagged", "trials", "stops"),
    # Of k flagged of n, the mean of p^k (1 - p)^(n - k) over p from 0.25 to 1, against p = 0.25:
    # 4 of 5: 1/30 (1 - 0.0046) / 0.75 = 0.0442 against 0.00293, 15 times; 5 of 5: 0.222 against 0.00098.
    [(4, 4, False), (4, 5, False), (5, 5, True), (6, 10, False), (7, 10, True), (0, 5, False)],
)
def test_a_session_stops_where_surely_more_than_a_quarter_of_the_trials_are_flagged(
    flagged: int, trials: int, stops: bool
) -> None:
    assert too_many_flagged([True] * flagged + [False] * (trials - flagged)) is stops


@pytest.mark.parametrize(("share", "fewest", "most"), [(0.2, 0, 10), (0.25, 0, 25), (0.5, 500, 500)])
def test_over_a_long_session_a_display_that_is_accepted_rarely_stops_it(
    share: float, fewest: int, most: int
) -> None:
    """Of 500 sessions of 600 trials with just the accepted share, looked at after each, at most 5 %."""
    counts = np.cumsum(np.random.default_rng(1).random((500, 600)) < share, axis=1)
    too_many = cache(lambda n, k: too_many_flagged([True] * k + [False] * (n - k)))
    stopped = sum(any(too_many(n, int(k)) for n, k in enumerate(row, start=1)) for row in counts)
    assert fewest <= stopped <= most


EIGHT = dataclasses.replace(course.DESIGN, catch_share=0.0, repetitions=8)  # 16 ramps


def everything(happens: Callable[[ShownInterval], ShownInterval]) -> course.Stage:
    return course.Stage(dict.fromkeys(range(1000), happens))


def test_a_display_that_drops_frames_in_every_trial_stops_the_session_after_five(tmp_path: Path) -> None:
    store = course.begun(tmp_path / "lab", EIGHT)
    stage = everything(course.drop_ten_frames)
    assert course.conducted(store, stage, design=EIGHT) is SessionStatus.ABORTED
    assert len(store.trials) == 5
    assert any("In 5 of 5 trials the display skipped too many frames" in page for page in stage.pages)
    assert store.events[-1].kind is EventKind.STOPPED
    assert "5 of 5 trials had too many dropped frames: close other programs" in store.events[-1].detail


def test_what_was_stopped_goes_on_with_a_better_display_and_shows_a_quarter_again(tmp_path: Path) -> None:
    """16 trials, 5 of them flagged before: a quarter of 16 are shown again."""
    course.conducted(course.begun(tmp_path / "lab", EIGHT), everything(course.drop_ten_frames), design=EIGHT)
    store = resume_session(tmp_path / "lab", "01", "01", utc=str)
    assert course.conducted(store, course.Stage({}), design=EIGHT) is SessionStatus.COMPLETE
    flags = [trial.flag for trial in store.trials]
    assert flags == [TrialFlag.DROPPED_FRAMES] * 5 + [TrialFlag.NONE] * (11 + 4)


class Cinema(course.Stage):
    """Plays clips of 2 s with so many refreshes dropped."""

    def __init__(self, dropped: int) -> None:
        super().__init__({})
        self.dropped, self.played = dropped, list[Clip]()

    def play(self, clip: Clip) -> ShownClip:
        self.played.append(clip)
        return dataclasses.replace(super().play(clip), frames_dropped=self.dropped)


def rating(tmp_path: Path, *, simulated: bool) -> RatingTask:
    """A session with one sequence of 10 s at 1 Hz, at full brightness."""
    track = example_track(np.ones(10), 1.0, mean_luminance=10.0, rate_limit=1.0, power=1.0)
    stimulus = LoadedStimulus(Stimulus("v", "", "0" * 64, 10, 10.0, 1.0, 0.5), tmp_path, track)
    manifest = SessionManifest(
        "01", "01", "rating", simulated, SessionStatus.RUNNING, 2, course.DISPLAY, RatingDesign(("v",)),
        Provenance(seed=1),
    )  # fmt: skip
    return RatingTask(SessionSetting(manifest, course.RIG, (stimulus,)))


def test_a_viewing_session_tries_two_seconds_of_a_sequence(tmp_path: Path) -> None:
    """1 % of 600 refreshes, 6, may be dropped: 4 of 124 in 2 s make 19 in 10 s."""
    stage = Cinema(dropped=0)
    rating(tmp_path, simulated=False).prepare(stage)
    assert [clip.seconds for clip in stage.played] == [2.0]
    told = "4 of 124 frames .* so 100% of the trials .* or raise max_dropped_share"
    with pytest.raises(InputError, match=told):
        rating(tmp_path, simulated=False).prepare(Cinema(dropped=4))
    rating(tmp_path, simulated=True).prepare(Cinema(dropped=60))


def test_the_terminal_says_why_a_session_stopped(capsys: pytest.CaptureFixture[str]) -> None:
    _close(SessionOutcome(SessionStatus.ABORTED, 1, 300, 4, Path("lab"), "4 of 5 had too many"))
    words = "stopped after 1 of 300 trials, 4 flagged in lab: 4 of 5 had too many; go on with --resume\n"
    assert capsys.readouterr().err == f"evenlight: {words}"
