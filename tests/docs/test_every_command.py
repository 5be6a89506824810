"""Every command of README and docs runs, page by page, in order, in a folder with its reader's files."""

from collections import Counter
from collections.abc import Callable

import pytest
from command_variants import PARSED, parse, trial_of, unknown_in
from page_commands import NOT_RUN, Step, first_word, named_in_prose, other_lines, pages, steps
from reader_files import HAS

from evenlight.help_pages import EXAMPLES

WITH_COMMANDS = [page for page in pages() if steps(page)]
HELP = [Step(f"evenlight {words} --help", 0, text) for words, texts in EXAMPLES.items() for text in texts]


READ_FIRST = ("README.md", "docs/first-hour.md")  # the others: `make test-docs`


@pytest.mark.parametrize(
    "page",
    [
        page if page in READ_FIRST else pytest.param(page, marks=pytest.mark.every_page)
        for page in WITH_COMMANDS
    ],
)
def test_the_commands_of_a_page_run_in_order(page: str, reader: Callable[..., list[str]]) -> None:
    assert "\n".join(reader(page, steps(page), HAS.get(page, ()))) == ""


def test_every_command_is_one_that_there_is() -> None:
    for step in [step for page in WITH_COMMANDS for step in steps(page)] + HELP:
        if step.text.startswith("evenlight "):
            assert unknown_in(step.words[1:]) == ""
            if not {"--help", "--version", "--request"} & {*step.words}:  # acted on as they are parsed
                parse(step.words[1:])


def test_few_commands_are_not_run() -> None:
    """Most run as they stand; those that do not have their reason, and no reason is left over."""
    lines = [
        step.words[1:] for page in WITH_COMMANDS for step in steps(page) if step.text.startswith("evenlight ")
    ]
    lines += [step.words[1:] for step in HELP]
    kinds = Counter(trial_of(words).kind for words in lines)
    assert kinds["literal"] > kinds["variant"] > kinds["parsed"], kinds
    assert kinds["parsed"] < 0.2 * len(lines), kinds
    assert [begin for begin in PARSED if not any(" ".join(w).startswith(begin) for w in lines)] == []


def test_each_other_line_of_a_shell_has_its_reason() -> None:
    """And no reason is left over; of what is run in a container, the command is parsed."""
    others = [step for page in pages() for step in other_lines(page)]
    assert [str(step) for step in others if first_word(step) not in NOT_RUN] == []
    assert set(NOT_RUN) == {first_word(step) for step in others}
    for step in others:
        if step.text.startswith("docker run "):
            parse(step.words[step.words.index("evenlight") + 1 :])


def test_commands_in_prose_have_words_and_options_that_there_are() -> None:
    named = [step for page in pages() for step in named_in_prose(page)]
    assert len(named) > 150
    assert [f"{step}: {wrong}" for step in named if (wrong := unknown_in(step.text.split()[1:]))] == []


@pytest.mark.parametrize(
    ("words", "unknown"),
    [
        ("optimise VIDEO", "optimise"),
        ("measure lumnance --out FILE", "lumnance"),
        ("fit lab --otu again", "--otu"),
        ("measure WHAT --instrument DRIVER:ADDRESS", ""),
        ("plan rating|comparison --quick", ""),
    ],
)
def test_what_there_is_not_is_found(words: str, unknown: str) -> None:
    assert unknown_in(words.split()) == unknown
