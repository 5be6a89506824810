"""The live view: what it tells of a session is what its files hold, as they grow; and it disturbs nothing."""

import dataclasses
import io
import json
import os
import shutil
import threading
import time
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from blind_sessions import SMALL, arguments, rows, written
from rich.console import Console

from evenlight.analysis.calibration.psychometric.thresholds import fit_thresholds_of
from evenlight.data_schema.recordings.dataset_layout import EVENTS, MANIFEST, TRIALS
from evenlight.data_schema.recordings.ramp import (
    Direction,
    Procedure,
    RampDesign,
    TrialFlag,
    trial_seconds,
)
from evenlight.data_schema.recordings.session import EventKind, SessionEvent, SessionStatus
from evenlight.data_schema.recordings.viewing import RatingTrial, Version
from evenlight.experiments import live_view as module
from evenlight.experiments.design_files import load_design
from evenlight.experiments.live_view import (
    LevelSoFar,
    SessionSoFar,
    ThresholdsSoFar,
    in_words,
    live_view,
    watch_session,
)
from evenlight.experiments.ramp.ramp_observer import SimulatedObserver
from evenlight.experiments.ramp.ramp_viewing import RampViewing
from evenlight.experiments.ramp.simulate_ramp import answered_session
from evenlight.method.preset_files import load_display

DISPLAY = load_display("varjo-xr3")


@pytest.fixture
def lab(command: Callable[..., Any], tmp_path: Path) -> Path:
    """A complete rehearsal of ten trials after two for practice."""
    assert command(*arguments(tmp_path / "lab", written(SMALL, tmp_path))).code == 0
    return tmp_path / "lab"


def session_of(lab: Path) -> Path:
    return lab / "sub-01/ses-01"


def cut(lab: Path, n: int) -> None:
    """Make of a complete session what it was when its trial number `n` had just begun."""
    folder = session_of(lab)
    kept = [line for line in rows(lab, TRIALS) if line["trial_index"] < n]
    (folder / TRIALS).write_text("".join(json.dumps(line) + "\n" for line in kept))
    kept = []
    for event in rows(lab, EVENTS):
        kept.append(event)
        if event["kind"] == "trial_begun" and event["trial_index"] == n:
            break
    (folder / EVENTS).write_text("".join(json.dumps(line) + "\n" for line in kept))
    manifest = json.loads((folder / MANIFEST).read_text()) | {"status": "running"}
    (folder / MANIFEST).write_text(json.dumps(manifest))


def so_far(lab: Path) -> SessionSoFar:
    return SessionSoFar(session_of(lab))


# Thresholds


@pytest.mark.parametrize("procedure", list(Procedure))
def test_the_thresholds_so_far_are_those_of_the_fit(procedure: Procedure) -> None:
    """The same prior and answers on a coarser grid: within a third of the fit's own standard error."""
    design = RampDesign(procedure=procedure, factors=(0.4, 1.0), screens=("white",), repetitions=8)
    trials = answered(design, participants=2)
    for who in ("01", "02"):
        own = [trial for trial in trials if trial.participant_id == who]
        shown = {level.level[1]: level for level in levels_after(design, own)}
        for fit in fit_thresholds_of(own, judge=False):
            level = shown[fit.threshold.factor]
            off = np.log(level.threshold / fit.threshold.threshold) / fit.threshold.standard_error_ln
            assert abs(off) < 1 / 3
            assert level.ci_low < fit.threshold.threshold < level.ci_high
            assert level.n_ramps == 64


def test_the_intervals_hold_the_true_thresholds_as_often_as_they_say() -> None:
    """100 intervals of 95 %: binomial SD 2.2 %, so 88 % is three of them below. Levels of one person share
    their guess rate alone."""
    design = load_design("yes_no_targeted")
    held = []
    for k in range(10):
        observer, trials = simulated(design, k)
        for level in levels_after(design, trials):
            truth = observer.function_at(level.luminance, design.procedure, *level.level[2:]).threshold
            held.append(level.ci_low <= truth <= level.ci_high)
    assert len(held) == 100
    assert np.mean(held) >= 0.88


def test_an_adaptive_session_is_told_what_its_placement_believes() -> None:
    """Rates that are candidates fall on the nodes of the schedule's own grid."""
    design = dataclasses.replace(load_design("recommended"), factors=(0.4, 1.0), trials_per_level=12)
    trials = answered(design, participants=1)
    thresholds = ThresholdsSoFar(design)
    low, high = min(design.relative_rates), max(design.relative_rates)
    for trial in trials:
        thresholds.take(trial)
        place = np.log(trial.rate / trial.initial_luminance / low) / thresholds._grid.step
        assert place == pytest.approx(round(place), abs=1e-6)
    assert thresholds._grid.step == pytest.approx(np.log(high / low) / 26)


def test_flagged_and_practice_trials_do_not_count_towards_a_threshold() -> None:
    design = dataclasses.replace(SMALL, practice_trials=0)
    (trial,) = answered(design, participants=1)[:1]
    thresholds = ThresholdsSoFar(design)
    thresholds.take(dataclasses.replace(trial, practice=True))
    thresholds.take(dataclasses.replace(trial, flag=TrialFlag.DROPPED_FRAMES))
    assert thresholds.levels() == []


def simulated(design: RampDesign, order_index: int) -> tuple[SimulatedObserver, list[Any]]:
    viewing, session = RampViewing(design, DISPLAY), (5, order_index)
    observer = viewing.person_of(session)
    return observer, answered_session(viewing, session, f"{order_index + 1:02d}", observer)


def answered(design: RampDesign, participants: int) -> list[Any]:
    return [trial for k in range(participants) for trial in simulated(design, k)[1]]


def levels_after(design: RampDesign, trials: list[Any]) -> list[Any]:
    thresholds = ThresholdsSoFar(design)
    for trial in trials:
        thresholds.take(trial)
    return thresholds.levels()


# Counts and times


def test_a_rehearsal_is_told_as_its_files_have_it(lab: Path) -> None:
    session = so_far(lab)
    assert in_words(session)[1] == "10 of 10 trials; complete"
    assert (len(session.usable), session.flagged) == (10, 0)
    catches = [t["response"] == "yes" for t in rows(lab) if t["is_catch"] and not t["practice"]]
    assert in_words(session)[3] == f"false alarms: {sum(catches)} of {len(catches)}"
    assert sum(level.n_ramps for level in session.thresholds.levels()) == 8


def test_a_rehearsal_that_counts_refreshes_does_not_say_that_none_was_dropped(lab: Path) -> None:
    session = so_far(lab)
    assert "frames dropped: not timed in this rehearsal" in "\n".join(in_words(session))
    session.manifest = dataclasses.replace(session.manifest, apparatus={"clock": "computer"})
    session.trials[3] = dataclasses.replace(session.trials[3], frames_dropped=7)
    assert "frames dropped: in 1 trials" in "\n".join(in_words(session))


def test_a_session_in_its_midst_is_told_with_what_goes_on(lab: Path) -> None:
    """Two for practice, then four of ten."""
    cut(lab, 2 + 4)
    session = so_far(lab)
    assert (len(session.usable), session.ended) == (4, False)
    assert in_words(session)[1].startswith("4 of 10 trials, about ")


def test_the_time_left_of_a_rehearsal_that_counts_refreshes_is_that_of_its_clock(lab: Path) -> None:
    """It may take longer: the case reported had 33 s left, and took 110."""
    cut(lab, 2 + 4)
    session = so_far(lab)
    assert in_words(session)[1].endswith(" s left on the session's own clock")
    session.manifest = dataclasses.replace(session.manifest, apparatus={"clock": "computer"})
    assert in_words(session)[1].endswith(" s left")


def test_a_session_from_which_nothing_comes_is_told_until_it_ends(lab: Path) -> None:
    def left_alone() -> str:
        """Its files as if written five minutes ago."""
        for path in session_of(lab).iterdir():
            os.utime(path, (time.time() - 300,) * 2)
        return in_words(so_far(lab))[1]

    assert left_alone() == "10 of 10 trials; complete"
    cut(lab, 2 + 4)
    assert "nothing new" not in in_words(so_far(lab))[1]
    assert left_alone().endswith("; nothing new for 5 min: does it still run?")


class HandMade(SessionSoFar):
    """A session of 20 trials of 10 s each, of which some are answered."""

    def __init__(self, done: int) -> None:
        self.manifest: Any = SimpleNamespace(
            task="rating",
            participant_id="01",
            session_id="01",
            simulated=False,
            status=SessionStatus.RUNNING,
            n_trials=20,
            design=SimpleNamespace(),
            apparatus={},
        )
        one = RatingTrial("01", "01", 0, "gym", Version.OURS, 1, 1, 0.5, 5, 2.0, simulated=False)
        self.trials = [dataclasses.replace(one, trial_index=k) for k in range(done)]
        begun = EventKind.TRIAL_BEGUN
        self.events = [SessionEvent(begun, 10.0 * k, trial_index=k, attempt=1) for k in range(done + 1)]
        self.thresholds = None

    silence = 0.0


def test_the_time_left_is_the_trials_left_at_the_pace_so_far() -> None:
    assert HandMade(done=0).seconds_left is None
    left = [HandMade(done).seconds_left for done in range(1, 21)]
    assert left == pytest.approx([10.0 * (20 - done) for done in range(1, 21)])


def test_a_ramp_session_knows_its_time_before_the_first_answer(lab: Path) -> None:
    """10 trials of the design's own length."""
    cut(lab, 0)
    assert so_far(lab).seconds_left == pytest.approx(10 * trial_seconds(SMALL))


def test_breaks_and_repeats_are_part_of_the_pace() -> None:
    """Of 10 trials in 100 s and a break of 30 s, 9 are usable: the 11 left take 130 / 9 s each."""
    session = HandMade(10)
    session.trials[1] = dataclasses.replace(session.trials[1], flag=TrialFlag.DROPPED_FRAMES)
    later = [dataclasses.replace(e, time=e.time + 30) for e in session.events[4:]]
    session.events = [*session.events[:4], SessionEvent(EventKind.PAGE_SHOWN, 40.0, detail="break"), *later]
    assert (len(session.usable), session.flagged) == (9, 1)
    assert session.seconds_left == pytest.approx(11 * 130 / 9)


@pytest.mark.parametrize(
    ("seen", "words"), [(0, "– above 0.500"), (4, "– below 2.00"), (2, "1.00 0.500 to 2.00")]
)
def test_of_answers_all_alike_only_a_bound_is_told(seen: int, words: str) -> None:
    """Their threshold is the prior's."""
    level = ("white", 1.0, Direction.DOWN, 5.0)
    session: Any = HandMade(1)
    known = LevelSoFar(level, 100.0, 1.0, 0.5, 2.0, 4, seen)
    session.thresholds = SimpleNamespace(latest=level, levels=lambda: [known])
    assert " ".join(in_words(session)[-2].split()) == f"white 1 * 100 {words} 4"


def test_of_a_viewing_experiment_no_answer_is_told() -> None:
    """Who knows how it goes may tell the participant: counts and times alone."""
    assert in_words(HandMade(3)) == [
        "rating, participant 01, session 01",
        "3 of 20 trials, about 3 min left",
        "0 flagged, frames dropped: in 0 trials",
    ]


# Files that grow


def test_a_line_without_its_end_waits_until_it_is_whole(lab: Path) -> None:
    path, details = session_of(lab) / EVENTS, []
    session = so_far(lab)
    before, line = (
        len(session.events),
        b'{"kind": "page_shown", "time_s": 1.0, "utc": "", "detail": "\xc3\xa4"}\n',
    )
    for part in (line[:-5], line[-5:-3], line[-3:]):  # in the midst of a letter
        with path.open("ab") as stream:
            stream.write(part)
        session.update()
        details.append([event.detail for event in session.events[before:]])
    assert details == [[], [], ["ä"]]
    path.write_bytes(b"")  # a crash tore lines off: nothing to take back
    session.update()
    assert len(session.events) == before + 1


def test_a_session_is_watched_while_it_grows(
    lab: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: Any
) -> None:
    """Trial after trial, the last line half written each time; it ends when the session does."""
    whole, folder = tmp_path / "whole", session_of(lab)
    shutil.copytree(folder, whole)
    lines = (folder / TRIALS).read_text().splitlines(keepends=True)
    cut(lab, 0)
    session, seen = SessionSoFar(folder), []
    for k, line in enumerate(lines):
        with (folder / TRIALS).open("a") as stream:
            stream.write(line[:40])
            stream.flush()
            session.update()
            before = len(session.usable)
            stream.write(line[40:])
        session.update()
        seen.append((before, len(session.usable)))
        assert len(session.trials) == k + 1
    assert seen == [(0, 0), (0, 0), *((k, k + 1) for k in range(10))]

    def end(seconds: float) -> None:
        for name in (EVENTS, MANIFEST):
            shutil.copy(whole / name, folder / name)

    monkeypatch.setattr("rich.console.Console.is_terminal", True)
    watch_session(folder, once=False, sleep=end)
    said = capsys.readouterr().out
    assert said.index("left") < said.index("complete")


# What is drawn


def test_a_session_of_ten_levels_fits_a_terminal_of_80_columns_and_24_lines(
    command: Callable[..., Any], tmp_path: Path
) -> None:
    design = dataclasses.replace(load_design("paper"), repetitions=1)
    assert command(*arguments(tmp_path / "lab", written(design, tmp_path))).code == 0
    session = so_far(tmp_path / "lab")
    levels = session.thresholds.levels()
    assert len(levels) == 10
    lines = in_words(session)
    assert len(lines) <= 24
    assert max(map(len, lines)) <= 60
    text = "\n".join(lines)
    assert "SIMULATED" in lines[0]
    for level in levels:
        if level.n_seen in (0, level.n_ramps):
            assert f"above {level.ci_low:#.3g}" in text or f"below {level.ci_high:#.3g}" in text
        else:
            assert f"{level.threshold:#.3g}" in text
            assert f"{level.ci_low:#.3g} to {level.ci_high:#.3g}" in text


def test_of_several_kinds_of_ramp_the_levels_of_the_present_one_are_told() -> None:
    design = dataclasses.replace(SMALL, ramp_durations=(0.5, 2.0), practice_trials=0)
    session: Any = HandMade(1)
    session.thresholds = ThresholdsSoFar(design)
    trials = [trial for trial in answered(design, participants=1) if not trial.is_catch]
    for trial in trials:
        session.thresholds.take(trial)
    last = trials[-1]
    lines = in_words(session)
    assert lines[-1] == f"falling within {last.duration:g} s"
    of_kind = [(t.screen, t.factor) for t in trials if t.duration == last.duration]
    told = [tuple(line.split()[:2]) for line in lines if line.startswith(("white", "gray"))]
    wanted = sorted(set(of_kind), key=lambda level: (level[0] != "white", -level[1]))
    assert told == [(screen, f"{factor:g}") for screen, factor in wanted]


class Terminal(io.StringIO):
    """Standard error as a terminal."""

    def isatty(self) -> bool:
        return True


@pytest.fixture
def terminal(monkeypatch: pytest.MonkeyPatch) -> Callable[[], Terminal]:
    """Put a terminal where standard error is; in a test itself, for pytest puts its own there before."""

    def attach() -> Terminal:
        screen = Terminal()
        monkeypatch.setattr("sys.stderr", screen)
        for name, value in {"COLUMNS": "80", "LINES": "24", "TERM": "xterm", "NO_COLOR": "1"}.items():
            monkeypatch.setenv(name, value)
        return screen

    return attach


def test_the_terminal_of_a_run_shows_the_session_to_its_end(
    command: Callable[..., Any], tmp_path: Path, terminal: Callable[[], Terminal]
) -> None:
    screen = terminal()
    ended = command(*arguments(tmp_path / "lab", written(SMALL, tmp_path)))
    assert ended.code == 0
    shown = screen.getvalue()
    assert "SIMULATED" in shown
    assert "10 of 10" in shown
    for level in so_far(tmp_path / "lab").thresholds.levels():
        assert f"{level.luminance:.3g}" in shown


@pytest.mark.parametrize("more", [["--rig", "nowhere.rig.toml"], ["--quiet"]])
def test_a_terminal_shows_nothing_of_what_is_refused_or_quiet(
    command: Callable[..., Any], tmp_path: Path, terminal: Callable[[], Terminal], more: list[str]
) -> None:
    screen = terminal()
    words = [
        w for w in arguments(tmp_path / "lab", written(SMALL, tmp_path)) if w not in ("--rig", "simulated")
    ]
    rig = [] if "--rig" in more else ["--rig", "simulated"]
    command(*words, *rig, *more)
    assert "SIMULATED" not in screen.getvalue()
    assert screen.getvalue().count("\n") == (more[0] == "--rig")  # the line that says why


def test_a_view_that_fails_says_so_once_and_the_session_goes_on(
    tmp_path: Path, terminal: Callable[[], Terminal]
) -> None:
    screen = terminal()
    with live_view(tmp_path / "nowhere", quiet=False) as show:
        show()
        show()
    (line,) = screen.getvalue().splitlines()
    assert line.startswith("evenlight: the live view ends, the session goes on: ")


def test_a_terminal_that_takes_no_text_holds_up_nothing(
    lab: Path, terminal: Callable[[], Terminal], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Selected text, or a line that is broken: writing waits, the session does not."""
    stopped = threading.Event()
    screen = terminal()
    monkeypatch.setattr(screen, "write", lambda text: stopped.wait(60) and len(text))
    monkeypatch.setattr(module, "PATIENCE", 0.05)
    begun = time.monotonic()
    with live_view(session_of(lab), quiet=False) as show:
        for _ in range(3):
            show()
    assert screen.getvalue() == ""
    assert time.monotonic() - begun < 50
    stopped.set()


def test_reading_and_drawing_between_two_trials_takes_at_most_20_ms(lab: Path) -> None:
    """Of the processor, in the median over 40 times; no flip is awaited then."""
    console = Console(file=Terminal(), force_terminal=True, width=80, height=24)
    session, times = so_far(lab), []
    with module._drawn(console) as draw:
        for _ in range(40):
            begun = time.process_time()
            session.update()
            draw(session)
            times.append(time.process_time() - begun)
    assert np.median(times) < 0.02


# The command `watch`


def test_watch_shows_the_latest_session_once(command: Callable[..., Any], lab: Path) -> None:
    shown = command("watch", lab, "--once")
    assert (shown.code, shown.err) == (0, "")
    assert "SIMULATED" in shown.out
    assert "10 of 10" in shown.out
    before = {path: path.read_bytes() for path in lab.glob("**/*") if path.is_file()}
    assert command("watch", lab).out == shown.out  # no terminal: once
    assert {path: path.read_bytes() for path in lab.glob("**/*") if path.is_file()} == before


@pytest.mark.parametrize(
    ("more", "said"),
    [
        ([], "nowhere: no such folder; give the one that `evenlight run` has as --out"),
        (["--participant", "99"], "lab: participant 99 has no session that was run"),
        (["--participant", "01", "--session", "02"], "lab: participant 01 has no session 02 that was run"),
        (["--session", "02"], "lab: there is no session 02 that was run"),
    ],
)
def test_watch_refuses_what_is_no_session_in_one_line(
    command: Callable[..., Any], tmp_path: Path, lab: Path, more: list[str], said: str
) -> None:
    shown = command("watch", lab if more else tmp_path / "nowhere", *more)
    assert (shown.code, shown.err.count("\n")) == (2, 1)
    assert said in shown.err


def test_watch_says_which_line_cannot_be_used(command: Callable[..., Any], lab: Path) -> None:
    with (session_of(lab) / TRIALS).open("a") as stream:
        stream.write("{}\n")
    shown = command("watch", lab, "--once")
    assert (shown.code, shown.err.count("\n")) == (2, 1)
    assert TRIALS in shown.err
