"""The command `evenlight displays`: what is known of each preset, as a device, and what is assumed of it."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Annotated

import typer

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
    rows = [HEADINGS, *(_cells(display) for display in shown)]
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


def _cells(display: Display) -> tuple[str, ...]:
    across, size = display.resolution, display.size
    seen = "" if display.viewing_distance is None else f"{display.viewing_distance:g} m"
    if display.field_of_view is not None:
        seen = f"{display.field_of_view:g}° wide"
    return (
        display.name,
        display.device,
        "" if across is None else f"{across[0]} x {across[1]}",
        "" if size is None else f"{size[0]:.0f} x {size[1]:.0f}",
        seen,
        f"{display.pixels_per_degree:.3g}",
        f"{display.peak_luminance:.4g}, {display.black_level:.2g}",
        display.actuator.value if display.actuator else "",
        display.power_model or "none",
    )


def _told(display: Display) -> Iterator[str]:
    words = dict(zip(HEADINGS, _cells(display), strict=True))
    words |= {
        "gamma": f"{display.gamma:g}",
        "panel": display.panel.value if display.panel else "",
        "measured": display.measured,
        "source": display.source,
    }
    for heading, said in words.items():
        first, *others = _wrapped(said or "not known", 13)
        yield f"{heading:<13}{first.strip()}"
        yield from others


def _wrapped(words: str, indent: int) -> list[str]:
    blank = " " * indent
    return textwrap.wrap(words, WIDEST, initial_indent=blank, subsequent_indent=blank, break_on_hyphens=False)
