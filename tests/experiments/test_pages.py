"""The pages of a session: in every language, and in a lab's own words."""

import string
from pathlib import Path

import pytest

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Keys
from evenlight.experiments.sessions.pages import PLACEHOLDERS, SHIPPED, languages, load_pages

NUMBERS = {"minutes": 40, "trials": 120, "done": 60, "trials_between_breaks": 30, "truth": "It changed."}


def placeholders(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name}


def test_every_language_has_every_page_with_the_same_placeholders() -> None:
    english = load_pages("en").texts
    assert set(languages()) >= {"en", "de"}
    for language in languages():
        pages = load_pages(language).texts
        assert set(pages) == set(english)
        for name, text in pages.items():
            assert placeholders(text) == placeholders(english[name]), (language, name)
            assert text != english[name] or language == "en"


def test_pages_name_the_keys_of_the_rig_and_the_numbers_of_the_session() -> None:
    pages = load_pages("en")
    text = pages.text("question_yes_no", Keys(yes="j", no="num_0"))
    assert "Press J for yes, 0 on the numeric pad for no." in text
    assert "60 of 120" in pages.text("break", Keys(), **NUMBERS)
    assert "the space bar" in pages.text("break", Keys())


@pytest.mark.parametrize("language", languages())
@pytest.mark.parametrize("answer", ["first", "second"])
def test_an_answer_is_called_the_same_where_keys_are_tried_asked_for_and_explained(
    language: str, answer: str
) -> None:
    pages = load_pages(language).texts
    for name in ("question_two_interval", "question_comparison", "instructions_comparison"):
        assert pages[f"meaning_{answer}"].strip() in pages[name]


def test_no_brace_is_left_in_any_filled_page() -> None:
    for language in languages():
        pages = load_pages(language)
        for name in pages.texts:
            assert not set("{}") & set(pages.text(name, Keys(), **NUMBERS))


def test_a_labs_own_page_takes_the_place_of_ours_and_changes_the_digests(tmp_path: Path) -> None:
    (tmp_path / "consent.txt").write_text("# Bienvenue\n\n{proceed} pour continuer.\n")
    (tmp_path / "keys.toml").write_text('space = "la barre d\'espace"\n')
    pages = load_pages("en", tmp_path)
    assert pages.text("consent", Keys()) == "# Bienvenue\n\nla barre d'espace pour continuer."
    ours, theirs = load_pages("en").digests, pages.digests
    assert {name for name in ours if ours[name] != theirs[name]} == {"consent"}


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("consent.txt", "{proced}", "consent.txt: unknown placeholder 'proced'; did you mean 'proceed'?"),
        ("consent.txt", "{proceed", "a brace is not closed"),
        ("consent.txt", " \n", "the page is empty"),
        ("consnt.txt", "hello", "no page of a session; did you mean 'consent'?"),
        ("keys.toml", "space = ", "holds no page; expected files such as"),
    ],
)
def test_a_page_that_cannot_be_shown_is_refused_before_anybody_sees_it(
    tmp_path: Path, name: str, text: str, message: str
) -> None:
    (tmp_path / name).write_text(text)
    with pytest.raises(InputError) as refused:
        load_pages("en", tmp_path)
    assert message in str(refused.value)
    assert "\n" not in str(refused.value)


def test_a_language_that_is_not_there_is_named_with_those_that_are() -> None:
    with pytest.raises(InputError, match="no pages in the language 'fr', only in de, en"):
        load_pages("fr")


def test_a_folder_with_all_pages_may_be_in_any_language(tmp_path: Path) -> None:
    for path in (SHIPPED / "de").glob("*.txt"):
        (tmp_path / path.name).write_text(path.read_text())
    assert load_pages("fr", tmp_path).texts == load_pages("de").texts


def test_every_placeholder_is_used_by_some_page() -> None:
    used = set().union(*(placeholders(text) for text in load_pages("en").texts.values()))
    assert used == set(PLACEHOLDERS)
