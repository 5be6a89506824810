"""The command `evenlight new`: files of a lab to fill in, with a comment on every key."""

from __future__ import annotations

import json
import os
import re
import shlex
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.option_panels import QuietOption

if TYPE_CHECKING:
    from evenlight.data_schema.display import Display

new = typer.Typer(invoke_without_command=True)


@new.callback()
def begin(context: typer.Context) -> None:
    """Write files that describe your rig, display and study, to fill in."""
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


@new.command()
def rig(
    file: Annotated[Path, typer.Argument(help="The rig to write, such as desk.rig.toml.")],
    display: Annotated[
        str, typer.Option(help="Begin with the numbers of this preset, or use a display's own toml file.")
    ] = "desktop-lcd",
    width_mm: Annotated[
        float | None,
        typer.Option("--width-mm", metavar="MM", min=1.0, help="Width of your display's picture."),
    ] = None,
    distance_m: Annotated[
        float | None,
        typer.Option("--distance-m", metavar="M", min=0.01, max=100.0, help="Distance from eye to display."),
    ] = None,
    pixels: Annotated[
        str | None,
        typer.Option(metavar="WIDTHxHEIGHT", help="Your display's pixels, if they are not the preset's."),
    ] = None,
    force: Annotated[
        bool, typer.Option("--force", help="Replace files that exist; never a measured display.")
    ] = False,
    quiet: QuietOption = False,
) -> None:
    """Write a rig (screen, keys, instruments) and its display: toml files with a comment on every key."""
    from evenlight.data_schema.mapping import mapping_from_record
    from evenlight.data_schema.storage.whole_files import write_whole
    from evenlight.method.preset_files import load_display, preset_names

    if file.suffix != ".toml" or not file.absolute().parent.is_dir():
        raise InputError(f"{file}: a rig is a toml file in a folder that is there, such as desk.rig.toml")
    stem = file.name.removesuffix(".toml").removesuffix(".rig")
    shown, is_preset = load_display(display), display in preset_names("display")
    beside = file.with_name(f"{stem}.display.toml") if is_preset else Path(display)
    for path in (file, beside) if is_preset else (file,):
        if path.exists() and not force:
            raise InputError(f"{path}: is there already; give another name, or --force to replace it")
    own = (width_mm, distance_m, pixels)
    if is_preset:
        shown = _of_size(shown, *own)
    elif any(value is not None for value in own):
        raise InputError(f"{display} has its own size: --width-mm, --distance-m, --pixels are for a preset")
    values: dict[str, object] = {"name": stem, "display": os.path.relpath(beside, file.parent)}
    if is_preset:
        _require_unmeasured(beside)
        values |= {"viewing_distance_m": shown.viewing_distance} if shown.viewing_distance else {}
        known = mapping_from_record(shown)
        del known["measured"], known["provenance"]
        known |= {"name": stem, "source": f"the preset {display}, not measured"}
        write_whole(beside, _filled("new_display.toml", known).encode())
    write_whole(file, _filled("desk.rig.toml", values).encode())
    named_file = shlex.quote(str(file))
    numbers = (
        f"the numbers of the preset {display}, to be replaced by yours" if is_preset else repr(shown.name)
    )
    if quiet:
        return
    typer.echo(
        f"{file} describes the rig, {beside} its display ({numbers})\n"
        f"to rehearse: evenlight run ramp --participant 01 --session 01 --rig {named_file} --design quick "
        "--simulate data --out rehearsal\n"
        f"before people take part: measure the display, and write when into {beside} (measured)"
    )


@new.command()
def study(
    dataset: Annotated[Path, typer.Argument(help="The data set's folder, which is made if there is none.")],
    quiet: QuietOption = False,
) -> None:
    """Write study.toml into a data set: whose it is, under which licence and approval; exports carry it."""
    from evenlight.data_schema.recordings.dataset_layout import STUDY
    from evenlight.data_schema.recordings.study import blank_study
    from evenlight.data_schema.storage.whole_files import make_folder, write_whole

    file = dataset / STUDY
    if file.exists():
        raise InputError(f"{file}: is there already; fill it in, or move it away")
    make_folder(dataset, 0o700)
    write_whole(file, blank_study())
    if not quiet:
        typer.echo(f"{file}: fill in authors, licence and ethics; what stays blank no export tells")


def _of_size(display: Display, width: float | None, distance: float | None, pixels: str | None) -> Display:
    """Return a display of another width [mm], at another distance [m], with other pixels, where given."""
    from evenlight.data_schema.display import pixels_per_degree_at
    from evenlight.stimuli.commands import size_in

    if width is None and distance is None and pixels is None:
        return display
    resolution, seen_from = (
        size_in(pixels, "--pixels") or display.resolution,
        distance or display.viewing_distance,
    )
    if display.size is None or resolution is None or seen_from is None:
        raise InputError(
            f"{display.name} has no flat picture: begin with a monitor, laptop-lcd or phone-oled"
        )
    across = width or display.size[0]
    size = across, round(across * resolution[1] / resolution[0], 1)
    found = pixels_per_degree_at(resolution, size, seen_from)
    return replace(
        display,
        resolution=resolution,
        size=size,
        viewing_distance=seen_from,
        pixels_per_degree=round(found, 2),
    )


def _require_unmeasured(display: Path) -> None:
    """Refuse to replace a display that was measured, though --force be given."""
    if not display.exists():
        return
    lines = display.read_text(encoding="utf-8", errors="replace").splitlines()
    if any(line.startswith("measured") for line in lines):
        raise InputError(
            f"{display}: is a measured display, which --force does not replace; keep it with --display "
            f"{shlex.quote(str(display))}, or give the rig another name"
        )


def _filled(template: str, values: Mapping[str, object]) -> str:
    """Return a file of the folder of rigs with some values in place of its own."""
    from evenlight.hardware.rig_files import RIGS

    text = (RIGS / template).read_text(encoding="utf-8")
    for key, value in values.items():
        begin, after = text.split(f"\n{key} = ", 1)
        old = re.match(r'"[^"]*"|\S+', after)
        assert old is not None  # each key has a value
        new = old[0] if value is None else json.dumps(value, ensure_ascii=False)
        text = f"{begin}\n{'# ' * (value is None)}{key} = {new}{after[old.end() :]}"
    return text
