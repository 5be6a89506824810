"""The command `evenlight apply`: a video dimmed by its track, as a file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evenlight.data_schema.errors import InputError
from evenlight.option_panels import QuietOption, asked, expert, output
from evenlight.progress import shown_progress
from evenlight.stimuli.dimmed.apply_options import AppliedVersion, Codec, DimmedFile

if TYPE_CHECKING:
    from evenlight.stimuli.dimmed.matched_track import MatchedTrack
    from evenlight.stimuli.video.video_source import VideoSource


def apply(
    video: Annotated[
        str, typer.Argument(help="The video: a file, a URL, a folder of images, or a built-in sequence.")
    ],
    track: Annotated[
        Path, typer.Argument(help="Its track: the folder that `evenlight optimize` wrote, or track.csv.")
    ],
    out: Annotated[Path, output(metavar="FILE", help="File to write: .mp4, .mov or .mkv.")],
    version: Annotated[
        AppliedVersion, asked(help="Dimmed by the track, constantly at equal power, or both in one picture.")
    ] = AppliedVersion.OURS,
    codec: Annotated[
        Codec | None,
        output(
            help="How to encode it: h264 plays everywhere; hevc10 and av1 have 10 bits; ffv1 is lossless.",
            show_default="h264; ffv1 in .mkv",
        ),
    ] = None,
    display: Annotated[
        str | None,
        expert(help="Display of an older track, which does not name it itself: a preset or a toml file."),
    ] = None,
    fps: Annotated[
        float | None, expert(help="Frames per second of images or a sequence. Otherwise the track's.")
    ] = None,
    other_video_ok: Annotated[
        bool, expert("--other-video-ok", help="Accept another video that has the same frame times.")
    ] = False,
    force: Annotated[bool, output("--force", help="Replace the file if it exists.")] = False,
    quiet: QuietOption = False,
) -> None:
    """Write the dimmed video to a file, with its sound, subtitles, frame times and tags."""
    from evenlight.data_schema.storage.whole_files import require_free
    from evenlight.stimuli.dimmed.apply_video import apply_track
    from evenlight.stimuli.dimmed.encoders import codec_for
    from evenlight.stimuli.dimmed.matched_track import match_track
    from evenlight.stimuli.video.video_locations import is_url, local_name

    video = local_name(video)
    encoding = codec_for(out, codec)
    if out.exists() and not is_url(video) and Path(video).exists() and out.samefile(video):
        raise InputError(f"--out {out}: is the video itself; give another name")
    require_free(out, force=force)
    source = _video_of(video, track, fps)
    matched = match_track(source, track, display, other_video_ok=other_video_ok)
    with shown_progress(quiet, f"dimming {source.name}", len(matched.loaded.track.times)) as progress:
        left_out = apply_track(source, matched, DimmedFile(out, encoding, version), progress.at)
    if not quiet:
        _say(source, matched, version, out, left_out)


def _video_of(name: str, track: Path, fps: float | None) -> VideoSource:
    from evenlight.data_schema.tracks.loaded_track import frame_durations, load_track
    from evenlight.stimuli.sequences import is_sequence, open_as_read
    from evenlight.stimuli.video.video_locations import is_url
    from evenlight.stimuli.video.video_source import rate_from_number

    path, made = Path(name), load_track(track).track
    if fps is None and not is_url(name) and (path.is_dir() or (is_sequence(name) and not path.exists())):
        fps = float(rate_from_number(1 / float(frame_durations(made).mean())))
    return open_as_read(name, made.header.film, fps)


def _say(
    video: VideoSource, matched: MatchedTrack, version: AppliedVersion, out: Path, left_out: list[str]
) -> None:
    loaded, factors = matched.loaded, matched.loaded.track.factors
    ours = f"dimmed by its track, factors {factors.min():.3g} to {factors.max():.3g}"
    constant = f"constant factor {loaded.baseline:.4g}, {loaded.source_of_baseline}"
    both = f"{ours} (left); {constant} (right)"
    shown = dict(zip(AppliedVersion, (ours, constant, both), strict=True))[version]
    typer.echo(f"{out}: {video.name}, {len(factors)} frames, {shown}")
    if left_out:
        typer.echo(f"{out} cannot hold, so it is left out: {', '.join(left_out)}", err=True)
