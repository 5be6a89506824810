"""The report: one self-contained HTML page of text, tables and figures, for screen and paper."""

from __future__ import annotations

import base64
import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape
from pathlib import Path

from evenlight.data_schema.storage.whole_files import write_whole

Cell = str | int | float | None
MANY_COLUMNS = 8  # from which on a table is set smaller
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
class Section:
    """A section of the report: paragraphs, then tables and figures.

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
    """

    title: str
    paragraphs: tuple[str, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    notes: tuple[str, ...] = ()
    simulated: bool = False
    mark: str = ""
    below: bool = False

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
        What came out, in a sentence or two.
    sections : tuple of Section
        In order.
    simulated_note : str
        What is said on top if any of them is simulated.
    banner : str
        What every page says on top, on screen and on paper; empty for nothing.
    """

    title: str
    lead: str
    sections: tuple[Section, ...] = field(default=())
    simulated_note: str = SIMULATED_NOTE
    banner: str = ""


def probability(p: float) -> str:
    """Return a probability for a cell: with two digits, or that it is small.

    >>> probability(0.456), probability(0.001)
    ('0.46', '< 0.01')
    """
    return "< 0.01" if p < 0.01 else f"{p:.2f}"


def write_report(path: Path, report: Report) -> None:
    """Write a report as an HTML file that needs no other file, no network and no script.

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
        f"<style>{_STYLE}{_banner_style(report.banner)}</style></head><body>",
        f'<p class="banner">{escape(report.banner)}</p>' if report.banner else "",
        "<main>",
        f"<h1>{escape(report.title)}</h1>",
        f'<p class="lead">{escape(report.lead)}</p>',
        f'<p class="simulated">{escape(report.simulated_note)}</p>' if simulated else "",
        _contents(report.sections),
        *(_section(number, section) for number, section in enumerate(report.sections, start=1)),
        "</main></body></html>\n",
    ]
    return "\n".join(part for part in parts if part)


def _banner_style(banner: str) -> str:
    """Return what puts a banner at the head of every printed page: the margin box of a page."""
    if not banner:
        return ""
    words = banner.translate({ord(c): f"\\{ord(c):06x}" for c in '"\\<\n'})  # as CSS writes them in a string
    return f'@page {{ @top-center {{ content: "{words}"; font: bold 9pt sans-serif; color: #882255; }} }}\n'


def _contents(sections: tuple[Section, ...]) -> str:
    """Return the table of contents."""
    own = [(k, section) for k, section in enumerate(sections, start=1) if not section.below]
    links = (f'<a href="#s{k}">{escape(section.title)}</a>' for k, section in own)
    return f"<nav>{' '.join(links)}</nav>" if len(sections) > 1 else ""


def _section(number: int, section: Section) -> str:
    """Return a section."""
    mark = "".join(f' <span class="mark">{escape(words)}</span>' for words in section.marks)
    heading = "h3" if section.below else "h2"
    return "\n".join(
        [
            f'<section id="s{number}"><{heading}>{escape(section.title)}{mark}</{heading}>',
            *(f"<p>{escape(text)}</p>" for text in section.paragraphs),
            *(f'<p class="note">{escape(text)}</p>' for text in section.notes),
            *(_figure(picture) for picture in section.pictures),
            *(_table(table) for table in section.tables),
            "</section>",
        ]
    )


def _figure(picture: Picture) -> str:
    """Return a figure with its picture inside."""
    data = base64.b64encode(picture.png).decode()
    caption = escape(picture.caption)
    return (
        f'<figure><img alt="{caption}" src="data:image/png;base64,{data}">'
        f"<figcaption>{caption}</figcaption></figure>"
    )


def _table(table: Table) -> str:
    """Return a table; columns of numbers are aligned to the right."""
    texts = [[cell_text(cell) for cell in row] for row in table.rows]
    numeric = [_are_numbers([row[k] for row in texts]) for k in range(len(table.columns))]
    kinds = [' class="number"' if is_numeric else "" for is_numeric in numeric]
    head = _cells("th", kinds, table.columns)
    body = "\n".join(f"<tr>{_cells('td', kinds, row)}</tr>" for row in texts)
    width = "wide many" if len(table.columns) >= MANY_COLUMNS else "wide"
    return (
        f'<div class="{width}"><table><caption>{escape(table.caption)}</caption>'
        f"<thead><tr>{head}</tr></thead>\n<tbody>{body}</tbody></table></div>"
    )


def _cells(element: str, kinds: Sequence[str], texts: Sequence[str]) -> str:
    """Return the cells of a row."""
    pairs = zip(kinds, texts, strict=True)
    return "".join(f"<{element}{kind}>{breakable(text)}</{element}>" for kind, text in pairs)


def breakable(text: str) -> str:
    """Return text for a cell, escaped, with places to break in long names (after / and _) and in hashes.

    >>> breakable("pipeline/stimuli/living_room/track.csv"), breakable("living_room")
    ('pipeline/<wbr>stimuli/<wbr>living_<wbr>room/<wbr>track.csv', 'living_room')
    """
    return "".join(_with_breaks(token) for token in re.split(r"(\s+)", text))


def _with_breaks(token: str) -> str:
    """Return a token, escaped, with the places where it may break."""
    if re.fullmatch(r"[0-9a-f]{32,}", token):
        parts = re.findall(".{1,16}", token)
    else:
        parts = re.split(r"(?<=[/_])", token) if len(token) > LONGEST_WHOLE else [token]
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


_NUMBER = r"(< |[-+±])?(0|[1-9][0-9]*)(\.[0-9]+)?(e[-+][0-9]+)?( %)?"


def _are_numbers(texts: list[str]) -> bool:
    """Return whether the cells of a column are numbers or ranges of numbers, some of them missing."""
    given = [text for text in texts if text != "–"]
    return bool(given) and all(re.fullmatch(f"{_NUMBER}( (to|of) {_NUMBER})?", text) for text in given)


_STYLE = """
:root { --ink: #22262b; --muted: #5f6670; --line: #d9dde2; --accent: #004488; --warn: #882255; }
* { box-sizing: border-box; }
html { background: #fff; color: var(--ink); font: 17px/1.55 Georgia, "Times New Roman", serif; }
body { margin: 0; }
main { max-width: 60rem; margin: 0 auto; padding: 3rem 1.5rem 5rem; }
h1, h2, h3, nav, table, figcaption, .mark, .simulated {
  font-family: "Helvetica Neue", Helvetica, Arial, "Liberation Sans", sans-serif;
}
h1 { font-size: 2.1rem; line-height: 1.2; letter-spacing: -0.01em; margin: 0 0 0.6rem; }
h2 { font-size: 1.35rem; line-height: 1.3; margin: 3rem 0 0.6rem; padding-top: 0.8rem;
  border-top: 2px solid var(--ink); }
h3 { font-size: 1.1rem; line-height: 1.3; margin: 2.2rem 0 0.5rem; }
p { max-width: 42rem; margin: 0 0 0.9rem; }
.lead { font-size: 1.2rem; color: var(--muted); }
.simulated, .note { border-left: 4px solid var(--warn); padding: 0.1rem 0 0.1rem 0.9rem; }
.simulated, .note, .mark { color: var(--warn); }
.simulated { font-size: 0.95rem; }
.banner { position: sticky; top: 0; z-index: 1; max-width: none; margin: 0; padding: 0.4rem 1.5rem;
  text-align: center; background: var(--warn); color: #fff; font: bold 0.9rem/1.4 sans-serif; }
.mark { font-size: 0.75rem; font-weight: normal; letter-spacing: 0.04em; vertical-align: 0.2em;
  border: 1px solid var(--warn); border-radius: 0.6rem; padding: 0.05rem 0.5rem; margin-left: 0.4rem; }
nav { margin: 1.6rem 0 0; font-size: 0.9rem; }
nav a { color: var(--accent); text-decoration: none; margin-right: 1.1rem; white-space: nowrap; }
nav a:hover { text-decoration: underline; }
figure { margin: 1.6rem 0; }
figure img { display: block; width: 100%; height: auto; }
figcaption { font-size: 0.85rem; line-height: 1.45; color: var(--muted); margin-top: 0.5rem;
  max-width: 46rem; }
.wide { position: relative; left: 50%; transform: translateX(-50%); margin: 1.4rem 0; overflow-x: auto;
  width: min-content; min-width: 100%; max-width: calc(100vw - 3rem); }
table { border-collapse: collapse; font-size: 0.85rem; line-height: 1.35;
  font-variant-numeric: tabular-nums; }
caption { text-align: left; color: var(--muted); padding-bottom: 0.5rem; }
th { text-align: left; font-weight: 600; vertical-align: bottom; border-bottom: 1.5px solid var(--ink); }
th, td { padding: 0.28rem 1.2rem 0.28rem 0; }
td { border-bottom: 1px solid var(--line); vertical-align: top; }
th:last-child, td:last-child { padding-right: 0; }
.many table { font-size: 0.78rem; }
.many th, .many td { padding-right: 0.8rem; }
@media (max-width: 60rem) {
  table { font-size: 0.78rem; }
  .many table { font-size: 0.68rem; }
  th, td, .many th, .many td { padding-right: 0.5rem; }
}
.number { text-align: right; }
td.number { white-space: nowrap; }
@page { size: A4; margin: 18mm 16mm; }
@media print {
  html { font-size: 10.5pt; }
  main { max-width: none; padding: 0; }
  nav, .banner { display: none; }
  h2, h3 { break-after: avoid; margin-top: 1.6rem; }
  table { font-size: 0.72rem; }
  .many table { font-size: 0.62rem; }
  th, td, .many th, .many td { padding-right: 0.6rem; }
  figure, tr, .note { break-inside: avoid; }
  figure img { max-height: 225mm; width: auto; max-width: 100%; }
  thead { display: table-header-group; }
  .wide { position: static; transform: none; width: auto; max-width: none; overflow: visible; }
}
"""
