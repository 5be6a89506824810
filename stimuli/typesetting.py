"""Lines of text in any script: which font has a letter, where a line may end, which way it runs.

Letters that join, stack or run from right to left are shaped by HarfBuzz and ordered by FriBidi, both through
Pillow; plain ones are set without them, alike on every machine. The font is a lab's own, where one is given,
and for what it lacks the DejaVu Sans that comes with matplotlib.
"""

from __future__ import annotations

import functools
import re
import unicodedata
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from evenlight.data_schema.errors import InputError
from evenlight.data_schema.storage.input_files import require_plain_file

if TYPE_CHECKING:
    from PIL.ImageDraw import ImageDraw
    from PIL.ImageFont import FreeTypeFont

Word = tuple[tuple[str, bool], ...]  # its pieces, and whether each is bold
Face = tuple[Path, bool]  # a font file, and whether its letters are thickened, for it has no bold ones
LINE_MAY_END = "\u200b"  # zero-width space: Thai and Khmer pages have it between their words
WIDE_GAP = "\u2003\u2003"  # two em spaces, at which no line ends
THICKENING = 0.015  # em, on either side of a stroke that is to look bold
RIGHT_TO_LEFT = ("R", "AL")  # classes of letters in Unicode's bidirectional algorithm (Annex 9)
# Chinese and Japanese: a line may end between any two of these (Unicode, Annex 14) ...
IDEOGRAPHS = "\u2e80-\u9fff\uf900-\ufaff\uff00-\uffef\U00020000-\U0003ffff"
# ... but not before or after some (JIS X 4051).
NEVER_FIRST = "、。，．・：；？！）」』】〉》〕］｝”’…‥ー々ぁぃぅぇぉっゃゅょゎァィゥェォッャュョヮ%),.:;!?"
NEVER_LAST = "（「『【〈《〔［｛“‘("
ENDS = re.compile(
    f"(?<=[{IDEOGRAPHS}])(?<![{NEVER_LAST}])(?=[^\\s*])(?![{NEVER_FIRST}])"
    f"|(?<=[^\\s*])(?<![{NEVER_LAST}])(?=[{IDEOGRAPHS}])(?![{NEVER_FIRST}])"
)


def words_of(text: str) -> tuple[Word, ...]:
    """Return the words of a text; a space that must not break stays within its word, three are a wide gap.

    A line may end after each word; one that no space follows ends with a zero-width space.

    >>> words_of("press **any key**, now")
    ((('press', False),), (('any', True),), (('key', True), (',', False)), (('now', False),))
    >>> [word[0][0].rstrip(LINE_MAY_END) for word in words_of("明るさは「変化」。")]
    ['明', 'る', 'さ', 'は', '「変', '化」。']
    """
    words: list[list[tuple[str, bool]]] = [[]]
    bold = False
    gaps = re.sub(
        r"(?<=\S) {3,}(?=\S)", WIDE_GAP, unicodedata.normalize("NFC", text).replace("\u3000", "\u2003")
    )
    joined = re.sub(f"(?<=[{IDEOGRAPHS}])\r?\n(?=[{IDEOGRAPHS}])", "", gaps)
    for piece in re.split(rf"(\*\*|[ \t\r\n]+|{LINE_MAY_END})", ENDS.sub(LINE_MAY_END, joined)):
        if piece == "**":
            bold = not bold
        elif piece == LINE_MAY_END and words[-1]:
            last, was_bold = words[-1].pop()
            words[-1].append((last + LINE_MAY_END, was_bold))
            words.append([])
        elif piece.strip(" \t\r\n" + LINE_MAY_END):
            words[-1].append((piece, bold))
        elif piece:
            words.append([])
    return tuple(tuple(word) for word in words if word)


def runs_to_left(text: str) -> bool:
    """Return whether most letters of a text run from right to left.

    >>> runs_to_left("اضغط Y الآن"), runs_to_left("Press Y: כן"), runs_to_left("7 8 9")
    (True, False, False)
    """
    classes = [unicodedata.bidirectional(letter) for letter in text]
    return sum(found in RIGHT_TO_LEFT for found in classes) > classes.count("L")


def beginning(text: str) -> str:
    r"""Return the first words of a text, for a message.

    >>> beginning("# Welcome\n\nThank you")
    "'# Welcome'"
    """
    return repr(text.strip().splitlines()[0][:40]) if text.strip() else "''"


def require_letters(text: str, font: Path | None) -> None:
    """Refuse a text with a letter that no font has."""
    quoted = beginning(text)
    for letter in unicodedata.normalize("NFC", text):
        if (
            not letter.isspace()
            and unicodedata.category(letter) != "Cf"
            and _face(letter, False, font) is None
        ):
            name = unicodedata.name(letter, "a character without a name")
            lacking = "which DejaVu Sans lacks" if font is None else f"which {font} and DejaVu Sans lack"
            raise InputError(
                f"the page {quoted} has {letter!r} (U+{ord(letter):04X}, {name}), {lacking}: give a font "
                "file that has it as `font`"
            )
    if _is_shaped(text) and not _can_shape():
        raise InputError(
            f"the page {quoted} has letters that join or run from right to left, which needs the library "
            "FriBidi: on Debian apt-get install libfribidi0, on macOS brew install fribidi"
        )


def require_font(path: Path) -> None:
    """Refuse a file that is no font."""
    require_plain_file(path, "a font")
    _letters(path)


class Line(NamedTuple):
    """A line of type."""

    words: tuple[Word, ...]
    size: int  # of its letters [pixels]
    font: Path | None = None  # a lab's own
    to_left: bool = False  # whether it runs from right to left
    # where its baseline begins, from the left (the right, of one that runs to the left) and the top [pixels]
    x: float = 0.0
    y: float = 0.0

    @property
    def width(self) -> float:
        """Its width [pixels]."""
        return sum(_width(run, self.size, self.to_left) for run in _runs(self.words, self.font))

    def draw(self, draw: ImageDraw, at: tuple[float, float]) -> None:
        """Draw it from its left end `at`.

        What is bold, or in another font, is a run of its own; runs follow each other in the line's direction.
        """
        x, baseline = at
        runs = _runs(self.words, self.font)
        for run in reversed(runs) if self.to_left else runs:
            how = _how(run, self.size, self.to_left)
            bolder = THICKENING * self.size if run[1][1] else 0  # for a font without bold letters
            draw.text((x, baseline), run[0], fill=255, anchor="ls", stroke_width=bolder, **how)
            x += _width(run, self.size, self.to_left)


Run = tuple[str, Face]


@functools.lru_cache(maxsize=4096)  # the same lines are tried in many sizes
def _runs(words: tuple[Word, ...], font: Path | None) -> tuple[Run, ...]:
    runs: list[Run] = []
    last_bold = False
    for number, word in enumerate(words):
        spaced = number + 1 < len(words) and not word[-1][0].endswith(LINE_MAY_END)
        pieces = [*word, (" ", word[-1][1])] if spaced else word
        for text, bold in pieces:
            for letter in text.replace(LINE_MAY_END, ""):
                face = _face(letter, bold, font) or _dejavu(bold)
                if runs and bold == last_bold and _goes_with(letter, runs[-1][1]):
                    face = runs[-1][1]
                last_bold = bold
                if runs and runs[-1][1] == face:
                    runs[-1] = (runs[-1][0] + letter, face)
                else:
                    runs.append((letter, face))
    return tuple(runs)


def _goes_with(letter: str, face: Face) -> bool:
    """Return whether a mark or a space is set in the face of the letter before: "Page Down" is one run."""
    if unicodedata.category(letter) == "Cf":  # joiners and marks of direction have no picture
        return True
    return not letter.isalnum() and ord(letter) in _letters(face[0])


@functools.lru_cache(maxsize=16384)
def _width(run: Run, size: int, to_left: bool) -> float:
    how = _how(run, size, to_left)
    return float(how.pop("font").getlength(run[0], **how))


def _how(run: Run, size: int, to_left: bool) -> dict[str, Any]:
    text, (path, _) = run
    shaped = to_left or _is_shaped(text)
    direction = {"direction": "rtl" if to_left else "ltr"} if shaped else {}
    return {"font": _font(path, size, shaped), **direction}


def _is_shaped(text: str) -> bool:
    return any(
        unicodedata.bidirectional(letter) in RIGHT_TO_LEFT or unicodedata.category(letter) in ("Mn", "Mc")
        for letter in text
    )


@functools.cache
def _can_shape() -> bool:
    from PIL import features

    return bool(features.check_feature("raqm") and features.check_feature("fribidi"))


@functools.lru_cache(maxsize=4096)
def _face(letter: str, bold: bool, font: Path | None) -> Face | None:
    faces = [(font, bold)] if font is not None else []
    faces += [_dejavu(True)] if bold else []
    faces.append((_dejavu(False)[0], bold))
    return next((face for face in faces if ord(letter) in _letters(face[0])), None)


@functools.cache
def _dejavu(bold: bool) -> Face:
    import matplotlib

    name = "DejaVuSans-Bold.ttf" if bold else "DejaVuSans.ttf"
    return Path(matplotlib.get_data_path()) / "fonts" / "ttf" / name, False


@functools.cache
def _letters(path: Path) -> frozenset[int]:
    from matplotlib.ft2font import FT2Font

    try:
        return frozenset(FT2Font(str(path)).get_charmap())
    except (OSError, RuntimeError):
        raise InputError(f"{path}: cannot be read; expected a font file, such as NotoSans.ttf") from None


@functools.lru_cache(maxsize=64)
def _font(path: Path, size: int, shaped: bool) -> FreeTypeFont:
    from PIL import ImageFont

    layout = ImageFont.Layout.RAQM if shaped else ImageFont.Layout.BASIC
    return ImageFont.truetype(str(path), size, layout_engine=layout)
