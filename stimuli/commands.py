"""The commands of this folder: `evenlight render`."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.progress import counted, shown_progress


def render(
    sequence: Annotated[str, typer.Argument(help="Name of a built-in sequence.")],
    out: Annotated[Path, typer.Option(help="File to write, ending in .mkv.")],
    size: Annotated[str | None, typer.Option(help="Size in pixels, as 640x360.")] = None,
    duration: Annotated[float | None, typer.Option(help="Length in seconds.")] = None,
    fps: Annotated[float | None, typer.Option(help="Frames per second.")] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace the file if it is there.")] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Show no progress.")] = False,
) -> None:
    """Render a built-in sequence to a lossless video (FFV1, 10 bits, Matroska)."""
    from evenlight.stimuli.sequences import built_in_sequence
    from evenlight.stimuli.video.video_file import write_video

    if out.exists() and not (force and out.is_file()):
        right = "give --force to replace it, or another name" if out.is_file() else "give the name of a file"
        raise InputError(f"--out {out}: is there already; {right}")
    source = built_in_sequence(sequence, size_in(size), duration, fps)
    with shown_progress(quiet) as progress:
        frames = counted(progress, source.frames(), f"rendering {source.name}", source.n_frames)
        write_video(out, frames, source.format.frames_per_second, bits=10)


def size_in(text: str | None) -> tuple[int, int] | None:
    """Read a size such as 640x360."""
    if text is None:
        return None
    match = re.fullmatch(r"([0-9]+)[xX×]([0-9]+)", text.strip())
    if match is None:
        raise InputError(f"--size {text}: give width and height in pixels, as 640x360")
    return int(match[1]), int(match[2])
