"""Answers on the panel of a headset: what they are called, how the stick marks them, where they stand."""

import tomllib

import numpy as np
import pytest

from evenlight.data_schema.recordings.rig import Keys
from evenlight.experiments.headset.choices import Choice, answers_of, choice_image
from evenlight.experiments.headset.headset_stage import NUMBER_SIZE
from evenlight.experiments.sessions.pages import SHIPPED, load_pages
from evenlight.stimuli.page_image import centred_image

KEYS = Keys()
PAGES = load_pages("en", in_headset=True)
YES_NO = answers_of(("y", "n"), KEYS, PAGES)
RATINGS = answers_of(KEYS.ratings, KEYS, PAGES)
GAPS = answers_of(KEYS.orientations, KEYS, PAGES)
SIZE = (1280, 960)


@pytest.mark.parametrize(
    ("asked", "language", "words"),
    [
        (("y", "n"), "en", ("yes", "no")),
        (("y", "n"), "de", ("Ja", "Nein")),
        (("left", "right"), "en", ("the first", "the second")),
        (KEYS.ratings, "de", ("1", "2", "3", "4", "5")),
        (("a", "space"), "en", ("A", "the space bar")),  # of another package's task
    ],
)
def test_answers_are_called_as_the_pages_say(
    asked: tuple[str, ...], language: str, words: tuple[str, ...]
) -> None:
    assert answers_of(asked, KEYS, load_pages(language, in_headset=True)).words == words


@pytest.mark.parametrize(
    ("pushes", "marked"),
    [([], None), ([1], 3), ([-1], 1), ([1, 1, 1], 4), ([-1, 1], 2), ([-1, -1, -1], 0)],
)
def test_the_stick_moves_the_mark_from_the_middle(pushes: list[int], marked: int | None) -> None:
    choice = Choice(RATINGS)
    for push in pushes:
        assert choice.taken("stick_right" if push > 0 else "stick_left", (0.0, 0.0)) is None
    assert choice.marked == marked
    assert choice.taken("trigger", (0.0, 0.0)) == (None if marked is None else KEYS.ratings[marked])


@pytest.mark.parametrize("index", range(8))
def test_a_direction_of_the_stick_marks_a_gap(index: int) -> None:
    """Counter-clockwise from the right, in steps of 45 degrees; it stays when the stick goes back."""
    choice, turn = Choice(GAPS), np.radians(45 * index + 20)
    choice.look((0.9 * np.cos(turn), 0.9 * np.sin(turn)))
    choice.look((0.1, 0.1))
    assert choice.taken("trigger", (0.0, 0.0)) == KEYS.orientations[index]


def test_the_rigs_own_keys_answer() -> None:
    assert Choice(YES_NO).taken("n", (0.0, 0.0)) == "n"
    assert Choice(YES_NO).taken("q", (0.0, 0.0)) is None


def test_a_mark_is_a_frame_around_its_answer_alone() -> None:
    plain = choice_image("Did it change?", YES_NO, None, SIZE)
    left, right = (choice_image("Did it change?", YES_NO, k, SIZE) != plain for k in (0, 1))
    assert left[:, :640].any()
    assert not left[:, 640:].any()
    assert right[:, 640:].any()
    assert not right[:, :640].any()
    np.testing.assert_array_equal(plain[:624].any(), True)  # the question above


def test_rings_stand_around_with_their_gaps_outwards() -> None:
    """A ring of 125 pixels field and 75 diameter has a gap of 15: it is open 30 pixels from its middle."""
    image = choice_image("Where is the gap?", GAPS, None, SIZE)
    middle = 960 - round(960 * 0.62) / 2
    for index in range(8):
        turn = np.radians(45 * index)
        across, up = np.cos(turn), np.sin(turn)
        x, y = 640 + 0.23 * 960 * across, middle - 0.23 * 960 * up
        assert image[round(y - 30 * up), round(x + 30 * across)] == 0
        assert image[round(y + 30 * up), round(x - 30 * across)] == 255


def test_a_question_has_letters_as_large_as_a_pages_however_low_its_part_of_the_panel_is() -> None:
    """A question of H alone: 1.25 ems of 960 / 24 pixels, of which capitals of DejaVu Sans have 0.729."""
    for answers in (YES_NO, GAPS):
        rows = choice_image("H", answers, None, SIZE)[:, 600:680].any(axis=1)[:365]
        assert np.ptp(np.flatnonzero(rows)) + 1 == pytest.approx(0.729 * 50, abs=1.5)


def test_pages_name_controllers_in_a_headset() -> None:
    """The keys of a rig are named on no page; a lab's own pages stand before ours."""
    for language in ("en", "de"):
        pages = load_pages(language, in_headset=True)
        texts, questions = pages.longest(KEYS)
        for name, text in zip(pages.texts, [*texts, *questions], strict=True):
            for word in (
                "space bar",
                "Leertaste",
                "Esc",
                "←",
                "numeric pad",
                "Ziffernblock",
                "mouse",
                "Maus",
            ):
                assert word not in text, (name, word)


@pytest.mark.parametrize("language", ["en", "de"])
def test_what_pages_say_otherwise_they_say_on_a_screen(language: str) -> None:
    """Each phrase that is replaced stands on a page, and no screen is left on one about stimuli."""
    pages = load_pages(language).texts.values()
    for phrase in tomllib.loads((SHIPPED / language / "headset/phrases.toml").read_text()):
        assert any(phrase in text for text in pages), phrase
    for name, text in load_pages(language, in_headset=True).texts.items():
        if name.startswith(("consent", "instructions", "question", "look")):
            assert "screen" not in text, name
            assert "Bildschirm" not in text, name


def test_a_labs_own_pages_stand_before_ours(tmp_path) -> None:
    (tmp_path / "question_rating.txt").write_text("How was it? Press {proceed}.\n")
    assert load_pages("en", tmp_path, in_headset=True).text("question_rating", KEYS) == (
        "How was it? Press the trigger."
    )


def test_the_number_of_an_interval_is_as_high_as_a_heading() -> None:
    """The panel has 23.95 pixels per degree in its middle; a heading is about 4 degrees high."""
    rows = np.flatnonzero(centred_image("1", SIZE, NUMBER_SIZE).max(axis=1) > 128)
    assert 3.0 < (rows[-1] - rows[0] + 1) / 23.95 < 5.0
