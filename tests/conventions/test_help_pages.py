"""`--help` is for a newcomer: commands in groups, options in panels, plain words, two examples."""

import os
import re
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
import typer
from typer.core import TyperArgument, TyperGroup, TyperOption

import evenlight
from evenlight import option_panels
from evenlight.command import COMMANDS, app
from evenlight.help_pages import EXAMPLES, GROUPS
from evenlight.stimuli.sequences import SEQUENCES

ROOT = Path(evenlight.__file__).parents[1]
TREE = typer.main.get_command(app)
MANY = 6  # options; more are shown in panels


def all_commands(group: Any = TREE, words: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], Any]]:
    """Each command and group with its words."""
    yield words, group
    if isinstance(group, TyperGroup):
        for name, one in group.commands.items():
            yield from all_commands(one, (*words, name))


ALL = dict(all_commands())


def page_of(words: tuple[str, ...]) -> str:
    """The page of a command, of its own context."""
    context: Any = None
    for depth in range(len(words) + 1):
        name = words[depth - 1] if depth else "evenlight"
        context = typer.Context(ALL[words[:depth]], parent=context, info_name=name)
    return context.get_help()


@pytest.fixture(autouse=True)
def no_colour(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("NO_COLOR", "1")
    monkeypatch.setenv("COLUMNS", "80")


@pytest.fixture(params=sorted(ALL), ids=lambda words: " ".join(words) or "evenlight")
def words(request: Any) -> tuple[str, ...]:
    return tuple(request.param)


def test_without_a_word_it_says_where_to_start(command: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a pipe, there are no colours anyway."""
    monkeypatch.delenv("NO_COLOR")
    shown = command()
    assert (shown.code, shown.err) == (0, "")
    assert "Start with: evenlight demo --out demo" in shown.out
    titles = re.findall(r"^(\S[^:\n]*):$", shown.out, re.MULTILINE)
    assert titles[: len(GROUPS)] == [
        "Start here", "Video", "Calibration", "Experiments", "Instruments", "Statistics", "Files",
    ]  # fmt: skip
    assert re.search(r"^Start here:\n  demo ", shown.out, re.MULTILINE)


def test_every_command_is_in_a_group_and_the_documents_have_the_same() -> None:
    assert tuple(COMMANDS) == GROUPS
    text = (ROOT / "docs" / "commands.md").read_text()
    documented = {
        section.partition("\n")[0]: re.findall(r"^\| `evenlight ([a-z]+)", section, re.MULTILINE)
        for section in text.split("\n## ")[1:]
        if "| `evenlight" in section
    }
    assert documented == {title: list(commands) for title, commands in COMMANDS.items()}


def test_no_page_shows_types_of_programmers(words: tuple[str, ...]) -> None:
    """Such as <bool> after a flag, <str>, or a default of nothing; each option and argument is explained."""
    page = page_of(words)
    assert not re.search(r"<\w|BOOLEAN|None\b|default: \]|default: False", page)
    for one in ALL[words].params:
        assert one.help, one.name
        if getattr(one, "hidden", False):
            assert not re.search(rf"^  {re.escape(one.opts[0])} ", page, re.MULTILINE)
        elif isinstance(one, TyperOption) and one.is_flag:
            assert re.search(rf"^  {re.escape(one.opts[0])}(  | / |$)", page, re.MULTILINE)
        if isinstance(one, TyperArgument):
            assert re.search(rf"^  {(one.metavar or one.name).upper()}(\.\.\.)?(  |$)", page, re.MULTILINE)


def test_what_all_commands_take_is_told_once_and_the_others_are_few() -> None:
    """But `watch`, which is nothing without its lines."""
    commands = {words: one for words, one in ALL.items() if not isinstance(one, TyperGroup)}
    assert [words for words, one in commands.items() if "quiet" not in {p.name for p in one.params}] == [
        ("watch",)
    ]
    assert [words for words in ALL if "--quiet" in page_of(words).partition("\nExamples:\n")[0]] == [()]
    visible = sum(not getattr(p, "hidden", False) for one in commands.values() for p in one.params)
    assert visible <= 241  # 11 of them are those of live


def test_many_options_are_shown_in_panels(words: tuple[str, ...]) -> None:
    options = [one for one in ALL[words].params if isinstance(one, TyperOption) and not one.hidden]
    if len(options) > MANY:
        assert len({one.rich_help_panel for one in options}) > 2
        assert {one.name for one in options if one.rich_help_panel is None} <= {"help"}


def test_a_page_ends_with_two_examples_that_can_be_copied(
    words: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    """At any width each command is one line, and the others are no wider than the terminal."""
    lines = [example.partition("  # ")[0].rstrip() for example in EXAMPLES[" ".join(words)]]
    assert len(lines) == 2
    for columns in (60, 80, 120):
        monkeypatch.setenv("COLUMNS", str(columns))
        text, _, examples = page_of(words).partition("\nExamples:\n")
        assert [line.strip() for line in examples.splitlines() if not line.startswith("  # ")] == lines
        assert max(map(len, text.splitlines())) <= columns
        assert "\x1b" not in text + examples


def test_every_command_has_its_examples() -> None:
    """The tests of the documents run them: tests/docs/test_help_examples.py."""
    assert set(EXAMPLES) == {" ".join(words) for words in ALL}


@pytest.mark.parametrize(
    ("given", "meant"),
    [
        (["optimise"], "'optimize'? See evenlight --help"),
        (["measure", "lumnance"], "'luminance'? See evenlight measure --help"),
        (["optimize", "film.mp4", "--budgte", "0.5"], "--budget"),
    ],
)
def test_a_mistyped_word_is_answered_in_one_line_with_what_was_meant(
    command: Any, given: list[str], meant: str
) -> None:
    refused = command(*given)
    assert refused.code == 2
    assert refused.out == ""
    assert refused.err.count("\n") == 1
    assert f"Did you mean {meant}" in refused.err


def test_a_shell_completes_presets_sequences_and_files(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sunset.mp4").touch()
    (tmp_path / "sunny").mkdir()
    assert option_panels.complete_video("sun") == ["sunrise", "sunny/", "sunset.mp4"]
    assert option_panels.complete_video("film") == []  # then the shell completes files
    assert set(SEQUENCES) < set(option_panels.complete_video(""))
    assert option_panels.complete_display("varjo") == ["varjo-xr3"]
    assert option_panels.complete_rate_limit("su") == ["surace2025", "sunny/"]
    assert option_panels.complete_rig("simu") == ["simulated", "simulated-headset"]
    assert option_panels.complete_design("qu") == ["quick"]


@pytest.mark.parametrize(
    ("typed", "completed"),
    [
        ("evenlight op", ["optimize"]),
        ("evenlight optimize film.mp4 --budget-u", ["--budget-unit"]),
        ("evenlight optimize film.mp4 --budget-unit p", ["power"]),
        ("evenlight optimize film.mp4 --display var", ["varjo-xr3"]),
        ("evenlight run lum", ["luminance-sweep"]),
        ("evenlight measure co", ["conform"]),
    ],
)
def test_the_command_answers_the_shell(
    command: Any, monkeypatch: pytest.MonkeyPatch, typed: str, completed: list[str]
) -> None:
    monkeypatch.setenv("_EVENLIGHT_COMPLETE", "complete_bash")
    monkeypatch.setenv("COMP_WORDS", typed)
    monkeypatch.setenv("COMP_CWORD", str(len(typed.split()) - 1))
    answered = command()
    assert (answered.code, answered.out.split()) == (0, completed)


def test_the_script_that_completes_is_one_that_bash_reads(
    command: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Whatever shell has started the tests."""
    monkeypatch.setattr("typer.completion._get_shell_name", lambda: "bash")
    script = command("--show-completion").out
    assert "_EVENLIGHT_COMPLETE=complete_bash" in script
    done = subprocess.run(["bash", "-n"], input=script, text=True, capture_output=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    assert os.environ.get("_EVENLIGHT_COMPLETE") is None
