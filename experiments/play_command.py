"""The command `evenlight play`: a video with its brightness track, on a window."""

from __future__ import annotations

import enum
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from data_schema.errors import InputError

if TYPE_CHECKING:
    from data_schema.display import Display
    from data_schema.rig import Rig
    from experiments.play_log import Pass
    from experiments.playback import Playback

FREE_RUNNING = 1.1  # times as many refreshes as the display makes


class Version(enum.Enum):
    """What is played."""

    OURS = "ours"  # by the track
    BASELINE = "baseline"  # constantly, at equal power
    BOTH = "both"  # one after the other
    FULL = "full"  # undimmed


def play(
    video: Annotated[
        str, typer.Argument(help="Video file, folder of images, or built-in sequence; a scene with --walk.")
    ],
    track: Annotated[
        Path | None, typer.Argument(help="Its track.csv, or the folder that holds it; none with --walk.")
    ] = None,
    version: Annotated[
        Version | None,
        typer.Option(help="By the track (if not given), constant at equal power, both in turn, undimmed."),
    ] = None,
    rig: Annotated[
        str | None, typer.Option(help="Rig: a toml file or a preset; else a window as large as the video.")
    ] = None,
    display: Annotated[
        str | None, typer.Option(help="Display: a preset or a toml file; else the rig's, or the track's.")
    ] = None,
    other_display_ok: Annotated[
        bool, typer.Option("--other-display-ok", help="Accept a track that was made for another display.")
    ] = False,
    size: Annotated[
        str | None, typer.Option(help="Size of a built-in sequence or a scene in pixels, as 640x360.")
    ] = None,
    loop: Annotated[bool, typer.Option("--loop", help="Begin again at the end, until escape.")] = False,
    label: Annotated[bool, typer.Option("--label", help="Say on the picture how it is dimmed.")] = False,
    log: Annotated[
        Path | None, typer.Option(help="File for flip times, frames, factors, drops: .csv or .jsonl.")
    ] = None,
    screenshots: Annotated[Path | None, typer.Option(help="Folder for a picture of the screen.")] = None,
    walk: Annotated[
        bool,
        typer.Option(
            "--walk", help="Walk in the scene house or school: W, A, S, D, arrows, mouse; shift hurries."
        ),
    ] = False,
    factor: Annotated[float | None, typer.Option(help="Brightness factor of a walk; else 1.")] = None,
    record: Annotated[
        Path | None, typer.Option(help="File for the way walked, .json: a path that `render` takes.")
    ] = None,
    seconds: Annotated[float | None, typer.Option(help="End a walk after so many seconds.")] = None,
    simulate: Annotated[
        bool, typer.Option("--simulate", help="As fast as it goes, on a clock that counts the refreshes.")
    ] = False,
    quiet: Annotated[bool, typer.Option("--quiet", help="Say nothing of what is shown.")] = False,
) -> None:
    """Show a video with its brightness track (keys: 1 ours, 2 baseline, 3 undimmed), or walk; escape ends."""
    of_videos = {"TRACK": track, "--version": version, "--log": log, "--loop": loop, "--label": label}
    of_videos["--other-display-ok"] = other_display_ok
    of_walks = {"--factor": factor, "--record": record, "--seconds": seconds}
    if walk:
        _refuse(
            of_videos, "--walk takes no {}, which is for videos; --record keeps the way, --factor dims it"
        )
        from experiments.walk_request import WalkRequest, walk_as_asked

        dimmed = 1.0 if factor is None else factor
        asked = WalkRequest(video, rig, display, size, dimmed, record, seconds, screenshots, simulate)
        said = walk_as_asked(asked)
        if not quiet:
            typer.echo(said)
        return
    _refuse(of_walks, "{} is for walks through a scene: give it with --walk, or leave it out")
    if track is None:
        raise InputError("play needs a TRACK: the folder that `evenlight optimize` wrote, or its track.csv")
    from experiments.play_log import require_log_file
    from experiments.play_request import playback_of, rig_of, video_of
    from experiments.track_fit import load_track, require_display, require_fit

    if loop and simulate:
        raise InputError("--loop goes on until somebody presses escape, and with --simulate nobody does")
    if log is not None:
        require_log_file(log)
    loaded = load_track(track)
    source, pixels = video_of(video, loaded.track, size)
    require_fit(source, loaded.track)
    used, panel = rig_of(rig, display, loaded.track.header.display_name, pixels)
    if not other_display_ok:
        require_display(loaded.track, panel)
    version = version or Version.OURS
    if not quiet and version in (Version.BASELINE, Version.BOTH):
        typer.echo(f"baseline: constant factor {loaded.baseline:.4g}, {loaded.source_of_baseline}")
    versions = ("ours", "baseline") if version is Version.BOTH else (version.value,)
    playback = playback_of(source, loaded, versions)
    playback = replace(playback, loop=loop, captions=label, screenshots=screenshots)
    _play(playback, used, panel, _How(simulate, rig is None, quiet, log))


def _refuse(options: Mapping[str, object], because: str) -> None:
    """Refuse the first option that was given, in words that have room for its name."""
    for name, given in options.items():
        if given is not None and given is not False:
            raise InputError(because.format(name))


@dataclass(frozen=True, slots=True)
class _How:
    """How it is played: on a clock of flips, at any refresh rate, silently, with a log."""

    simulate: bool
    any_rate: bool
    quiet: bool
    log: Path | None


def _play(playback: Playback, rig: Rig, display: Display, how: _How) -> None:
    """Play, and say how it went; whatever ends it, the log is written."""
    from experiments.play_log import write_log
    from experiments.playback import Player, open_devices

    def say(words: str) -> None:
        if not how.quiet:
            typer.echo(f"showing {words}")

    with open_devices(rig, display, simulated=how.simulate, any_rate=how.any_rate) as devices:
        player = Player(devices, playback, say)
        try:
            whole = player.play()
        finally:
            if how.log is not None and player.passes:
                write_log(how.log, player.passes, devices.rig.refresh_rate)
    if not how.quiet:
        for one in player.passes:
            typer.echo(_said(one, playback, devices.rig.refresh_rate))
        if not whole:
            typer.echo("ended before its end")


def _said(one: Pass, playback: Playback, refresh_rate: float) -> str:
    """Return how a pass went, in one line."""
    shown = one.shown
    names = " and ".join(dict.fromkeys(one.versions))
    words = (
        f"{playback.video.name}, {names}: {len(set(shown.video_frames))} of {len(playback.times)} frames in "
        f"{len(shown.flip_times)} refreshes at {refresh_rate:.4g} Hz, {shown.frames_dropped} dropped"
    )
    seconds = shown.flip_times[-1] + 1 / refresh_rate
    if len(shown.flip_times) > FREE_RUNNING * seconds * refresh_rate:
        words += " (the flips waited for no display)"
    if not shown.probe_luminance:
        return words
    pairs = zip(shown.probe_luminance, shown.probe_intended, strict=True)
    error = max(abs(drawn - intended) for drawn, intended in pairs)
    return (
        f"{words}; luminance read back {len(shown.probe_luminance)} times, off by {error:.2g} cd/m^2 at most"
    )
