"""Plays a video with its track, as `evenlight play` is asked to."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import typer

from evenlight.data_schema.display import Display
from evenlight.data_schema.errors import InputError
from evenlight.data_schema.recordings.rig import Rig
from evenlight.data_schema.tracks.brightness_track import (
    BrightnessTrack,
    require_display_of,
    require_light_of,
)
from evenlight.data_schema.tracks.loaded_track import LoadedTrack, frame_durations, load_track, track_file
from evenlight.experiments.calibration_age import require_young
from evenlight.experiments.playback.headset_picture import require_as_analysed, seen_in_headset, words_of
from evenlight.experiments.playback.play_options import (
    FilmOptions,
    HeadsetOptions,
    PlayedVersion,
    VersionOptions,
    refuse,
)
from evenlight.experiments.playback.player import (
    Dimming,
    Pass,
    Playback,
    PlaybackDevices,
    Player,
    dropped_words,
    open_devices,
    require_log_file,
    write_log,
)
from evenlight.experiments.playback.screen_geometry import ScreenGeometry
from evenlight.experiments.playback.track_refusals import floor_note
from evenlight.hardware.rig_files import load_rig
from evenlight.method.preset_files import load_display
from evenlight.stimuli.commands import size_in
from evenlight.stimuli.dimmed.matched_track import display_of, is_of
from evenlight.stimuli.dimmed.track_fit import require_fit
from evenlight.stimuli.eyes.surfaces import Surface
from evenlight.stimuli.scenes.scene_sequence import SceneSequence
from evenlight.stimuli.sequences import built_in_sequence, is_sequence, open_as_read
from evenlight.stimuli.video.video_file import VideoFile
from evenlight.stimuli.video.video_locations import is_url, local_name, shown_name
from evenlight.stimuli.video.video_source import VideoSource, size_of

SMALLEST_WINDOW = 64  # [pixels]
FREE_RUNNING = 1.1  # times as many refreshes as the display makes


def play_video(film: FilmOptions, options: VersionOptions, headset: HeadsetOptions) -> None:
    """Play a video with its track, and say how it went; whatever ends it, the log is written.

    Raises
    ------
    InputError
        If video, track and display do not go together, or an option cannot be.
    """
    if options.loop and film.simulate:
        raise InputError("--loop goes on until someone presses escape, and with --simulate no one does")
    if options.log is not None:
        require_log_file(options.log)
    asked = video_request(film, headset)
    version = options.version or PlayedVersion.OURS
    if not film.quiet and version in (PlayedVersion.BASELINE, PlayedVersion.BOTH):
        typer.echo(
            f"baseline: constant factor {asked.loaded.baseline:.4g}, {asked.loaded.source_of_baseline}"
        )
    versions = ("ours", "baseline") if version is PlayedVersion.BOTH else (version.value,)
    if not film.quiet and (note := floor_note(asked.loaded.track, asked.rig)):
        typer.echo(note)
    playback = replace(asked.playback(versions), loop=options.loop, captions=options.label)

    def say(words: str) -> None:
        if not film.quiet:
            typer.echo(f"showing {words}")

    any_rate, gaze = film.rig is None, options.log is not None
    on = asked.rig, asked.display
    with open_devices(*on, simulated=film.simulate, any_rate=any_rate, gaze=gaze) as devices:
        if not film.quiet:
            typer.echo(asked.shown_on(devices))
        player = Player(devices, playback, say)
        try:
            whole = player.play()
        finally:
            if options.log is not None and player.passes:
                write_log(options.log, player.passes, devices.rig.refresh_rate, asked.density_on(devices))
    if not film.quiet:
        for one in player.passes:
            typer.echo(_pass_summary(one, playback, devices.rig.refresh_rate, timed=not film.simulate))
        if not whole:
            typer.echo("ended before its end")


@dataclass(frozen=True, slots=True, eq=False)
class VideoRequest:
    """A video, its track, and what they are shown on."""

    video: VideoSource
    loaded: LoadedTrack  # its track, and the baseline
    rig: Rig
    display: Display  # the rig's display
    screenshots: Path | None  # folder for a picture of the screen
    geometry: ScreenGeometry | None  # how it is seen; None where the window's pixels are of unknown angle
    surface: Surface | None = None  # what it lies on in a headset

    def shown_on(self, devices: PlaybackDevices) -> str:
        """Return what the window shows of the video, in words."""
        if self.geometry is None:
            return (
                f"{self.video.name}: a look only, at no known angle; a --rig or --display with the window's "
                "pixels per degree shows it as its track was made for"
            )
        if devices.rig.in_headset:
            density = devices.display.pixels_per_degree
            return words_of(self.video.name, self.geometry, self.surface, density)
        drawn = isinstance(self.video, SceneSequence)
        return self.geometry.in_words(self.video.name, devices.window.size(), drawn=drawn)

    def density_on(self, devices: PlaybackDevices) -> float | None:
        """Return the pixels per degree of the video as it is shown: if it is drawn anew, the headset's."""
        if devices.rig.in_headset and self.surface is None:
            return devices.display.pixels_per_degree
        return None if self.geometry is None else self.geometry.pixels_per_degree

    def playback(self, versions: Sequence[str]) -> Playback:
        """Return the video with the factors of each version, and the versions in their order."""
        loaded = self.loaded
        factors, full = np.asarray(loaded.track.factors), np.ones(len(loaded.track.factors))
        return Playback(
            video=self.video,
            times=np.asarray(loaded.track.times),
            duration=float(frame_durations(loaded.track).sum() + loaded.track.times[0]),
            factors={Dimming.OURS: factors, Dimming.BASELINE: loaded.baseline * full, Dimming.FULL: full},
            order=tuple(Dimming(version) for version in versions),
            screenshots=self.screenshots,
            scale=None if self.geometry is None else self.geometry.scale,
            surface=self.surface,
        )


def video_request(film: FilmOptions, headset: HeadsetOptions) -> VideoRequest:
    """Return what some options ask for; refuse what does not go together.

    Raises
    ------
    InputError
        If the track is not the video's or the display's or was made for another angle, or the
        calibration is too old.
    """
    loaded = load_track(film.track)
    video, pixels = video_of(film.video, loaded.track, film.size)
    require_fit(video, loaded.track)
    if not film.quiet and isinstance(video, VideoFile) and not is_of(video, loaded.track):
        typer.echo(
            f"note: the track was made of {loaded.track.header.video!r}, and {video.name!r} has other "
            "content: right if it is the same film, encoded again"
        )
    rig, display = rig_of(film.rig, film.display_name, lambda: display_of(loaded.track), pixels)
    if not film.other_display_ok:
        otherwise = ", or play this one all the same with --other-display-ok"
        require_display_of(loaded.track.header, display, rig.display, otherwise)
        require_light_of(loaded.track, display, track_file(film.track))
    if film.rig is not None and not film.simulate:
        require_young(display, rig.calibration_age_limit, accepted=film.old_calibration_ok)
    otherwise = ", or accept that with --other-geometry-ok"
    if rig.in_headset:
        seen, surface = seen_in_headset(video, pixels, display, loaded.track.header, headset)
        if not film.other_geometry_ok:
            require_as_analysed(seen, surface, otherwise)
        return VideoRequest(video, loaded, rig, display, film.screenshots, seen, surface)
    refuse("{} is for a headset: give it with a --rig whose screen is one, or leave it out", headset)
    geometry = None
    if film.rig is not None or film.display is not None:
        geometry = ScreenGeometry.of(video, pixels, display, loaded.track.header)
        if not film.other_geometry_ok:
            geometry.require_as_analysed(otherwise)
    return VideoRequest(video, loaded, rig, display, film.screenshots, geometry)


def video_of(name: str, track: BrightnessTrack, size: str | None) -> tuple[VideoSource, tuple[int, int]]:
    """Return a video, and its width and height; what has no frame rate of its own gets the track's.

    Parameters
    ----------
    name : str
        A file, a folder of images, or a built-in sequence.
    track : BrightnessTrack
        Its track.
    size : str or None
        Of a built-in sequence, as 640x360.

    Raises
    ------
    InputError
        If it cannot be read.
    """
    step = float(frame_durations(track).mean())
    name = local_name(name)
    path = Path(name)
    if is_sequence(name) and (path.suffix == ".json" or not path.exists()):
        sequence = built_in_sequence(name, size_in(size), len(track.times) * step, 1 / step)
        return sequence, (sequence.format.width, sequence.format.height)
    if size is not None:
        raise InputError(f"--size is for built-in sequences; {shown_name(name)} has a size of its own")
    fps = 1 / step if not is_url(name) and path.is_dir() else None
    video = open_as_read(name, track.header.film, fps)
    return video, size_of(video)


def rig_of(
    name: str | None, display: str | None, otherwise: Callable[[], Display], size: tuple[int, int]
) -> tuple[Rig, Display]:
    """Return a rig, naming its display as from here, and that; without, a window on the first film.

    Parameters
    ----------
    name : str or None
        Of the rig: a toml file or a preset.
    display : str or None
        A preset or a toml file; None for the rig's.
    otherwise : callable
        Returns the display where neither is given: that of the track, or of the rate limit.
    size : (int, int)
        Width and height of the picture [pixels].
    """
    if name is not None:
        rig, its_display = load_rig(name)
        rig = replace(rig, display=display or its_display)
        return rig, load_display(rig.display)
    panel = otherwise() if display is None else load_display(display)
    width, height = (max(SMALLEST_WINDOW, pixels) for pixels in size)
    window = Rig("window", display or panel.name, 0.6, 60.0, full_screen=False, window_size=(width, height))
    return window, panel


def _pass_summary(one: Pass, playback: Playback, refresh_rate: float, *, timed: bool) -> str:
    shown = one.shown
    names = " and ".join(dict.fromkeys(one.versions))
    words = (
        f"{playback.video.name}, {names}: {len(set(shown.video_frames))} of {len(playback.times)} frames in "
        f"{len(shown.flip_times)} refreshes at {refresh_rate:.4g} Hz, "
        + dropped_words(shown.frames_dropped, timed=timed)
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
