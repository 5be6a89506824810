"""Progress: lines at their time where no terminal is, on standard error alone, and none with --quiet."""

from pathlib import Path

import pytest

import evenlight
from evenlight import progress as progress_module
from evenlight.progress import ProgressLines, counted, shown_progress

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
def told(clock) -> tuple[ProgressLines, list[str]]:
    said: list[str] = []
    return ProgressLines(said.append, clock), said


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
    assert shown.err.splitlines()[0] == "evenlight: 0 s: rendering"
    assert shown.out == ""
    with shown_progress(quiet=True) as progress:
        progress.step("rendering", 3)
        progress.at(2)
    assert capfd.readouterr() == ("", "")


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
