"""Pages: set in any script, on every ground, in letters that can be read."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont, features

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.stimuli import typesetting
from evenlight.stimuli.page_image import MARGIN, SMALLEST_SHARE, TEXT_SIZE, centred_image, ink_on, page_image
from evenlight.stimuli.typesetting import LINE_MAY_END, Line, runs_to_left, words_of

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
        ("ようこそ", r"'よ' \(U\+3088, HIRAGANA LETTER YO\), which DejaVu Sans lacks: give a font .* `font`"),
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


# --- typesetting

SIZE = (640, 480)

DEJAVU = typesetting._dejavu(False)[0]

MONO = DEJAVU.with_name("DejaVuSansMono.ttf")  # a font that is another, and lacks ش and the like of none

shaped = pytest.mark.skipif(
    not features.check_feature("fribidi"), reason="FriBidi is missing: on Debian, apt-get install libfribidi0"
)


def drawn(text: str, to_left: bool = False, font: Path | None = None) -> np.ndarray:
    """Draw a line of 40-pixel letters at (20, 60)."""
    image = Image.new("L", (900, 80))
    Line(words_of(text), 40, font, to_left).draw(ImageDraw.Draw(image), (20.0, 60.0))
    return np.asarray(image)


def ends(image: np.ndarray) -> tuple[int, int]:
    columns = np.flatnonzero((image > 0).any(axis=0))
    return int(columns[0]), int(columns[-1])


def place_of(part: np.ndarray, whole: np.ndarray) -> int:
    """Return the column where a picture's ink stands within another one, but for parts of a pixel."""
    first, last = ends(part)
    ink = part[:, first : last + 1].astype(int)
    columns = range(whole.shape[1] - ink.shape[1] + 1)
    differences = [np.abs(whole[:, c : c + ink.shape[1]] - ink).sum() / ink.sum() for c in columns]
    assert min(differences) < 0.4, "the picture is not there"
    return int(np.argmin(differences))


@shaped
def test_the_words_of_a_right_to_left_line_follow_each_other_to_the_left() -> None:
    line = drawn("שלום עולם", to_left=True)
    assert place_of(drawn("שלום", to_left=True), line) > place_of(drawn("עולם", to_left=True), line)


@shaped
def test_latin_words_within_keep_their_order_and_bold_ones_their_place() -> None:
    """Read from the right: Hebrew, "Page Down" from the left, Hebrew; a bold word is a run of its own."""
    line = drawn("לחצו Page Down עכשיו", to_left=True)
    first, latin, last = (drawn(word, to_left=True) for word in ("לחצו", "Page Down", "עכשיו"))
    assert place_of(last, line) < place_of(latin, line) < place_of(first, line)
    bold = drawn("לחצו **Y** עכשיו", to_left=True)
    assert place_of(last, bold) < place_of(drawn("**Y**"), bold) < place_of(first, bold)


@shaped
def test_arabic_letters_join() -> None:
    """Four letters that join are narrower than the four alone, and their ink is one piece."""
    joined = ends(drawn("ستمر", to_left=True))
    alone = sum(np.ptp(ends(drawn(letter, to_left=True))) for letter in "ستمر")
    assert np.ptp(joined) < 0.9 * alone
    inked = drawn("ستمس"[:2], to_left=True)[:, slice(*ends(drawn("ستمس"[:2], to_left=True)))].any(axis=0)
    assert inked.all()


@shaped
def test_a_combining_mark_takes_no_width_of_its_own() -> None:
    assert Line(words_of("שָׁ"), 40, None).width == pytest.approx(Line(words_of("ש"), 40, None).width)
    composed, decomposed = drawn("é"), drawn("e\u0301")
    np.testing.assert_array_equal(composed, decomposed)


@shaped
def test_paragraphs_of_a_right_to_left_page_begin_at_the_right_and_its_digits_stay_as_on_the_keys() -> None:
    page = page_image("# שלום\n\nהניסוי הזה בודק עד כמה אנשים מבחינים בשינוי הבהירות של מסך.", SIZE)
    rows = np.flatnonzero((page > 0).any(axis=1))
    breaks = np.flatnonzero(np.diff(rows) > 12)
    title, rest = page[: rows[breaks[0]] + 1], page[rows[breaks[0]] + 1 :]
    assert ends(title)[1] == pytest.approx(ends(rest)[1], abs=4)
    assert ends(title)[0] > ends(rest)[0] + 50
    plain = centred_image("7   8   9", SIZE, scale=1.0)
    mixed = centred_image("היכן הפתח?\n\n7   8   9", SIZE)
    digits = mixed[np.flatnonzero((mixed > 0).any(axis=1))[-1] - 14 :]
    assert ends(digits) == pytest.approx(ends(plain), abs=2)
    seven = page_image("7", SIZE)
    assert place_of(seven[(seven > 0).any(axis=1)], digits[(digits > 0).any(axis=1)]) == pytest.approx(
        ends(digits)[0], abs=2
    )


def test_most_letters_say_which_way_a_page_runs() -> None:
    assert runs_to_left("לחצו Y או N")
    assert not runs_to_left("Press כן")
    assert not runs_to_left("1 2 3")


def test_japanese_lines_end_anywhere_but_before_a_full_stop_and_after_an_opening_bracket() -> None:
    words = ["".join(piece for piece, _ in word) for word in words_of("画面（明るさ）が\n変化した。")]
    assert [word.rstrip(LINE_MAY_END) for word in words] == [
        "画", "面", "（明", "る", "さ）", "が", "変", "化", "し", "た。",
    ]  # fmt: skip


def test_a_latin_word_among_ideographs_is_not_divided_and_gets_no_space() -> None:
    words = ["".join(piece for piece, _ in word) for word in words_of("キーEscを押す")]
    assert [word.rstrip(LINE_MAY_END) for word in words] == ["キー", "Esc", "を", "押", "す"]
    assert Line(words_of("aを"), 40, DEJAVU).width < Line(words_of("a を"), 40, DEJAVU).width


def test_korean_and_thai_lines_end_where_they_are_written_to() -> None:
    """Korean has spaces; Thai pages have zero-width spaces, which take no room."""
    assert len(words_of("화면의 밝기가 변했습니까")) == 3
    assert len(words_of(f"การ{LINE_MAY_END}ทดลอง")) == 2
    assert Line(words_of(f"ab{LINE_MAY_END}c"), 40, None).width == Line(words_of("abc"), 40, None).width


def test_a_labs_own_font_is_used_and_dejavu_for_what_it_lacks() -> None:
    own, ours = drawn("iiii", font=MONO), drawn("iiii")
    assert np.ptp(ends(own)) > 1.5 * np.ptp(ends(ours))  # of fixed width
    lacking = next(c for c in typesetting._letters(DEJAVU) - typesetting._letters(MONO) if chr(c).isalpha())
    np.testing.assert_array_equal(drawn(chr(lacking), font=MONO), drawn(chr(lacking)))
    regular, bold = drawn("ab", font=MONO), drawn("**ab**", font=MONO)
    assert bold.sum(dtype=float) > 1.05 * regular.sum(dtype=float)


def test_a_letter_that_no_font_has_is_named_with_the_way_out() -> None:
    says = (
        r"'画' \(U\+753B, CJK UNIFIED IDEOGRAPH-753B\), which .*DejaVuSansMono.ttf and DejaVu Sans lack: give"
    )
    with pytest.raises(InputError, match=says) as refused:
        page_image("画面", SIZE, font=MONO)
    assert "\n" not in str(refused.value)


def test_a_file_that_is_no_font_is_refused(tmp_path: Path) -> None:
    (tmp_path / "notes.ttf").write_text("no font")
    for name, says in (
        ("notes.ttf", "cannot be read; expected a font file"),
        ("missing.ttf", "no such file"),
    ):
        with pytest.raises(InputError, match=rf"{name}: {says}"):
            typesetting.require_font(tmp_path / name)


def test_without_fribidi_a_page_that_needs_it_is_refused_and_others_are_not(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(typesetting, "_can_shape", lambda: False)
    with pytest.raises(InputError, match="FriBidi: on Debian apt-get install libfribidi0"):
        page_image("שלום", SIZE)
    assert page_image("größer, Стало темнее", SIZE).any()


def test_plain_lines_are_set_as_pillow_sets_them() -> None:
    """As before there were other scripts: one run, by the basic layout."""
    image = Image.new("L", (900, 80))
    font = ImageFont.truetype(str(DEJAVU), 40, layout_engine=ImageFont.Layout.BASIC)
    ImageDraw.Draw(image).text((20.0, 60.0), "Avoid 1 and 2.", fill=255, font=font, anchor="ls")
    np.testing.assert_array_equal(drawn("Avoid 1 and 2."), np.asarray(image))
