"""The table of hard cases (docs/hard-cases.md) names every test of its files, and no other."""

import re
from pathlib import Path

import pytest

HERE = Path(__file__).parent
PAGE = (HERE.parents[1] / "docs/hard-cases.md").read_text(encoding="utf-8")
SECTIONS = dict(
    re.findall(r"^## [^\n]*`(test_\w+\.py)`\n(.*?)(?=^## )", PAGE, flags=re.MULTILINE | re.DOTALL)
)


def test_there_are_tables() -> None:
    assert len(SECTIONS) == 4


@pytest.mark.parametrize("file", SECTIONS)
def test_each_row_has_a_test_and_each_test_a_row(file) -> None:
    rows = [line for line in SECTIONS[file].splitlines() if line.startswith("|")][2:]
    assert all(len(re.split(r"(?<!\\)\|", row)) == 6 for row in rows)  # four cells between five bars
    named = [re.fullmatch(r".*\| `(test_\w+)` \|", row) for row in rows]
    written = re.findall(r"^def (test_\w+)", (HERE / file).read_text(encoding="utf-8"), flags=re.MULTILINE)
    assert [match and match[1] for match in named] == written
