"""Sections of a report from templates."""

import jinja2
import pytest

from evenlight.analysis import report_prose


@pytest.fixture
def templates(monkeypatch: pytest.MonkeyPatch) -> None:
    found = report_prose._environment()
    text = "# Choices of\n{{ name | spaced }}\n\nOf {{ n }} answers\n{{ share | percent }}.\n\n> Simulated.\n"
    monkeypatch.setattr(found, "loader", jinja2.DictLoader({"choices.txt": text}))


@pytest.mark.usefixtures("templates")
def test_a_template_gives_title_paragraphs_and_notes() -> None:
    made = report_prose.section("choices", name="living_room", n=17, share=0.53)
    assert made.title == "Choices of living room"
    assert made.paragraphs == ("Of 17 answers 53 %.",)
    assert made.notes == ("Simulated.",)


@pytest.mark.usefixtures("templates")
def test_a_value_that_is_missing_is_an_error() -> None:
    with pytest.raises(jinja2.UndefinedError, match="'n' is undefined"):
        report_prose.section("choices", name="gym", share=0.5)
