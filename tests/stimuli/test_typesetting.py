"""Pages in any script: which way lines run, where they end, which font has a letter."""

from pathlib import Path

import numpy as np
import pytest
from PIL import Image, ImageDraw, ImageFont, features

from evenlight.data_schema.errors import InputError
from evenlight.stimuli import typesetting
from evenlight.stimuli.page_image import centred_image, page_image
from evenlight.stimuli.typesetting import LINE_MAY_END, Line, runs_to_left, words_of

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
