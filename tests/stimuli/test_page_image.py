"""Pages: everything is on them, within the margins, in letters that can be read."""

import numpy as np
import pytest

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.stimuli.page_image import MARGIN, SMALLEST_SHARE, TEXT_SIZE, centred_image, ink_on, page_image

PAGE = """# How it works

You will see a uniform field of light. It may **slowly become darker**, or it may stay as it is.

- Press **Y** if the brightness changed;
- press **N** if it did not.
"""
SIZES = [(640, 480), (1280, 800), (1920, 1080), (1080, 1920)]


def text_rows(image: np.ndarray) -> list[int]:
    """Return the heights of the lines of an image: runs of rows with ink."""
    inked = np.concatenate([[0], (image > 0).any(axis=1).astype(int), [0]])
    edges = np.flatnonzero(np.diff(inked))
    return [int(b - a) for a, b in zip(edges[::2], edges[1::2], strict=True)]


@pytest.mark.parametrize("size", SIZES)
def test_a_page_is_as_large_as_the_window_and_keeps_its_margins(size) -> None:
    image = page_image(PAGE, size, "Space: go on")
    assert image.shape == size[::-1]
    assert image.dtype == np.uint8
    rows, columns = np.nonzero(image)
    assert columns.min() >= MARGIN * size[0] - 2  # letters overhang their origin by a pixel or two
    assert columns.max() <= (1 - MARGIN) * size[0] + 2
    assert rows.min() >= MARGIN * size[1] - 2
    assert rows.max() <= size[1] - 0.5 * MARGIN * size[1]


def test_a_line_is_no_longer_than_the_eye_follows() -> None:
    """At most some 65 letters of body text, 34 em of 1/24 of the height, however wide the window is."""
    image = page_image("word " * 100, (2560, 720))
    columns = np.nonzero(image.any(axis=0))[0]
    assert np.ptp(columns) <= 34 * 720 / 24


def test_the_words_of_a_page_appear_in_full_whatever_it_is_wrapped_to() -> None:
    """The ink of a text does not depend on where its lines break, but for rounding at letters' edges."""
    words = "a uniform field of light that may slowly become darker"
    narrow, wide = page_image(words, (500, 480)), page_image(words, (1000, 480))
    assert len(text_rows(narrow)) > len(text_rows(wide)) >= 1
    assert narrow.sum(dtype=float) == pytest.approx(wide.sum(dtype=float), rel=0.02)


@pytest.mark.slow
def test_a_long_page_is_set_smaller_and_one_too_long_is_refused() -> None:
    tall = max(text_rows(page_image("Ap " * 40, (640, 480))))
    small = max(text_rows(page_image("Ap " * 400, (640, 480))))
    assert SMALLEST_SHARE * tall * 0.85 <= small < tall
    with pytest.raises(InputError, match=r"'Ap Ap Ap.* does not fit on 640 x 480 pixels") as refused:
        page_image("Ap " * 2000, (640, 480))
    assert "\n" not in str(refused.value)


def test_a_word_wider_than_the_column_is_refused() -> None:
    with pytest.raises(InputError, match="does not fit"):
        page_image("x" * 300, (640, 480))
    with pytest.raises(InputError, match="does not fit"):
        page_image("Text", (640, 480), "x" * 300)


def test_bold_words_have_more_ink() -> None:
    plain, bold = page_image("darker", (640, 480)), page_image("**darker**", (640, 480))
    assert bold.sum(dtype=float) > 1.2 * plain.sum(dtype=float)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "a page is empty"),
        ("  \n\n ", "a page is empty"),
        ("# Title\n\nan **open end", "'# Title' has a \\*\\* that no second one ends"),
        ("ようこそ", r"'よ' \(U\+3088, HIRAGANA LETTER YO\), which DejaVu Sans lacks: give a font .* --font"),
    ],
)
def test_a_text_that_cannot_be_set_is_refused_by_its_first_line(text, says) -> None:
    with pytest.raises(InputError, match=says):
        page_image(text, (640, 480))


def test_translations_with_latin_greek_and_cyrillic_letters_are_set() -> None:
    for text in ("größer, süß, œuvre\u00a0: « ça »", "Πιο σκούρο", "Стало темнее"):
        assert page_image(text, (640, 480)).any()


def test_a_question_stands_in_the_middle() -> None:
    image = centred_image("Did the brightness change?\n\n**Y** yes", (800, 600))
    rows, columns = np.nonzero(image)
    assert (columns.min() + columns.max()) / 2 == pytest.approx(400, abs=4)
    assert (rows.min() + rows.max()) / 2 == pytest.approx(300, abs=600 * TEXT_SIZE)


def test_a_question_of_two_lines_leaves_no_word_alone() -> None:
    image = centred_image("In which of the two did the brightness change?", (640, 480))
    rows = np.flatnonzero((image > 0).any(axis=1))
    middle = (rows.min() + rows.max()) // 2
    upper, lower = (np.ptp(np.nonzero(half.any(axis=0))[0]) for half in (image[:middle], image[middle:]))
    assert min(upper, lower) > 0.6 * max(upper, lower)


def test_three_spaces_are_a_gap_and_one_or_a_line_end_is_a_space() -> None:
    plain, spaced = centred_image("Y yes N no", (640, 480)), centred_image("Y yes    N no", (640, 480))
    width = [np.ptp(np.nonzero(image.any(axis=0))[0]) for image in (plain, spaced)]
    em = 1.25 * 480 / 24  # a question's letters
    assert width[1] - width[0] == pytest.approx(
        2 * em - 0.32 * em, abs=3
    )  # two em, and the space they replace
    np.testing.assert_array_equal(centred_image("Y\nyes", (640, 480)), centred_image("Y yes", (640, 480)))


def test_text_is_readable_on_every_ground_that_the_display_has() -> None:
    """Ratio of at least 7 (WCAG 2.1, 1.4.6), except where neither black nor white gives it."""
    lab = Display("lab", 100.0, 0.2, 2.2, pixels_per_degree=60.0)
    for ground in np.geomspace(0.2, 100.0, 200):
        ink = ink_on(ground, lab)
        assert 0.2 <= ink <= 100.0
        assert max(ground / ink, ink / ground) >= 7


def test_text_in_a_bright_room_is_as_readable_as_can_be() -> None:
    """With 20 cd/m^2 reflected, black at 20 and white at 60, no ground can have a ratio of 7."""
    room = Display("room", 40.0, 0.0, 2.2, pixels_per_degree=60.0, reflected_luminance=20.0)
    for ground in (20.0, 30.0, 34.0, 35.0, 60.0):
        ink = ink_on(ground, room)
        assert max(ground / ink, ink / ground) == pytest.approx(max(ground / 20, 60 / ground))
