"""The report: one self-contained HTML page of text, tables and figures, for screen and paper."""

from __future__ import annotations

import base64
import os
import re
from dataclasses import dataclass, field
from functools import cache
from html import escape
from pathlib import Path
from urllib.parse import quote

from evenlight.data_schema.storage.whole_files import write_whole

Cell = str | int | float | None
MANY_COLUMNS = 8  # from which on a table is set smaller
LONG_TABLE = 30  # rows above which a table scrolls by itself on screen, its header staying in sight
LONGEST_WHOLE = 16  # characters of a name that stays on one line

SIMULATED_NOTE = (
    "Simulated: the answers come from simulated participants, drawn at random around the published (yes/no) "
    "rate limit. They show how the procedure works and say nothing about people."
)


@dataclass(frozen=True, slots=True)
class Picture:
    """A figure of the report.

    Attributes
    ----------
    png : bytes
        The figure, from `png_bytes` or a file.
    caption : str
        What is to be seen; also the text for those who cannot see it.
    """

    png: bytes
    caption: str


@dataclass(frozen=True, slots=True)
class Table:
    """A table of the report.

    Attributes
    ----------
    caption : str
        What it lists.
    columns : tuple of str
        Names of the columns, with units.
    rows : tuple of tuples of str, int, float or None
        The cells; a float is shown with three significant digits, None as a dash.
    """

    caption: str
    columns: tuple[str, ...]
    rows: tuple[tuple[Cell, ...], ...]

    def __post_init__(self) -> None:
        for row in self.rows:
            if len(row) != len(self.columns):
                raise ValueError(f"each row needs {len(self.columns)} cells, got {len(row)}: {row}")


@dataclass(frozen=True, slots=True)
class Card:
    """A result beside the report: a picture of it, by which a page is opened.

    Attributes
    ----------
    page, picture : str
        Their paths, from the report's folder.
    title, words : str
        What it is, and what to know of it.
    """

    page: str
    picture: str
    title: str
    words: str


@dataclass(frozen=True, slots=True)
class KeyFigure:
    """One of the three or four figures with which a report begins.

    Attributes
    ----------
    value : str
        The figure with its unit, e.g. "0.33 points".
    what : str
        What it is, in a few words.
    beside : str
        What to hold it against, or how sure it is; empty for nothing.
    warns : bool
        Whether it says that something is wrong with the data.
    """

    value: str
    what: str
    beside: str = ""
    warns: bool = False

    @property
    def in_words(self) -> str:
        """The same on one line, as a terminal shows it."""
        told = f"{self.value} {self.what}" if self.what.startswith("of ") else f"{self.what}: {self.value}"
        return f"{told}{f' ({self.beside})' if self.beside else ''}"


@dataclass(frozen=True, slots=True)
class Section:
    """A section of the report: paragraphs, pictures, tables, then methods.

    Attributes
    ----------
    title : str
        Its heading.
    paragraphs : tuple of str
        Plain text.
    tables : tuple of Table
        Its tables.
    pictures : tuple of Picture
        Its figures.
    notes : tuple of str
        What a reader should be warned of.
    simulated : bool
        Whether it rests on simulated data; the heading says so.
    mark : str
        What else the heading says of where it comes from, e.g. "computed".
    below : bool
        Whether it belongs to the section before it: a smaller heading, and no line of the contents.
    links : tuple of (str, str)
        Pages beside the report, by their paths, and what they show.
    cards : tuple of Card
        Results beside the report, as a gallery; their pictures are loaded as they come into sight.
    key_figures : tuple of KeyFigure
        What came out, below the heading.
    methods : tuple of str
        How it was computed: the last that a reader looks for.
    """

    title: str
    paragraphs: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    notes: tuple[str, ...] = ()
    simulated: bool = False
    mark: str = ""
    below: bool = False
    links: tuple[tuple[str, str], ...] = ()
    cards: tuple[Card, ...] = ()
    key_figures: tuple[KeyFigure, ...] = ()
    methods: tuple[str, ...] = ()

    @property
    def marks(self) -> tuple[str, ...]:
        """What its heading says of where it comes from."""
        return tuple(mark for mark in ("simulated" if self.simulated else "", self.mark) if mark)


@dataclass(frozen=True, slots=True)
class Report:
    """A report.

    Attributes
    ----------
    title : str
        Its title.
    lead : str
        What came out, in at most 60 words.
    sections : tuple of Section
        In order.
    simulated_note : str
        What is said on top if any of them is simulated.
    banner : str
        What every page says on top, on screen and on paper; empty for nothing.
    key_figures : tuple of KeyFigure
        What came out, how sure it is, and what is wrong with the data if anything is: three or four.
    """

    title: str
    lead: str
    sections: tuple[Section, ...] = field(default=())
    simulated_note: str = SIMULATED_NOTE
    banner: str = ""
    key_figures: tuple[KeyFigure, ...] = ()


def probability(p: float) -> str:
    """Return a probability for a cell: with two digits, or that it is small.

    >>> probability(0.456), probability(0.001)
    ('0.46', '< 0.01')
    """
    return "< 0.01" if p < 0.01 else f"{p:.2f}"


def write_report(path: Path, report: Report) -> None:
    """Write a report as an HTML file that needs no network, no script, and no other file but those of cards.

    Parameters
    ----------
    path : Path
        The file.
    report : Report
        What to write; its text is plain, and is escaped here.
    """
    write_whole(path, report_html(report))


def report_html(report: Report) -> str:
    """Return a report as a page of HTML."""
    simulated = any(section.simulated for section in report.sections)
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en"><head><meta charset="utf-8">',
        '<meta name="viewport" content="width=device-width, initial-scale=1">',
        f"<title>{escape(report.title)}</title>",
        f"<style>{_style()}{_banner_style(report.banner)}</style></head><body>",
        f'<p class="banner">{escape(report.banner)}</p>' if report.banner else "",
        '<a class="skip" href="#s1">Skip the contents</a>' if len(report.sections) > 1 else "",
        "<main>",
        f"<h1>{escape(report.title)}</h1>",
        f'<p class="lead">{escape(report.lead)}</p>',
        _key_figures(report.key_figures),
        f'<p class="simulated">{escape(report.simulated_note)}</p>' if simulated else "",
        _contents(report.sections),
        *(_section(number, section) for number, section in enumerate(report.sections, start=1)),
        "</main></body></html>\n",
    ]
    return "\n".join(part for part in parts if part)


@cache
def _style() -> str:
    return Path(__file__).with_name("report.css").read_text(encoding="utf-8")


def _banner_style(banner: str) -> str:
    """Return what puts a banner at the head of every printed page: the margin box of a page."""
    if not banner:
        return ""
    words = banner.translate({ord(c): f"\\{ord(c):06x}" for c in '"\\<\n'})  # as CSS writes them in a string
    return f'@page {{ @top-center {{ content: "{words}"; font: bold 9pt sans-serif; color: #882255; }} }}\n'


def _contents(sections: tuple[Section, ...]) -> str:
    own = [(k, section) for k, section in enumerate(sections, start=1) if not section.below]
    links = (f'<li><a href="#s{k}">{escape(section.title)}</a></li>' for k, section in own)
    return f'<nav aria-label="Contents"><ul>{" ".join(links)}</ul></nav>' if len(sections) > 1 else ""


def _section(number: int, section: Section) -> str:
    mark = "".join(f' <span class="mark">{escape(words)}</span>' for words in section.marks)
    heading = "h3" if section.below else "h2"
    return "\n".join(
        [
            f'<section id="s{number}"><{heading}>{escape(section.title)}{mark}</{heading}>',
            *([_key_figures(section.key_figures)] if section.key_figures else ()),
            *(f"<p>{escape(text)}</p>" for text in section.paragraphs),
            *(f'<p><a href="{escape(path)}">{escape(text)}</a></p>' for path, text in section.links),
            *(f'<p class="note">{escape(text)}</p>' for text in section.notes),
            *(_figure(picture) for picture in section.pictures),
            *(_table(table) for table in section.tables),
            *([_cards(section.cards)] if section.cards else ()),
            *(f'<p class="methods">{escape(text)}</p>' for text in section.methods),
            "</section>",
        ]
    )


def _key_figures(figures: tuple[KeyFigure, ...]) -> str:
    items = "".join(_key_figure(own) for own in figures)
    return f'<ul class="key-figures">{items}</ul>' if figures else ""


def _key_figure(own: KeyFigure) -> str:
    kind = ' class="warns"' if own.warns else ""
    beside = f"<small>{escape(own.beside)}</small>" if own.beside else ""
    return f"<li{kind}><b>{escape(own.value)}</b> {escape(own.what)}{beside}</li>"


def _cards(cards: tuple[Card, ...]) -> str:
    items = (
        f'<li><a href="{_url(card.page)}"><img loading="lazy" alt="" src="{_url(card.picture)}">'
        f"<b>{breakable(card.title)}</b></a> {escape(card.words)}</li>"
        for card in cards
    )
    return f'<ul class="gallery">{"".join(items)}</ul>'


def _url(path: str) -> str:
    """Return a path beside the report as a link has it; the bytes of a name may be no text."""
    return quote(os.fsencode(path))


def _figure(picture: Picture) -> str:
    data = base64.b64encode(picture.png).decode()
    caption = escape(picture.caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _table(table: Table) -> str:
    texts = [[cell_text(cell) for cell in row] for row in table.rows]
    columns = [[row[k] for row in texts] for k in range(len(table.columns))]
    numeric = [_are_numbers(column) for column in columns]
    named = len(columns) > 1 and not numeric[0]  # the first column says what a row is about
    kinds = [' class="number"' if right else "" for right in numeric]
    head = "".join(_header(name, kind) for name, kind in zip(table.columns, kinds, strict=True))
    cells = [
        [f"<td{kind}>{breakable(text)}</td>" for text in column]
        for column, kind in zip(columns, kinds, strict=True)
    ]
    if named:
        cells[0] = [f'<th scope="row">{breakable(text)}</th>' for text in columns[0]]
    body = "\n".join(f"<tr>{''.join(row)}</tr>" for row in zip(*cells, strict=True))
    scrolls = len(texts) > LONG_TABLE
    kind = f"wide{' many' if len(columns) >= MANY_COLUMNS else ''}{' long' if scrolls else ''}"
    focus = ' tabindex="0"' if scrolls else ""  # so that keys scroll it, in every browser
    return (
        f'<div class="{kind}"{focus}><table><caption>{escape(table.caption)}</caption>'
        f"<thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>"
    )


def _header(name: str, kind: str) -> str:
    """Return the header of a column; one without a name is an empty cell, which heads nothing."""
    return f'<th scope="col"{kind}>{breakable(name)}</th>' if name else f"<td{kind}></td>"


def breakable(text: str) -> str:
    """Return text for a cell, escaped, with places to break in long names (after / and _) and in hashes.

    Short words with a hyphen stay whole.

    >>> breakable("pipeline/stimuli/living_room/track.csv"), breakable("living_room")
    ('pipeline/<wbr>stimuli/<wbr>living_<wbr>room/<wbr>track.csv', 'living_room')
    >>> breakable("mid-p")
    '<span class="whole">mid-p</span>'
    """
    return "".join(_with_breaks(token) for token in re.split(r"(\s+)", text))


def _with_breaks(token: str) -> str:
    """Return a token, escaped, with the places where it may break."""
    if re.fullmatch(r"[0-9a-f]{32,}", token):
        parts = re.findall(".{1,16}", token)
    elif len(token) > LONGEST_WHOLE:
        parts = re.split(r"(?<=[/_])", token)
    elif re.search(r"[^\W\d]-[^\W\d]", token):
        return f'<span class="whole">{escape(token)}</span>'
    else:
        parts = [token]
    return "<wbr>".join(escape(part) for part in parts if part)


def cell_text(cell: Cell) -> str:
    """Return a cell as text.

    >>> [cell_text(cell) for cell in ("a", 12000, 0.123456, 1234.5, 0.000012, None)]
    ['a', '12000', '0.123', '1234', '1.2e-05', '–']
    """
    if cell is None:
        return "–"
    if isinstance(cell, float):
        return f"{cell:.0f}" if 1000 <= abs(cell) < 1e6 else f"{cell:.3g}"
    return str(cell)


# More than ten digits are those of a revision.
_NUMBER = r"(< |[-+±])?(0|[1-9][0-9]{0,9})(\.[0-9]+)?(e[-+][0-9]+)?( %)?"


def _are_numbers(texts: list[str]) -> bool:
    """Return whether the cells of a column are numbers or ranges of numbers, some of them missing."""
    given = [text for text in texts if text != "–"]
    return bool(given) and all(re.fullmatch(f"{_NUMBER}( (to|of|±) {_NUMBER})?", text) for text in given)
