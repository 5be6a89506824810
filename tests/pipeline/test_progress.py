"""Progress: lines at their time where no terminal is, on standard error alone, and none with --quiet."""

import re
from io import StringIO
from pathlib import Path

import numba
import pytest
from rich.console import Console
from rich.progress import Progress as Bars
from rich.progress import TimeElapsedColumn

import evenlight
from evenlight import progress as progress_module
from evenlight.progress import COMPILING, Progress, counted, shown_progress

ROOT = Path(evenlight.__file__).resolve().parents[1]
# A session's bar tells of the trials that are safe; it is watched by the operator.
OTHER_BARS = {"progress.py", "run_command.py"}


class Clock:
    """A clock that is set by hand [s]."""

    def __init__(self) -> None:
        self.now = 100.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture
def clock() -> Clock:
    return Clock()


@pytest.fixture
def told(clock) -> tuple[Progress, list[str]]:
    said: list[str] = []
    return Progress(Bars(get_time=clock, disable=True), said.append), said


def test_what_takes_less_than_ten_seconds_says_nothing(told, clock) -> None:
    lines, said = told
    lines.step("analysing", 40)
    clock.now += 9.9
    lines.at(39)
    lines.tell_if_due()
    lines.step("writing")
    assert said == []


def test_a_line_comes_every_ten_seconds_and_says_how_much_is_done_and_since_when(told, clock) -> None:
    lines, said = told
    lines.step("analysing gym", 40)
    for second in range(1, 31):  # asked once a second
        clock.now = 100.0 + second
        lines.at(second)
        lines.tell_if_due()
    assert said == [
        "evenlight: 10 s: analysing gym, 10 of 40",
        "evenlight: 20 s: analysing gym, 20 of 40",
        "evenlight: 30 s: analysing gym, 30 of 40",
    ]


def test_each_step_of_long_work_is_told_when_it_begins(told, clock) -> None:
    lines, said = told
    clock.now += 75
    lines.step("track of gym")
    clock.now += 3
    lines.step("track of library")
    lines.tell_if_due()  # told 0 s ago
    assert said == ["evenlight: 1 min 15 s: track of gym", "evenlight: 1 min 18 s: track of library"]


def test_a_total_may_be_known_late_and_a_count_without_one_is_told_alone(told, clock) -> None:
    lines, said = told
    lines.step("fitting")
    lines.at(3)
    clock.now += 10
    lines.tell_if_due()
    lines.at(4, 8)
    clock.now += 10
    lines.tell_if_due()
    assert said == ["evenlight: 10 s: fitting, 3", "evenlight: 20 s: fitting, 4 of 8"]


def test_lines_go_to_standard_error_and_quiet_work_has_none(monkeypatch, capfd) -> None:
    monkeypatch.setattr(progress_module, "INTERVAL", 0.0)
    with shown_progress(quiet=False) as progress:
        assert list(counted(progress, "abc", "rendering", None)) == ["a", "b", "c"]
    shown = capfd.readouterr()
    assert re.fullmatch(r"evenlight: \d+ s: rendering", shown.err.splitlines()[0])
    assert shown.out == ""
    with shown_progress(quiet=True) as progress:
        progress.step("rendering", 3)
        progress.at(2)
    assert capfd.readouterr() == ("", "")


def test_a_terminal_shows_a_bar_of_what_is_done(monkeypatch) -> None:
    screen = StringIO()
    terminal = Console(file=screen, force_terminal=True, width=80)
    monkeypatch.setattr("rich.console.Console", lambda **_: terminal)
    with shown_progress(quiet=False) as progress:
        progress.step("rendering", 4)
        progress.at(2)
        with progress.aside("baking", 3) as done:
            done(1)
        terminal.print("")  # which draws the bars anew
    assert "rendering" in screen.getvalue()
    assert "2 of 4" in screen.getvalue()


def test_the_time_is_that_of_the_command_though_it_shows_several(clock) -> None:
    """On a terminal and in lines: the analysis took 90 s, and the drawing does not begin at 0."""
    said: list[str] = []
    bars = Bars(TimeElapsedColumn(), get_time=clock, disable=True)
    clock.now += 90
    lines = Progress(bars, said.append, begun=clock.now - 90)
    lines.step("drawing", 4)
    assert said == ["evenlight: 1 min 30 s: drawing, 0 of 4"]
    with lines.aside("light", 3):
        assert [bars.columns[0].render(task).plain for task in bars.tasks] == ["0:01:30", "0:01:30"]


def test_work_that_tells_nothing_for_long_is_told_of_all_the_same(monkeypatch, capfd) -> None:
    monkeypatch.setattr(progress_module, "INTERVAL", 0.0)
    with shown_progress(quiet=False) as progress:
        progress.step("solving")
        capfd.readouterr()
        said = ""
        while "solving" not in said:  # written beside the work, about once a second
            said += capfd.readouterr().err
    assert said.splitlines()[0].endswith(": solving")


def test_no_command_has_a_bar_of_its_own_that_only_a_terminal_shows() -> None:
    folders = ("evenlight", "analysis", "experiments", "stimuli", "benchmarks")
    files = (path for folder in folders for path in (ROOT / folder).glob("**/*.py"))
    own = {p.name for p in files if "rich.progress" in p.read_text() or ".status(" in p.read_text()}
    assert own <= OTHER_BARS


def test_work_within_a_step_is_told_and_then_the_step_again(told, clock) -> None:
    lines, said = told
    lines.step("curves", 40)
    lines.at(3)
    with lines.aside("light", 64) as at:
        at(16)
        clock.now += 10.0
        lines.tell_if_due()
    clock.now += 10.0
    lines.tell_if_due()
    assert said == ["evenlight: 10 s: light, 16 of 64", "evenlight: 20 s: curves, 3 of 40"]


def test_long_work_deep_within_is_told_by_the_command_alone(monkeypatch, capsys) -> None:
    """In a program that uses the Python interface nothing is written; in a command, after `INTERVAL`."""
    monkeypatch.setattr(progress_module, "INTERVAL", 0.0)
    for told_by_default in (False, True):
        monkeypatch.setattr(progress_module, "told_by_default", told_by_default)
        with progress_module.aside("light", 64) as at:
            at(1)
        assert ("light" in capsys.readouterr().err) == told_by_default


def bar_of(clock: Clock) -> tuple[Progress, Bars]:
    """A bar that nobody sees, and what shows it."""
    bars = Bars(get_time=clock, console=Console(file=StringIO()), auto_refresh=False)
    return Progress(bars), bars


def test_the_time_left_is_estimated_from_the_frames_after_compiling_alone(clock) -> None:
    """By hand: 95 frames at 10 a second take 9.5 s; the 20 s of the first frame say nothing of them."""
    bar, bars = bar_of(clock)
    bar.step("analysing", 100)
    clock.now += 0.5
    bar.at(1)
    assert bars.tasks[0].fields["left"] == "0:00:50 left"  # 99 times 0.5 s
    bar.compiling(True)
    clock.now += 20.0
    bar.at(2)  # read ahead meanwhile
    assert (bars.tasks[0].description, bars.tasks[0].fields["left"]) == (COMPILING, "")
    bar.compiling(False)
    assert (bars.tasks[0].description, bars.tasks[0].completed) == ("analysing", 2)
    for done in (3, 4, 5):
        clock.now += 0.1
        bar.at(done)
    assert bars.tasks[0].fields["left"] == "0:00:10 left"  # whole seconds, rounded up
    bar.compiling(True)  # of another loop
    assert bars.tasks[0].fields["left"] == ""
    assert bars.tasks[0].total == 100


def test_parts_that_come_all_at_once_are_not_taken_to_be_quick(clock) -> None:
    """Two processes: after 16 s two parts of 40 are there within 0.01 s. The other 38 take 304 s."""
    bar, bars = bar_of(clock)
    bar.step("simulating experiments")
    assert bars.tasks[0].fields["left"] == ""  # nobody knows of how many parts
    for seconds, done in ((15.99, 1), (0.01, 2)):
        clock.now += seconds
        bar.at(done, 40)
    assert bars.tasks[0].fields["left"] == "0:05:04 left"
    with bar.aside("light", 64) as at:
        clock.now += 1.0
        at(32)
        assert bars.tasks[1].fields["left"] == "0:00:01 left"
    assert len(bars.tasks) == 1


def test_a_line_says_that_loops_are_compiled(told, clock) -> None:
    lines, said = told
    lines.step("analysing", 40)
    lines.compiling(True)
    clock.now += 10.0
    lines.tell_if_due()
    lines.compiling(False)
    lines.at(4)
    clock.now += 10.0
    lines.tell_if_due()
    assert said == [f"evenlight: 10 s: {COMPILING}, 0 of 40", "evenlight: 20 s: analysing, 4 of 40"]


def test_compiling_is_told_once_for_a_loop_and_those_that_it_uses(monkeypatch) -> None:
    inner = numba.njit(lambda x: x + 1)
    outer = numba.njit(lambda x: inner(x) + inner(x))
    told: list[bool] = []
    with shown_progress(quiet=True) as progress:
        monkeypatch.setattr(progress, "compiling", told.append)
        assert outer(1) == 4
        assert told == [True, False]
        assert outer(2) == 6  # compiled by now
    numba.njit(lambda x: x)(1)  # told nobody
    assert told == [True, False]
