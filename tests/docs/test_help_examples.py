"""The examples at the end of each `--help` run, with the files that they name."""

from collections.abc import Callable

import pytest
from page_commands import Step
from reader_files import named

from evenlight.help_pages import EXAMPLES

pytestmark = pytest.mark.every_page


@pytest.mark.parametrize("words", EXAMPLES)
def test_the_examples_of_a_command_run(words: str, reader: Callable[..., list[str]]) -> None:
    todo = [Step(f"evenlight {words} --help", 0, text) for text in EXAMPLES[words]]
    for step in todo:
        assert reader("", [step], named(step.words)) == []
