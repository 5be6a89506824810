"""The command `evenlight displays`: what is known of each preset, as a device, and what is assumed of it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.notebook import display_facts
from evenlight.option_panels import QuietOption, complete_display

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display

WIDEST = 110  # columns, as of help pages
HEADINGS = (
    "name", "device", "pixels", "size [mm]", "seen from", "pixels/°", "cd/m²", "dimmed by", "power model",
)  # fmt: skip
NOTE = (
    "cd/m²: white, then black. Without a power model savings are not told: measure one by `evenlight run "
    "power-sweep`, and give it as --power-model. `evenlight new rig` writes a display of your own."
)
NUMBERS = range(2, 7)  # columns that end at the right


def displays(
    name: Annotated[
        str | None,
        typer.Argument(
            help="Only this one, with its sources: a preset, or a display's own file.",
            autocompletion=complete_display,
        ),
    ] = None,
    quiet: QuietOption = False,
) -> None:
    """List the displays that are known by name: size, luminance, what dims them, and what is assumed."""
    from evenlight.method.preset_files import load_display, preset_names

    if name is not None:
        lines = [*_told(load_display(name))]
    elif quiet:
        lines = preset_names("display")
    else:
        lines = [*_table([load_display(one) for one in preset_names("display")])]
    typer.echo("\n".join(lines))


def _table(shown: Sequence[Display]) -> Iterator[str]:
    facts = [display_facts(display) for display in shown]
    rows = [HEADINGS, *([one[heading] for heading in HEADINGS] for one in facts)]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row, display in zip(rows, (None, *shown), strict=True):
        cells = (
            cell.rjust(width) if k in NUMBERS else cell.ljust(width)
            for k, (cell, width) in enumerate(zip(row, widths, strict=True))
        )
        yield "  ".join(cells).rstrip()
        if display is not None and display.assumed:
            yield from _wrapped(f"assumed: {display.assumed}", 2)
    yield ""
    yield from _wrapped(NOTE, 0)


def _told(display: Display) -> Iterator[str]:
    for heading, said in display_facts(display).items():
        first, *others = _wrapped(said or "not known", 13)
        yield f"{heading:<13}{first.strip()}"
        yield from others


def _wrapped(words: str, indent: int) -> list[str]:
    blank = " " * indent
    return textwrap.wrap(words, WIDEST, initial_indent=blank, subsequent_indent=blank, break_on_hyphens=False)
