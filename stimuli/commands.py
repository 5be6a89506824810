"""The commands of this folder: `evenlight render`."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.option_panels import QuietOption, asked, expert, output, viewing
from evenlight.progress import counted, shown_progress

if TYPE_CHECKING:
    from evenlight.data_schema.frame import Frame
    from evenlight.stimuli.sequence_format import SequenceFormat

DIM = 1.0  # [cd/m^2] a film of less on the average is said to be dark
DARK = 0.2  # [cd/m^2] and so is one of which more than half is below this


def render(
    sequence: Annotated[
        str,
        typer.Argument(
            help="A built-in sequence or scene (library, gym, living_room, basement, house, checkerboard, "
            "sunrise), or with --path a .glb file."
        ),
    ],
    out: Annotated[
        Path, output(metavar="FILE", help="File to write: a video (.mkv), or the scene itself (.glb).")
    ],
    path: Annotated[Path | None, asked(help="Camera path through the scene (.json).")] = None,
    size: Annotated[str | None, asked(metavar="WxH", help="Size in pixels, such as 640x360.")] = None,
    duration: Annotated[float | None, asked(metavar="SECONDS", help="Length of the video.")] = None,
    fps: Annotated[float | None, asked(help="Frames per second.")] = None,
    field_of_view: Annotated[
        float | None, viewing(help="Visual angle that the width of the video spans.", show_default="90")
    ] = None,
    display: Annotated[
        str | None, viewing(help="Display that it fills, or pixel for pixel if its size is not known.")
    ] = None,
    strict: Annotated[
        bool, expert("--strict", help="Refuse a scene that is not shown in all as in its file.")
    ] = False,
    force: Annotated[bool, output("--force", help="Replace the file if it exists.")] = False,
    quiet: QuietOption = False,
) -> None:
    """Make a video file of a built-in sequence, or of a walk through a scene: lossless, 10 bits (FFV1)."""
    from evenlight.data_schema.storage.whole_files import require_free
    from evenlight.method.preset_files import load_display
    from evenlight.stimuli.scenes.content.catalogue import is_scene_file
    from evenlight.stimuli.scenes.scene_sequence import SceneSequence
    from evenlight.stimuli.sequences import built_in_sequence
    from evenlight.stimuli.video_writer import write_video

    require_free(out, force=force)
    if out.suffix.lower() == ".glb":
        if (size, duration, fps, field_of_view, display) != (None,) * 5:
            raise InputError(f"--out {out} is a scene: leave out the options of a video")
        _export(sequence, path, out, force)
        return
    if None not in (field_of_view, display):
        raise InputError("--field-of-view and --display both say how large the picture is seen; give one")
    seen = load_display(display) if display is not None else field_of_view
    name, scene = (sequence, "") if path is None else (str(path), sequence)
    source = built_in_sequence(name, size_in(size), duration, fps, seen, scene=scene)
    if isinstance(source, SceneSequence):
        source = replace(source, strict=strict)
    made, light = source.format, list[tuple[float, float]]()
    with shown_progress(quiet) as progress:
        frames = counted(progress, source.frames(), f"rendering {source.name}", source.n_frames)
        write_video(out, _watched(frames, light), made.frames_per_second, 10, made.field_of_view)
    if not quiet:
        _say_geometry(source.name, made)
    if isinstance(source, SceneSequence) and is_scene_file(source.path().scene):
        _warn_if_dark(source.path().scene, light)


def _say_geometry(name: str, made: SequenceFormat) -> None:
    from evenlight.stimuli.video.viewing_geometry import geometry_words, pixels_per_degree_in

    seen = geometry_words(made.field_of_view, pixels_per_degree_in(made.field_of_view, made.width))
    typer.echo(f"{name}: {made.width}x{made.height} pixels {seen}", err=True)


def _watched(frames: Iterable[Frame], light: list[tuple[float, float]]) -> Iterator[Frame]:
    import numpy as np

    from evenlight.stimuli.scenes.engine.graphics import PEAK
    from evenlight.stimuli.scenes.engine.scene import REC_709
    from evenlight.stimuli.sequence_format import ENCODING_GAMMA
    from evenlight.stimuli.video.frame_conversion import linear_light

    for frame in frames:
        luminance = PEAK * linear_light(frame.pixel_values[::4, ::4], ENCODING_GAMMA) @ REC_709
        light.append((float(luminance.mean()), float(np.mean(luminance < DARK))))
        yield frame


def _warn_if_dark(scene: str, light: list[tuple[float, float]]) -> None:
    mean, dark = (sum(values) / len(light) for values in zip(*light, strict=True))
    if mean < DIM or dark > 0.5:
        typer.echo(
            f"evenlight: warning: {scene}: the film is dark, {mean:.2g} cd/m² on the average, {dark:.0%} of "
            f"it below {DARK:g} cd/m²; raise the lamps' emissive_strength, or give the path a sky or a sun",
            err=True,
        )


def _export(name: str, path: Path | None, out: Path, force: bool) -> None:
    from evenlight.data_schema.storage.whole_files import write_whole
    from evenlight.stimuli.scenes.content.catalogue import (
        SCENES,
        is_scene_file,
        path_named,
        scene_named,
        scene_of,
    )
    from evenlight.stimuli.scenes.gltf.gltf_export import glb_of
    from evenlight.stimuli.sequences import WALKS

    if path is None and name in SCENES and name not in WALKS:
        write_whole(out, glb_of(scene_named(name)))
        return
    if path is None and is_scene_file(name):
        raise InputError(
            f"{name}: is a scene in glTF already; give a --path through it, and --out a .mkv file"
        )
    walk = path_named(name) if path is None else path_named(str(path), name)
    beside = out.with_suffix(".path.json")
    if beside.exists() and not force:
        raise InputError(f"{beside}: is there already, and the walk goes there; give --force to replace it")
    write_whole(out, glb_of(scene_of(walk)))
    write_whole(beside, walk.text)


def size_in(text: str | None, option: str = "--size") -> tuple[int, int] | None:
    """Read a size such as 640x360."""
    if text is None:
        return None
    match = re.fullmatch(r"([0-9]+)[xX×]([0-9]+)", text.strip())
    if match is None:
        raise InputError(f"{option} {text}: give width and height in pixels, as 640x360")
    return int(match[1]), int(match[2])
